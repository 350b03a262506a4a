"""Rejection: whether a motion is known, by its guess's evidence and numbers learned from motions.

A logistic function distinguishes rightly named windows from other windows. A library that has to learn it from its own
motions takes Fisher's discriminant: each person (or each recording) left out asks as known, and each class left out
asks as unknown. Each group of parts is evaluated alone: a motion is known when all groups are near to the same class
and far from the others, which says more than the distance of all parts together.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from operator import mul
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from kinespace.library.library_file import Learned
from kinespace.library.windows.comparer import named_and_alone
from kinespace.library.windows.taught import usual_weighing

if TYPE_CHECKING:
    from kinespace.library.windows.index import WindowIndex

#: Shares of unknown time that may be named; a threshold is kept for each.
RATES = (0.01, 0.02, 0.05, 0.1, 0.2, 0.4)
#: A lead counts no more than this, in log distance, either way: a guess cannot be clearer.
MAX_LEAD = 2.0
#: Windows that ask when a library learns from its own motions, at most.
_ASKING = 600
#: Windows of each kind without which nothing is learned.
_MIN_WINDOWS = 10
#: The beginning of the name of a class's bias.
_BIAS = "bias "
#: The beginning of the name of a class's slope.
_SLOPE = "slope "
#: The beginning of the names of the numbers for bodies of few joints.
_FEW = "few "
#: Added to a variance, so that evidence that hardly varies does not get an unlimited weight.
_RIDGE = 0.02
#: Noise of a distance, metres, from which on it counts.
_NOISE = 0.01
#: Seconds over which evidence is averaged, unless the numbers were learned for another time.
USUAL_OVER = 0.3
#: The evidence for a named motion may fall this much below the threshold, so that a motion at the threshold does not
#: flicker. Less where one person's motions teach what is unknown: else an unknown motion that was named stays named.
HELD, HELD_ONE = 1.5, 0.5

#: Evidence by likelihood ratios above which each of `RATES` of everyday movement lies: the 14 minutes of CMU's takes,
#: of eight subjects, in which nothing is like the classes, asking 120 libraries of 1 to 11 gestures, one example each.
_EVERYDAY = (6.0, 5.2, 4.1, 3.2, 2.05, 0.45)


class Evidence(NamedTuple):
    """The evidence for a guess.

    Attributes
    ----------
    distances
        Log distance of the guess by each group of parts.
    leads
        Log distance by which the nearest other class is farther, by each group: below 0 where it is nearer; between
        -`MAX_LEAD` and `MAX_LEAD`; 0 without another class.
    noise
        Standard deviation of the noise of a distance in the feed, metres.
    """

    distances: tuple[float, ...]
    leads: tuple[float, ...]
    noise: float = 0.0

    @classmethod
    def of(cls, groups: NDArray[np.float64], guess: int, noise: float = 0.0) -> Self:
        """Take the evidence for a guess from the log distances by each group, (groups, classes)."""
        distances, leads = [], []
        for each in groups.tolist():
            distance, each[guess] = each[guess], math.inf
            lead = min(each) - distance
            distances.append(distance)
            if not -MAX_LEAD <= lead <= MAX_LEAD:
                # Where there is no other class, the lead says nothing.
                lead = 0.0 if lead == math.inf else min(max(lead, -MAX_LEAD), MAX_LEAD)
            leads.append(lead)
        return cls(tuple(distances), tuple(leads), noise)

    @property
    def compared(self) -> tuple[float, ...]:
        """Distances and leads: the result of the comparison with the library."""
        return self.distances + self.leads

    @property
    def lead(self) -> float:
        """Mean lead over the groups."""
        return sum(self.leads) / len(self.leads)

    @property
    def noisiness(self) -> float:
        """The noise of the feed on a logarithmic scale; 0 without noise."""
        return math.log1p(self.noise / _NOISE)


@dataclass(frozen=True, slots=True, eq=False)
class Rejection:
    """Weighs evidence: a guess is known above the threshold.

    Attributes
    ----------
    weights
        The weights of each distance, each lead, and the noise, shape (2 groups + 1,).
    offset
        Added to the weighed evidence.
    biases, slopes
        Numbers added for a guess of each class, and numbers added times the mean lead.
    thresholds
        For each of `RATES` the logit above which this share of unknown time lies.
    typical
        Typical distances and leads of the library's own motions, each person (or else motion) left out, shape (2
        groups,): evidence is weighed relative to them. They differ with the joints.
    joints
        The number of joints with which the other numbers were learned, for few joints the most of them; 0 when they
        were learned for the library as it is.
    over
        Seconds over which evidence is averaged before it is compared with a threshold.
    held
        How much the evidence for a named motion may fall below the threshold.
    by_likelihood
        Whether it judges likelihood ratios (`library.windows.comparer`), as one group, in place of distances.
    """

    weights: NDArray[np.float64] = field(repr=False)
    offset: float
    biases: Mapping[str, float] = field(repr=False)
    slopes: Mapping[str, float] = field(repr=False)
    thresholds: NDArray[np.float64] = field(repr=False)
    typical: NDArray[np.float64] = field(repr=False)
    joints: int = 0
    over: float = USUAL_OVER
    held: float = HELD
    by_likelihood: bool = False
    _listed: tuple[float, ...] = field(init=False, repr=False)
    _constant: float = field(init=False, repr=False)
    _lead: float = field(init=False, repr=False)

    def __post_init__(self) -> None:
        count = len(self.typical)
        object.__setattr__(self, "_listed", tuple(self.weights.tolist()))
        object.__setattr__(self, "_constant", self.offset - float(self.weights[:count] @ self.typical))
        object.__setattr__(self, "_lead", float(self.typical[count // 2 :].mean()))

    def logit(self, evidence: Evidence, class_name: str) -> float:
        """Give the log odds that a guess is right, up to a constant that the threshold contains."""
        numbers = (*evidence.distances, *evidence.leads, evidence.noisiness)
        weighed: float = sum(map(mul, self._listed, numbers)) + self._constant
        slope = self.slopes.get(class_name, 0.0)
        return weighed + self.biases.get(class_name, 0.0) + slope * (evidence.lead - self._lead)

    def kept(self, *, few: bool = False) -> Learned:
        """Give the numbers in the form of a library's file, perhaps as those for bodies of few joints."""
        numbers = {
            "weights": self.weights,
            "offset": np.array([self.offset]),
            "thresholds": self.thresholds,
            "typical": self.typical,
            "joints": np.array([self.joints]),
            "over": np.array([self.over]),
        }
        by_class = {_BIAS + name: bias for name, bias in self.biases.items()}
        by_class |= {_SLOPE + name: slope for name, slope in self.slopes.items()}
        numbers |= {name: np.array([number]) for name, number in by_class.items()}
        begin = _FEW if few else ""
        return {begin + name: array.astype(np.float32) for name, array in numbers.items()}

    @classmethod
    def of_kept(cls, learned: Learned, groups: int, *, few: bool = False) -> Self:
        """Make it from the numbers of a library's file, for a comparison of so many groups of parts.

        With `few` from the numbers for bodies of few joints (`most_of_few`).

        Raises
        ------
        ValueError
            A number is missing or not finite, there are more or fewer than expected, or `over` is not positive.
        """
        begin = _FEW if few else ""
        named = {name.removeprefix(begin): each for name, each in learned.items() if name.startswith(begin)}
        # Older files do not say over how many seconds.
        named.setdefault("over", np.array([USUAL_OVER], dtype=np.float32))
        shapes = {"weights": 2 * groups + 1, "thresholds": len(RATES), "typical": 2 * groups}
        shapes |= {name: 1 for name in named if name.startswith((_BIAS, _SLOPE))}
        shapes |= dict.fromkeys(("offset", "joints", "over"), 1)
        for name, count in shapes.items():
            if name not in named or named[name].shape != (count,) or not np.isfinite(named[name]).all():
                raise ValueError(f"{name}: expected {count} finite numbers, got {named.get(name)}")
        numbers = {name: named[name].astype(np.float64) for name in shapes}
        if numbers["over"][0] <= 0:
            raise ValueError(f"over: expected seconds above 0, got {numbers['over'][0]:g}")
        return cls(
            weights=numbers["weights"],
            offset=float(numbers["offset"][0]),
            biases=_of_classes(_BIAS, numbers),
            slopes=_of_classes(_SLOPE, numbers),
            thresholds=numbers["thresholds"],
            typical=numbers["typical"],
            joints=int(numbers["joints"][0]),
            over=float(numbers["over"][0]),
        )

    def threshold_at(self, rate: float) -> float:
        """Give the logit above which a motion is known, when this share of unknown time may be named."""
        rate = min(max(rate, RATES[0]), RATES[-1])
        return float(np.interp(np.log(rate), np.log(RATES), self.thresholds))


