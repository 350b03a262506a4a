"""A library's windows laid out for the comparison with a live window, in numpy and in the compiled loops."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from kinespace.library.kernels import compiled
from kinespace.library.windows.comparison import NEAREST
from kinespace.library.windows.parts import EIGENVECTORS, Kind

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from kinespace.library.windows.comparison import Comparison
    from kinespace.library.windows.index import Blocks
    from kinespace.library.windows.metric import Metric
    from kinespace.library.windows.parts import Part


class Windows:
    """Compares a live window with all windows of a library.

    Parameters
    ----------
    comparison
        How they are compared.
    vectors, eigenvectors, blocks
        The fields of `WindowIndex`.
    """

    def __init__(
        self,
        comparison: Comparison,
        vectors: Sequence[NDArray[np.float32]],
        eigenvectors: NDArray[np.float32],
        blocks: Blocks,
    ) -> None:
        self._comparison, self._blocks = comparison, blocks
        self._vectors, self._eigenvectors = vectors, eigenvectors
        self._views = np.array(comparison.weighing.weights, dtype=np.float32)
        self._parts = comparison.weighing.parts
        self._shape = (len(self._views), len(blocks.class_starts))
        self._groups: tuple[_Group, ...] = ()
        self._transposed = eigenvectors.T
        self._table: compiled.Table | None = None
        self._fits = True

    def __getstate__(self) -> dict[str, Any]:
        # A compiled table cannot be copied; a copy lays the windows out anew.
        return self.__dict__ | {"_table": None}

    def prepare(self) -> None:
        """Lay the windows out now, so that the first hop need not wait."""
        if self._compiled() is None:
            self._lay_out_groups()

    def compared(self, numbers: Mapping[Part, NDArray[np.float64]]) -> NDArray[np.float64]:
        """Compute `WindowIndex.log_distances`."""
        table = self._compiled()
        if table is None:
            return self._blocks.agreed(self._blocks.nearest(self.weighed(self._comparison.place(numbers))))
        logs = np.empty(self._shape)
        # A live window has its parts in this order; others may not.
        in_order = numbers.values() if tuple(numbers) == self._parts else [numbers[part] for part in self._parts]
        table.compared(*in_order, logs)
        return logs

    def weighed(self, vectors: Sequence[NDArray[np.float32]]) -> NDArray[np.float32]:
        """Weigh the log distances of one window (the vector of each group) to all windows: (views, windows)."""
        self._lay_out_groups()
        logs = np.empty((len(vectors), len(self._eigenvectors)), dtype=np.float32)
        for log, vector, group in zip(logs, vectors, self._groups, strict=True):
            group.squared_distances(vector, log)
        np.maximum(logs, np.float32(NEAREST), out=logs)
        np.log(logs, out=logs)
        weighed: NDArray[np.float32] = self._views @ logs
        return weighed

    def scores(self, eigenvector: NDArray[np.float64]) -> NDArray[np.float64]:
        """Compute `WindowIndex.eigenvector_scores`."""
        table = self._compiled()
        if table is not None:
            scores = np.empty(self._shape[1])
            table.scores(eigenvector, scores)
            return scores
        self._lay_out_groups()
        products = eigenvector.astype(np.float32) @ self._transposed
        np.abs(products, out=products)
        return np.maximum.reduceat(products, self._blocks.class_starts).astype(np.float64)

    def _lay_out_groups(self) -> None:
        if not self._groups:
            self._groups = tuple(_Group(each) for each in self._vectors)
            self._transposed = np.ascontiguousarray(self._transposed)

    def _compiled(self) -> compiled.Table | None:
        """Give the windows as a compiled table, which is laid out at first use.

        None without loops, or where there are too many parts, views or axes for them.
        """
        if compiled.loops is None or not self._fits:
            return None
        if self._table is None:
            try:
                self._table = self._laid_out(compiled.loops)
            except ValueError:
                self._fits = False
        return self._table

    def _laid_out(self, loops: compiled.Loops) -> compiled.Table:
        comparison, blocks = self._comparison, self._blocks
        weighing = comparison.weighing
        starts = np.searchsorted(blocks.starts, blocks.class_starts)
        table = loops.Table(np.ascontiguousarray(self._eigenvectors), blocks.starts, starts, self._views, NEAREST)
        for part in weighing.parts:
            count = min(EIGENVECTORS, self._eigenvectors.shape[1]) if part.kind is Kind.EIGEN else 0
            table.add_part(count, self._eigenvectors.shape[1], *_as_halves(comparison.parts.get(part)))
        for group, metric, vectors in zip(weighing.groups, comparison.groups, self._vectors, strict=True):
            parts = np.array([weighing.parts.index(part) for part in group])
            halves = vectors.astype(np.float16)
            if halves.ndim == 3:
                halves = np.pad(halves, ((0, 0), (0, EIGENVECTORS - halves.shape[1]), (0, 0))).reshape(len(halves), -1)
            table.add_group(parts, *_as_halves(metric), halves, _squares(vectors))
        return table


def _as_halves(metric: Metric | None) -> tuple[NDArray[np.float32], NDArray[np.float16]]:
    """Give a metric's origin and axes; both empty for no metric."""
    if metric is None:
        return np.empty(0, dtype=np.float32), np.empty((0, 0), dtype=np.float16)
    return np.ascontiguousarray(metric.origin), np.ascontiguousarray(metric.axes, dtype=np.float16)


class _Group:
    """The windows' vectors of one group, laid out for numpy."""

    def __init__(self, vectors: NDArray[np.float32]) -> None:
        self._is_eigen = vectors.ndim == 3
        # Axes come first, because products with few rows are faster from the left.
        self._axes = np.ascontiguousarray(np.moveaxis(vectors, -1, 0).swapaxes(1, -1).reshape(vectors.shape[-1], -1))
        self._squares = _squares(vectors) + np.float32(NEAREST)
        self._each = np.full(vectors.shape[1] ** 2, -2, dtype=np.float32)

    def squared_distances(self, vector: NDArray[np.float32], squared: NDArray[np.float32]) -> None:
        """Write the squared distances of one vector to all windows, plus `NEAREST`, into (windows,)."""
        if self._is_eigen:
            products = vector @ self._axes
            np.square(products, out=products)
            np.dot(self._each, products.reshape(-1, len(squared)), out=squared)
            squared += np.float32(1)
        else:
            np.dot(vector * np.float32(-2), self._axes, out=squared)
            squared += vector @ vector
        squared += self._squares


def _squares(vectors: NDArray[np.float32]) -> NDArray[np.float32]:
    """Give the squared lengths of windows' vectors, or of their matrices.

    Matrices have length 1 but for rounding; the matrix of a window without movement has length 0, which counts as 1, so
    that such a window is at the greatest distance from all others.
    """
    if vectors.ndim == 2:
        lengths: NDArray[np.float32] = np.square(vectors).sum(axis=1)
        return lengths
    squares = np.square(np.matmul(vectors, vectors.transpose(0, 2, 1))).sum(axis=(1, 2))
    counted: NDArray[np.float32] = np.where(squares > 0, squares, np.float32(1))
    return counted
