"""BlazePose's two networks: the bodies in a picture, and the landmarks of one body.

The constants are those of MediaPipe's graph `pose_detection_cpu.pbtxt`; Bazarevsky et al., BlazePose (2020), and, for
the averaging over overlapping boxes, BlazeFace (2019).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from kinespace.tools.camera import bodies
from kinespace.tools.camera.bodies import Landmarks, Region
from kinespace.tools.camera.models import Models
from kinespace.tools.camera.vision import Network, cut_out

#: Pixels of the detector's picture, on each side.
WHOLE_SIDE = 224
#: Pixels between the anchors of each grid, and the anchors at each place of it.
_GRIDS = ((8, 2), (16, 2), (32, 6))
#: Numbers of one box: centre, width, height, and x and y of four points.
NUMBERS = 12
#: The least score of a body; boxes that overlap by more than this share of both together are one body's.
MIN_SCORE, _SAME_BODY = 0.5, 0.3


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
        along = (np.arange(WHOLE_SIDE // stride) + 0.5) * stride / WHOLE_SIDE
        grid = np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)
        centres.append(grid.repeat(each, axis=0))
    return np.concatenate(centres)


def decoded(boxes: NDArray[np.floating], scores: NDArray[np.floating], centres: NDArray[np.float64]) -> Detections:
    """Read the detector's two outputs, (anchors, 12) in pixels from each anchor and (anchors,) as logits."""
    likely = np.asarray(expit(scores.astype(np.float64)), dtype=np.float64)
    kept = np.flatnonzero(likely >= MIN_SCORE)
    kept = kept[np.argsort(-likely[kept], kind="stable")]
    numbers = boxes[kept].astype(np.float64).reshape(-1, NUMBERS // 2, 2) / WHOLE_SIDE
    numbers[:, [0, 2, 3, 4, 5]] += centres[kept, None]
    middle, half = numbers[:, 0], numbers[:, 1] / 2
    return Detections(np.concatenate([middle - half, middle + half], axis=1), numbers[:, 2:], likely[kept])


def one_for_each_body(found: Detections) -> NDArray[np.float64]:
    """Give the points of each body, (bodies, 4, 2), averaged over its boxes and weighed by their scores."""
    left, points = np.arange(len(found.scores)), []
    while len(left):
        own = bodies.overlaps(found.boxes[left], found.boxes[left[0]]) > _SAME_BODY
        own[0] = True
        same, left = left[own], left[~own]
        weights = found.scores[same] / found.scores[same].sum()
        points.append(np.einsum("n,npc->pc", weights, found.points[same]))
    return np.reshape(points, (-1, 4, 2))


#: The least score of a body in a region.
_PRESENT = 0.5


class Networks:
    """Finds the bodies in a picture, and the landmarks of one body in a region of it.

    Parameters
    ----------
    models
        The two networks.

    Raises
    ------
    ValueError
        One of them is another network, or none.
    """

    def __init__(self, models: Models) -> None:
        self._anchors = anchors()
        count = len(self._anchors)
        self._detector = Network(models.detector, WHOLE_SIDE, (count * NUMBERS, count))
        marks, cells = bodies.MARKS, bodies.CELLS**2
        self._landmarks = Network(models.landmarks, bodies.SIDE, (marks * 5, marks * 3, 1, cells * marks))

    def bodies(self, picture: NDArray[np.uint8]) -> list[Region]:
        """Find the region of each body in a picture (height, width, 3), the surest first."""
        everything = bodies.whole(*picture.shape[1::-1])
        square = cut_out(picture, everything.matrix(WHOLE_SIDE), WHOLE_SIDE, black=True)
        # From -1 to 1.
        boxes, scores = self._detector.run(square * np.float32(2 / 255) - np.float32(1.0))
        found = decoded(boxes.reshape(-1, NUMBERS), scores, self._anchors)
        points = one_for_each_body(found) * WHOLE_SIDE
        placed = (bodies.in_picture(each, everything, WHOLE_SIDE) for each in points)
        return [bodies.region_around(each[0], each[1]) for each in placed]

    def landmarks(self, picture: NDArray[np.uint8], where: Region) -> Landmarks | None:
        """Find the landmarks of the body in a region; None where there is none."""
        square = cut_out(picture, where.matrix(bodies.SIDE), bodies.SIDE, black=False)
        marks, world, score, heat = self._landmarks.run(square * np.float32(1 / 255))
        if not float(score[0]) >= _PRESENT:
            return None
        size = bodies.MARKS, bodies.CELLS
        heats = heat.reshape(size[1], -1, size[0])
        return bodies.landmarks_in(marks.reshape(size[0], 5), world.reshape(-1, 3), heats, where)
