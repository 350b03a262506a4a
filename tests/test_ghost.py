"""Ghosts: stored motions made visible again, and recognised as what they are."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from programs import ghost_cues
from synthetic import STICK, stick_clips

from library import Clip, Moments, MotionLibrary, distance_rows, hdm05, signature_of
from library.skeleton import Skeleton
from stream import Outcome, Recognizer
from tools.ghost import embedded, ghost, representative, swinging_rows

CLASSES = MotionLibrary.builtin().classes


@given(seed=st.integers(0, 10_000), size=st.sampled_from([0.1, 1.0, 1000.0]))
def test_distances_that_fit_in_space_are_returned(seed: int, size: float) -> None:
    """Positions found for the distances of any points in space have those distances again, and are centred."""
    points = np.random.default_rng(seed).normal(scale=size, size=(4, 6, 3)) + 5.0 * size
    rows = distance_rows(points, STICK)
    found = embedded(rows, STICK)
    assert found.shape == (4, 6, 3)
    np.testing.assert_allclose(distance_rows(found, STICK), rows, rtol=1e-6, atol=1e-9 * size)
    np.testing.assert_allclose(found.mean(axis=1), 0.0, atol=1e-9 * size)


def test_flat_bodies_are_embedded_too() -> None:
    """Points that lie in a plane, or on a line, keep their distances as well."""
    points = np.random.default_rng(3).normal(size=(2, 6, 3)) * [[[1, 1, 0]], [[1, 0, 0]]]
    rows = distance_rows(points, STICK)
    np.testing.assert_allclose(distance_rows(embedded(rows, STICK), STICK), rows, atol=1e-6)


@given(seed=st.integers(0, 10_000))
def test_a_body_never_jumps_more_than_its_points_did(seed: int) -> None:
    """From frame to frame the found body moves no more than the points moved whose distances were given."""
    generator = np.random.default_rng(seed)
    points = generator.normal(size=(6, 3)) + np.cumsum(generator.normal(scale=0.02, size=(30, 6, 3)), axis=0)
    found = embedded(distance_rows(points, STICK), STICK)
    centred = points - points.mean(axis=1, keepdims=True)
    moved = np.linalg.norm(np.diff(centred, axis=0), axis=(1, 2))
    assert (np.linalg.norm(np.diff(found, axis=0), axis=(1, 2)) <= moved * (1 + 1e-6) + 1e-6).all()


@pytest.mark.parametrize("class_name", CLASSES)
def test_no_ghost_flips(class_name: str) -> None:
    """No joint of any class's ghost moves more than 15 cm within a frame at 120 Hz; a flipped body would by metres."""
    library = MotionLibrary.builtin()
    positions = ghost(library, representative(library, class_name), seconds=2.5, frame_rate=120.0, rate=0.9)
    assert np.linalg.norm(np.diff(positions, axis=0), axis=-1).max() < 0.15


def test_a_skeleton_without_segments_cannot_be_embedded() -> None:
    """When not all pairs are measured there is nothing to embed, and the error says how many there are."""
    skeleton = hdm05.SKELETON.without_segments()
    with pytest.raises(ValueError, match="expected all pairs measured, got 435 for 31 joints"):
        embedded(np.ones((1, 435)), skeleton)


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


def test_an_unknown_class_has_no_representative() -> None:
    """Asking for a class that is not in the library names those that are."""
    with pytest.raises(ValueError, match=r"expected one of bow, jump, wave, got 'fly'"):
        representative(MotionLibrary.of_clips(stick_clips()), "fly")


@pytest.mark.parametrize("class_name", CLASSES)
def test_swinging_rows_have_the_stored_signature(class_name: str) -> None:
    """Over whole swings the rows have the stored mean, the stored axis and the variance that was along it."""
    library = MotionLibrary.builtin()
    motion = representative(library, class_name)
    rows = swinging_rows(library, motion, np.arange(2400) / 1200, 1.0)
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
    rows = swinging_rows(library, 0, np.arange(400) / 400, 1.0)
    amplitude = np.sqrt(2 * library.motions[0].eigenvalue)
    assert amplitude > library.means[0][0]
    assert rows.min() == 0.0
    assert rows[:, 0].max() == pytest.approx(library.means[0][0] + amplitude, rel=0.05)


@pytest.mark.parametrize(("seconds", "frame_rate", "frames"), [(1.0, 120.0, 120), (0.5, 30.0, 15), (2.0, 59.94, 120)])
def test_a_ghost_lasts_its_seconds(seconds: float, frame_rate: float, frames: int) -> None:
    """A ghost has as many frames as its seconds and rate say, each of all joints, all finite."""
    library = MotionLibrary.builtin()
    positions = ghost(library, 0, seconds=seconds, frame_rate=frame_rate, rate=1.0)
    assert positions.shape == (frames, 31, 3)
    assert np.isfinite(positions).all()


@pytest.mark.parametrize("class_name", CLASSES)
def test_every_classs_ghost_is_recognised_as_its_class(class_name: str) -> None:
    """A recogniser answers the ghost of each class with that class, in every single window."""
    recognizer = Recognizer(MotionLibrary.builtin())
    recognitions = [recognizer.push(cue.frame) for cue in ghost_cues(class_name, 2.5)]
    answers = [recognition for recognition in recognitions if recognition is not None]
    assert len(answers) >= 40
    assert {answer.outcome for answer in answers} == {Outcome.NAMED}
    assert {answer.class_name for answer in answers} == {class_name}
