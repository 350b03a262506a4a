"""BlazePose's two networks: the bodies in a picture, and the landmarks of one body."""

import numpy as np
from numpy.typing import NDArray

from kinespace.tools.camera import detection, region
from kinespace.tools.camera.models import Models
from kinespace.tools.camera.region import Landmarks, Region
from kinespace.tools.camera.vision import Network, cut_out

#: The least score of a body in a region.
_MIN_SCORE = 0.5


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
        self._anchors = detection.anchors()
        count = len(self._anchors)
        self._detector = Network(models.detector, detection.SIDE, (count * detection.NUMBERS, count))
        marks, cells = region.MARKS, region.CELLS**2
        self._landmarks = Network(models.landmarks, region.SIDE, (marks * 5, marks * 3, 1, cells * marks))

    def bodies(self, picture: NDArray[np.uint8]) -> list[Region]:
        """Find the region of each body in a picture (height, width, 3), the surest first."""
        everything = region.whole(*picture.shape[1::-1])
        square = cut_out(picture, everything.matrix(detection.SIDE), detection.SIDE, black=True)
        # From -1 to 1.
        boxes, scores = self._detector.run(square * np.float32(2 / 255) - np.float32(1.0))
        found = detection.decoded(boxes.reshape(-1, detection.NUMBERS), scores, self._anchors)
        points = detection.one_for_each_body(found) * detection.SIDE
        placed = (region.in_picture(each, everything, detection.SIDE) for each in points)
        return [region.region_around(each[0], each[1]) for each in placed]

    def landmarks(self, picture: NDArray[np.uint8], where: Region) -> Landmarks | None:
        """Find the landmarks of the body in a region; None where there is none."""
        square = cut_out(picture, where.matrix(region.SIDE), region.SIDE, black=False)
        marks, world, score, heat = self._landmarks.run(square * np.float32(1 / 255))
        if not float(score[0]) >= _MIN_SCORE:
            return None
        size = region.MARKS, region.CELLS
        heats = heat.reshape(size[1], -1, size[0])
        return region.landmarks_in(marks.reshape(size[0], 5), world.reshape(-1, 3), heats, where)
