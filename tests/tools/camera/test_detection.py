import naive_camera
import numpy as np
import pytest

from kinespace.tools.camera.networks import anchors, decoded, one_for_each_body


def _outputs(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Give outputs of a detector that sees three bodies, each by several anchors, and nothing at all elsewhere."""
    generator = np.random.default_rng(seed)
    boxes = generator.normal(0, 8, (2254, 12)).astype(np.float32)
    boxes[:, 2:4] = generator.uniform(30, 90, (2254, 2))
    scores = generator.normal(-6, 1, 2254).astype(np.float32)
    scores[generator.choice(2254, 40, replace=False)] = generator.normal(1, 2, 40)
    scores[:2] = 500.0, -500.0
    return boxes, scores


def test_anchors_are_those_of_mediapipe() -> None:
    """The order of the grid, the places and the number of anchors agree."""
    np.testing.assert_allclose(anchors(), naive_camera.anchors(), atol=1e-12)
    assert anchors().shape == (2254, 2)


@pytest.mark.parametrize("seed", range(8))
def test_bodies_are_decoded_and_averaged_as_by_the_textbook(seed: int) -> None:
    """Scores, boxes and points agree with the loop, and the points also after the averaging."""
    boxes, scores = _outputs(seed)
    found, expected = decoded(boxes, scores, anchors()), naive_camera.decoded(boxes, scores)
    averaged = naive_camera.weighted(expected)
    assert 1 < len(averaged) < len(expected)
    np.testing.assert_allclose(found.scores, [each[0] for each in expected])
    np.testing.assert_allclose(found.boxes, [each[1] for each in expected], atol=1e-6)
    np.testing.assert_allclose(found.points, [each[2] for each in expected], atol=1e-6)
    np.testing.assert_allclose(one_for_each_body(found), [each[2] for each in averaged], atol=1e-6)
