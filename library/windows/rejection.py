"""Whether a motion is known: the evidence of a guess, weighed by numbers learned from known and unknown motions.

A logistic function tells a rightly named window from a window of something else (Fisher's discriminant where a library
has to learn it from its own motions: each person, else each recording, left out asks as known, each class left out asks
as unknown). The lead of the guess tells more than its distance: an unknown motion is about as far from several classes.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from kinespace.library.learned import Learned

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from kinespace.library.windows.index import WindowIndex

#: Shares of unknown time that may be named, at which thresholds are kept.
RATES = (0.01, 0.02, 0.05, 0.1, 0.2, 0.4)
#: A lead counts no more than this, in log distance: beyond it a guess is as clear as can be.
MAX_LEAD = 2.0
#: Windows that ask when a library learns from its own motions, at most.
_ASKING = 600
#: Windows of either kind below which nothing is learned.
_MIN_WINDOWS = 10
_BIAS = "bias "
#: How many numbers of the evidence compare a window with the library: the first ones.
_COMPARED = 3
#: Added to a variance: evidence that hardly varies is not to be trusted without bound.
_RIDGE = 0.02


class Evidence(NamedTuple):
    """What speaks for a guess.

    Attributes
    ----------
    whole
        Log distance of the guess by the first view, of all parts.
    lead
        Log distance by which the second class is further, at most `MAX_LEAD`.
    eigen
        Log distance of the guess by the last view.
    swing, sway
        Logarithms of the movement of a distance over half a second and over two.
    """

    whole: float
    lead: float
    eigen: float
    swing: float
    sway: float


@dataclass(frozen=True, slots=True, eq=False)
class Rejection:
    """Weighs evidence: above the threshold a guess is known.

    Attributes
    ----------
    weights
        Of each number of the evidence, shape (5,).
    offset
        Added to the weighed evidence.
    biases
        Added for a guess of some class.
    thresholds
        For each of `RATES` the logit above which that share of unknown time lies.
    typical
        Distance, lead and eigen distance that are typical of the library's own motions, each person (or else motion)
        left out, shape (3,): with the joints for which the other numbers were learned.
    joints
        How many joints those are; 0 when the numbers were learned for the library as it is.
    """

    weights: NDArray[np.float64] = field(repr=False)
    offset: float
    biases: Mapping[str, float] = field(repr=False)
    thresholds: NDArray[np.float64] = field(repr=False)
    typical: NDArray[np.float64] = field(repr=False)
    joints: int = 0
    _listed: tuple[float, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_listed", tuple(self.weights.tolist()))

    def logit(self, evidence: Evidence, class_name: str) -> float:
        """Say how likely a guess is right: log odds, up to a constant that the threshold decides."""
        weighed = sum(weight * number for weight, number in zip(self._listed, evidence, strict=True))
        return weighed + self.offset + self.biases.get(class_name, 0.0)

    def kept(self) -> Learned:
        """Give the numbers as a library's file keeps them."""
        numbers = {
            "weights": self.weights,
            "offset": np.array([self.offset]),
            "thresholds": self.thresholds,
            "typical": self.typical,
            "joints": np.array([self.joints]),
        }
        biases = {f"{_BIAS}{name}": np.array([bias]) for name, bias in self.biases.items()}
        return Learned({name: array.astype(np.float32) for name, array in (numbers | biases).items()})

    @classmethod
    def of_kept(cls, learned: Learned) -> Self:
        """Take the numbers from a library's file.

        Raises
        ------
        ValueError
            A number is missing, not finite, or there are more or fewer than expected.
        """
        named = learned.arrays()
        counts = {"weights": len(Evidence._fields), "thresholds": len(RATES), "typical": _COMPARED}
        shapes = counts | {"offset": 1, "joints": 1}
        for name, count in shapes.items():
            if name not in named or named[name].shape != (count,) or not np.isfinite(named[name]).all():
                raise ValueError(f"{name}: expected {count} finite numbers, got {named.get(name)}")
        biases = {name.removeprefix(_BIAS): float(array[0]) for name, array in named.items() if name.startswith(_BIAS)}
        numbers = {name: array.astype(np.float64) for name, array in named.items() if name in shapes}
        return cls(
            weights=numbers["weights"],
            offset=float(numbers["offset"][0]),
            biases=biases,
            thresholds=numbers["thresholds"],
            typical=numbers["typical"],
            joints=int(numbers["joints"][0]),
        )

    def moved_to(self, typical: NDArray[np.float64]) -> Rejection:
        """Give the same judgement for other joints, with which other distances and leads are typical, (3,)."""
        shift = float(self.weights[:_COMPARED] @ (typical - self.typical))
        return replace(self, offset=self.offset - shift, typical=typical)

    def threshold_at(self, rate: float) -> float:
        """Give the logit above which a motion is known, when this share of unknown time may be named."""
        rate = min(max(rate, RATES[0]), RATES[-1])
        return float(np.interp(np.log(rate), np.log(RATES), self.thresholds))


