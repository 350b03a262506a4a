"""`kinespace demo`: the whole loop on this machine, with nothing but the built-in library.

What is played are ghosts: motions of the library made visible again from what the library keeps of them. That every
ghost is recognised shows that the loop works, not how well people are recognised; `kinespace evaluate` shows that.
"""

from __future__ import annotations

import json
import time
from collections import Counter
from contextlib import closing
from dataclasses import dataclass, field
from io import StringIO
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.live import Live
from rich.text import Text

from library import MotionLibrary
from stream.frame import Announcement, Frame
from stream.recognizer import Settings
from tools.background import BackgroundService
from tools.console import console
from tools.expected import AnswerMatcher, expected_answers
from tools.feed import Cue, Pace
from tools.ghost import ghost
from tools.listener import Listener, answer_in
from tools.livetable import score_shown
from tools.output import require_place_for
from tools.tables import narrow_table

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from rich.table import Table

    from stream.answer import Answer
    from tools.background import Transport
    from tools.feed import FrameSender
    from tools.listener import Heard

PERFORMER = "ghost"
_FRAME_RATE = 120.0
#: Cycles per second of a ghost: at another beat than hops fall, so that no two answers are alike.
_SWING = 0.97
#: Seconds between two ghosts: longer than the recogniser bridges, so that its window starts anew.
_PAUSE = 0.7
_LINGER = 0.3
_PICTURE_WIDTH = 112


@dataclass(slots=True)
class _Played:
    """One ghost, and what was answered while it played."""

    class_name: str
    labels: Counter[str] = field(default_factory=Counter)
    latest: Answer | None = None
    latencies: list[float] = field(default_factory=list)

    @property
    def answered(self) -> str:
        """The label heard most often; empty when nothing was answered."""
        return self.labels.most_common(1)[0][0] if self.labels else ""


def run(transport: Transport, *, seconds: float, picture: Path | None, as_json: bool) -> int:
    """Play every class for its share of the seconds and show what is answered.

    Raises
    ------
    ValueError
        The seconds are too few for every class to fill a window.
    OSError
        The picture has no place to be written to.
    """
    if picture:
        require_place_for(picture)
    library, settings = MotionLibrary.builtin(), Settings()
    each = seconds / len(library.classes) - _PAUSE
    if each < settings.window + 0.2:
        least = len(library.classes) * (settings.window + 0.2 + _PAUSE)
        raise ValueError(
            f"--seconds: expected at least {least:.0f} for {len(library.classes)} classes, got {seconds:g}"
        )
    cues = _cues(library, each)
    matcher = AnswerMatcher(expected_answers(cues, library, settings))
    with BackgroundService(transport, settings=settings) as service:
        sender, receiver = service.connect()
        show = _Show([_Played(class_name) for class_name in library.classes], matcher, transport)
        with closing(sender), closing(Listener(receiver)) as listener:
            sender.announce(Announcement(PERFORMER, library.skeleton.joints))
            if as_json:
                _play(cues, sender, listener, show)
            else:
                _play_watched(cues, sender, listener, show)
    if as_json:
        print(json.dumps(show.as_json()))
    else:
        console.print(show.tally())
    if picture:
        _save_picture(picture, show)
    return 0 if show.right == len(show.played) else 1


def _cues(library: MotionLibrary, each: float) -> list[Cue]:
    """Cue a ghost of every class, one after the other."""
    cues = list[Cue]()
    for place, class_name in enumerate(library.classes):
        begin = place * (each + _PAUSE)
        positions = ghost(library, class_name, seconds=each, frame_rate=_FRAME_RATE, rate=_SWING).astype(np.float32)
        for index, joints in enumerate(positions):
            due = begin + index / _FRAME_RATE
            cues.append(Cue(due, Frame(PERFORMER, 1.0 + due, joints), len(cues), class_name))
    return cues


class _Show:
    """Who has played, what was answered, and how it is drawn."""

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
        """Note what was answered; say whether there was an answer."""
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
        """How many ghosts were answered with their own class most of the time."""
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
        """Draw the ghosts so far, on a terminal of so many characters."""
        table = narrow_table("Ghosts, made from the library's own signatures, sent over loopback")
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
        score = score_shown(each.latest.score, width)
        return name, Text(each.answered, style=style), score, f"{each.latest.margin:.3f}", f"{latency:.2f}"

    def tally(self) -> str:
        """Say how it went."""
        latencies = self.latencies_ms
        answers = sum(each.labels.total() for each in self.played)
        right = sum(each.labels[each.class_name] for each in self.played)
        lost = self._matcher.lost + self._matcher.waiting
        times = (
            f"p50 {np.percentile(latencies, 50):.2f} ms, p99 {np.percentile(latencies, 99):.2f} ms" if latencies else ""
        )
        return (
            f"{self.right} of {len(self.played)} ghosts named; {right} of {answers} answers right, {lost} lost\n"
            f"frame sent to answer received over {self._transport.upper()}: {times}"
        )


def _play(cues: Sequence[Cue], sender: FrameSender, listener: Listener, show: _Show, live: Live | None = None) -> None:
    pace = Pace()
    for cue in cues:
        packet = sender.encode(cue)
        if show.hear(listener.listen_until(pace.moment(cue.due))) and live:
            # Right after an answer nothing is under way that drawing could delay.
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
