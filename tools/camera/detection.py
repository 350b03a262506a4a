"""BlazePose's detector, read: anchors, boxes and points decoded, the points of one body averaged. Pure numbers.

The constants are those of MediaPipe's graph `pose_detection_cpu.pbtxt`; Bazarevsky et al., BlazePose (2020), and, for
the averaging over overlapping boxes, BlazeFace (2019).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

#: Pixels of the detector's picture, on each side.
SIDE = 224
#: Pixels between the anchors of each grid, and the anchors at each place of it.
_GRIDS = ((8, 2), (16, 2), (32, 6))
#: Numbers of one box: centre, width, height, and x and y of four points.
NUMBERS = 12
#: The least score of a body; boxes that overlap by more than this share of both together are one body's.
MIN_SCORE, _ONE_BODY = 0.5, 0.3
#: Raw scores beyond this mean certainty; their exponentials would overflow.
_CERTAIN = 100.0


class Detections(NamedTuple):
    """Bodies in a square picture whose sides are 1 long, the surest first.

    Attributes
    ----------
    boxes
        Left, top, right and bottom of the face and trunk, shape (bodies, 4).
    points
        x and y of the middle of the hips, of a point on the circle around the body, of the middle of the shoulders, and
        of one on the circle around the upper body, shape (bodies, 4, 2).
    scores
        0 to 1, shape (bodies,).
    """

    boxes: NDArray[np.float64]
    points: NDArray[np.float64]
    scores: NDArray[np.float64]


def anchors() -> NDArray[np.float64]:
    """Give the centre of each of the detector's 2254 anchors, shape (anchors, 2), in shares of the picture's side."""
    centres = []
    for stride, each in _GRIDS:
        along = (np.arange(SIDE // stride) + 0.5) * stride / SIDE
        grid = np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)
        centres.append(grid.repeat(each, axis=0))
    return np.concatenate(centres)


def decoded(boxes: NDArray[np.floating], scores: NDArray[np.floating], centres: NDArray[np.float64]) -> Detections:
    """Read the detector's two outputs, (anchors, 12) in pixels from each anchor and (anchors,) as logits."""
    likely = 1 / (1 + np.exp(-np.clip(scores.astype(np.float64), -_CERTAIN, _CERTAIN)))
    kept = np.flatnonzero(likely >= MIN_SCORE)
    kept = kept[np.argsort(-likely[kept], kind="stable")]
    numbers = boxes[kept].astype(np.float64).reshape(-1, NUMBERS // 2, 2) / SIDE
    numbers[:, [0, 2, 3, 4, 5]] += centres[kept, None]
    middle, half = numbers[:, 0], numbers[:, 1] / 2
    return Detections(np.concatenate([middle - half, middle + half], axis=1), numbers[:, 2:], likely[kept])


def one_for_each_body(found: Detections) -> NDArray[np.float64]:
    """Give the points of each body, (bodies, 4, 2), averaged over its boxes and weighed by their scores."""
    left, points = np.arange(len(found.scores)), []
    while len(left):
        own = overlaps(found.boxes[left], found.boxes[left[0]]) > _ONE_BODY
        own[0] = True
        same, left = left[own], left[~own]
        weights = found.scores[same] / found.scores[same].sum()
        points.append(np.einsum("n,npc->pc", weights, found.points[same]))
    return np.reshape(points, (-1, 4, 2))


def overlaps(boxes: NDArray[np.float64], box: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the area that each of some boxes (boxes, 4) shares with one box, relative to both together."""
    sides = np.minimum(boxes[:, 2:], box[2:]) - np.maximum(boxes[:, :2], box[:2])
    shared = np.maximum(sides, 0.0).prod(axis=1)
    whole = (boxes[:, 2:] - boxes[:, :2]).prod(axis=1) + (box[2:] - box[:2]).prod() - shared
    shares: NDArray[np.float64] = np.divide(shared, whole, out=np.zeros_like(shared), where=whole > 0)
    return shares
