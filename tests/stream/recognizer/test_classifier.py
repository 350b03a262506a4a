"""Whole clips classified by scikit-learn's conventions."""

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest
from naive_windows import nearest
from synthetic import STICK, STICK_CLASSES, stick_clip

from kinespace.library import MotionLibrary, SkeletonMismatchError, distance_rows, opened
from kinespace.library.windows.comparison import NEAREST
from kinespace.library.windows.cutting import window_ends
from kinespace.stream import MotionClassifier
from kinespace.stream.recognizer.window import Window

pytestmark = pytest.mark.slow

CLASSES = tuple(sorted(STICK_CLASSES)[:3])
CLIPS = [
    replace(stick_clip(name, seed=seed, frames=120, rate=60.0), actor=f"actor {seed % 3}")
    for name in CLASSES
    for seed in range(6)
]
NAMES = [each.class_name for each in CLIPS]


@pytest.mark.parametrize("timing", [0.0, 0.5])
def test_clips_are_named_by_the_mean_score_of_their_windows(timing: float) -> None:
    """Scores are by the live windows' distances, a window of another time being farther, the first counting less."""
    classifier = MotionClassifier(timing=timing)
    assert classifier.fit(CLIPS[::2], NAMES[::2]) is classifier
    assert classifier.classes_.tolist() == list(CLASSES)
    asked, index = CLIPS[1], opened(classifier.library_)
    windows, logs, before = Window(index), [], 0
    whose = [(index.library.motions[each].class_name, index.library.motions[each].actor) for each in index.motions]
    ends = window_ends(asked, 0.1)
    for end in ends.tolist():
        some = slice(before, end)
        windows.push(asked.times[some], distance_rows(asked.positions[some], asked.skeleton))
        signature, before = windows.read(), end
        if timing:
            own = index.comparison.joined(signature.parts, index.comparison.placed(signature.parts))
            apart = zip(own, index.vectors, strict=True)
            squared = [np.square(mine - theirs.astype(float)).sum(axis=1) + NEAREST for mine, theirs in apart]
            late = timing * np.abs(np.log((end / 60 + 0.3) / (index.seconds_into + 0.3)))
            logs.append(list(nearest(np.log(squared).mean(axis=0) + late, *zip(*whose, strict=True)).values()))
        else:
            logs.append(index.distances([signature])[0].named)
    scores = classifier.decision_function(CLIPS[1::2])
    weights = [min(end / 60, 0.6) ** 2 for end in ends.tolist()]
    np.testing.assert_allclose(scores[0], np.average(1 / (1 + np.exp(logs)), axis=0, weights=weights), rtol=2e-3)
    named = [CLASSES[max(range(3), key=row.__getitem__)] for row in scores.tolist()]
    assert classifier.predict(CLIPS[1::2]).tolist() == named
    assert classifier.predict(CLIPS[:6:2]).tolist() == [CLASSES[0]] * 3
    assert classifier.score(CLIPS[1::2], named) == 1.0
    assert classifier.score(CLIPS[1::2], ["another"] * len(named)) == 0.0


def test_labels_come_back_as_they_came_with_probabilities() -> None:
    """Whole numbers stay numbers, sorted as numbers; probabilities add up to 1, the largest at the named class."""
    numbers = [(2, 10, 1)[CLASSES.index(name)] for name in NAMES]
    classifier = MotionClassifier().fit(CLIPS, numbers)
    assert (classifier.classes_.tolist(), classifier.classes_.dtype.kind) == ([1, 2, 10], "i")
    assert classifier.predict(CLIPS).tolist() == numbers
    assert classifier.score(CLIPS, numbers) == 1.0
    shares = classifier.predict_proba(CLIPS[:4])
    np.testing.assert_allclose(shares.sum(axis=1), 1.0)
    assert classifier.classes_[shares.argmax(axis=1)].tolist() == numbers[:4]
    again = pickle.loads(pickle.dumps(copy.deepcopy(classifier)))  # noqa: S301 - our own
    np.testing.assert_array_equal(again.predict_proba(CLIPS[:4]), shares)
    assert repr(classifier) == "MotionClassifier(skeleton=None, frame_rate=120.0, hop=0.1, timing=0.5)"


