"""The bodies in a camera's pictures, followed from picture to picture, each with a stable name, and their joints.

The detector looks at a whole picture only while a body is missing; a body that was found is looked for where its own
landmarks say, in the turned square of a picture in which it stands, as MediaPipe's graphs
`pose_detection_to_roi.pbtxt`, `pose_landmarks_to_roi.pbtxt` and `pose_landmark_by_roi_cpu.pbtxt` do it (Bazarevsky et
al., BlazePose, 2020, section 3.1 and figure 2).
"""

import math
from contextlib import closing
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from kinespace.library import Clip
from kinespace.library.recordings.formats.markers.marker_clip import clips_of_markers
from kinespace.library.recordings.formats.measures import evened
from kinespace.library.signature.landmark_body import JOINTS, body_of
from kinespace.stream.feeds import builtin_preset

if TYPE_CHECKING:
    from kinespace.tools.camera.networks import Networks

#: Pixels of the landmark network's picture, and cells of its heat maps, on each side.
SIDE, CELLS = 256, 64
#: All its landmarks, and those of a body; two of the others say where the body is in the next picture.
MARKS, LANDMARKS = 39, 33
_MIDDLE, _CIRCLE = 33, 34
#: The square is so many times as wide as the circle around the body.
_MARGIN = 1.25
#: Cells of the heat map around a landmark that correct it, and what one must reach for it.
_AROUND, _MIN_HEAT = 3, 0.5


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
    picture = np.column_stack([points[:LANDMARKS], own[:, 2] * (region.size / SIDE)])
    return Landmarks(picture, turned, expit(own[:, 4]), region_around(points[_MIDDLE], points[_CIRCLE]))


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
        near = expit(heat[top : row + _AROUND + 1, left : column + _AROUND + 1, place].astype(np.float64))
        if near.max() >= _MIN_HEAT:
            across, down = near.sum(axis=0) @ np.arange(near.shape[1]), near.sum(axis=1) @ np.arange(near.shape[0])
            moved[place] = np.array([left + across / near.sum(), top + down / near.sum()]) * (SIDE / cells)
    return moved


#: Bodies that are followed at once, at most.
MAX_BODIES = 4
#: Seconds between two looks for a further body while some are followed.
_LOOK_EVERY = 0.5
#: Regions that overlap by more than this share of both together are one body's.
_ONE_BODY = 0.4
#: Seconds for which a lost body is looked for; how far it may have moved, in sides of its region; and by what factor
#: its size may have changed.
_MISSED, _MAX_WAY, _MAX_GROWN = 5.0, 1.0, 1.6


@dataclass(slots=True)
class _SeenBody:
    """Where a body was seen last, and when, seconds; whether it is followed now."""

    region: Region
    last: float
    is_here: bool = True


class Bodies:
    """Follows bodies.

    Parameters
    ----------
    finder
        Finds them.
    most
        How many are followed at once.
    name
        The name of the first body; the others have it with a number from 2 on.

    Raises
    ------
    ValueError
        `most` is below 1 or above `MAX_BODIES`.
    """

    def __init__(self, finder: "Networks", most: int, name: str) -> None:
        if not 1 <= most <= MAX_BODIES:
            raise ValueError(f"--people: expected 1 to {MAX_BODIES}, got {most}")
        self._finder = finder
        self._names = (name, *(f"{name}-{number}" for number in range(2, most + 1)))
        self._bodies: dict[str, _SeenBody] = {}
        self._next_look = -math.inf

    def seen(self, picture: NDArray[np.uint8], time: float) -> dict[str, Landmarks]:
        """Find the bodies in the next picture (height, width, 3), taken at `time` seconds, by name in their order."""
        found: dict[str, Landmarks] = {}
        for name, body in self._bodies.items():
            if body.is_here:
                self._take(name, self._another(picture, body.region, found), time, found)
                body.is_here = name in found
        if len(found) < len(self._names) and (not found or time >= self._next_look):
            self._next_look = time + _LOOK_EVERY
            self._look(picture, time, found)
        return {name: found[name] for name in self._names if name in found}

    def _look(self, picture: NDArray[np.uint8], time: float, found: dict[str, Landmarks]) -> None:
        """Look at the whole picture for further bodies: those first that were lost a moment ago, then the largest."""
        regions = self._finder.bodies(picture)
        regions.sort(key=lambda region: (self._lost(region, time, found) is None, -region.size))
        for region in regions:
            if len(found) < len(self._names):
                marks = self._another(picture, region, found)
                name = marks and (self._lost(marks.next_region, time, found) or self._free(found))
                self._take(name or "", marks, time, found)

    def _another(self, picture: NDArray[np.uint8], region: Region, found: dict[str, Landmarks]) -> Landmarks | None:
        """Give the landmarks in a region, unless there is no body or one that was found already."""
        if not region.size >= 1 or _is_among(region, found):
            return None
        marks = self._finder.landmarks(picture, region)
        return None if marks is None or _is_among(marks.next_region, found) else marks

    def _take(self, name: str, marks: Landmarks | None, time: float, found: dict[str, Landmarks]) -> None:
        if marks is not None:
            found[name] = marks
            self._bodies[name] = _SeenBody(marks.next_region, time)

    def _lost(self, region: Region, time: float, found: dict[str, Landmarks]) -> str | None:
        """Give the name of the body that was lost near a region a moment ago, if there is one."""
        near = {
            name: math.hypot(region.x - body.region.x, region.y - body.region.y) / body.region.size
            for name, body in self._bodies.items()
            if name not in found
            and 0 <= time - body.last <= _MISSED
            and 1 / _MAX_GROWN <= region.size / body.region.size <= _MAX_GROWN
        }
        best = min(near, key=lambda name: near[name], default=None)
        return best if best and near[best] <= _MAX_WAY else None

    def _free(self, found: dict[str, Landmarks]) -> str:
        """Give the name that nobody has, or that was given up the longest ago."""
        free = [name for name in self._names if name not in found]
        return min(free, key=lambda name: self._bodies[name].last if name in self._bodies else -math.inf)


