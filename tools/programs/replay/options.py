"""The options of `kinespace replay`, as typed, in groups: how recordings are played, and the faults of the feed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kinespace.tools.feeding.feed import with_drops, with_jitter, with_reordering

if TYPE_CHECKING:
    from collections.abc import Iterator

    from kinespace.tools.feeding.feed import Cue


@dataclass(frozen=True, slots=True)
class Course:
    """How recordings are played: performer, speed, pause, loop, and the part of each recording (seconds)."""

    performer: str
    speed: float = 1.0
    pause: float = 1.0
    loop: bool = False
    begin: float = 0.0
    end: float | None = None

    def __post_init__(self) -> None:
        if self.end is not None and self.end <= self.begin:
            raise ValueError(f"--to: expected more than --from ({self.begin:g}), got {self.end:g}")


@dataclass(frozen=True, slots=True)
class Faults:
    """Faults of the feed, drawn from a seed.

    Attributes
    ----------
    drop, reorder
        Shares of the frames, 0 to 1, that are dropped or change places with the next frame.
    jitter
        Seconds by which frames may be late.
    """

    drop: float = 0.0
    jitter: float = 0.0
    reorder: float = 0.0
    seed: int = 0

    def applied(self, cues: Iterator[Cue]) -> Iterator[Cue]:
        """Apply the faults to a feed."""
        generator = np.random.default_rng(self.seed)
        if self.drop:
            cues = with_drops(cues, self.drop, generator)
        if self.reorder:
            cues = with_reordering(cues, self.reorder, generator)
        if self.jitter:
            cues = with_jitter(cues, self.jitter, generator)
        return cues
