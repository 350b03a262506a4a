"""Whole clips classified by scikit-learn's conventions, by the recogniser that runs live."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinespace.library.clip import Clip
from kinespace.library.motion_library import NOTHING, MotionLibrary
from kinespace.library.naming import hdm05
from kinespace.library.skeleton import Skeleton
from kinespace.stream.recognizer.whole import recognise


class MotionClassifier:
    """Learns classes from clips and names other clips, by scikit-learn's conventions; it does not need scikit-learn.

    A clip may be an array of positions, shape (frames, joints, 3), metres. A `Clip` may say its actor, too: clips of
    several actors teach what differs between persons.

    Parameters
    ----------
    skeleton
        The joints of arrays; HDM05's when not given.
    frame_rate
        Frames per second of arrays.

    Attributes
    ----------
    classes_
        The classes, sorted, shape (classes,); after `fit`.
    library_
        The motions that were learned.
    """

    def __init__(self, skeleton: Skeleton | None = None, frame_rate: float = 120.0) -> None:
        self.skeleton = skeleton
        self.frame_rate = frame_rate

    def fit(self, X: Iterable[Clip | ArrayLike], y: Iterable[str]) -> Self:  # noqa: N803 - scikit-learn's name
        """Learn clips and their classes, and forget others.

        Raises
        ------
        ValueError
            There is no clip, `y` is of another length, or a clip cannot be learned (`MotionLibrary.of_clips`).
        SkeletonMismatchError
            The clips have different joints.
        """
        clips, names = self._clips(X), [str(each) for each in y]
        if len(clips) != len(names):
            raise ValueError(f"y: expected a class for each of {len(clips)} clips, got {len(names)}")
        named = (
            Clip(each.skeleton, each.positions, each.frame_rate, each.name, name, each.actor, gaps=each.gaps)
            for each, name in zip(clips, names, strict=True)
        )
        return self._learned(MotionLibrary.of_clips(named))

    def partial_fit(self, X: Iterable[Clip | ArrayLike], y: Iterable[str], classes: object = None) -> Self:  # noqa: ARG002, N803
        """Learn more clips; `classes` is not needed. Raises what `fit` raises."""
        before = getattr(self, "library_", None)
        more = type(self)(**self.get_params()).fit(X, y).library_
        return self._learned(before.merged_with(more) if before else more)

    def _learned(self, library: MotionLibrary) -> Self:
        self.library_ = library
        self.classes_ = np.array([name for name in library.classes if name != NOTHING])
        return self

    def predict(self, X: Iterable[Clip | ArrayLike]) -> NDArray[np.str_]:  # noqa: N803
        """Name each clip: the class that scores highest over its windows; shape (clips,).

        Raises
        ------
        ValueError
            Nothing was learned before, there is something else than clips, or a clip is too short for a window.
        SkeletonMismatchError
            A clip shares fewer than five joints with those learned.
        """
        nearest = self.decision_function(X).argmax(axis=1)
        named: NDArray[np.str_] = self.classes_[nearest]
        return named

    def decision_function(self, X: Iterable[Clip | ArrayLike]) -> NDArray[np.float64]:  # noqa: N803
        """Give the mean score of each class over a clip's windows, 0 to 1, (clips, classes); raises as `predict`."""
        if not hasattr(self, "library_"):
            raise ValueError("fit: expected to be called before, got no clip yet")
        means = [self._mean_scores(each) for each in self._clips(X)]
        return np.array(means, dtype=np.float64).reshape(-1, len(self.classes_))

    def _mean_scores(self, clip: Clip) -> NDArray[np.float64]:
        answers = recognise(self.library_, clip)
        if not answers:
            raise ValueError(f"clip {clip.name!r}: expected some tenths of a second, got {clip.duration:.2f} s")
        means: NDArray[np.float64] = np.mean([each.scores for each in answers], axis=0)
        return means

    def score(self, X: Iterable[Clip | ArrayLike], y: Sequence[str]) -> float:  # noqa: N803
        """Give the share of clips that are named as in `y`."""
        return float(np.mean(self.predict(X) == np.asarray(y)))

    def get_params(self, *, deep: bool = True) -> dict[str, Any]:  # noqa: ARG002 - scikit-learn's name
        """Give the parameters by name."""
        return {"skeleton": self.skeleton, "frame_rate": self.frame_rate}

    def set_params(self, **parameters: object) -> Self:
        """Change parameters; ValueError for an unknown one."""
        for name, value in parameters.items():
            if name not in self.get_params():
                raise ValueError(f"{name}: expected skeleton or frame_rate, got {value!r}")
            setattr(self, name, value)
        return self

    def __sklearn_tags__(self) -> object:
        """Say what scikit-learn asks of an estimator: it classifies clips, which are no rows of a table."""
        from sklearn.utils import ClassifierTags, InputTags, Tags, TargetTags  # noqa: PLC0415 - only it asks

        rows = InputTags(two_d_array=False, three_d_array=True)
        return Tags("classifier", TargetTags(required=True), classifier_tags=ClassifierTags(), input_tags=rows)

    def _clips(self, given: Iterable[Clip | ArrayLike]) -> list[Clip]:
        skeleton = self.skeleton or hdm05.SKELETON
        return [each if isinstance(each, Clip) else Clip(skeleton, np.asarray(each), self.frame_rate) for each in given]
