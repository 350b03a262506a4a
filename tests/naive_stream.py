"""The slow twins of a motion in flight: every frame is kept, and everything is computed again from all of them.

Nothing here calls the product. The rules are those of the docstrings of the window and of the recogniser's settings.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import naive
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from naive import Matrix

#: Spans of time are compared to the microsecond: frame times are rounded.
MICROSECOND = 1e-6


def reaches(span: float, seconds: float) -> bool:
    """Say whether a span of time is as long as some seconds."""
    return span >= seconds - MICROSECOND


@dataclass
class NaiveWindow:
    """The window's rows, each with its time in whole ticks, in a plain list; no rounding decides anything here.

    A row at time t is in the window while the newest time is less than t + seconds, and while it is among the `most`
    newest.
    """

    ticks: int
    most: int
    rows: list[tuple[int, float]] = field(default_factory=list)
    since: int | None = None
    entered: list[float] = field(default_factory=list)
    left: list[float] = field(default_factory=list)

    def push(self, time: int, mark: float) -> None:
        """Take in a row that holds one mark, and let go of what is too old or too many."""
        if self.since is None:
            self.since = time
        self.rows.append((time, mark))
        self.entered.append(mark)
        while time >= self.rows[0][0] + self.ticks or len(self.rows) > self.most:
            self._let_go(self.rows.pop(0)[1])

    def _let_go(self, mark: float) -> None:
        if mark in self.entered:
            self.entered.remove(mark)
        else:
            self.left.append(mark)

    def take_change(self) -> tuple[list[float], list[float]]:
        """Say which marks entered and left since the last call."""
        change = self.entered, self.left
        self.entered, self.left = [], []
        return change

    def clear(self) -> None:
        """Forget everything."""
        self.rows, self.since, self.entered, self.left = [], None, [], []

    @property
    def full(self) -> bool:
        """Whether rows have come for the window's whole length since it was last empty."""
        return self.since is not None and self.rows[-1][0] - self.since >= self.ticks


@dataclass(frozen=True)
class NaiveRecognition:
    """What the twin answers, and what it was computed from."""

    time: float
    label: str
    scores: dict[str, float]
    movement: float
    share: float
    gap: float
    axis: Matrix
    rows: Matrix

    @property
    def margin(self) -> float:
        """How far the best class is above the second."""
        second, best = sorted(self.scores.values())[-2:]
        return best - second


@dataclass
class NaiveRecognizer:
    """The recogniser of one performer: all frames in a list, everything computed anew at each hop.

    The parameters are a library's measured pairs, axes and class names, and the settings by their names.
    """

    pairs: Sequence[tuple[int, int]]
    axes: Matrix
    class_names: Sequence[str]
    window: float = 1.0
    hop: float = 1 / 30
    longest_gap: float = 0.5
    stillness: float = 0.01
    smallest_gap: float = 0.02
    patience: int = 10
    frames: list[tuple[float, Matrix]] = field(default_factory=list)
    late_in_a_row: int = 0
    out_of_order: int = 0
    restarts: int = 0
    due: float | None = None

    def push(self, time: float, positions: Matrix) -> NaiveRecognition | None:
        """Take in a frame, shape (joints, 3); answer when an answer is due."""
        if self._is_late(time):
            self.out_of_order += 1
            return None
        self.late_in_a_row = 0
        self.frames.append((time, naive.distance_rows(positions[None], self.pairs)[0]))
        if not reaches(time - self.frames[0][0], self.window):
            return None
        if self.due is not None and time < self.due - self.hop / 1000:
            return None
        # Hops lie on a grid from the first answer on, and a frame a thousandth early is on time; a feed that misses a
        # whole hop begins a new grid.
        on_grid = None if self.due is None else self.due + self.hop
        self.due = time + self.hop if on_grid is None or on_grid <= time else on_grid
        return self._recognized(time)

    def _is_late(self, time: float) -> bool:
        """Say whether to refuse a frame; begin anew after a gap, or when the sender's clock began again."""
        if not self.frames:
            return False
        behind = self.frames[-1][0] - time
        if behind < 0:
            if -behind > min(self.longest_gap, self.window):
                self._begin_anew()
            return False
        self.late_in_a_row += 1
        if behind > self.window or self.late_in_a_row > self.patience:
            self._begin_anew()
            return False
        return True

    def _begin_anew(self) -> None:
        self.frames, self.due = [], None
        self.restarts += 1

    def _recognized(self, now: float) -> NaiveRecognition:
        rows = np.array([row for time, row in self.frames if not reaches(now - time, self.window)])
        matrix = naive.covariance(rows)
        values, vectors = np.linalg.eigh(matrix)
        axis, total = vectors[:, -1], float(np.trace(matrix))
        body_size = float(np.sqrt(np.mean(rows.mean(axis=0) ** 2)))
        movement = float(np.sqrt(total / len(axis))) / body_size
        gap = 1.0 - float(values[-2]) / float(values[-1])
        _, scores = naive.match(self.axes, self.class_names, axis)
        label = max(scores, key=lambda name: scores[name])
        if movement < self.stillness:
            label = "still"
        elif gap < self.smallest_gap:
            label = "ambiguous"
        return NaiveRecognition(now, label, scores, movement, float(values[-1]) / total, gap, axis, rows)
