"""`kinespace demo`: the whole loop on this machine, with the built-in library alone.

Plays a recorded motion of every class of the built-in library over loopback into a recogniser in another process, and
shows its answers. The recogniser's library holds none of the motions played, but others of the same persons. Exit
status: 0 every motion named, 1 a motion not named, 2 could not be done.
"""

import argparse
import time
from bisect import bisect_left
from collections import Counter
from collections.abc import Sequence
from contextlib import nullcontext

import numpy as np
from numpy.typing import NDArray
from rich.live import Live
from rich.table import Table
from rich.text import Text

from kinespace.library import Clip, MotionLibrary
from kinespace.stream import Announcement, Settings
from kinespace.stream.recognition import Answer
from kinespace.tools.cli.arguments import add_shared
from kinespace.tools.cli.console import console, print_json, table_of
from kinespace.tools.cli.live_table import score_shown
from kinespace.tools.feeding import service
from kinespace.tools.feeding.feed import Cue, FrameSender, Pace, clip_cues

PERFORMER = "demo"
#: Seconds of the shortest motion that is played, if a class has a longer one: recognition begins after half a second.
MIN_SECONDS = 1.0
#: Seconds of the longest motion that is played, if a class has a shorter one: all together take half a minute.
MAX_SECONDS = 2.14
#: Seconds between two motions: longer than the recogniser's longest gap, so that its window begins empty.
_PAUSE = 0.7
#: Answers that may be owed before the next frame waits for them: on a busy machine the feed slows, and loses none.
_MAX_OWED = 3
#: Seconds of silence after which answers that are owed are given up.
_PATIENCE = 20.0
#: Seconds for which the demo listens before it looks whether it waits for anything more.
_LOOK_EVERY = 0.05
#: Milliseconds after which an answer comes late.
LATE = 100.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.add_argument("--transport", choices=("osc", "zmq"), default="osc")
    add_shared(parser, "--json")


def run(options: argparse.Namespace) -> int:
    """Play a motion of every class and show the answers; return the exit status."""
    whole, settings = MotionLibrary.builtin(), Settings()
    motions = chosen(whole)
    library = whole.without(motions=motions)
    cues = list(clip_cues(motions, PERFORMER, pause=_PAUSE))
    expected = service.expected_answers(cues, library, settings)
    watched = console.is_terminal and not options.json
    show = _Demo([motion.class_name for motion in motions], expected, options.transport)
    with (
        service.background_service(options.transport, library=library, settings=settings) as background,
        Live(console=console, auto_refresh=False) if watched else nullcontext() as live,
    ):
        background.sender.announce(Announcement(PERFORMER, library.skeleton.joints))
        _play(cues, background.sender, service.Listener(background.receiver), show, live)
    if options.json:
        print_json(show.as_json())
    else:
        if not watched:
            console.print(show.table(console.width))
        console.print(show.tally())
    return 0 if show.right == len(show.played) else 1


def chosen(library: MotionLibrary) -> list[Clip]:
    """Choose a motion of each class: the longest of one to some two seconds, else the shortest of a second or more."""
    motions = []
    for name in library.classes:
        own = sorted((each for each in library.motions if each.class_name == name), key=lambda each: each.duration)
        own = [each for each in own if each.duration >= MIN_SECONDS] or own
        motions.append(([each for each in own if each.duration <= MAX_SECONDS] or own[:1])[-1])
    return motions


