"""A window compared with all windows of a library: how far it is from each class, and how likely the same motion."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from kinespace.library.windows.comparison import MAX_AXES, NEAREST, Weighing

Numbers = NDArray[np.float64]

#: Variance of everyday movement along a metric's first axis; along the k-th it is √k times less. Metrics are scaled
#: alike, and order their axes: CMU's everyday movement varies so, whatever taught them (tests/TRIED.md).
_EVERYDAY = 0.05
#: Between two people in the same motion windows vary by 1 over `MAX_AXES`, as metrics are scaled, but along none by
#: more than this share of all variance.
_MOST_WITHIN = 0.8
#: The ratio is counted in units of so many, so that a lead counts up to `rejection.MAX_LEAD`.
UNIT = 5.0


class Likelihood(NamedTuple):
    """How much likelier a window and a library's are the same motion by two people than any two movements.

    Along each axis of a metric windows vary by t among all movement, and by w between two people in the same motion, so
    the same motion shares b = t − w (the two-covariance model of speaker verification: Prince and Elder 2007; Brümmer
    and de Villiers 2010). With c = b / (t² − b²) and a = t / (t² − b²) − 1 / t, the log-likelihood ratio of q and l is

        Σ c q l − ½ Σ a (q² + l²) − ½ Σ log((t² − b²) / t²).

    So a match near the middle of all movement says little, and one far from it much, even of one example alone. Numbers
    are in units, the mean over the groups that have a metric, and negative.

    Attributes
    ----------
    products
        What is multiplied with a live window's vectors, shape (windows, axes of all groups).
    squares
        What is multiplied with their squares, shape (axes of all groups,).
    constants
        What is added for each window, shape (windows,).
    """

    products: NDArray[np.float32]
    squares: NDArray[np.float32]
    constants: NDArray[np.float32]

    @classmethod
    def of(cls, vectors: Sequence[NDArray[np.floating]]) -> Self:
        """Prepare windows, of which for each group the vectors are given, as in `WindowIndex`."""
        # Scaled eigenvectors have no metric.
        count = UNIT * max(sum(each.ndim == 2 for each in vectors), 1)
        products, squares, constants = list[Numbers](), list[Numbers](), np.zeros(len(vectors[0]))
        for each in vectors:
            if each.ndim == 2:
                shared, own, constant = factors(each.shape[1])
                wide = each.astype(np.float64)
                products.append(wide * -shared / count)
                squares.append(own / (2 * count))
                constants += np.square(wide) @ squares[-1] + constant / count
            else:
                products.append(np.zeros((len(each), each[0].size)))
                squares.append(np.zeros(each[0].size))
        joined = np.concatenate(products, axis=1, dtype=np.float32), np.concatenate(squares, dtype=np.float32)
        return cls(*joined, constants.astype(np.float32))

    def of_windows(self, vectors: Sequence[NDArray[np.float32]], classes: NDArray[np.intp]) -> Numbers:
        """Compare some windows' vectors of all groups with classes, by where their windows start: (asked, classes)."""
        asked = np.concatenate([each.reshape(len(each), -1) for each in vectors], axis=1)
        ratios = asked @ self.products.T
        ratios += self.constants
        found: Numbers = np.minimum.reduceat(ratios, classes, axis=1).astype(np.float64)
        found += (np.square(asked) @ self.squares)[:, None]
        return found


def factors(axes: int) -> tuple[Numbers, Numbers, float]:
    """Give c and a along each of so many axes, and ½ Σ log((t² − b²) / t²)."""
    whole = _EVERYDAY / np.sqrt(np.arange(1, axes + 1))
    shared = whole - np.minimum(1 / MAX_AXES, _MOST_WITHIN * whole)
    left = np.square(whole) - np.square(shared)
    return shared / left, whole / left - 1 / whole, 0.5 * float(np.log(left / np.square(whole)).sum())


