"""Forward kinematics against the textbook's: a product of 4 × 4 matrices down from the root."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from kinespace.stream.feeds import builtin_preset
from kinespace.stream.feeds.kinematics import Bone, world_positions

VMC = builtin_preset("vmc").bones
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


def naive_positions(bones, poses):  # noqa: ANN001, ANN201 - the textbook's way, for comparison only
    """Multiply each bone's matrix to its parent's."""
    matrices = {"": np.eye(4)}
    for name, bone in bones.items():
        position, rotation = poses.get(name, (bone.offset, UPRIGHT))
        matrix = np.eye(4)
        matrix[:3, :3] = Rotation.from_quat(rotation).as_matrix()
        matrix[:3, 3] = position
        matrices[name] = matrices[bone.parent] @ matrix
    return {name: matrices[name][:3, 3] for name in bones}


@given(st.integers(0, 10_000))
def test_it_is_the_product_of_matrices(seed: int) -> None:
    """For any positions and rotations of all humanoid bones every bone stands where the matrices put it."""
    generator = np.random.default_rng(seed)
    poses = {name: (tuple(generator.normal(size=3)), tuple(Rotation.random(rng=generator).as_quat())) for name in VMC}
    expected = naive_positions(VMC, poses)
    for name, position in world_positions(VMC, poses).items():
        np.testing.assert_allclose(position, expected[name], atol=1e-9)


@pytest.mark.parametrize("rotation", [(0.0,) * 4, (1e300,) * 4, (1e-20,) * 4])
def test_a_rotation_that_is_none_is_no_rotation(rotation: tuple[float, ...]) -> None:
    """Zeros, and numbers too large or small for a direction, do not turn the bone."""
    bones = {"a": Bone(), "b": Bone("a", (1.0, 0.0, 0.0))}
    assert world_positions(bones, {"a": (None, rotation)})["b"] == (1.0, 0.0, 0.0)  # type: ignore[dict-item]  # of four
