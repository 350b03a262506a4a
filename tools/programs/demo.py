"""`kinespace demo`: the whole loop on this machine, with the built-in library alone.

It plays recorded motions of the library, one of each class. The library that names them does not contain the motions
that are played. It contains other motions of the same persons: `kinespace evaluate` tells how well other persons are
recognised.
"""

from __future__ import annotations

import json
import math
import time
from collections import Counter
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.live import Live
from rich.text import Text

from kinespace.library import MotionLibrary
from kinespace.stream.frame import Announcement
from kinespace.stream.recognizer import Settings
from kinespace.tools.cli.arguments import add_json, add_shared, positive
from kinespace.tools.feeding.feed import Pace, clip_cues
from kinespace.tools.loopback.answer_listener import Listener, answer_in
from kinespace.tools.loopback.expected_answers import AnswerMatcher, expected_answers
from kinespace.tools.loopback.service_process import BackgroundService
from kinespace.tools.terminal.console import console
from kinespace.tools.terminal.live_table import score_shown
from kinespace.tools.terminal.output_path import require_place_for
from kinespace.tools.terminal.tables import narrow_table

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

    from rich.table import Table

    from kinespace.library import Clip
    from kinespace.stream.recognition import Answer
    from kinespace.tools.feeding.feed import Cue, FrameSender
    from kinespace.tools.loopback.answer_listener import Heard
    from kinespace.tools.loopback.service_process import Transport

PERFORMER = "demo"
#: Seconds of the shortest motion that is played, if a class has one as long: recognition begins after half a second.
MIN_SECONDS = 1.0
#: Seconds between two motions: longer than the recogniser's longest gap, so that its window starts anew.
_PAUSE = 0.7
_LINGER = 0.3
#: Seconds in which a person opens the page before the first motion.
_OPENING = 4.0
_PICTURE_WIDTH = 112
#: Characters of a full score bar, and of a terminal that has room for it.
_BAR, _WIDE = 20, 110