class _Demo:
    """The motions played so far, their answers, and their table."""

    def __init__(
        self, classes: Sequence[str], expected: Sequence[service.Expected], transport: service.Transport
    ) -> None:
        #: The answers while the motion of each class played, with their latencies in milliseconds.
        self.played: dict[str, list[tuple[Answer, float]]] = {name: [] for name in classes}
        self._matcher, self._transport = service.AnswerMatcher(expected), transport
        #: The frames to which an answer comes, by their indices.
        self._answered = [each.cue for each in expected]
        #: The answers that came, expected or not, and those that were given up.
        self.came = self.given_up = 0
        #: The class of each frame, and when the frame was sent.
        self.sent: list[tuple[str, float]] = []

    @property
    def owed(self) -> int:
        """How many answers to the frames sent have not come, and are waited for."""
        return bisect_left(self._answered, len(self.sent)) - self.came - self.given_up

    def take_in(self, received: Sequence[service.ReceivedPacket]) -> bool:
        """Note the answers that came; say whether there were any that were expected."""
        news = False
        for each in received:
            if not (answer := service.answer_in(each.packet)):
                continue
            self.came += 1
            if expected := self._matcher.match(answer):
                name, moment = self.sent[expected.cue]
                self.played[name].append((answer, 1000 * (each.arrival - moment)))
                news = True
        return news

    def answered(self, name: str) -> str:
        """Give the most frequent label while a class's motion played; empty without answers."""
        labels = Counter(answer.label for answer, _ in self.played[name])
        return labels.most_common(1)[0][0] if labels else ""

    @property
    def right(self) -> int:
        """The number of motions that were answered with their own class most of the time."""
        return sum(self.answered(name) == name for name in self.played)

    @property
    def latencies(self) -> NDArray[np.float64]:
        """The latencies of all answers, milliseconds."""
        return np.array([latency for each in self.played.values() for _, latency in each])

    def as_json(self) -> dict[str, object]:
        """Give the tally by name."""
        latencies = self.latencies
        return {
            "played": len(self.played),
            "answered": sum(map(bool, self.played.values())),
            "right": self.right,
            "late": int((latencies > LATE).sum()),
            "p99_ms": round(float(np.percentile(latencies, 99)), 3) if latencies.size else None,
        }

    def table(self, width: int) -> Table:
        """Draw the motions so far, on a terminal of some width, characters."""
        title = "Motions of the built-in library, each left out of the library that names it"
        rows = [self._row(name, width) for name in self.played]
        return table_of(title, ("played", "answered", "score", "margin", "ms"), rows, names=3)

    def _row(self, name: str, width: int) -> tuple[str | Text, ...]:
        if not (played := self.played[name]):
            return (Text(name, style="dim"),)
        answered = self.answered(name)
        label = Text(answered, style="green" if answered == name else "red")
        latest, latency = played[-1][0], np.median([latency for _, latency in played])
        return name, label, score_shown(latest.score, width), f"{latest.margin:.3f}", f"{latency:.2f}"

    def tally(self) -> str:
        """Give the last lines of the report."""
        latencies, lost = self.latencies, self._matcher.lost + self._matcher.waiting
        right = sum(answer.label == name for name, each in self.played.items() for answer, _ in each)
        late = (latencies > LATE).sum()
        busy = f", {late} late (after more than {LATE / 1000:g} s: this machine is busy)" if late else ""
        times = "p50 {:.2f} ms, p99 {:.2f} ms".format(*np.percentile(latencies, (50, 99))) if latencies.size else ""
        answered = f"{right} of {len(latencies)} answers right, {lost} lost{busy}"
        return (
            f"{self.right} of {len(self.played)} motions named; {answered}\n"
            f"frame sent to answer received over {self._transport.upper()}: {times}"
        )


def _play(cues: Sequence[Cue], sender: FrameSender, listener: service.Listener, show: _Demo, live: Live | None) -> None:
    """Play the motions, and draw the table after answers where there is a terminal."""
    pace, patience = Pace(), _PATIENCE
    for cue in cues:
        packet = sender.encode(cue.frame)
        if show.take_in(listener.listen_until(pace.moment(cue.due))) and live:
            # Right after an answer, drawing delays no frame.
            live.update(show.table(console.width), refresh=True)
        if show.owed > _MAX_OWED:
            patience = _wait(listener, show, _MAX_OWED, patience)
            pace.put_off(cue.due)
        show.sent.append((cue.class_name, time.perf_counter()))
        sender.send(packet)
    _wait(listener, show, 0, patience)
    if live:
        live.update(show.table(console.width), refresh=True)


def _wait(listener: service.Listener, show: _Demo, most: int, patience: float) -> float:
    """Wait until no more than some answers are owed, or nothing came for too long; give the patience that is left.

    Who says nothing is not waited for again: the demo ends soon.
    """
    until = time.perf_counter() + patience
    while show.owed > most:
        before = show.came
        show.take_in(listener.listen_until(time.perf_counter() + _LOOK_EVERY))
        if show.came > before:
            until = time.perf_counter() + patience
        elif time.perf_counter() > until:
            show.given_up += show.owed
            return patience if show.came else 0.0
    return patience
