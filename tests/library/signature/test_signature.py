"""What a window's signature is made of: basis, body, leading eigenvector, parts."""

import math

import naive
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from kinespace.library import MotionLibrary, WindowIndex, signature_of, similarity
from kinespace.library.signature.basis import MAX_DIRECTIONS, Basis
from kinespace.library.signature.body import Body
from kinespace.library.signature.landmark_body import HEAD, JOINTS, LENGTH, LIMBS, TRUNK, WIDTHS, body_of
from kinespace.stream.feeds import builtin_preset

# --- basis ------------------------------------------------------------------------------------------------------------


#: The rounding of single precision, in which a basis is kept, in sums of some hundred numbers.
SINGLE = 1e-6


def test_the_builtin_basis_holds_nearly_all_movement(builtin_index: WindowIndex) -> None:
    """32 directions, orthonormal but for the weights, hold 98 %; segments are rigid."""
    basis, segments = builtin_index.basis, builtin_index.body.segments
    assert basis.directions.shape == (465, MAX_DIRECTIONS)
    assert 0.98 <= basis.share < 1.0
    moving = basis.weights > 0
    plain = basis.directions[moving] / basis.weights[moving, None]
    assert np.allclose(plain.T @ plain, np.eye(MAX_DIRECTIONS), atol=SINGLE)
    assert not basis.weights[segments].any()
    assert not basis.directions[segments].any()
    assert moving.sum() <= len(basis.weights) - len(segments)


def test_few_moving_pairs_make_few_directions(builtin: MotionLibrary) -> None:
    """Two distances that vary give two directions, which hold all movement; none that vary give none."""
    body = Body.of(builtin.skeleton)
    still = np.ones((50, len(body.sizing)))
    assert Basis.learned([[still]], body).share == 0.0
    still[:, 7] += np.sin(np.arange(50))
    still[:, 9] += np.cos(np.arange(50))
    basis = Basis.learned([[still]], body)
    assert (np.count_nonzero(basis.weights), basis.directions.shape[1]) == (2, 2)
    assert basis.share == pytest.approx(1.0)
    with pytest.raises(ValueError, match="expected a body, got a motion with all joints in one place"):
        Basis.learned([[0 * still]], body)


# --- body -------------------------------------------------------------------------------------------------------------


# --- leading ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("frames", [2, 10])
def test_a_statue_has_some_unit_vector(frames: int) -> None:
    """Where nothing moves, the signature is still finite and of length 1."""
    assert np.linalg.norm(signature_of(np.tile([0.5, 1.25, 3.0], (frames, 1)))) == pytest.approx(1.0)


@given(st.integers(0, 2**32 - 1))
def test_similarity_is_the_inner_product_without_its_sign(seed: int) -> None:
    """Scores equal products added up in a loop, for one window and for several, whatever the signs."""
    generator = np.random.default_rng(seed)
    axes, windows = generator.normal(size=(5, 9)), generator.normal(size=(9, 3))
    for column, window in zip(similarity(axes, windows).T, windows.T, strict=True):
        assert column.tolist() == pytest.approx([naive.score(row, window) for row in axes])
        turned = generator.choice([-1.0, 1.0], size=(5, 1)) * axes
        assert np.array_equal(similarity(turned, -window), similarity(axes, window))


# --- parts ------------------------------------------------------------------------------------------------------------


_SENT = builtin_preset("mediapipe").sent


def _twin(seen: dict[str, list[float]]) -> dict[str, list[float]]:
    """Walk from the hips outwards, one joint at a time, as far as the last step's direction and a bone's length say."""

    def middle(first: str, other: str) -> list[float]:
        return [(a + b) / 2 for a, b in zip(seen[first], seen[other], strict=True)]

    def step(start: list[float], begin: list[float], end: list[float], length: float) -> list[float]:
        far = math.dist(begin, end)
        return [c + length * (b - a) / far for a, b, c in zip(begin, end, start, strict=True)]

    hips, shoulders = middle("lhipjoint", "rhipjoint"), middle("lclavicle", "rclavicle")
    zero = [0.0, 0.0, 0.0]
    body = {name: step(zero, hips, shoulders, share * LENGTH) for name, share in TRUNK.items()}
    top = step(zero, hips, shoulders, LENGTH)
    body["head"] = step(top, shoulders, seen["head"], HEAD)
    for side, other in (("l", "r"), ("r", "l")):
        for name, start in (("hipjoint", zero), ("clavicle", top)):
            body[side + name] = step(start, seen[other + name], seen[side + name], WIDTHS[name] / 2)
        for name, (above, length) in LIMBS.items():
            body[side + name] = step(body[side + above], seen[side + above], seen[side + name], length)
    return body


def _landmarks(seed: int) -> NDArray[np.float64]:
    return np.random.default_rng(seed).normal(0, 0.5, (len(_SENT), 3))


@pytest.mark.parametrize("seed", range(10))
def test_a_body_as_the_slow_twin_walks_it(seed: int) -> None:
    """Every joint is where the twin arrives; the unit and the place of the landmarks do not matter."""
    landmarks = _landmarks(seed)
    expected = _twin(dict(zip(_SENT, landmarks.tolist(), strict=True)))
    for shown in (landmarks, landmarks * 320 + 7.0):
        np.testing.assert_allclose(body_of(_SENT, shown), [expected[name] for name in JOINTS], atol=1e-9)


def test_joints_that_are_not_seen_are_not_invented() -> None:
    """A lost knee takes what hangs on it; a lost hip takes the trunk and all that hangs on it."""
    landmarks = _landmarks(0)
    landmarks[_SENT.index("lfemur")] = math.nan
    lost = np.isnan(body_of(_SENT, landmarks)).any(axis=1)
    assert [name for name, gone in zip(JOINTS, lost, strict=True) if gone] == ["lfemur", "ltibia", "ltoes"]
    landmarks = _landmarks(0)
    landmarks[_SENT.index("rhipjoint")] = math.nan
    assert np.isnan(body_of(_SENT, landmarks)).all()
    assert np.isnan(body_of(_SENT, np.zeros_like(landmarks))).any()
