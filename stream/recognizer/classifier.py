"""Whole clips classified by scikit-learn's conventions, by the windows that the live recogniser compares."""

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from numbers import Real
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinespace.library import NOTHING, Clip, MotionLibrary, Skeleton, WindowIndex, distance_rows, opened
from kinespace.library.naming import hdm05
from kinespace.library.signature.parts import Signature
from kinespace.library.windows.comparer import named_and_alone
from kinespace.library.windows.cutting import window_ends
from kinespace.library.windows.taught import teacher_of
from kinespace.stream.frame import MAX_PERFORMER_LENGTH, Frame
from kinespace.stream.recognition import Recognition
from kinespace.stream.recognizer.recognizer import Recognizer
from kinespace.stream.recognizer.settings import Settings
from kinespace.stream.recognizer.window import Window

#: Seconds added to the times of two windows before they are compared: a motion's first moments are alike.
_BEGINNING = 0.3
#: Seconds after the beginning up to which windows count less: they show little of the motion yet.
_LITTLE = 0.6
#: Power of a score that makes it a probability, between what two cameras' takes want.
_SURE = 8.0


class MotionClassifier:
    """Learns classes from clips and names other clips, by scikit-learn's conventions; it does not need scikit-learn.

    A clip may be an array of positions, shape (frames, joints, 3), metres. A `Clip` may say its actor, too: clips of
    three persons or more who share classes teach what differs between persons. Else the built-in library's persons
    teach it where they have all joints: with arrays of HDM05, among them perhaps those who are asked about later. Give
    `groups` then; `taught_by_` says who taught.

    A clip is one motion from its beginning, or its first part: a window is compared with the library's windows, and
    those that come as long after their motion's beginning count as nearer.

    Parameters
    ----------
    skeleton
        The joints of arrays; HDM05's when not given.
    frame_rate
        Frames per second of arrays.
    hop
        Seconds between two windows of a clip that is named.
    timing
        How much the time since the beginning counts; 0 for nothing.

    Attributes
    ----------
    classes_
        The classes, sorted, shape (classes,); after `fit`.
    library_
        The motions that were learned.
    taught_by_
        The persons from whom the metrics were learned.
    """

    def __init__(
        self, skeleton: Skeleton | None = None, frame_rate: float = 120.0, hop: float = 0.1, timing: float = 0.5
    ) -> None:
        self.skeleton = skeleton
        self.frame_rate = frame_rate
        self.hop = hop
        self.timing = timing

    def __repr__(self) -> str:
        """Say the parameters."""
        return f"MotionClassifier({', '.join(f'{name}={value!r}' for name, value in self.get_params().items())})"

    def fit(self, X: Iterable[Clip | ArrayLike], y: Iterable[Any], groups: Iterable[Any] | None = None) -> Self:  # noqa: N803 - scikit-learn's name
        """Learn clips and their classes, and forget others; `groups` are the persons, in place of the clips' actors.

        Raises
        ------
        ValueError
            There is no clip, `y` or `groups` is of another length, or a clip cannot be learned
            (`MotionLibrary.of_clips`).
        SkeletonMismatchError
            The clips have different joints.
        """
        clips, names = self._clips(X), np.asarray([*y])
        people = [each.actor for each in clips] if groups is None else [str(each) for each in groups]
        for name, what, given in (("y", "class", names), ("groups", "person", people)):
            if len(given) != len(clips):
                raise ValueError(f"{name}: expected a {what} for each of {len(clips)} clips, got {len(given)}")
        named = (
            Clip(each.skeleton, each.positions, each.frame_rate, each.name, str(name), person, gaps=each.gaps)
            for each, name, person in zip(clips, names.tolist(), people, strict=True)
        )
        return self._learned(MotionLibrary.of_clips(named), names)

    def partial_fit(self, X: Iterable[Clip | ArrayLike], y: Iterable[Any], classes: object = None) -> Self:  # noqa: ARG002, N803
        """Learn more clips; `classes` is not needed. Raises what `fit` raises."""
        more = type(self)(**self.get_params()).fit(X, y)
        if not hasattr(self, "library_"):
            return self._learned(more.library_, more.classes_)
        names = np.concatenate([self.classes_, more.classes_])
        return self._learned(self.library_.merged_with(more.library_), names)

    def _learned(self, library: MotionLibrary, names: NDArray[Any]) -> Self:
        self.library_, self.taught_by_ = library, teacher_of(library).actors
        self.classes_ = np.unique(names[[str(each) != NOTHING for each in names.tolist()]])
        return self

    def predict(self, X: Iterable[Clip | ArrayLike]) -> NDArray[Any]:  # noqa: N803
        """Name each clip: the class that scores highest over its windows, as `fit` was given it; shape (clips,).

        Raises
        ------
        ValueError
            Nothing was learned before, there is something else than clips, or a clip is too short for a window.
        SkeletonMismatchError
            A clip shares fewer than five joints with those learned.
        """
        nearest = self.decision_function(X).argmax(axis=1)
        named: NDArray[Any] = self.classes_[nearest]
        return named

    def predict_proba(self, X: Iterable[Clip | ArrayLike]) -> NDArray[np.float64]:  # noqa: N803
        """Give the probability of each class, which add up to 1, (clips, classes); raises as `predict`."""
        powers = self.decision_function(X) ** _SURE
        shares: NDArray[np.float64] = powers / powers.sum(axis=1, keepdims=True)
        return shares

    def decision_function(self, X: Iterable[Clip | ArrayLike]) -> NDArray[np.float64]:  # noqa: N803
        """Give the mean score of each class over a clip's windows, 0 to 1, (clips, classes); raises as `predict`."""
        if not hasattr(self, "library_"):
            raise ValueError("fit: expected to be called before, got no clip yet")
        means = [self._mean_scores(each) for each in self._clips(X)]
        return np.array(means, dtype=np.float64).reshape(-1, len(self.classes_))

    def _mean_scores(self, clip: Clip) -> NDArray[np.float64]:
        index = opened(self.library_.restricted_to(clip.skeleton.joints))
        ends = window_ends(clip, self.hop)
        if not len(ends):
            raise ValueError(f"clip {clip.name!r}: expected some tenths of a second, got {clip.duration:.2f} s")
        found = _log_distances(index, clip.over(index.library.skeleton), ends, self.timing)
        means = np.zeros(len(index.classes) + 1)
        weights = np.minimum(ends / clip.frame_rate, _LITTLE) ** 2
        means[:-1] = np.average(1 / (1 + np.exp(found)), axis=0, weights=weights)
        # A class without a window long enough has no score.
        places = {name: place for place, name in enumerate(index.classes)}
        return means[[places.get(str(each), -1) for each in self.classes_.tolist()]]

    def score(self, X: Iterable[Clip | ArrayLike], y: Sequence[Any]) -> float:  # noqa: N803
        """Give the share of clips that are named as in `y`."""
        return float(np.mean(self.predict(X) == np.asarray(y)))

    def get_params(self, *, deep: bool = True) -> dict[str, Any]:  # noqa: ARG002 - scikit-learn's name
        """Give the parameters by name."""
        return {name: getattr(self, name) for name in ("skeleton", "frame_rate", "hop", "timing")}

    def set_params(self, **parameters: object) -> Self:
        """Change parameters; ValueError for an unknown one."""
        for name, value in parameters.items():
            if name not in self.get_params():
                raise ValueError(f"{name}: expected one of {', '.join(self.get_params())}, got {value!r}")
            setattr(self, name, value)
        return self

    def __sklearn_tags__(self) -> object:
        """Say what scikit-learn asks of an estimator: it classifies clips, which are no rows of a table."""
        from sklearn.utils import ClassifierTags, InputTags, Tags, TargetTags  # noqa: PLC0415 - only it asks

        rows = InputTags(two_d_array=False, three_d_array=True)
        return Tags("classifier", TargetTags(required=True), classifier_tags=ClassifierTags(), input_tags=rows)

    def _clips(self, given: Iterable[Clip | ArrayLike]) -> list[Clip]:
        for name, least in (("frame_rate", 0.001), ("hop", 0.001), ("timing", 0.0)):
            value = getattr(self, name)
            if not isinstance(value, Real) or not least <= float(value) < math.inf:
                raise ValueError(f"{name}: expected a number from {least:g} on, got {value!r}")
        if isinstance(given, Clip):
            raise ValueError("X: expected a list of clips, got one Clip")  # noqa: TRY004 - as scikit-learn has it
        skeleton = self.skeleton or hdm05.SKELETON
        return [each if isinstance(each, Clip) else Clip(skeleton, np.asarray(each), self.frame_rate) for each in given]