def _of_classes(prefix: str, numbers: Mapping[str, NDArray[np.float64]]) -> dict[str, float]:
    return {name.removeprefix(prefix): float(each[0]) for name, each in numbers.items() if name.startswith(prefix)}


def most_of_few(learned: Learned) -> int:
    """Give the number of joints up to which a library's file has numbers for few joints; 0 if it has none."""
    joints = learned.get(f"{_FEW}joints")
    return int(joints[0]) if joints is not None and joints.shape == (1,) else 0


def by_likelihood(classes: int) -> Rejection:
    """Give numbers for a library of so many classes of one person, or with too few motions to learn from.

    The thresholds are where these shares of everyday movement were named: `_EVERYDAY`.
    """
    # Of many classes some is like any movement by chance. The only class leads as a clear guess does.
    offset = -math.log(classes) if classes > 1 else MAX_LEAD
    weights, thresholds = np.array([-1.0, 1.0, 0.0]), np.array(_EVERYDAY)
    return Rejection(weights, offset, {}, {}, thresholds, np.zeros(2), held=HELD_ONE, by_likelihood=True)


def rejection_of(index: "WindowIndex") -> Rejection:
    """Give a library's rejection: as strangers' motions taught it, else as its own do."""
    library, weighing = index.library, index.comparison.weighing
    if weighing.as_in_paper:
        return by_likelihood(len(index.classes))
    # Strangers' motions taught numbers for all groups: without some parts the library's own motions teach.
    if not library.judged_by_strangers or weighing != usual_weighing(library):
        return learned_rejection(index)
    joints = len(library.skeleton.joints)
    few = joints <= most_of_few(library.learned)
    rejection = Rejection.of_kept(library.learned, len(weighing.groups), few=few)
    return replace(rejection, typical=typical_evidence(index)) if few or joints < rejection.joints else rejection