#: For a library with too few motions to learn from: as the built-in library's motions teach with joint metrics.
_TOO_FEW = Rejection(
    weights=np.array([-2.0, 2.0, 0.0, 0.0, 0.0]),
    offset=0.0,
    biases={},
    thresholds=np.array([1.5, 1.0, 0.5, 0.0, -0.5, -1.5]),
    typical=np.zeros(_COMPARED),
)


def learned_rejection(index: WindowIndex) -> Rejection:
    """Learn from a library's own motions how near known ones are, and unknown ones."""
    known, unknown, classes = _asked(index)
    if len(known) < _MIN_WINDOWS or len(unknown) < _MIN_WINDOWS:
        return _TOO_FEW
    near, far = known[:, :2], unknown[:, :2]
    scatter = (np.cov(near.T) + np.cov(far.T)) / 2 + _RIDGE * np.eye(2)
    slope = np.linalg.solve(scatter, near.mean(axis=0) - far.mean(axis=0))
    # With few classes left the lead of an unknown motion is wide: a clear guess must not count against itself.
    slope[1] = max(slope[1], 0.0)
    offset = -float(slope @ (near.mean(axis=0) + far.mean(axis=0))) / 2
    logits = far @ slope + offset
    by_class = [np.quantile(logits[classes == each], 1 - np.array(RATES)) for each in np.unique(classes)]
    weights = np.array([*slope, 0.0, 0.0, 0.0])
    return Rejection(weights, offset, {}, np.mean(by_class, axis=0), np.median(known, axis=0))


def typical_evidence(index: WindowIndex) -> NDArray[np.float64]:
    """Give the distance, lead and eigen distance that are typical of a library's own motions, shape (3,)."""
    known, _, _ = _asked(index)
    return np.median(known, axis=0) if len(known) else np.zeros(_COMPARED)


def _asked(index: WindowIndex) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.intp]]:
    """Let windows ask the rest of the library, and then the rest without their class.

    Returns
    -------
    Distance, lead and eigen distance of the windows named rightly, (known, 3), and of the windows without their class,
    (unknown, 3); the classes of the windows without their class.
    """
    motions = index.library.motions
    names = np.array([motions[each].class_name for each in index.motions])
    people = np.array([motions[each].actor for each in index.motions])
    classes = np.searchsorted(index.classes, names)
    several = len(set(people.tolist())) > 1
    naming = index.comparison.weighing.naming
    known: list[tuple[float, float, float]] = []
    unknown: list[tuple[float, float, float]] = []
    asked: list[int] = []
    for asking in range(0, len(index), -(-len(index) // _ASKING)):
        own = people == people[asking] if several else index.motions == index.motions[asking]
        views = index.own_distances(asking, own)
        performed = int(classes[asking])
        if np.isfinite(views[0, performed]) and int(views[:naming].min(axis=0).argmin()) == performed:
            known.append(_compared(views, naming))
        views[:, performed] = np.inf
        if np.isfinite(views[0]).any():
            unknown.append(_compared(views, naming))
            asked.append(performed)
    return np.array(known).reshape(-1, _COMPARED), np.array(unknown).reshape(-1, _COMPARED), np.array(asked)


def _compared(views: NDArray[np.float64], naming: int) -> tuple[float, float, float]:
    """Give the whole distance, the lead and the eigen distance of the nearest class, of views (views, classes)."""
    distances = views[:naming].min(axis=0)
    guess = int(distances.argmin())
    first, *others = sorted(distances.tolist())
    lead = min(others[0] - first, MAX_LEAD) if others else MAX_LEAD
    return float(views[0, guess]), lead, float(views[-1, guess])