def _is_among(region: Region, found: dict[str, Landmarks]) -> bool:
    boxes = [each.next_region.box for each in found.values()]
    return bool(boxes) and bool((overlaps(np.array(boxes), region.box) > _ONE_BODY).any())


def overlaps(boxes: NDArray[np.float64], box: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the area that each of some boxes (boxes, 4) shares with one box, relative to both together."""
    sides = np.minimum(boxes[:, 2:], box[2:]) - np.maximum(boxes[:, :2], box[:2])
    shared = np.maximum(sides, 0.0).prod(axis=1)
    whole = (boxes[:, 2:] - boxes[:, :2]).prod(axis=1) + (box[2:] - box[:2]).prod() - shared
    shares: NDArray[np.float64] = np.divide(shared, whole, out=np.zeros_like(shared), where=whole > 0)
    return shares


#: The presence from which on a landmark is taken to be inside of the picture.
_INSIDE = 0.5


def require_extra() -> None:
    """Refuse to go on without the libraries that a camera needs; ImportError says how to get them."""
    try:
        import_module("kinespace.tools.camera.vision")
    except ImportError as error:
        how = "pip install 'kinespace[camera]', on Python 3.11 to 3.13"
        raise ImportError(f"a camera needs OpenCV and LiteRT ({error}): {how}") from error


def landmark_names() -> list[str]:
    """Give the names of BlazePose's 33 landmarks, as the preset `mediapipe` has them."""
    preset = builtin_preset("mediapipe")
    return [preset.joint_map[name] for name in preset.order]


def upright(landmarks: Landmarks, picture: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Give landmarks as positions (33, 3) with y up and z towards the camera; NaN for those outside of the picture.

    Parameters
    ----------
    landmarks
        Of one body.
    picture
        The picture in which they were found, (height, width, 3).
    """
    height, width = picture.shape[:2]
    turned: NDArray[np.float64] = landmarks.world * np.array([1.0, -1.0, -1.0])
    inside = (landmarks.picture[:, :2] >= 0).all(axis=1) & (landmarks.picture[:, :2] < (width, height)).all(axis=1)
    turned[~inside | (landmarks.present < _INSIDE)] = np.nan
    return turned


def film_clip(path: Path) -> Clip:
    """Read a film as a recording of one body, which begins with the film; joints that were not seen are on lines.

    Raises
    ------
    ImportError
        The extra is not installed.
    OSError
        Models or film cannot be opened.
    ValueError
        A body is in fewer than two pictures, or a joint is missing for long.
    """
    require_extra()
    from kinespace.tools.camera import film, models, networks  # noqa: PLC0415 - need an extra

    bodies, joints = Bodies(networks.Networks(models.models_at(None, "full")), 1, "camera"), landmark_names()
    times, positions = [], []
    with closing(film.Film(str(path), lambda: False, paced=False)) as pictures:
        for picture in pictures:
            for landmarks in bodies.seen(picture.pixels, picture.time).values():
                times.append(picture.time)
                positions.append(body_of(joints, upright(landmarks, picture.pixels)))
    if len(times) < 2:
        raise ValueError(f"{path}: no body in its {pictures.taken} pictures")
    even = evened(np.array(times), np.array(positions), begin=film.FIRST)
    return replace(clips_of_markers(path, JOINTS, even.positions, even.rate, ())[0], gaps=even.gaps)
