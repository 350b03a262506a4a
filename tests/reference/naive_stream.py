"""The slow twins of a motion in flight: every frame is kept, and everything is computed again from all of them.

Nothing here calls the product. The rules are those of the docstrings, written out with their numbers.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from naive_windows import Matrix

#: Spans of time are compared to the microsecond: frame times are rounded.
MICROSECOND = 1e-6
#: Frames and seconds before there is a first answer, and the longest window.
FIRST_FRAMES, FIRST_SECONDS, LONGEST = 3, 0.15, 2.0
#: Noise from which rows are averaged (metres), over how many seconds, and how many frames are measured together.
NOISY, AVERAGED_OVER, TOGETHER = 0.0113, 0.1, 16
#: A lead counts no more than this.
MAX_LEAD = 3.0
#: Events: seconds of no class until an end, the longest hop that counts, and the lead that counts most.
ENDED_AFTER, MAX_HOP, MAX_PACE = {"still": 0.4, "unknown": 0.8, "ambiguous": 0.4, "implausible": 0.8}, 0.1, 1.0


def reaches(span: float, seconds: float) -> bool:
    """Say whether a span of time is as long as some seconds."""
    return span >= seconds - MICROSECOND


# --- a trembling sensor ------------------------------------------------------------------------------------------


@dataclass
class NaiveSmoother:
    """Averages rows over a tenth of a second while the quarter of the segments that tremble least tremble by 11 mm."""

    segments: Sequence[int]
    rows: list[tuple[float, Matrix]] = field(default_factory=list)
    waiting: int = 0
    variance: Matrix | float = 0.0
    known: float = 0.0
    noise: float = 0.0
    calm: int = 0

    def smoothed(self, batch: Sequence[tuple[float, Matrix]]) -> list[tuple[float, Matrix]]:
        """Take in rows measured together; give them averaged with the rows before, or unchanged."""
        self.rows += batch
        self.waiting += len(batch)
        if self.waiting >= 30 or reaches(self.rows[-1][0] - self.rows[-self.waiting][0], 0.1):
            self._estimate(self.waiting)
            self.waiting = 0
        if self.noise < NOISY:
            self.calm = len(self.rows)
            return list(batch)
        return [(now, np.mean(self._before(now), axis=0)) for now, _ in batch]

    def _before(self, now: float) -> list[Matrix]:
        return [row for time, row in self.rows[self.calm :] if time <= now and not reaches(now - time, AVERAGED_OVER)]

    def _estimate(self, new: int) -> None:
        recent = self.rows[-(new + 2) :]
        if len(recent) < 3:
            return
        raw = np.array([row[self.segments] for _, row in recent])
        bends = raw[2:] - 2 * raw[1:-1] + raw[:-2]
        seconds = recent[-1][0] - recent[1][0]
        self.known = min(self.known + seconds, 1.0)
        # White noise of variance s² has second differences of variance 6 s².
        square = np.mean(bends**2, axis=0) / 6
        self.variance += min(seconds / self.known, 1.0) * (square - self.variance)
        self.noise = math.sqrt(sorted(self.variance.tolist())[len(self.segments) // 4])


# --- one performer -----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class NaiveHop:
    """What is due at one hop: its time, the rows to look at, and their noise."""

    time: float
    times: Matrix
    rows: Matrix
    noise: float

    def last(self, seconds: float) -> tuple[Matrix, Matrix]:
        """Give times and rows of the last seconds."""
        kept = [index for index, time in enumerate(self.times) if not reaches(self.time - time, seconds)]
        return self.times[kept], self.rows[kept]


@dataclass
class NaiveFeed:
    """One performer's frames in a list: which are taken in, and when an answer is due.

    The parameters are the segments among the pairs, the settings by their names, and the longest window.
    """

    segments: Sequence[int]
    hop: float = 1 / 30
    longest_gap: float = 0.5
    longest: float = LONGEST
    rows: list[tuple[float, Matrix]] = field(default_factory=list)
    waiting: list[tuple[float, Matrix]] = field(default_factory=list)
    late_in_a_row: int = 0
    out_of_order: int = 0
    restarts: int = 0
    due: float = -math.inf
    newest: float | None = None

    def __post_init__(self) -> None:
        self.smoother = NaiveSmoother(self.segments)

    def push(self, time: float, row: Matrix) -> NaiveHop | None:
        """Take in a frame's distances; give the hop when one is due."""
        if self._is_late(time):
            self.out_of_order += 1
            return None
        self.late_in_a_row, self.newest = 0, time
        self.waiting.append((time, row))
        due = time >= self.due - self.hop / 1000
        if due or len(self.waiting) == TOGETHER:
            self.rows += self.smoother.smoothed(self.waiting)
            self.waiting = []
        if not due or len(self.rows) < FIRST_FRAMES or not reaches(time - self.rows[0][0], FIRST_SECONDS):
            return None
        # Hops lie on a grid from the first answer on; a feed that misses a whole hop begins a new grid.
        self.due = self.due + self.hop if self.due + self.hop > time else time + self.hop
        times, rows = (np.array(each) for each in zip(*self.rows, strict=True))
        return NaiveHop(time, times, rows, self.smoother.noise)

    def _is_late(self, time: float) -> bool:
        """Say whether to refuse a frame; begin anew after a gap, or when the sender's clock began again."""
        if self.newest is None:
            return False
        behind = self.newest - time
        if behind < 0:
            if -behind > min(self.longest_gap, self.longest):
                self._begin_anew()
            return False
        self.late_in_a_row += 1
        if behind > self.longest or self.late_in_a_row > 10:
            self._begin_anew()
            return False
        return True

    def _begin_anew(self) -> None:
        self.rows, self.waiting, self.due = [], [], -math.inf
        self.smoother = NaiveSmoother(self.segments)
        self.restarts += 1


