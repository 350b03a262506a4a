"""The body's own frame: distances to three joints that are fixed to the body, far to its left, above and in front.

Distances between joints cannot tell a motion from its mirror image, and tell directions badly: a jab, a hook and an
uppercut all take a hand away from everything. The paper's graph G = (V, E, d) (Le Naour et al. 2012, section 2) gets
three more vertices, which the shoulders and the hips carry. The distance to a vertex at the distance f grows by f − d
where a joint moves d towards it; for f → ∞ these numbers are coordinates in the body's own frame. They stay blind to
where the body stands and which way it faces.

In the body's own frame lying down looks like crouching. So the frame's axes stay beside the joints: they say how the
trunk has turned since a motion began.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from kinespace.library.distances import distance_rows
from kinespace.library.skeleton import Skeleton

#: Seconds between two points of a path.
STEP = 1 / 30
#: Steps over which the frame, and then the points, are averaged: the frame must not tremble with a shoulder.
_FRAME_STEPS, _POINT_STEPS = 15, 5
#: Steps before the first new one that a point depends on.
HISTORY = _FRAME_STEPS + _POINT_STEPS - 2
#: Left and right shoulder, left and right hip: the first joint that a skeleton has.
_CORNERS = (("lclavicle", "lhumerus"), ("rclavicle", "rhumerus"), ("lhipjoint", "lfemur"), ("rhipjoint", "rfemur"))
#: What these are multiplied by: leftwards, upwards, and the middle of the hips.
_FROM_CORNERS = np.array([[1.0, -1.0, 1.0, -1.0], [1.0, 1.0, -1.0, -1.0], [0.0, 0.0, 0.5, 0.5]])
#: The axes after and before each axis, for cross products.
_AFTER, _BEFORE = [1, 2, 0], [2, 0, 1]
#: Numbers of the frame's axes, the last of a point, and how long the axes are, in the body's sizes: so short that they
#: add nothing to a way.
AXES, _SHORT = 9, 1e-3
#: A length in metres that divides nothing by 0.
_TINY = 1e-6


@lru_cache(maxsize=64)
def corners_of(skeleton: Skeleton) -> list[int] | None:
    """Find the left and right shoulder and the left and right hip; None for a skeleton that lacks one."""
    places = {name: place for place, name in enumerate(skeleton.joints)}
    found = [next((places[name] for name in names if name in places), None) for names in _CORNERS]
    corners = [place for place in found if place is not None]
    return corners if len(corners) == len(_CORNERS) else None


def own_path(
    positions: NDArray[np.floating], skeleton: Skeleton, newest: int | None = None
) -> tuple[NDArray[np.float64], float]:
    """Give a body's points, from which courses are cut, and the body's size.

    Parameters
    ----------
    positions
        The body every `STEP`, shape (steps, joints, 3), metres.
    skeleton
        Its joints.
    newest
        How many points are given, the last ones; None for all.

    Returns
    -------
    points
        Shape (steps, numbers + `AXES`), metres: how far each joint lies to the left of, above and in front of the hips,
        averaged over the last sixth of a second, and the axes left, up and front: their first coordinates, second and
        third. Without shoulders or hips: the distance rows, and axes that stay as they are.
    size
        Metres: the mean distance of the middles of shoulders and hips. Without them: of all joints.
    """
    corners, first = corners_of(skeleton), len(positions) - (len(positions) if newest is None else newest)
    if corners is None:
        rows = distance_rows(positions, skeleton)
        size = max(float(rows.mean()), _TINY)
        return _beside(averaged(rows, _POINT_STEPS)[first:], np.tile(size * np.eye(3), (len(rows) - first, 1, 1))), size
    left, up, hips = (_FROM_CORNERS @ positions.take(corners, axis=1)).transpose(1, 0, 2)
    size = float(_lengths(up).sum()) / (2 * len(positions))
    left, up = averaged(left, _FRAME_STEPS), averaged(up, _FRAME_STEPS)
    up /= np.maximum(_lengths(up), _TINY)[:, None]
    left -= np.einsum("tc,tc->t", left, up)[:, None] * up
    left /= np.maximum(_lengths(left), _TINY)[:, None]
    front = left.take(_AFTER, axis=1) * up.take(_BEFORE, axis=1) - left.take(_BEFORE, axis=1) * up.take(_AFTER, axis=1)
    axes = np.concatenate([left, up, front], axis=1).reshape(-1, 3, 3).transpose(0, 2, 1)
    # The points are averaged over these.
    some = slice(max(first - _POINT_STEPS + 1, 0), None)
    own = (positions[some] - hips[some, None]) @ axes[some]
    own, size = averaged(own.reshape(len(own), -1), _POINT_STEPS)[first - some.start :], max(size, _TINY)
    return _beside(own, size * axes[first:]), size


def _beside(points: NDArray[np.float64], axes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Put axes, shape (steps, 3, 3), beside points."""
    return np.concatenate([points, _SHORT * axes.reshape(-1, AXES)], axis=1)


def _lengths(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    lengths: NDArray[np.float64] = np.sqrt(np.einsum("tc,tc->t", vectors, vectors))
    return lengths


def averaged(rows: NDArray[np.floating], steps: int) -> NDArray[np.float64]:
    """Average each row with the steps before it; before the first row the body stood as in it."""
    sums = np.empty((len(rows) + steps, *rows.shape[1:]))
    sums[:steps], sums[steps:] = rows[:1], rows
    np.add.accumulate(sums, axis=0, out=sums)
    means: NDArray[np.float64] = (sums[steps:] - sums[:-steps]) / steps
    return means


def at_steps(
    times: NDArray[np.floating], positions: NDArray[np.floating], steps: NDArray[np.floating]
) -> NDArray[np.float64]:
    """Give the body at some times, on straight lines between frames.

    Parameters
    ----------
    times, positions
        Two frames or more, ascending: shape (frames,), seconds, and (frames, joints, 3), metres.
    steps
        Times between the first frame and the last, shape (steps,).
    """
    after = np.minimum(np.maximum(times.searchsorted(steps), 1), len(times) - 1)
    begun, before = times.take(after - 1), positions.take(after - 1, axis=0)
    body: NDArray[np.float64] = np.subtract(positions.take(after, axis=0), before, dtype=np.float64)
    body *= ((steps - begun) / (times.take(after) - begun))[:, None, None]
    body += before
    return body
