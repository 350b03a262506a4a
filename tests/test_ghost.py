"""Ghosts: stored motions made visible again, and recognised as what they are."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic import STICK_CLASSES, stick_clips

from library import Clip, Moments, MotionLibrary, distance_rows, signature_of
from library.skeleton import Skeleton
from stream import Frame, Outcome, Recognizer
from tools.ghost import ghost, representative, swinging_rows

CLASSES = MotionLibrary.builtin().classes


@pytest.mark.parametrize("class_name", CLASSES)
def test_no_ghost_flips(class_name: str) -> None:
    """No joint of any class's ghost moves more than 15 cm within a frame at 120 Hz; a flipped body would by metres."""
    library = MotionLibrary.builtin()
    positions = ghost(library, class_name, seconds=2.5, frame_rate=120.0, rate=0.9)
    assert np.linalg.norm(np.diff(positions, axis=0), axis=-1).max() < 0.15


def test_the_representative_is_its_classs_medoid() -> None:
    """The motion chosen for a class is of it, and no other of the class is more like all of the class."""
    library = MotionLibrary.of_clips(stick_clips())
    for class_name in library.classes:
        chosen = representative(library, class_name)
        assert library.motions[chosen].class_name == class_name
        own = [index for index, motion in enumerate(library.motions) if motion.class_name == class_name]
        likeness = {
            index: sum(abs(float(np.vdot(library.axes[index], library.axes[other]))) for other in own) for index in own
        }
        assert likeness[chosen] >= max(likeness.values()) - 1e-6


def test_an_unknown_class_has_no_ghost() -> None:
    """Asking for a class that is not in the library names those that are."""
    with pytest.raises(ValueError, match=r"class_name: expected one of bow, jump, wave, got 'fly'"):
        ghost(MotionLibrary.of_clips(stick_clips()), "fly", seconds=1.0, frame_rate=120.0, rate=1.0)


@pytest.mark.parametrize("class_name", CLASSES)
def test_swinging_rows_have_the_stored_signature(class_name: str) -> None:
    """Over whole swings the rows have the stored mean, the stored axis and the variance that was along it."""
    library = MotionLibrary.builtin()
    motion = representative(library, class_name)
    rows = swinging_rows(library, motion, np.arange(2400) / 1200)
    signature = signature_of(Moments.of_rows(rows))
    np.testing.assert_allclose(signature.mean, library.means[motion], atol=5e-3)
    assert abs(float(np.vdot(signature.axis.vector, library.axes[motion]))) > 0.9999
    assert signature.axis.value == pytest.approx(library.motions[motion].eigenvalue, rel=0.01)


def test_distances_never_swing_below_zero() -> None:
    """A distance whose swing would go through zero stays there meanwhile; up to then it swings as far as it should."""
    skeleton = Skeleton(("a", "b", "c"))
    positions = np.zeros((20, 3, 3))
    positions[:, 1, 0] = [0.05] * 18 + [1.0] * 2
    positions[:, 2, 1] = 2.0
    library = MotionLibrary.of_clips([Clip(skeleton, positions, 120.0, "snap", "snap")])
    rows = swinging_rows(library, 0, np.arange(400) / 400)
    amplitude = np.sqrt(2 * library.motions[0].eigenvalue)
    assert amplitude > library.means[0][0]
    assert rows.min() == 0.0
    assert rows[:, 0].max() == pytest.approx(library.means[0][0] + amplitude, rel=0.05)


@pytest.mark.parametrize(("seconds", "frame_rate", "frames"), [(1.0, 120.0, 120), (0.5, 30.0, 15), (2.0, 59.94, 120)])
def test_a_ghost_lasts_its_seconds(seconds: float, frame_rate: float, frames: int) -> None:
    """A ghost has as many frames as its seconds and rate say, each of all joints, all finite."""
    library = MotionLibrary.builtin()
    positions = ghost(library, "grabHighR", seconds=seconds, frame_rate=frame_rate, rate=1.0)
    assert positions.shape == (frames, 31, 3)
    assert np.isfinite(positions).all()


def test_without_portraits_a_ghost_swings_along_its_classs_axis() -> None:
    """Of a library that keeps no portraits the ghost is the representative's, swinging so many cycles a second."""
    library = MotionLibrary.of_clips(stick_clips())
    assert library.portraits == ()
    for class_name in STICK_CLASSES:
        positions = ghost(library, class_name, seconds=2.0, frame_rate=60.0, rate=1.5)
        swinging = swinging_rows(library, representative(library, class_name), np.arange(120) / 40)
        # Six points in space have most of any distances between them, not all.
        np.testing.assert_allclose(distance_rows(positions, library.skeleton), swinging, atol=0.05)


def test_a_ghost_is_its_classs_portrait() -> None:
    """Of the built-in library the ghost has the distances of its class's portrait, up to what fits in space."""
    library = MotionLibrary.builtin()
    for index, class_name in enumerate(CLASSES):
        positions = ghost(library, class_name, seconds=1.0, frame_rate=60.0, rate=0.5)
        portrayed = library.portraits[index].rows(np.arange(60) / 120)
        far = np.abs(distance_rows(positions, library.skeleton) - portrayed)
        assert far.mean() < 0.012
        others = [np.abs(portrayed - other.rows(np.arange(60) / 120)).mean() for other in library.portraits]
        assert int(np.argmin(others)) == index
        assert sorted(others)[1] > 2 * far.mean()


@pytest.mark.parametrize("rate", [0.83, 0.97, 1.0])
@pytest.mark.parametrize("class_name", CLASSES)
def test_every_classs_ghost_is_recognised_as_its_class(class_name: str, rate: float) -> None:
    """A recogniser answers each class's ghost with that class from the first second on, and never with another."""
    library = MotionLibrary.builtin()
    recognizer = Recognizer(library)
    positions = ghost(library, class_name, seconds=2.5, frame_rate=120.0, rate=rate)
    frames = [Frame("ghost", 1.0 + index / 120, each) for index, each in enumerate(positions)]
    answers = [answer for frame in frames if (answer := recognizer.push(frame)) is not None]
    assert len(answers) == 60
    assert {answer.class_name for answer in answers} <= {class_name, None}
    assert {(answer.outcome, answer.class_name) for answer in answers if answer.time >= 2.0} == {
        (Outcome.NAMED, class_name)
    }
