"""Whole clips classified by scikit-learn's conventions."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import STICK, STICK_CLASSES, stick_clip

from kinespace.library import MotionLibrary, SkeletonMismatchError
from kinespace.stream import MotionClassifier, recognise

CLASSES = tuple(sorted(STICK_CLASSES)[:3])
CLIPS = [
    replace(stick_clip(name, seed=seed, frames=120, rate=60.0), actor=f"actor {seed % 3}")
    for name in CLASSES
    for seed in range(6)
]
NAMES = [each.class_name for each in CLIPS]


@pytest.mark.slow
def test_clips_are_named_by_the_mean_score_of_their_windows() -> None:
    """The scores are those of the answers, as they would be live; a clip in the library is named rightly."""
    classifier = MotionClassifier()
    assert classifier.fit(CLIPS[::2], NAMES[::2]) is classifier
    assert classifier.classes_.tolist() == list(CLASSES)
    asked = CLIPS[1::2]
    scores = classifier.decision_function(asked)
    library = MotionLibrary.of_clips(CLIPS[::2])
    for clip, row in zip(asked, scores, strict=True):
        answers = recognise(library, clip)
        assert row.tolist() == pytest.approx(sum(each.scores for each in answers) / len(answers))
    named = [CLASSES[max(range(3), key=row.__getitem__)] for row in scores.tolist()]
    assert classifier.predict(asked).tolist() == named
    assert classifier.predict(CLIPS[:6:2]).tolist() == [CLASSES[0]] * 3
    assert classifier.score(asked, named) == 1.0
    assert classifier.score(asked, ["another"] * len(asked)) == 0.0


@pytest.mark.slow
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
    with pytest.raises(ValueError, match="speed: expected skeleton or frame_rate, got 2"):
        classifier.set_params(speed=2)


@pytest.mark.slow
def test_scikit_learn_takes_it() -> None:
    """Its own checks pass, a clone has the same parameters, and it divides clips by person."""
    base, checks = pytest.importorskip("sklearn.base"), pytest.importorskip("sklearn.utils.estimator_checks")
    selection = pytest.importorskip("sklearn.model_selection")
    classifier = MotionClassifier(STICK, 60.0)
    # Most of its checks give rows of a table, which are no clips; it says so.
    with pytest.warns(UserWarning, match="Can't test estimator MotionClassifier which requires input"):
        checks.check_estimator(classifier)
    assert base.is_classifier(classifier)
    assert base.clone(classifier).set_params(frame_rate=30.0).get_params() == {"skeleton": STICK, "frame_rate": 30.0}
    people = [each.actor for each in CLIPS]
    scores = selection.cross_val_score(classifier, CLIPS, NAMES, groups=people, cv=selection.LeaveOneGroupOut())
    assert len(scores) == 3
    assert scores.mean() > 0.9