def test_arrays_are_clips_of_the_skeleton_given() -> None:
    """Positions alone are named as a clip is; without a skeleton they are of HDM05's joints."""
    arrays = [each.positions for each in CLIPS]
    by_arrays, by_clips = MotionClassifier(STICK, 60.0).fit(arrays, NAMES), MotionClassifier().fit(CLIPS, NAMES)
    assert by_arrays.predict(arrays).tolist() == by_clips.predict(CLIPS).tolist()
    with pytest.raises(ValueError, match=r"positions: expected \(frames, 31, 3\)"):
        MotionClassifier().fit(arrays, NAMES)


def test_more_clips_are_learned() -> None:
    """By parts the same is learned as at once; `fit` forgets what was before."""
    parts, whole = MotionClassifier(), MotionClassifier().fit(CLIPS, NAMES)
    for begin in range(0, len(CLIPS), 6):
        parts.partial_fit(CLIPS[begin : begin + 6], NAMES[begin : begin + 6], classes=CLASSES)
    np.testing.assert_array_equal(parts.decision_function(CLIPS[:4]), whole.decision_function(CLIPS[:4]))
    assert parts.fit(CLIPS[:6], NAMES[:6]).classes_.tolist() == [CLASSES[0]]


def test_mistakes_are_said() -> None:
    """Too few classes, nothing learned, a clip without a window, other joints, an unknown parameter."""
    classifier = MotionClassifier(STICK, 60.0)
    with pytest.raises(ValueError, match="y: expected a class for each of 18 clips, got 1"):
        classifier.fit(CLIPS, ["bow"])
    with pytest.raises(ValueError, match="fit: expected to be called before"):
        classifier.predict(CLIPS)
    classifier.fit(CLIPS, NAMES)
    with pytest.raises(ValueError, match=r"expected some tenths of a second, got 0\.03 s"):
        classifier.predict([CLIPS[0].positions[:2]])
    with pytest.raises(SkeletonMismatchError):
        classifier.predict([CLIPS[0].restricted_to(STICK.joints[:4])])
    with pytest.raises(ValueError, match="speed: expected one of skeleton, frame_rate, hop, timing, got 2"):
        classifier.set_params(speed=2)


@pytest.mark.parametrize(("key", "n"), [("hop", 0), ("hop", -1), ("frame_rate", "x"), ("timing", -5), ("timing", None)])
def test_parameters_that_mean_nothing_are_refused(builtin: MotionLibrary, key: str, n: object) -> None:
    """As scikit-learn has it, when something is learned: the error names the parameter, and what was expected."""
    motions = builtin.motions[:2]
    with pytest.raises(ValueError, match=f"{key}: expected a number from "):
        MotionClassifier().set_params(**{key: n}).fit(motions, ["a", "b"])
    with pytest.raises(ValueError, match="X: expected a list of clips"):
        MotionClassifier().fit(motions[0], ["a"])
    assert MotionClassifier(frame_rate=np.int64(60), hop=np.float32(0.1)).fit(motions, ["a", "b"]).library_


def test_scikit_learn_takes_it() -> None:
    """Its own checks pass, a clone has the same parameters, and it divides clips by person."""
    base, checks = pytest.importorskip("sklearn.base"), pytest.importorskip("sklearn.utils.estimator_checks")
    selection = pytest.importorskip("sklearn.model_selection")
    classifier = MotionClassifier(STICK, 60.0)
    # Most of its checks give rows of a table, which are no clips; it says so.
    with pytest.warns(UserWarning, match="Can't test estimator MotionClassifier which requires input"):
        checks.check_estimator(classifier)
    assert base.is_classifier(classifier)
    cloned = base.clone(classifier).set_params(frame_rate=30.0).get_params()
    assert cloned == {"skeleton": STICK, "frame_rate": 30.0, "hop": 0.1, "timing": 0.5}
    people = [each.actor for each in CLIPS]
    scores = selection.cross_val_score(classifier, CLIPS, NAMES, groups=people, cv=selection.LeaveOneGroupOut())
    assert len(scores) == 3
    assert scores.mean() > 0.9