#: Log distance for each unit of a class's negative log probability.
_SHARE = 0.06
#: The share of the scatter within classes that is replaced by equal scatter, and how much equal scatter there is at
#: least: windows of a class may be the same, number for number.
_SHRINKAGE, _LEAST = 0.1, 1e-6


class Head(NamedTuple):
    """Which class a window belongs to, by linear discriminant analysis of its parts' vectors.

    A distance to the nearest window takes all axes alike. The head learns which axes tell the classes apart while a
    window still holds the motion before: by the library's windows, and by windows of its motions behind others of the
    same person. It knows the people and the sensor that taught it, so it only helps within one laboratory
    (tests/TRIED.md).

    It holds the classes and, for each, the factors of a window's parts and what is added, (axes, classes), (classes,).
    """

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

    def of_classes(self, classes: Sequence[str]) -> "Head | None":
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


Floats = NDArray[np.float32]
Indices = NDArray[np.intp]


class Distances(NamedTuple):
    """How far a window is from each class.

    Attributes
    ----------
    logs
        For each of the weighing's `weights` the log distance of the nearest window, as the mean over the two nearest
        persons, shape (weights, classes).
    named
        The log distance of each class for naming, shape (classes,).
    judged
        The numbers by which a guess is judged: the log distances by each group alone, shape (groups, classes), or by
        `Likelihood`, shape (1, classes).
    scores
        Each class's best |inner product| of leading eigenvectors (Le Naour et al. 2012, section 3), 0 to 1, shape
        (classes,).
    """

    logs: Numbers
    named: Numbers
    judged: Numbers
    scores: Numbers


class Comparer(NamedTuple):
    """A library's windows as they are compared.

    Attributes
    ----------
    weighing
        How they are compared.
    windows
        For each group the windows' vectors, axes first, shape (axes, windows), or (directions, eigenvectors × windows).
    lengths
        Their squared lengths plus `NEAREST`, shape (groups, windows).
    weights
        The weight of each group in each blend, shape (blends, groups).
    starts
        Where the windows of each person in each class start, and where the last ones end, shape (starts + 1,).
    persons
        For each class the places of its persons among `starts`, filled up with the last, shape (classes, persons).
        One person's class has this person twice.
    eigenvectors, classes
        The leading eigenvectors, shape (directions, windows), and where each class's windows start, shape (classes,).
    likelihood
        What judges a guess in place of the distances by each group; None for nothing.
    head
        What helps to name; None for nothing.
    """

    weighing: Weighing
    windows: tuple[Floats, ...]
    lengths: Floats
    weights: Floats
    starts: Indices
    persons: Indices
    eigenvectors: Floats
    classes: Indices
    likelihood: Likelihood | None = None
    head: Head | None = None

    @classmethod
    def of(
        cls, weighing: Weighing, vectors: Sequence[NDArray[np.float16]], eigenvectors: Floats, whose: Indices
    ) -> Self:
        """Lay windows out.

        Parameters
        ----------
        weighing
            How they are compared.
        vectors, eigenvectors
            As in `WindowIndex`.
        whose
            The class and the person of each window, as numbers, shape (windows, 2); the windows of a class lie
            together.
        """
        count = len(whose)
        lengths = np.array([_squares(each.astype(np.float32)) for each in vectors]) + np.float32(NEAREST)
        windows = tuple(np.ascontiguousarray(each.astype(np.float32).T.reshape(each.shape[-1], -1)) for each in vectors)
        new = np.any(whose[1:] != whose[:-1], axis=1)
        starts = np.concatenate([[0], np.flatnonzero(new) + 1, [count]])
        of_class = whose[starts[:-1], 0]
        most = max(int(np.bincount(of_class).max()), 2)
        persons = np.full((int(of_class.max()) + 1, most), len(starts) - 1)
        for place, row in enumerate(persons):
            places = np.flatnonzero(of_class == place)
            row[: max(len(places), 2)] = places
        return cls(
            weighing,
            windows,
            lengths,
            np.array(weighing.weights, dtype=np.float32),
            starts,
            persons,
            np.ascontiguousarray(eigenvectors.T),
            starts[persons[:, 0]],
        )

    def distances(self, leading: Floats, placed: Iterable[Floats], vectors: Sequence[Floats]) -> list[Distances]:
        """Compare some windows: their leading eigenvectors, (asked, directions), and what `Comparison` makes of them.

        That is the vectors of their parts (`placed`), and of their groups (`joined`).
        """
        scores = np.maximum.reduceat(np.abs(leading @ self.eigenvectors), self.classes, axis=1).astype(np.float64)
        logs = self.logs(vectors)
        named, judged = named_and_alone(logs, self.weighing)
        if self.head:
            named += self.head.added(placed)
        if self.likelihood:
            judged = self.likelihood.of_windows(vectors, self.classes)[None]
        windows = zip(logs.swapaxes(0, 1), named, judged.swapaxes(0, 1), scores, strict=True)
        return [Distances(*each) for each in windows]

    def logs(self, vectors: Sequence[Floats], added: Numbers | None = None) -> Numbers:
        """Give the log distances of some windows' vectors, perhaps with some of the library's windows farther.

        Parameters
        ----------
        vectors
            For each group, shape (asked, axes), or (asked, eigenvectors, directions).
        added
            By how much each of the library's windows is farther, in log distance, shape (windows,) or (asked, windows).

        Returns
        -------
        Shape (weights, asked, classes), as in `Distances`.
        """
        (groups, count), asked = self.lengths.shape, len(vectors[0])
        squared = np.empty((groups, asked, count), dtype=np.float32)
        for own, vector, windows in zip(squared, vectors, self.windows, strict=True):
            alike = vector.reshape(-1, len(windows)) @ windows
            if vector.ndim == 2:
                np.subtract(np.einsum("qa,qa->q", vector, vector)[:, None], 2 * alike, out=own)
            else:
                # The squared distance of two matrices of length 1: 1 + 1 − 2 Σᵢⱼ ⟨sᵢ, tⱼ⟩².
                np.square(alike, out=alike)
                np.subtract(1, 2 * np.add.reduce(alike.reshape(asked, -1, count), axis=1), out=own)
        squared += self.lengths[:, None]
        np.maximum(squared, np.float32(NEAREST), out=squared)
        weighed = (self.weights @ np.log(squared, out=squared).reshape(groups, -1)).reshape(-1, asked, count)
        if added is not None:
            weighed += added
        return agreed(weighed, self.starts, self.persons)


