import math

import numpy as np
import pytest
from numpy.typing import NDArray

from kinespace.library.signature.landmark_body import HEAD, JOINTS, LENGTH, LIMBS, TRUNK, WIDTHS, LandmarkBody
from kinespace.stream.feeds import builtin_preset

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
        found = LandmarkBody(_SENT).of(shown)
        np.testing.assert_allclose(found, [expected[name] for name in JOINTS], atol=1e-9)


def test_joints_that_are_not_seen_are_not_invented() -> None:
    """A lost knee takes what hangs on it; a lost hip takes the trunk and all that hangs on it."""
    landmarks = _landmarks(0)
    landmarks[_SENT.index("lfemur")] = math.nan
    lost = np.isnan(LandmarkBody(_SENT).of(landmarks)).any(axis=1)
    assert [name for name, gone in zip(JOINTS, lost, strict=True) if gone] == ["lfemur", "ltibia", "ltoes"]
    landmarks = _landmarks(0)
    landmarks[_SENT.index("rhipjoint")] = math.nan
    assert np.isnan(LandmarkBody(_SENT).of(landmarks)).all()
    assert np.isnan(LandmarkBody(_SENT).of(np.zeros_like(landmarks))).any()