# --- guess and judgement -----------------------------------------------------------------------------------------


def so_far(times: Sequence[float], distances: Matrix, movements: Sequence[float]) -> list[int]:
    """Give the class nearest to the last seconds at each hop: every hop before weighs by movement, time and age."""
    lasted = [1 / 30, *(after - before for before, after in pairwise(times))]
    nearest = []
    for last, now in enumerate(times):
        weights = [movements[hop] * lasted[hop] * math.exp((times[hop] - now) / 1.5) for hop in range(last + 1)]
        nearest.append(int(np.argmin(np.asarray(weights) @ np.asarray(distances)[: last + 1])))
    return nearest


def guesses(times: Sequence[float], distances: Matrix, needed: float) -> list[int]:
    """Compute the guess at every hop from all log distances (hops, classes) since the feed began.

    The guess changes when a class has been nearest for so long that its lead over the second, times the thirtieths of a
    second that it lasts, adds up to what is needed.
    """
    spans = [1 / 30, *(after - before for before, after in pairwise(times))]
    leaders = [min(range(len(row)), key=row.__getitem__) for row in distances.tolist()]
    made = list[int]()
    for hop, leader in enumerate(leaders):
        led_since = next((k + 1 for k in range(hop, -1, -1) if leaders[k] != leader), 0)
        lead = 30 * sum(lead_of(distances[k], leader) * spans[k] for k in range(led_since, hop + 1))
        made.append(leader if not made or lead >= needed else made[-1])
    return made


def lead_of(distances: Matrix, leader: int) -> float:
    """Say by how much one class is ahead of the second; a lone class by as much as counts."""
    others = [distance for index, distance in enumerate(distances.tolist()) if index != leader]
    return min(min(others, default=math.inf) - float(distances[leader]), MAX_LEAD)


def known(times: Sequence[float], logits: Sequence[float], threshold: float, over: float, held: float) -> list[bool]:
    """Judge at every hop from the whole course of logits since the feed began, averaged over some seconds.

    `held` says how far the evidence for a named motion may fall below the threshold.
    """
    made = list[bool]()
    for hop, now in enumerate(times):
        ages = [math.exp(-(now - time) / over) for time in times[: hop + 1]]
        # The first logit counts as if it had always been so; each later one for the time since the one before.
        weights = [ages[0], *(after - before for before, after in pairwise(ages))]
        average = sum(weight * logit for weight, logit in zip(weights, logits[: hop + 1], strict=True))
        made.append(average >= threshold - (held if made and made[-1] else 0.0))
    return made


# --- events ------------------------------------------------------------------------------------------------------


def events(
    times: Sequence[float], leads: Sequence[float], named: Sequence[int], outcomes: Sequence[str], needed: float
) -> Iterator[tuple[float, str, int]]:
    """List starts and ends; `named` is each hop's class, -1 for none, and `outcomes` the reason for none."""
    going_on: int | None = None
    for hop, leader in enumerate(named):
        led_since = next((k + 1 for k in range(hop, -1, -1) if named[k] != leader), 0)
        gathered = 0.0
        for k in range(led_since, hop + 1):
            span = min(times[k] - times[k - 1], MAX_HOP) if k else 0.0
            pace = 30 * min(max(leads[k], 0.0), MAX_PACE) if leader >= 0 else needed / ENDED_AFTER[outcomes[k]]
            gathered += span * pace
        if leader != going_on and gathered >= needed:
            if going_on is not None and going_on >= 0:
                yield times[hop], "end", going_on
            if leader >= 0:
                yield times[hop], "start", leader
            going_on = leader
