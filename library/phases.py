"""The keyframes of a library's motions with their phases: a live body is compared with them to find its progress.

A recording's own relative time is a poor phase: some recordings stand still before the motion, some after it. Every
recording is warped onto others of its class (dynamic time warping, Sakoe and Chiba 1978), each of them gives it a
phase, and the median of these is the phase on which they agree.
"""

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from kinespace.library.clip import Clip
from kinespace.library.distances import distance_rows
from kinespace.library.signature.basis import Basis
from kinespace.library.signature.body import Body
from kinespace.library.windows.comparison import whitened

#: Keyframes of a recording that are kept, a second.
KEYFRAMES_PER_SECOND = 15.0
#: Seconds over which a keyframe's velocity is taken.
VELOCITY_SECONDS = 2 / KEYFRAMES_PER_SECOND
#: Weight of a velocity relative to a posture, both in the basis.
VELOCITY = 3.0
#: The share of the scatter between actors that is replaced by equal scatter.
_SHRINKAGE = 0.1
#: Axes that are kept of posture and velocity: along the others keyframes differ no more than actors do.
_AXES = 24
#: Seconds over which the swing of the body is measured.
SWING_SECONDS = 1.0
#: A class is cyclic when its recordings end this near to their beginning, relative to the farthest point between, and
#: in this direction (the cosine).
_SAME_PLACE, _SAME_DIRECTION = 0.35, 0.3


@dataclass(frozen=True, slots=True, eq=False)
class Keyframes:
    """The keyframes of the recordings of one class, every recording at the same phases, from 0 to 1 in equal steps.

    Attributes
    ----------
    clips, phases
        The recordings, and of each the phase of each of its own keyframes, shape (own keyframes,).
    moving
        Posture and velocity in the basis, shape (recordings, keyframes, 2 × directions).
    speeds
        Mean squared length of each keyframe's velocity, relative to the library's mean recording, shape (recordings,
        keyframes).
    usual_speeds
        Mean of `speeds` over the recordings, (keyframes,).
    usual_swings
        Log of the swing over the last second of a recording, mean over the recordings, (keyframes,).
    seconds
        Mean length of the recordings.
    cyclic
        Whether the recordings end as they begin, so that one can follow another.
    vectors
        Posture and velocity, whitened by the differences of actors at the same phase, (recordings, keyframes, numbers):
        the only numbers that depend on other classes.
    """

    clips: tuple[Clip, ...] = field(repr=False)
    phases: list[NDArray[np.float64]] = field(repr=False)
    moving: NDArray[np.float64] = field(repr=False)
    speeds: NDArray[np.float64] = field(repr=False)
    usual_speeds: NDArray[np.float64] = field(repr=False)
    usual_swings: NDArray[np.float64] = field(repr=False)
    seconds: float
    cyclic: bool
    vectors: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 0, 0), np.float32), repr=False)


@dataclass(frozen=True, slots=True, eq=False)
class PhaseTable:
    """The keyframes and the basis from which the progress of a body is computed.

    Attributes
    ----------
    classes
        The keyframes of each class.
    whitening
        Posture and velocity times this are a vector of the table, shape (2 × directions, numbers).
    basis
        The basis of postures.
    """

    classes: Mapping[str, Keyframes]
    whitening: NDArray[np.float64] = field(repr=False)
    basis: Basis = field(repr=False)

    @classmethod
    def of(cls, motions: Iterable[Clip], body: Body, basis: Basis) -> "PhaseTable":
        """Find the phases of motions that share a skeleton, whose body and basis are given.

        Motions shorter than twice `VELOCITY_SECONDS` are left out, because they cannot be followed.
        """
        performed: dict[str, list[Clip]] = {}
        for clip in motions:
            if clip.duration >= 2 * VELOCITY_SECONDS:
                performed.setdefault(clip.class_name, []).append(clip)
        before, found = _KNOWN.get(basis, {}), dict[str, Keyframes]()
        for name, clips in performed.items():
            found[name] = before.get(tuple(clips)) or _keyframes(tuple(clips), body, basis)
        _KNOWN[basis] = {each.clips: each for each in found.values()}
        several = [each.moving for each in found.values()]
        whitening = _telling(several, _whitening(several, 2 * basis.directions.shape[1]))
        vectors = {name: (each.moving @ whitening).astype(np.float32) for name, each in found.items()}
        return cls({name: replace(each, vectors=vectors[name]) for name, each in found.items()}, whitening, basis)


#: What the last table in a basis was made of: where another class is taught, the others need not be followed again.
_KNOWN = WeakKeyDictionary[Basis, dict[tuple[Clip, ...], Keyframes]]()