def named_and_alone(logs: Numbers, weighing: Weighing) -> tuple[Numbers, Numbers]:
    """Give the log distances for naming, (..., classes), and by each group alone, from those by all `weights`."""
    blends = len(weighing.blends)
    named: Numbers = np.minimum.reduce(logs[:blends])
    return named, logs[blends:]


def agreed(numbers: NDArray[np.floating], starts: Indices, persons: Indices) -> Numbers:
    """Take the mean of the two nearest persons' least of each class, from (..., windows) to (..., classes).

    Where several persons perform a class, the second nearest must agree: one person's way may resemble another motion.
    """
    least = np.full((*numbers.shape[:-1], len(starts)), np.inf)
    least[..., :-1] = np.minimum.reduceat(numbers, starts[:-1], axis=-1)
    by_person = least.take(persons, axis=-1)
    by_person.partition(1, axis=-1)
    both: Numbers = (by_person[..., 0] + by_person[..., 1]) / 2
    return both


def _squares(vectors: Floats) -> Floats:
    """Give the squared lengths of windows' vectors, or of their matrices.

    Matrices have length 1 but for rounding; the matrix of a window without movement has length 0, which counts as 1, so
    that such a window is at the greatest distance from all others.
    """
    if vectors.ndim == 2:
        lengths: Floats = np.square(vectors).sum(axis=1)
        return lengths
    squares = np.square(np.matmul(vectors, vectors.transpose(0, 2, 1))).sum(axis=(1, 2))
    counted: Floats = np.where(squares > 0, squares, np.float32(1))
    return counted
