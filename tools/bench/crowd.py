"""The feed of every part, motions of the built-in library without end; performers played over sockets; cores' time."""

from __future__ import annotations

import gc
import math
import os
import time
from collections.abc import Iterable, Iterator
from itertools import count, islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from kinespace.library import MotionLibrary
from kinespace.stream.frame import Frame
from kinespace.stream.recognition import Recognition
from kinespace.stream.recognizer import Performers, Settings
from kinespace.tools.feeding.feed import Cue, FrameSender, Pace, without_pause
from kinespace.tools.feeding.service import Listener, Received

#: Frames per second of the feeds.
FRAME_RATE = 120.0
#: Every eighth of the library's motions is played, so that there are some of each class.
_EVERY = 8
#: Performers whose frames come all at once, to see how many a core holds: frames do so that wait for a full core.
CROWD = 40
#: Seconds after the last frame in which answers may still come: fewer than of the silence that ends a motion.
_LINGER = 0.7


def positions() -> NDArray[np.float32]:
    """Give every eighth motion of the built-in library: shape (frames, 31, 3), metres, 120 frames per second."""
    return without_pause(MotionLibrary.builtin().motions[::_EVERY], FRAME_RATE)


def endless(positions: NDArray[np.floating], performer: str = "bench", begin: int = 0) -> Iterator[Frame]:
    """Play positions, shape (frames, joints, 3), metres, 120 times a second without end, from one of them on."""
    # Time 0 would mean "on arrival".
    return (
        Frame(performer, 1.0 + number / FRAME_RATE, positions[(begin + number) % len(positions)]) for number in count()
    )


class Feed(NamedTuple):
    """Performers doing the same motion, each at a moment of its own, and the answers of one recogniser.

    They enter one after the other, a frame apart, so that their hops do not coincide.
    """

    frames: list[list[Frame]]
    answers: list[Recognition]

    @classmethod
    def of(cls, positions: NDArray[np.float32], performers: int, seconds: float) -> Feed:
        """Make a feed of positions, shape (frames, joints, 3), metres, 120 a second, and recognise it."""
        moments, shift = round(seconds * FRAME_RATE), len(positions) // performers + 1
        each = [list(islice(endless(positions, f"p{index}", index * shift), moments)) for index in range(performers)]
        frames = [[of[k] for of in each[: k + 1]] for k in range(moments)]
        recognisers = Performers(MotionLibrary.builtin(), Settings(), most=performers)
        answers = [each for together in frames for each in recognisers.push_all(together, together[0].time) if each]
        # Looking for garbage among all these frames would take a tenth of a second.
        gc.freeze()
        return cls(frames, answers)

    def cues(self) -> list[Cue]:
        """Cue all frames of a moment at once."""
        return [Cue(k / FRAME_RATE, frame, k) for k, together in enumerate(self.frames) for frame in together]


class Played(NamedTuple):
    """What was sent and received; moments as `time.perf_counter` reads them.

    Attributes
    ----------
    begun
        When the schedule began.
    sent
        When each frame was sent, by performer and the time in it; for frames sent twice the first.
    received
        The packets that came back.
    """

    begun: float
    sent: dict[tuple[str, float], float]
    received: list[Received]


def play(cues: Iterable[Cue], sender: FrameSender, listener: Listener) -> Played:
    """Send frames on schedule, and collect what comes back meanwhile and shortly afterwards."""
    pace = Pace()
    played = Played(pace.moment(0.0), {}, [])
    for cue in cues:
        packet = sender.encode(cue)
        played.received.extend(listener.listen_until(pace.moment(cue.due)))
        # Before the call, because the answer may be on its way before the call returns.
        played.sent.setdefault((cue.frame.performer, cue.frame.time), time.perf_counter())
        sender.send(packet)
    played.received.extend(listener.listen_until(time.perf_counter() + _LINGER))
    return played


def core_seconds(process_id: int) -> float:
    """Give for how many seconds a process has used a core, all its threads; NaN where the system does not count it.

    Only Linux says it, in `/proc`.
    """
    try:
        status = Path(f"/proc/{process_id}/stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return math.nan
    # After the command's name, which may hold any character; user and system time are the 14th and 15th field.
    fields = status.rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def performers_a_core(core_us: float) -> float:
    """Give how many performers one core holds when each of their frames takes `core_us` microseconds."""
    return 1e6 / FRAME_RATE / core_us if core_us else math.nan


class Measured(NamedTuple):
    """The results of a part: its figures by name, NaN for a figure that was not measured, and its tables."""

    figures: dict[str, float]
    tables: list[Table]


def rounded(value: float) -> float | int | None:
    """Keep four digits, because more would be noise; None for NaN and infinity."""
    if isinstance(value, int):
        return value
    return float(f"{value:.4g}") if math.isfinite(value) else None


def shown(value: float, digits: int = 0) -> str:
    """Write a number with some digits after the point; a dash for a number that was not measured."""
    return "-" if math.isnan(value) else f"{value:,.{digits}f}"