def _keyframes(clips: tuple[Clip, ...], body: Body, basis: Basis) -> Keyframes:
    """Find the keyframes of a class, without vectors."""
    points = [points_of(clip, body, basis) for clip in clips]
    moving, half = [with_velocity(each) for each in points], basis.directions.shape[1]
    scale = math.sqrt(np.mean([each.var(axis=0).mean() for each in moving])) or 1.0
    phases = agreed_phases([each / scale for each in moving], [clip.actor for clip in clips])
    cyclic, lengths = _is_cyclic(points, [each[:, half:] for each in moving]), np.array([len(each) for each in moving])
    same = np.linspace(0.0, 1.0, round(lengths.mean()))
    at = [np.interp(same, own, np.arange(len(own))) for own in phases]
    read, mean = _read(moving, at), float(lengths.mean())
    speeds = (read[:, :, half:] ** 2).sum(axis=2) * (lengths[:, None] / mean) ** 2
    swings = _read([_swings(each) for each in points], at).mean(axis=0)
    seconds = (mean - 1) / KEYFRAMES_PER_SECOND
    return Keyframes(clips, phases, read, speeds, speeds.mean(axis=0), swings, seconds, cyclic)


def _read(rows: Sequence[NDArray[np.float64]], at: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Read each recording's rows at places between them."""
    before = [np.minimum(places.astype(np.intp), len(each) - 2) for each, places in zip(rows, at, strict=True)]
    first, second = (np.array([each[b + n] for each, b in zip(rows, before, strict=True)]) for n in (0, 1))
    shares = (np.array(at) - before).reshape(*first.shape[:2], *[1] * (first.ndim - 2))
    read: NDArray[np.float64] = first + shares * (second - first)
    return read


def points_of(clip: Clip, body: Body, basis: Basis) -> NDArray[np.float64]:
    """Give a clip's keyframes as points in the basis, relative to the body's size, shape (keyframes, directions)."""
    times = np.arange(round(clip.duration * KEYFRAMES_PER_SECOND) + 1) / KEYFRAMES_PER_SECOND
    frames = np.minimum(np.rint(times * clip.frame_rate).astype(int), clip.frames - 1)
    rows = distance_rows(clip.positions[frames], clip.skeleton)
    relative: NDArray[np.float64] = rows @ basis.directions / body.size(rows).mean()
    return relative


def with_velocity(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Append to each point its movement in the last `VELOCITY_SECONDS`, weighted, (keyframes, 2 × directions).

    The first points have no past: they get the velocity with which the recording begins.
    """
    lag = round(VELOCITY_SECONDS * KEYFRAMES_PER_SECOND)
    later = np.minimum(np.maximum(np.arange(len(points)), lag), len(points) - 1)
    velocity = points[later] - points[np.maximum(later - lag, 0)]
    return np.hstack([points, VELOCITY * velocity])


def _whitening(moving: Iterable[NDArray[np.float64]], width: int) -> NDArray[np.float64]:
    """Learn how recordings of a class differ at the same phase; a class of one recording is ignored."""
    deviations = [(each - each.mean(axis=0)).reshape(-1, width) for each in moving if len(each) > 1]
    scatter = np.mean([each.T @ each / len(each) for each in deviations], axis=0) if deviations else np.eye(width)
    return whitened(scatter, _SHRINKAGE) / math.sqrt(float(scatter.trace()) / width or 1.0)


def _telling(moving: Collection[NDArray[np.float64]], whitening: NDArray[np.float64]) -> NDArray[np.float64]:
    """Keep the axes along which the keyframes of a class differ most, in the mean of the classes."""
    if not moving:
        return whitening
    spreads = np.mean([(each @ whitening).var(axis=(0, 1)) for each in moving], axis=0)
    kept = np.sort(spreads.argsort()[-_AXES:])
    return np.ascontiguousarray(whitening[:, kept])


def _is_cyclic(points: Sequence[NDArray[np.float64]], velocities: Sequence[NDArray[np.float64]]) -> bool:
    """Say whether the recordings of a class end where, and in the direction in which, they begin."""
    apart, along = [], []
    for places, ways in zip(points, velocities, strict=True):
        farthest = np.linalg.norm(places - places[0], axis=1).max()
        apart.append(np.linalg.norm(places[-1] - places[0]) / max(farthest, 1e-9))
        lengths = np.linalg.norm(ways[0]) * np.linalg.norm(ways[-1])
        along.append(ways[0] @ ways[-1] / max(lengths, 1e-9))
    return bool(np.median(apart) < _SAME_PLACE and np.median(along) > _SAME_DIRECTION)


def _swings(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Log of the swing over the last second at each keyframe; at the beginning over the time that has passed."""
    span = round(SWING_SECONDS * KEYFRAMES_PER_SECOND)
    windows = (points[max(0, end - span) : end + 1] for end in range(len(points)))
    return np.array([log_swing(float(each.var(axis=0).sum())) for each in windows])


def log_swing(variance: float) -> float:
    """Log of the swing of points whose variances in all directions add up to this."""
    return 0.5 * math.log(variance + 1e-6)


# --- warping ----------------------------------------------------------------------------------------------------------

#: Cost of a step along both recordings, relative to a step along one: a diagonal path is as long as the detour.
_DIAGONAL = 1.4
#: Recordings of each other actor onto which a recording is warped, at most; of its own actor if there is no other.
_PER_ACTOR, _OF_ONE = 2, 6
#: Pairs of recordings that are warped together.
_TOGETHER = 256


def agreed_phases(features: Sequence[NDArray[np.float64]], actors: Sequence[str]) -> list[NDArray[np.float64]]:
    """Find the phase of every frame of the recordings of one class.

    Parameters
    ----------
    features
        The numbers of each recording's frames that are compared, each (frames, numbers), two frames at least.
    actors
        The actor of each recording.

    Returns
    -------
    For each recording the phase of its frames, (frames,), 0 to 1, never falling; relative time if the class has no
    other recording.
    """
    pairs = [(index, other) for index in range(len(features)) for other in _partners(index, actors)]
    found: list[list[NDArray[np.float64]]] = [[] for _ in features]
    # Recordings of similar length are warped together, because all are filled up to the longest.
    pairs.sort(key=lambda pair: (len(features[pair[0]]) + len(features[pair[1]]), pair))
    for start in range(0, len(pairs), _TOGETHER):
        some = pairs[start : start + _TOGETHER]
        warped = warped_phases([(features[one], features[other]) for one, other in some])
        for (one, _), phases in zip(some, warped, strict=True):
            found[one].append(phases)
    return [
        np.maximum.accumulate(np.median(phases, axis=0)) if phases else np.linspace(0.0, 1.0, len(own))
        for phases, own in zip(found, features, strict=True)
    ]


def _partners(index: int, actors: Sequence[str]) -> list[int]:
    """Choose the recordings onto which one is warped, spread over each other actor's recordings."""
    others: dict[str, list[int]] = {}
    for other, actor in enumerate(actors):
        if actor != actors[index]:
            others.setdefault(actor, []).append(other)
    if not others:
        own = [other for other in range(len(actors)) if other != index]
        return _spread(own, index, _OF_ONE)
    return [other for group in others.values() for other in _spread(group, index, _PER_ACTOR)]


def _spread(group: list[int], index: int, count: int) -> list[int]:
    """Take some of a group, evenly spread, beginning at a place that depends on the asking recording."""
    step = max(len(group) // count, 1)
    return [group[(index + each * step) % len(group)] for each in range(min(count, len(group)))]


def warped_phases(pairs: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]]) -> list[NDArray[np.float64]]:
    """Warp the first of each pair onto the second, with both ends pinned.

    Parameters
    ----------
    pairs
        The numbers of two recordings, (frames, numbers) and (other frames, numbers).

    Returns
    -------
    For each pair the mean relative time of the frames of the second recording with which each frame of the first is
    matched, shape (frames,).
    """
    rows, columns = max(len(a) for a, _ in pairs), max(len(b) for _, b in pairs)
    costs = np.zeros((len(pairs), rows, columns))
    for cost, (a, b) in zip(costs, pairs, strict=True):
        squares = (a**2).sum(1)[:, None] + (b**2).sum(1) - 2 * a @ b.T
        cost[: len(a), : len(b)] = np.sqrt(np.maximum(squares, 0.0))
    steps = _best_steps(costs)
    return _followed_back(steps, [(len(a), len(b)) for a, b in pairs])


def _best_steps(costs: NDArray[np.float64]) -> NDArray[np.int8]:
    """Say from where the cheapest path reaches each cell: 0 from both before, 1 from above, 2 from the left."""
    count, rows, columns = costs.shape
    total = np.full((count, rows + 1, columns + 1), np.inf)
    total[:, 0, 0] = 0.0
    steps = np.zeros(costs.shape, dtype=np.int8)
    for diagonal in range(rows + columns - 1):
        i = np.arange(max(0, diagonal - columns + 1), min(rows, diagonal + 1))
        j = diagonal - i
        here = costs[:, i, j]
        ways = np.stack([total[:, i, j] + (_DIAGONAL - 1) * here, total[:, i, j + 1], total[:, i + 1, j]])
        best = ways.argmin(axis=0)
        steps[:, i, j] = best
        total[:, i + 1, j + 1] = np.take_along_axis(ways, best[None], axis=0)[0] + here
    return steps


def _followed_back(steps: NDArray[np.int8], sizes: Sequence[tuple[int, int]]) -> list[NDArray[np.float64]]:
    """Follow every pair's path from its end, and average the columns that each row is matched with."""
    place = np.array(sizes) - 1
    last = np.maximum(place[:, 1], 1)
    sums, counts = np.zeros(steps.shape[:2]), np.zeros(steps.shape[:2])
    while (there := (place >= 0).all(axis=1)).any():
        which, (i, j) = np.flatnonzero(there), place[there].T
        sums[which, i] += j / last[which]
        counts[which, i] += 1
        step = steps[which, i, j]
        done = (i == 0) & (j == 0)
        place[which, 0] = np.where(done, -1, i - (step != 2))
        place[which, 1] = np.where(done, -1, j - (step != 1))
    return [sums[each, :rows] / counts[each, :rows] for each, (rows, _) in enumerate(sizes)]
