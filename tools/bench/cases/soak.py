"""`kinespace bench soak`: a day of feed at full speed, and minutes over real sockets, to see whether anything grows."""

from __future__ import annotations

import math
import multiprocessing
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from kinespace.library import MotionLibrary
from kinespace.stream.frame import Frame
from kinespace.stream.recognizer import Recognizer, Settings
from kinespace.tools.bench.cases import capacity
from kinespace.tools.bench.memory import resident_mb
from kinespace.tools.bench.recorded import FRAME_RATE, Feed
from kinespace.tools.terminal.console import progress

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from kinespace.stream.recognition import Recognition
    from kinespace.stream.recognizer import LiveSignature, RecognizerCounts
    from kinespace.tools.bench.cases.capacity import Crowd
    from kinespace.tools.loopback.service_process import Transport

#: Frames of a day at 120 Hz.
DAY = round(24 * 3600 * FRAME_RATE)
#: Frames between two checks of the leading eigenvector: a prime number, so that checks fall on different places.
_CHECK_EVERY = 9973
#: Frames between two updates of the progress bar.
_PIECE = 1000
#: Pieces after which memory is first measured: by then everything is allocated and used.
_SETTLED = 20
#: Seconds that a fresh recogniser sees before it is compared: more than the longest window.
_LOOK_BACK = 3.0
#: Performers of the feed over sockets.
_PERFORMERS = 4
_OVER: tuple[Transport, ...] = ("osc",)


@dataclass(frozen=True, slots=True)
class Day:
    """The result of a long feed.

    Attributes
    ----------
    frames
        Frames pushed.
    seconds
        How long that took, checks included.
    resident_mb
        Resident memory at the start, in the middle and at the end, MB; None where the system does not tell.
    checked
        Answers that were compared with a recogniser that had seen the last three seconds only.
    max_error
        Largest difference between the two in the leading eigenvector's share of the variance, gap, or |inner product|;
        None when no answer was checked.
    answers
        Recognitions that were given.
    counts
        The recogniser's own count of everything.
    """

    frames: int
    seconds: float
    resident_mb: tuple[float | None, float | None, float | None]
    checked: int
    max_error: float | None
    answers: int
    counts: RecognizerCounts

    @property
    def consistent(self) -> bool:
        """Whether the counts match the frames pushed and the answers given, with nothing refused and no restart."""
        counts = self.counts
        refused = counts.out_of_order + counts.restarts
        return counts.frames == self.frames and counts.hops == self.answers and refused == 0


@dataclass(frozen=True, slots=True)
class Soak:
    """A long feed without sockets, and one with sockets; None for a feed that was not asked for."""

    day: Day
    over_sockets: Crowd | None


def measure(positions: NDArray[np.float32], *, signature: LiveSignature, frames: int, minutes: float) -> Soak:
    """Push a long feed.

    Parameters
    ----------
    positions
        Positions that the feed repeats, shape (frames, joints, 3), metres.
    signature
        Of the recogniser.
    frames
        The number of frames without sockets.
    minutes
        The minutes over UDP; 0 for none.
    """
    # A process of its own, because the other parts of the bench have filled the memory of this one.
    settings = Settings(signature=signature, plausibility=False)
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as process:
        day = process.submit(pushed, positions, settings, frames).result()
    if not minutes:
        return Soak(day, None)
    looped = np.resize(positions, (round(minutes * 60 * FRAME_RATE), *positions.shape[1:]))
    over_sockets = next(progress((capacity.play(each, _PERFORMERS, looped, settings) for each in _OVER), "Sockets", 1))
    return Soak(day, over_sockets)


def pushed(positions: NDArray[np.float32], settings: Settings, frames: int) -> Day:
    """Push a long feed through a recogniser, without sockets, and watch it.

    Parameters
    ----------
    positions
        Positions that the feed repeats, shape (frames, joints, 3), metres.
    settings
        Of the recogniser.
    frames
        The number of frames.
    """
    library, feed = MotionLibrary.builtin(), Feed(positions)
    recognizer = Recognizer(library, settings)
    pieces = [min(_PIECE, frames - begin) for begin in range(0, frames, _PIECE)]
    settled = min(_SETTLED, (len(pieces) - 1) // 4)
    memory: dict[int, float | None] = {}
    errors, answers, check_at = list[float](), 0, round(_LOOK_BACK * FRAME_RATE)
    start = time.perf_counter()
    for index, piece in enumerate(progress(pieces, "Thousands of frames", len(pieces))):
        if index in (settled, len(pieces) // 2):
            memory[index] = resident_mb()
        for _ in range(piece):
            recognition = recognizer.push(feed.next())
            if recognition is None:
                continue
            answers += 1
            if feed.sent >= check_at:
                check_at += _CHECK_EVERY
                errors.append(_error(recognition, library, settings, feed))
    return Day(
        frames=feed.sent,
        seconds=time.perf_counter() - start,
        resident_mb=(memory.get(settled), memory.get(len(pieces) // 2), resident_mb()),
        checked=len(errors),
        max_error=max(errors, default=None),
        answers=answers,
        counts=recognizer.counts,
    )


def _error(answer: Recognition, library: MotionLibrary, settings: Settings, feed: Feed) -> float:
    """Compare the numbers of an answer's leading eigenvector with a recogniser that has just begun."""
    anew = Recognizer(library, replace(settings, hop=0.0))
    begin, last = feed.sent - round(_LOOK_BACK * FRAME_RATE), None
    for index, positions in enumerate(feed.last(feed.sent - begin)):
        last = anew.push(Frame(answer.performer, 1.0 + (begin + index) / FRAME_RATE, positions))
    if last is None:
        return math.inf
    differences = [getattr(answer, name) - getattr(last, name) for name in ("share", "gap", "eigenvector_score")]
    return float(np.abs(differences).max())
