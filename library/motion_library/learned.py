"""Numbers learned from people, kept with a library's motions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

#: The beginning of the names of arrays that only hold for the motions that taught them.
TAUGHT = "taught "


@dataclass(frozen=True, slots=True, eq=False)
class Learned:
    """Named arrays, each float32."""

    named: Mapping[str, NDArray[np.float32]] = field(repr=False)

    @property
    def judges(self) -> bool:
        """Whether there are numbers that hold for other motions too."""
        return any(not name.startswith(TAUGHT) for name in self.named)

    def for_other_motions(self) -> Learned:
        """Give the numbers that hold for other motions too."""
        kept = {name: array for name, array in self.named.items() if not name.startswith(TAUGHT)}
        return self if len(kept) == len(self.named) else Learned(kept)
