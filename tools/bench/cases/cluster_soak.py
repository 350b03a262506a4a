"""`kinespace bench cluster-soak`: a long feed through a gateway and three workers, of which one is killed at times."""

from __future__ import annotations

import math
import time
from collections import Counter
from contextlib import closing
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from kinespace.library import MotionLibrary
from kinespace.library.windows.index import opened
from kinespace.stream.frame import Frame
from kinespace.stream.recognizer import Performers
from kinespace.tools.bench.cases.scale import Cluster, end
from kinespace.tools.bench.memory import resident_mb
from kinespace.tools.bench.recorded import FRAME_RATE

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from kinespace.stream.recognition import Recognition

#: How many workers there are, and how often one of them is killed in a run.
_WORKERS, _KILLS = 3, 12
#: The round of the motion after which each round brings the same events.
_STEADY = 2
#: Seconds in which the last answers may still come.
_LINGER = 3.0


@dataclass(frozen=True, slots=True)
class Endured:
    """The result.

    Attributes
    ----------
    performers, minutes, kills
        How many performers were followed, for how long, and how many workers were killed.
    lags
        How many answers came so many tenths of a millisecond after their frame.
    rounds
        How often each performer did the whole motion, the first times not counted.
    events, lost_events, false_events
        Events of one process in these rounds; how many did not come, and how many came beside them.
    dropped
        Frames that no worker took, or that were dropped because workers were busy: the gateway's notes.
    memory_mb
        Memory of this process after a twelfth of the time and at the end, MB; None where the system does not tell.
    """

    performers: int
    minutes: float
    kills: int
    lags: Counter[int] = field(repr=False)
    rounds: int
    events: int
    lost_events: int
    false_events: int
    dropped: str
    memory_mb: tuple[float | None, float | None]

    def percentile(self, percent: float) -> float:
        """Give a percentile of the lags in milliseconds; NaN without an answer."""
        wanted = self.lags.total() * percent / 100
        for tenths in sorted(self.lags):
            wanted -= self.lags[tenths]
            if wanted <= 0:
                return tenths / 10
        return math.nan


class _Told:
    """Counts the events of some rounds of a motion, which are told by an event's time."""

    def __init__(self, seconds: float, rounds: range) -> None:
        self._seconds, self._rounds = seconds, rounds
        self.events: Counter[tuple[str, str, str]] = Counter()

    def note(self, recognition: Recognition) -> None:
        """Count the events of an answer."""
        for event in recognition.events:
            if int((recognition.time - 1.0) / self._seconds) in self._rounds:
                self.events[recognition.performer, str(event.kind), event.label] += 1


def _expected(positions: NDArray[np.float32], rounds: int, crowd: int) -> Counter[tuple[str, str, str]]:
    """Count the events that one process sends for a crowd, from a round that brings the same as the round before."""
    performers = Performers(opened(MotionLibrary.builtin()), most=1)
    told = _Told(len(positions) / FRAME_RATE, range(_STEADY, _STEADY + 1))
    for k in range((_STEADY + 1) * len(positions)):
        frame = Frame("p", 1.0 + k / FRAME_RATE, positions[k % len(positions)])
        if answer := performers.push(frame, k / FRAME_RATE):
            told.note(answer)
    one = {event: rounds * count for event, count in told.events.items()}
    return Counter({(f"p{i}", kind, label): count for i in range(crowd) for (_, kind, label), count in one.items()})


def measure(positions: NDArray[np.float32], *, minutes: float, crowd: int) -> Endured:
    """Play a motion over and over to a crowd's recognisers, and kill a worker twelve times.

    Parameters
    ----------
    positions
        The motion, shape (frames, joints, 3), metres.
    minutes
        How long.
    crowd
        The number of performers, each at a moment of its own.
    """
    moments, shift = round(minutes * 60 * FRAME_RATE), len(positions) // crowd + 1
    rounds = range(_STEADY, max(moments // len(positions), _STEADY))
    told = _Told(len(positions) / FRAME_RATE, rounds)
    lags: Counter[int] = Counter()
    early: float | None = None
    kills = 0
    with closing(Cluster(_WORKERS, crowd)) as cluster:

        def collect(until: float) -> None:
            while (left := until - time.monotonic()) > 0:
                for each, lag in cluster.answers(left):
                    lags[round(lag * 1e4)] += 1
                    told.note(each)

        begun = time.monotonic() + 0.1
        for k in range(moments):
            if k * (_KILLS + 1) // moments > kills:
                kills += 1
                end([cluster.workers.pop(0)])
                cluster.add_worker()
            if k == moments // _KILLS:
                early = resident_mb()
            # They enter one after the other, so that their hops do not coincide.
            for index in range(min(k + 1, crowd)):
                collect(begun + (k + index / crowd) / FRAME_RATE)
                frame = Frame(f"p{index}", 1.0 + k / FRAME_RATE, positions[(k + index * shift) % len(positions)])
                cluster.performers.push_all([frame], time.monotonic())
        collect(time.monotonic() + _LINGER)
        dropped = [note for note in cluster.gateway.notes if "dropped" in note or "no worker" in note]
        late = resident_mb()
    due = _expected(positions, len(rounds), crowd)
    return Endured(
        crowd,
        minutes,
        kills,
        lags,
        len(rounds),
        due.total(),
        (due - told.events).total(),
        (told.events - due).total(),
        "; ".join(dropped) or "none",
        (early, late),
    )