def _log_distances(index: WindowIndex, clip: Clip, ends: NDArray[np.intp], timing: float) -> NDArray[np.float64]:
    """Give the log distance of each class from each of a clip's windows, shape (windows, classes).

    As the recogniser has it, but that windows at other times since the beginning are farther: by `timing` times the
    logarithm of how many times as long after it.
    """
    comparison, comparer, window = index.comparison, index.comparer, Window(index)
    times, rows = clip.times.tolist(), distance_rows(clip.positions, clip.skeleton)
    seen = list[Signature]()
    for begin, end in pairwise([0, *ends.tolist()]):
        window.push(times[begin:end], rows[begin:end])
        seen.append(window.shown())
    numbers = {part: np.array([each.parts[part] for each in seen]) for part in comparison.weighing.parts}
    placed = comparison.placed(numbers)
    since = ends[:, None] / clip.frame_rate + _BEGINNING
    late = timing * np.abs(np.log(since / (index.seconds_into + _BEGINNING)))
    found = named_and_alone(comparer.logs(comparison.joined(numbers, placed), late), comparison.weighing)[0]
    return found + comparer.head.added(placed.values()) if comparer.head else found


def recognise(library: MotionLibrary, clip: Clip, settings: Settings | None = None) -> list[Recognition]:
    """Recognise a clip, as it would be live.

    Parameters
    ----------
    library
        The motions to compare with, over the joints that the clip has: five of them at least.
    clip
        A recording of one performer, with our names for its joints, as `read_recordings` gives it.
    settings
        Of the recogniser.

    Returns
    -------
    The answers, by time: thirty a second unless `settings.hop` says otherwise. Times are seconds from the clip's start.

    Raises
    ------
    ValueError
        It is no clip.
    SkeletonMismatchError
        Library and clip share fewer than five joints.
    """
    if not isinstance(clip, Clip):
        raise ValueError(f"clip: expected a Clip, got {type(clip).__name__}")  # noqa: TRY004 - as all our caller's mistakes
    shared = library.restricted_to(clip.skeleton.joints)
    recognizer, over = Recognizer(shared, settings), clip.over(shared.skeleton)
    name = (clip.actor or clip.name or "performer")[:MAX_PERFORMER_LENGTH]
    frames = (Frame(name, time, each) for time, each in zip(over.times.tolist(), over.positions, strict=True))
    return [answer for frame in frames if (answer := recognizer.push(frame))]
