"""Faults of a feed's joints, applied to recorded takes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kinespace.library.distances import distance_rows
from kinespace.library.windows.segments import mirrored_places
from kinespace.tools.evaluation.harness import Feed

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

#: The joints of the left arm, in HDM05's names; a skeleton has some of them.
LEFT_ARM = ("lhumerus", "lradius", "lwrist", "lhand", "lthumb", "lfingers")
#: The standard deviation of each coordinate in metres, and the share of frames that is dropped.
NOISE, DROPPED = 0.02, 0.5
#: Metres by which a body is elsewhere, the standard deviation of each coordinate.
_FAR = 3.0
#: One in so many frames is searched for the posture farthest from the first.
_EVERY = 12


def _frozen(feed: Feed, _: np.random.Generator) -> Feed:
    places = [place for place, name in enumerate(feed.skeleton.joints) if name in LEFT_ARM]
    positions = feed.positions.copy()
    positions[:, places] = positions[0, places]
    return feed._replace(positions=positions)


def _wrists(feed: Feed, _: np.random.Generator) -> Feed:
    joints = feed.skeleton.joints
    # A body without wrists has hands.
    name = "wrist" if "lwrist" in joints else "hand"
    order = np.arange(len(joints))
    left, right = joints.index(f"l{name}"), joints.index(f"r{name}")
    order[[left, right]] = right, left
    return feed._replace(positions=feed.positions[:, order])


def _sides(feed: Feed, where: NDArray[np.bool_]) -> Feed:
    order = mirrored_places(feed.skeleton.joints)
    if order is None:
        raise ValueError("--fault: expected joints whose names say left or right")
    positions = feed.positions.copy()
    positions[where] = positions[where][:, order]
    return feed._replace(positions=positions)


def _sides_throughout(feed: Feed, _: np.random.Generator) -> Feed:
    return _sides(feed, np.ones(len(feed.times), dtype=np.bool_))


def _sides_now_and_then(feed: Feed, _: np.random.Generator) -> Feed:
    return _sides(feed, np.asarray(feed.times % 3.0 > 1.5))


def _unit(feed: Feed, _: np.random.Generator) -> Feed:
    factor = np.where(feed.times > feed.times[len(feed.times) // 2], 1000.0, 1.0)
    return feed._replace(positions=feed.positions * factor[:, None, None])


def _elsewhere(period: float) -> Callable[[Feed, np.random.Generator], Feed]:
    def fault(feed: Feed, generator: np.random.Generator) -> Feed:
        moved = (feed.times / period).astype(np.intp)
        places = _FAR * generator.standard_normal((moved.max() + 1, 1, 3))
        return feed._replace(positions=feed.positions + places[moved])

    return fault


def _jumping(period: float) -> Callable[[Feed, np.random.Generator], Feed]:
    def fault(feed: Feed, _: np.random.Generator) -> Feed:
        rows = distance_rows(feed.positions[::_EVERY], feed.skeleton)
        farthest = int(np.abs(rows - rows[0]).sum(axis=1).argmax()) * _EVERY
        shown = np.where((feed.times / period).astype(np.intp) % 2, farthest, 0)
        return feed._replace(positions=feed.positions[shown])

    return fault


def _lost(feed: Feed, _: np.random.Generator) -> Feed:
    joints, positions = feed.skeleton.joints, feed.positions.copy()
    hand = joints.index("rhand")
    positions[:, joints.index("head")] = np.nan
    positions[feed.times % 1.0 < 0.15, hand] = np.nan
    return feed._replace(positions=positions)


def _zeros(feed: Feed, _: np.random.Generator) -> Feed:
    positions = feed.positions.copy()
    positions[feed.times % 4.0 > 2.0, feed.skeleton.joints.index("lhand")] = 0.0
    return feed._replace(positions=positions)


def _order(feed: Feed, generator: np.random.Generator) -> Feed:
    return feed._replace(positions=feed.positions[:, generator.permutation(len(feed.skeleton.joints))])


def noisy(metres: float) -> Callable[[Feed, np.random.Generator], Feed]:
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
FAULTS: dict[str, Callable[[Feed, np.random.Generator], Feed]] = {
    "left arm frozen": _frozen,
    "wrists exchanged": _wrists,
    "sides exchanged": _sides_throughout,
    "sides exchanged now and then": _sides_now_and_then,
    "elsewhere, 1/60 s": _elsewhere(1 / 60),
    "elsewhere, 1 s": _elsewhere(1.0),
    "two postures, 1/30 s": _jumping(1 / 30),
    "two postures, 1/4 s": _jumping(0.25),
    "two postures, 1 s": _jumping(1.0),
    "unit changed": _unit,
    "head and hand lost": _lost,
    "hand at 0, 0, 0": _zeros,
    "joints in another order": _order,
    "none": lambda feed, _: feed,
    "noise of 20 mm, 30 Hz": noisy(NOISE),
    "half the frames dropped": _drops,
}
