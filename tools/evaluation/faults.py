"""Faults of a feed's joints, applied to recorded takes."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinespace.library.distances import distance_rows
from kinespace.library.windows.segments import mirrored_places
from kinespace.tools.evaluation.harness import Feed

#: What becomes of a feed's frames.
Fault = Callable[[Feed, np.random.Generator], Feed]

#: The joints of the left arm, in HDM05's names; a skeleton has some of them.
LEFT_ARM = ("lhumerus", "lradius", "lwrist", "lhand", "lthumb", "lfingers")
#: The standard deviation of each coordinate, metres.
NOISE = 0.02
#: The share of frames that is dropped.
DROPPED = 0.5
#: Metres by which a body is elsewhere, the standard deviation of each coordinate.
_FAR = 3.0
#: Every twelfth frame is searched for the posture farthest from the first.
_EVERY = 12


def _posed(change: Callable[[NDArray[Any], Feed], object]) -> Fault:
    """Make a fault of a function that changes the positions, (frames, joints, 3), of a feed in their place."""

    def fault(feed: Feed, _: np.random.Generator) -> Feed:
        positions = feed.positions.copy()
        change(positions, feed)
        return feed._replace(positions=positions)

    return fault


def _freeze(positions: NDArray[np.float64], feed: Feed) -> None:
    places = [place for place, name in enumerate(feed.skeleton.joints) if name in LEFT_ARM]
    positions[:, places] = positions[0, places]


def _exchange_wrists(positions: NDArray[np.float64], feed: Feed) -> None:
    joints = feed.skeleton.joints
    # A body without wrists has hands.
    name = "wrist" if "lwrist" in joints else "hand"
    left, right = joints.index(f"l{name}"), joints.index(f"r{name}")
    positions[:, [left, right]] = positions[:, [right, left]]


def _exchange_sides(positions: NDArray[np.float64], feed: Feed, since: float = -1.0) -> None:
    """Exchange left and right after some of each three seconds."""
    order = mirrored_places(feed.skeleton.joints)
    if order is None:
        raise ValueError("--fault: expected joints whose names say left or right")
    where = feed.times % 3.0 > since
    positions[where] = positions[where][:, order]


def _change_unit(positions: NDArray[np.float64], feed: Feed) -> None:
    positions[feed.times > feed.times[len(feed.times) // 2]] *= 1000.0


def _lose(positions: NDArray[np.float64], feed: Feed) -> None:
    joints = feed.skeleton.joints
    positions[:, joints.index("head")] = np.nan
    positions[feed.times % 1.0 < 0.15, joints.index("rhand")] = np.nan


def _zero(positions: NDArray[np.float64], feed: Feed) -> None:
    positions[feed.times % 4.0 > 2.0, feed.skeleton.joints.index("lhand")] = 0.0


def _jumping(period: float) -> Fault:
    def jump(positions: NDArray[np.float64], feed: Feed) -> None:
        rows = distance_rows(feed.positions[::_EVERY], feed.skeleton)
        farthest = int(np.abs(rows - rows[0]).sum(axis=1).argmax()) * _EVERY
        positions[:] = feed.positions[np.where((feed.times / period).astype(np.intp) % 2, farthest, 0)]

    return _posed(jump)


def _elsewhere(period: float) -> Fault:
    def fault(feed: Feed, generator: np.random.Generator) -> Feed:
        moved = (feed.times / period).astype(np.intp)
        places = _FAR * generator.standard_normal((moved.max() + 1, 1, 3))
        return feed._replace(positions=feed.positions + places[moved])

    return fault


def _order(feed: Feed, generator: np.random.Generator) -> Feed:
    return feed._replace(positions=feed.positions[:, generator.permutation(len(feed.skeleton.joints))])


def noisy(metres: float) -> Fault:
    """Make the fault of a sensor of 30 frames per second with white noise, metres, on every coordinate."""

    def fault(feed: Feed, generator: np.random.Generator) -> Feed:
        step = max(1, round(1 / 30 / float(np.median(np.diff(feed.times)))))
        positions = feed.positions[::step]
        return Feed(feed.times[::step], positions + metres * generator.standard_normal(positions.shape), feed.skeleton)

    return fault


def _drops(feed: Feed, generator: np.random.Generator) -> Feed:
    kept = generator.random(len(feed.times)) >= DROPPED
    return Feed(feed.times[kept], feed.positions[kept], feed.skeleton)


#: Faults by name; for the last four no joint is to blame.
FAULTS: dict[str, Fault] = {
    "left arm frozen": _posed(_freeze),
    "wrists exchanged": _posed(_exchange_wrists),
    "sides exchanged": _posed(_exchange_sides),
    "sides exchanged now and then": _posed(partial(_exchange_sides, since=1.5)),
    "elsewhere, 1/60 s": _elsewhere(1 / 60),
    "elsewhere, 1 s": _elsewhere(1.0),
    "two postures, 1/30 s": _jumping(1 / 30),
    "two postures, 1/4 s": _jumping(0.25),
    "two postures, 1 s": _jumping(1.0),
    "unit changed": _posed(_change_unit),
    "head and hand lost": _posed(_lose),
    "hand at 0, 0, 0": _posed(_zero),
    "joints in another order": _order,
    "none": lambda feed, _: feed,
    "noise of 20 mm, 30 Hz": noisy(NOISE),
    "half the frames dropped": _drops,
}
