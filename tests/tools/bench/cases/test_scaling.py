"""`kinespace bench growth`: the grown bodies and libraries are right. No figure has a limit here."""

from __future__ import annotations

import numpy as np
import pytest

from kinespace.library import MotionLibrary
from kinespace.stream.recognizer import Settings
from kinespace.tools.bench.cases import scaling
from kinespace.tools.bench.cases.scaling import Sizes, enlarged, with_joints
from kinespace.tools.bench.timing import exponent


@pytest.mark.parametrize("count", [15, 20, 31, 55])
def test_a_body_of_any_number_of_joints_moves_as_recorded(count: int) -> None:
    """Joints that stay keep their positions; added joints lie half way along a bone."""
    library = MotionLibrary.builtin().without(classes=MotionLibrary.builtin().classes[1:])
    other = with_joints(library, count)
    assert len(other.skeleton.joints) == count
    assert len(other) == len(library)
    before, after, joints = library.motions[3], other.motions[3], library.skeleton.joints
    assert after.class_name == before.class_name
    for place, name in enumerate(other.skeleton.joints):
        joint = joints.index(name.removeprefix("above "))
        expected = before.positions[:, joint]
        if name not in joints:
            expected = (expected + before.positions[:, library.skeleton.parents[joint]]) / 2
        np.testing.assert_allclose(after.positions[:, place], expected, atol=0.00051)


@pytest.mark.parametrize("count", [0, 4, 25, 62])
def test_an_impossible_number_of_joints_is_refused(count: int) -> None:
    """Below 5, between 20 and 31 and above 61 there is no body."""
    with pytest.raises(ValueError, match="joints: expected"):
        with_joints(MotionLibrary.builtin(), count)


@pytest.mark.parametrize("count", [288, 3000])
def test_a_larger_library_holds_stretches_of_the_real_motions(count: int) -> None:
    """There are as many motions as asked for, of all classes, no two alike, and none takes memory of its own."""
    real = MotionLibrary.builtin()
    large = enlarged(real, count)
    assert len(large) == count
    assert large.classes == real.classes
    kept = {(motion.positions.__array_interface__["data"][0], motion.frame_rate) for motion in large.motions}
    assert len(kept) == count
    assert {motion.frames for motion in large.motions} == {15}
    assert any(np.shares_memory(large.motions[-1].positions, motion.positions) for motion in real.motions)


def test_more_motions_than_there_are_stretches_are_refused() -> None:
    """A library has so many stretches and no more."""
    with pytest.raises(ValueError, match=r"count: expected at most \d+, got 1000000"):
        enlarged(MotionLibrary.builtin(), 1_000_000)


@pytest.mark.slow
def test_everything_is_grown_and_its_exponent_fitted() -> None:
    """Each growth has a cost for each size, in order, and the exponent fitted to these costs."""
    found = scaling.measure(Settings(), sizes=Sizes(joints=(15, 20), motions=(288, 600)), rounds=1)
    assert [(each.of, each.labels, each.sizes) for each in found] == [
        ("joints", ("15", "20"), (105.0, 190.0)),
        ("library", ("288", "600"), (288.0, 600.0)),
    ]
    for each in found:
        assert min(each.us) > 0
        assert each.exponent == pytest.approx(exponent(each.sizes, each.us))
