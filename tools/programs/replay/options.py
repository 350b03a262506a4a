"""The faults of the feed that `kinespace replay` sends, as typed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kinespace.tools.feeding.feed import with_drops, with_jitter, with_reordering

if TYPE_CHECKING:
    from collections.abc import Iterator

    from kinespace.tools.feeding.feed import Cue


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
