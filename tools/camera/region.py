"""The turned square of a picture in which one body stands: found, cut out, and its landmarks brought back.

As MediaPipe's graphs `pose_detection_to_roi.pbtxt`, `pose_landmarks_to_roi.pbtxt` and `pose_landmark_by_roi_cpu.pbtxt`
do it; Bazarevsky et al., BlazePose (2020), figure 2.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

#: Pixels of the landmark network's picture, and cells of its heat maps, on each side.
SIDE, CELLS = 256, 64
#: All its landmarks, and those of a body; two of the others say where the body is in the next picture.
MARKS, LANDMARKS = 39, 33
_MIDDLE, _CIRCLE = 33, 34
#: The square is so many times as wide as the circle around the body.
_MARGIN = 1.25
#: Cells of the heat map around a landmark that correct it, and what one must reach for it.
_AROUND, _MIN_HEAT = 3, 0.5
#: Logits beyond this mean certainty.
_CERTAIN = 50.0


class Region(NamedTuple):
    """A square in a picture, turned so that the body in it is upright.

    Attributes
    ----------
    x, y
        The middle, pixels.
    size
        The side, pixels.
    angle
        By how much it is turned, radians, clockwise as one sees the picture.
    """

    x: float
    y: float
    size: float
    angle: float

    @property
    def box(self) -> NDArray[np.float64]:
        """Left, top, right and bottom of the square without its turn, shape (4,), pixels."""
        half = self.size / 2
        return np.array([self.x - half, self.y - half, self.x + half, self.y + half])

    def matrix(self, side: int) -> NDArray[np.float64]:
        """Give the affine map (2, 3) from pixels of the cut out square, `side` wide, to those of the picture."""
        across, down = self.size / side * math.cos(self.angle), self.size / side * math.sin(self.angle)
        middle = side / 2
        away = (across - down) * middle, (down + across) * middle
        return np.array([[across, -down, self.x - away[0]], [down, across, self.y - away[1]]])


class Landmarks(NamedTuple):
    """One body's 33 landmarks in one picture.

    Attributes
    ----------
    picture
        x, y and z in pixels of the picture, z from the middle of the hips, shape (33, 3).
    world
        Metres from the middle of the hips: x to the picture's right, y down, z away from the camera, shape (33, 3).
    present
        How likely each is inside of the picture, 0 to 1, shape (33,).
    next_region
        Where the body is looked for in the next picture.
    """

    picture: NDArray[np.float64]
    world: NDArray[np.float64]
    present: NDArray[np.float64]
    next_region: Region


def whole(width: int, height: int) -> Region:
    """Give the square around a whole picture."""
    return Region(width / 2, height / 2, max(width, height), 0.0)


def region_around(middle: NDArray[np.floating], circle: NDArray[np.floating]) -> Region:
    """Give the region of a body by the middle of its hips and a point on its circle, above its head; pixels (2,)."""
    across, down = float(circle[0] - middle[0]), float(circle[1] - middle[1])
    # Upright is 0.
    angle = math.remainder(math.pi / 2 - math.atan2(-down, across), math.tau)
    return Region(float(middle[0]), float(middle[1]), 2 * _MARGIN * math.hypot(across, down), angle)


def in_picture(points: NDArray[np.floating], region: Region, side: int) -> NDArray[np.float64]:
    """Bring points (points, 2) from a cut out square, `side` wide, back to the picture."""
    matrix = region.matrix(side)
    return np.asarray(points, dtype=np.float64) @ matrix[:, :2].T + matrix[:, 2]


def landmarks_in(
    marks: NDArray[np.floating], world: NDArray[np.floating], heat: NDArray[np.floating], region: Region
) -> Landmarks:
    """Read the landmark network's outputs for a region.

    Parameters
    ----------
    marks
        Landmarks in pixels of the cut out square: x, y, z, and the logits of visibility and presence, shape (39, 5).
    world
        The same in metres, shape (39, 3).
    heat
        Logits of where each landmark is, shape (cells, cells, 39).
    region
        The square that was cut out.
    """
    points = in_picture(refined(marks[:, :2].astype(np.float64), heat), region, SIDE)
    cosine, sine = math.cos(region.angle), math.sin(region.angle)
    turn = np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    turned = np.asarray(world[:LANDMARKS], dtype=np.float64) @ turn
    own = marks[:LANDMARKS].astype(np.float64)
    present = 1 / (1 + np.exp(-np.clip(own[:, 4], -_CERTAIN, _CERTAIN)))
    picture = np.column_stack([points[:LANDMARKS], own[:, 2] * (region.size / SIDE)])
    return Landmarks(picture, turned, present, region_around(points[_MIDDLE], points[_CIRCLE]))


def refined(points: NDArray[np.float64], heat: NDArray[np.floating]) -> NDArray[np.float64]:
    """Move landmarks (landmarks, 2), pixels of the square, to the middle of the heat around them, if it is warm there.

    MediaPipe's `RefineLandmarksFromHeatmapCalculator`, 7 cells wide.
    """
    cells = len(heat)
    moved = points.copy()
    for place, (x, y) in enumerate(points * (cells / SIDE)):
        column, row = int(x), int(y)
        if not (0 <= column < cells and 0 <= row < cells):
            continue
        top, left = max(row - _AROUND, 0), max(column - _AROUND, 0)
        near = heat[top : row + _AROUND + 1, left : column + _AROUND + 1, place].astype(np.float64)
        near = 1 / (1 + np.exp(-near))
        if near.max() < _MIN_HEAT:
            continue
        weight = near.sum()
        moved[place] = (
            (left + near.sum(axis=0) @ np.arange(near.shape[1]) / weight) * (SIDE / cells),
            (top + near.sum(axis=1) @ np.arange(near.shape[0]) / weight) * (SIDE / cells),
        )
    return moved
