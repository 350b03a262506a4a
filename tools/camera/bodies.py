"""The bodies in a camera's pictures, followed from picture to picture, each with a stable name. No clock, no file.

The detector looks at a whole picture only while a body is missing; a body that was found is looked for where its own
landmarks say (Bazarevsky et al., BlazePose, 2020, section 3.1).
"""

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from kinespace.tools.camera.detection import overlaps
from kinespace.tools.camera.region import Landmarks, Region

#: Bodies that are followed at once, at most.
MAX_BODIES = 4
#: Seconds between two looks for a further body while some are followed.
_LOOK_EVERY = 0.5
#: Regions that overlap by more than this share of both together are one body's.
_ONE_BODY = 0.4
#: Seconds for which a lost body is looked for; how far it may have moved, in sides of its region; and by what factor
#: its size may have changed.
_MISSED, _MAX_WAY, _MAX_GROWN = 5.0, 1.0, 1.6


class Finder(Protocol):
    """Finds bodies in one picture, and the landmarks of one body (`networks.Networks`)."""

    def bodies(self, picture: NDArray[np.uint8]) -> list[Region]:
        """Give the region of each body."""

    def landmarks(self, picture: NDArray[np.uint8], where: Region) -> Landmarks | None:
        """Give the landmarks of the body in a region, if there is one."""


class Seen(NamedTuple):
    """A body in one picture, and its name."""

    name: str
    landmarks: Landmarks


@dataclass(slots=True)
class _Body:
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

    def __init__(self, finder: Finder, most: int, name: str) -> None:
        if not 1 <= most <= MAX_BODIES:
            raise ValueError(f"--people: expected 1 to {MAX_BODIES}, got {most}")
        self._finder = finder
        self._names = (name, *(f"{name}-{number}" for number in range(2, most + 1)))
        self._bodies: dict[str, _Body] = {}
        self._next_look = -math.inf

    def seen(self, picture: NDArray[np.uint8], time: float) -> list[Seen]:
        """Find the bodies in the next picture (height, width, 3), taken at `time` seconds; in the order of names."""
        found: dict[str, Landmarks] = {}
        for name, body in self._bodies.items():
            if body.is_here:
                self._take(name, self._another(picture, body.region, found), time, found)
                body.is_here = name in found
        if len(found) < len(self._names) and (not found or time >= self._next_look):
            self._next_look = time + _LOOK_EVERY
            self._look(picture, time, found)
        return [Seen(name, found[name]) for name in self._names if name in found]

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
            self._bodies[name] = _Body(marks.next_region, time)

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