def learned_rejection(index: "WindowIndex") -> Rejection:
    """Learn from a library's own motions how near known motions are, and unknown motions.

    Of one person's motions nothing is learned: three gestures, three times each, say little of all other movement.
    """
    groups = len(index.comparison.weighing.groups)
    if len(index.library.actors) < 2:
        return by_likelihood(len(index.classes))
    known, unknown, classes = _asked(index)
    if len(known) < _MIN_WINDOWS or len(unknown) < _MIN_WINDOWS:
        return by_likelihood(len(index.classes))
    scatter = (np.cov(known.T) + np.cov(unknown.T)) / 2 + _RIDGE * np.eye(2 * groups)
    slope = np.linalg.solve(scatter, known.mean(axis=0) - unknown.mean(axis=0))
    # With few classes left an unknown motion has a wide lead: a clear guess must not count against itself.
    slope[groups:] = np.maximum(slope[groups:], 0.0)
    typical = np.median(known, axis=0)
    thresholds = _thresholds((unknown - typical) @ slope, classes)
    return Rejection(np.append(slope, 0.0), 0.0, {}, {}, thresholds, typical)


def _thresholds(logits: NDArray[np.float64], classes: NDArray[np.intp]) -> NDArray[np.float64]:
    """Find for each of `RATES` the logit above which this share of unknown windows lies; classes count alike."""
    counts = np.bincount(classes)[classes]
    order = np.argsort(-logits)
    shares = np.cumsum(1 / counts[order])
    return np.interp(RATES, shares / shares[-1], logits[order])


def typical_evidence(index: "WindowIndex") -> NDArray[np.float64]:
    """Give the typical distances and leads of a library's own motions, shape (2 groups,)."""
    known, _, _ = _asked(index)
    return np.median(known, axis=0) if len(known) else np.zeros(known.shape[1])


def _asked(index: "WindowIndex") -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.intp]]:
    """Let windows ask the rest of the library, and then the rest without their class.

    Returns
    -------
    Distances and leads of the windows named rightly, (known, 2 groups), and of the windows without their class,
    (unknown, 2 groups); and the classes of the latter.
    """
    motions = index.library.motions
    names = np.array([motions[each].class_name for each in index.motions])
    people = np.array([motions[each].actor for each in index.motions])
    classes = np.searchsorted(index.classes, names)
    several = len(set(people.tolist())) > 1
    weighing = index.comparison.weighing
    known: list[tuple[float, ...]] = []
    unknown: list[tuple[float, ...]] = []
    asked: list[int] = []
    for asking in range(0, len(index), -(-len(index) // _ASKING)):
        own = people == people[asking] if several else index.motions == index.motions[asking]
        logs = index.asked_by(asking, own)
        performed = int(classes[asking])
        nearest, alone = named_and_alone(logs, weighing)
        if np.isfinite(nearest[performed]) and int(nearest.argmin()) == performed:
            known.append(Evidence.of(alone, performed).compared)
        logs[:, performed] = np.inf
        nearest, alone = named_and_alone(logs, weighing)
        if np.isfinite(nearest).any():
            unknown.append(Evidence.of(alone, int(nearest.argmin())).compared)
            asked.append(performed)
    shape = (-1, 2 * len(weighing.groups))
    return np.array(known).reshape(shape), np.array(unknown).reshape(shape), np.array(asked, dtype=np.intp)