@dataclass(slots=True)
class _Played:
    """The motion of one class, and the answers while it played."""

    class_name: str
    labels: Counter[str] = field(default_factory=Counter)
    latest: Answer | None = None
    latencies: list[float] = field(default_factory=list)

    @property
    def answered(self) -> str:
        """The most frequent label; empty without answers."""
        return self.labels.most_common(1)[0][0] if self.labels else ""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.description = (
        "Plays a recorded motion of every class of the built-in library over loopback into a recogniser in another "
        "process, and shows its answers. The recogniser's library holds none of the motions played. Exit status: "
        "0 every motion named, 1 a motion not named, 2 could not be done."
    )
    parser.add_argument(
        "--seconds", type=positive, default=30.0, help="maximum length of the demo (default %(default)s)"
    )
    parser.add_argument("--transport", choices=("osc", "zmq"), default="osc")
    add_shared(parser, "--page")
    parser.add_argument("--picture", type=Path, metavar="SVG", help="write the final table as a picture")
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Play a motion of every class and show the answers; return the exit status."""
    picture, page = options.picture, options.page
    if picture:
        require_place_for(picture)
    whole, settings = MotionLibrary.builtin(), Settings()
    motions = chosen(whole, options.seconds)
    library = whole.without(motions=motions)
    cues = list(clip_cues(motions, PERFORMER, pause=_PAUSE))
    matcher = AnswerMatcher(expected_answers(cues, library, settings))
    with ExitStack() as opened:
        service = opened.enter_context(
            BackgroundService(options.transport, library=library, settings=settings, page=page)
        )
        if page:
            console.print(f"page: {service.page}", soft_wrap=True)
            time.sleep(_OPENING)
        sender, receiver = service.connect()
        show = _Show([_Played(motion.class_name) for motion in motions], matcher, options.transport)
        with closing(sender), closing(Listener(receiver)) as listener:
            sender.announce(Announcement(PERFORMER, library.skeleton.joints))
            if options.json:
                _play(cues, sender, listener, show)
            else:
                _play_watched(cues, sender, listener, show)
    if options.json:
        print(json.dumps(show.as_json()))
    else:
        console.print(show.tally())
    if picture:
        _save_picture(picture, show)
    return 0 if show.right == len(show.played) else 1


def chosen(library: MotionLibrary, seconds: float) -> list[Clip]:
    """Choose a motion of each class: the longest up to a limit, the same for all, that fits all into the seconds.

    A class without a motion below the limit gives its shortest; motions of less than a second are left out.

    Parameters
    ----------
    library
        The library whose motions are chosen.
    seconds
        Seconds for all motions, with the pauses between them.

    Raises
    ------
    ValueError
        Even the shortest motions take longer.
    """
    by_class = {name: [each for each in library.motions if each.class_name == name] for name in library.classes}
    candidates = [
        sorted([each for each in motions if each.duration >= MIN_SECONDS] or motions, key=lambda each: each.duration)
        for motions in by_class.values()
    ]
    for limit in sorted({each.duration for motions in candidates for each in motions}, reverse=True):
        taken = [([each for each in motions if each.duration <= limit] or motions[:1])[-1] for motions in candidates]
        least = sum(each.duration + _PAUSE for each in taken)
        if least <= seconds:
            return taken
    raise ValueError(f"--seconds: expected at least {math.ceil(least)} for {len(taken)} classes, got {seconds:g}")


class _Show:
    """The motions played so far, their answers, and their table."""

    def __init__(self, played: list[_Played], matcher: AnswerMatcher, transport: Transport) -> None:
        self.played = played
        self._by_class = {each.class_name: each for each in played}
        self._matcher = matcher
        self._transport = transport
        self._sent: list[float] = []
        self._cues: list[Cue] = []
        self.now_playing = ""

    def sent(self, cue: Cue, moment: float) -> None:
        """Note that a frame was sent."""
        self._cues.append(cue)
        self._sent.append(moment)
        self.now_playing = cue.class_name

    def hear(self, heard: Sequence[Heard]) -> bool:
        """Note the answers that came; say whether there were any."""
        news = False
        for each in heard:
            answer = answer_in(each.packet)
            expected = self._matcher.match(answer) if answer else None
            if answer is None or expected is None:
                continue
            played = self._by_class[self._cues[expected.cue].class_name]
            played.labels[answer.label] += 1
            played.latest = answer
            played.latencies.append(each.arrival - self._sent[expected.cue])
            news = True
        return news

    @property
    def right(self) -> int:
        """The number of motions that were answered with their own class most of the time."""
        return sum(each.answered == each.class_name for each in self.played)

    @property
    def latencies_ms(self) -> list[float]:
        """All latencies, milliseconds."""
        return [latency * 1000 for each in self.played for latency in each.latencies]

    def as_json(self) -> dict[str, object]:
        """Give the tally by name."""
        latencies = self.latencies_ms
        return {
            "played": len(self.played),
            "answered": sum(bool(each.labels) for each in self.played),
            "right": self.right,
            "p99_ms": round(float(np.percentile(latencies, 99)), 3) if latencies else None,
        }

    def table(self, width: int) -> Table:
        """Draw the motions so far, on a terminal of so many characters."""
        table = narrow_table("Motions of the built-in library, each left out of the library that names it")
        for heading in ("played", "answered", "score"):
            table.add_column(heading, overflow="fold")
        for heading in ("margin", "ms"):
            table.add_column(heading, justify="right")
        for each in self.played:
            table.add_row(*self._row(each, width))
        return table

    def _row(self, each: _Played, width: int) -> tuple[str | Text, ...]:
        playing = each.class_name == self.now_playing
        name = Text(each.class_name, style="bold" if playing else "" if each.latest else "dim")
        if each.latest is None:
            return name, "", "", "", ""
        style = "green" if each.answered == each.class_name else "red"
        latency = float(np.median(each.latencies)) * 1000
        score = score_shown(each.latest.score, _BAR if width >= _WIDE else 0)
        return name, Text(each.answered, style=style), score, f"{each.latest.margin:.3f}", f"{latency:.2f}"

    def tally(self) -> str:
        """Give the last lines of the report."""
        latencies = self.latencies_ms
        answers = sum(each.labels.total() for each in self.played)
        right = sum(each.labels[each.class_name] for each in self.played)
        lost = self._matcher.lost + self._matcher.waiting
        times = (
            f"p50 {np.percentile(latencies, 50):.2f} ms, p99 {np.percentile(latencies, 99):.2f} ms" if latencies else ""
        )
        return (
            f"{self.right} of {len(self.played)} motions named; {right} of {answers} answers right, {lost} lost\n"
            f"frame sent to answer received over {self._transport.upper()}: {times}"
        )


def _play(cues: Sequence[Cue], sender: FrameSender, listener: Listener, show: _Show, live: Live | None = None) -> None:
    pace = Pace()
    for cue in cues:
        packet = sender.encode(cue)
        if show.hear(listener.listen_until(pace.moment(cue.due))) and live:
            # Right after an answer, drawing delays no frame.
            live.update(show.table(console.width), refresh=True)
        show.sent(cue, time.perf_counter())
        sender.send(packet)
    show.hear(listener.listen_until(time.perf_counter() + _LINGER))
    show.now_playing = ""


def _play_watched(cues: Sequence[Cue], sender: FrameSender, listener: Listener, show: _Show) -> None:
    if not console.is_terminal:
        _play(cues, sender, listener, show)
        console.print(show.table(console.width))
        return
    with Live(show.table(console.width), console=console, auto_refresh=False) as live:
        _play(cues, sender, listener, show, live)
        live.update(show.table(console.width), refresh=True)


def _save_picture(path: Path, show: _Show) -> None:
    recorder = Console(record=True, width=_PICTURE_WIDTH, file=StringIO(), force_terminal=True, highlight=False)
    recorder.print(show.table(_PICTURE_WIDTH))
    recorder.print(show.tally())
    recorder.save_svg(str(path), title="kinespace demo")
