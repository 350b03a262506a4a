"""A linear head: which class a window belongs to, by linear discriminant analysis of its parts' vectors.

A distance to the nearest window takes all axes alike. The head learns which axes tell the classes apart while a window
still holds the motion before: it is taught by the library's windows, and by windows of its motions behind other motions
of the same person. It knows the people and the sensor that taught it, so it only helps within one laboratory
(tests/TRIED.md).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]

#: Log distance for each unit of a class's negative log probability.
_SHARE = 0.06
#: The share of the scatter within classes that is replaced by equal scatter, and how much equal scatter there is at
#: least: windows of a class may be the same, number for number.
_SHRINKAGE, _LEAST = 0.1, 1e-6


class Head(NamedTuple):
    """The classes and, for each, the factors of a window's parts and what is added, (axes, classes) and (classes,)."""

    classes: tuple[str, ...]
    factors: Numbers
    offsets: Numbers

    @classmethod
    def learned(cls, vectors: NDArray[np.float32], names: Sequence[str]) -> Self:
        """Learn from windows: the parts' vectors one after another, (windows, axes), and the class of each window."""
        classes, own = np.unique(names, return_inverse=True)
        means = np.array([vectors[own == each].mean(axis=0, dtype=np.float64) for each in range(len(classes))])
        # Classes weigh the same.
        apart = (vectors - means[own]) / np.sqrt(np.bincount(own))[own, None]
        scatter = apart.T @ apart / len(classes)
        equal = max(_SHRINKAGE * float(scatter.diagonal().mean()), _LEAST)
        factors = np.linalg.solve((1 - _SHRINKAGE) * scatter + equal * np.eye(len(scatter)), means.T)
        return cls(tuple(classes.tolist()), factors, -(means.T * factors).sum(axis=0) / 2)

    def of_classes(self, classes: Sequence[str]) -> Head | None:
        """Give the head of some of the classes, in their order; None if another is among them."""
        if not set(classes) <= set(self.classes):
            return None
        places = [self.classes.index(name) for name in classes]
        return Head(tuple(classes), self.factors[:, places], self.offsets[places])

    def added(self, parts: Iterable[NDArray[np.floating]]) -> Numbers:
        """Say how unlikely windows' parts say each class is: what is added to its log distance, (..., classes)."""
        likely = np.concatenate([*parts], axis=-1) @ self.factors + self.offsets
        likely -= likely.max(axis=-1, keepdims=True)
        added: Numbers = _SHARE * (np.log(np.exp(likely).sum(axis=-1, keepdims=True)) - likely)
        return added
