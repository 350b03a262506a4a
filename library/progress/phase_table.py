"""The moments of a library's motions with their phases: a live body is compared with them to find its progress."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinespace.library.clip import Clip
from kinespace.library.distances import distance_rows
from kinespace.library.progress.warping import agreed_phases
from kinespace.library.signature.basis import Basis
from kinespace.library.signature.body import Body

#: Moments of a recording that are kept, a second.
MOMENTS_PER_SECOND = 15.0
#: Seconds over which a moment's velocity is taken.
VELOCITY_SECONDS = 2 / MOMENTS_PER_SECOND
#: Weight of a velocity relative to a posture, both in the basis.
VELOCITY = 3.0
#: The share of the scatter between actors that is replaced by equal scatter.
_SHRINKAGE = 0.1
#: Phases at which recordings are compared to learn how actors differ.
_COMPARED_AT = np.linspace(0.0, 1.0, 10)
#: Axes that are kept of posture and velocity: along the others moments differ no more than actors do.
_AXES = 24
#: Bins of phases that count as the same.
BINS = 40
#: Seconds over which the swing of the body is measured.
SWING_SECONDS = 1.0
#: A class is cyclic when its recordings end this near to their beginning, relative to the farthest point between, and
#: in this direction (the cosine).
_SAME_PLACE, _SAME_DIRECTION = 0.35, 0.3


@dataclass(frozen=True, slots=True, eq=False)
class Moments:
    """The moments of the recordings of one class, recording after recording.

    Attributes
    ----------
    vectors
        Posture and velocity, whitened by the differences of actors at the same phase, shape (numbers, moments).
    phases
        The phase of each moment, shape (moments,), 0 to 1.
    starts
        Where each recording begins, ascending, shape (recordings,).
    speeds
        Mean squared length of each moment's velocity, relative to the library's mean recording, (moments,).
    usual_speeds
        Mean of `speeds` over all moments at the same phase, (moments,).
    usual_swings
        Log of the swing over the last second of a recording, mean over all moments at the same phase, (moments,).
    seconds
        Mean length of the recordings.
    cyclic
        Whether the recordings end as they begin, so that one can follow another.
    """

    vectors: NDArray[np.float32] = field(repr=False)
    phases: NDArray[np.float64] = field(repr=False)
    starts: NDArray[np.intp] = field(repr=False)
    speeds: NDArray[np.float64] = field(repr=False)
    usual_speeds: NDArray[np.float64] = field(repr=False)
    usual_swings: NDArray[np.float64] = field(repr=False)
    seconds: float
    cyclic: bool


@dataclass(frozen=True, slots=True, eq=False)
class PhaseTable:
    """The moments and the basis from which the progress of a body is computed.

    Attributes
    ----------
    classes
        The moments of each class.
    whitening
        Posture and velocity times this are a vector of the table, shape (2 × directions, numbers).
    basis
        The basis of postures.
    courses
        For each class its clips, and their numbers that do not depend on other classes.
    """

    classes: Mapping[str, Moments]
    whitening: NDArray[np.float64] = field(repr=False)
    basis: Basis = field(repr=False)
    courses: Mapping[str, tuple[tuple[Clip, ...], _Courses]] = field(repr=False)

    @classmethod
    def of(cls, motions: Iterable[Clip], body: Body, basis: Basis, known: PhaseTable | None = None) -> PhaseTable:
        """Find the phases of motions that share a skeleton.

        Motions shorter than twice `VELOCITY_SECONDS` are left out, because they cannot be followed.

        Parameters
        ----------
        motions, body, basis
            The motions, and the body and basis of their skeleton.
        known
            A table of some of the same motions: a class that did not change is not computed again.
        """
        performed: dict[str, list[Clip]] = {}
        for clip in motions:
            if clip.duration >= 2 * VELOCITY_SECONDS:
                performed.setdefault(clip.class_name, []).append(clip)
        before = known.courses if known and known.basis is basis else {}
        courses: dict[str, tuple[tuple[Clip, ...], _Courses]] = {}
        for name, clips in performed.items():
            now, found = tuple(clips), before.get(name)
            # A clip equals itself alone.
            courses[name] = found if found and found[0] == now else (now, _courses(now, body, basis))
        numbers = [each for _, each in courses.values()]
        whitening = _telling(numbers, _whitening(numbers, 2 * basis.directions.shape[1]))
        moments = {name: _moments(each, whitening) for name, (_, each) in courses.items()}
        return cls(moments, whitening, basis, courses)


class _Courses(NamedTuple):
    """The numbers of the recordings of one class, which do not depend on other classes."""

    #: For each recording arrays (moments, 2 × directions), (moments,) and (moments,).
    moving: list[NDArray[np.float64]]
    phases: list[NDArray[np.float64]]
    swings: list[NDArray[np.float64]]
    actors: list[str]
    cyclic: bool


def _courses(clips: Sequence[Clip], body: Body, basis: Basis) -> _Courses:
    """Compute the numbers of a class."""
    points = [points_of(clip, body, basis) for clip in clips]
    moving = [with_velocity(each) for each in points]
    scale = math.sqrt(np.mean([each.var(axis=0).mean() for each in moving])) or 1.0
    actors = [clip.actor for clip in clips]
    phases = agreed_phases([each / scale for each in moving], actors)
    half = basis.directions.shape[1]
    cyclic = _is_cyclic(points, [each[:, half:] for each in moving])
    return _Courses(moving, phases, [_swings(each) for each in points], actors, cyclic)


def points_of(clip: Clip, body: Body, basis: Basis) -> NDArray[np.float64]:
    """Give the points in the basis, relative to the body's size, of a clip's moments, shape (moments, directions)."""
    times = np.arange(round(clip.duration * MOMENTS_PER_SECOND) + 1) / MOMENTS_PER_SECOND
    frames = np.minimum(np.rint(times * clip.frame_rate).astype(int), clip.frames - 1)
    rows = distance_rows(clip.positions[frames], clip.skeleton)
    relative: NDArray[np.float64] = rows @ basis.directions / body.size(rows).mean()
    return relative


def with_velocity(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Append to each point its movement in the last `VELOCITY_SECONDS`, weighted, (moments, 2 × directions).

    The first points have no past: they get the velocity with which the recording begins.
    """
    lag = round(VELOCITY_SECONDS * MOMENTS_PER_SECOND)
    later = np.minimum(np.maximum(np.arange(len(points)), lag), len(points) - 1)
    velocity = points[later] - points[np.maximum(later - lag, 0)]
    return np.hstack([points, VELOCITY * velocity])


def _whitening(courses: Iterable[_Courses], width: int) -> NDArray[np.float64]:
    """Learn how recordings of a class differ at the same phase; a class of one recording is ignored."""
    scatters = []
    for each in courses:
        places = [np.searchsorted(phases, _COMPARED_AT).clip(0, len(phases) - 1) for phases in each.phases]
        compared = np.array([moving[place] for moving, place in zip(each.moving, places, strict=True)])
        deviations = (compared - compared.mean(axis=0)).reshape(-1, width)
        if len(compared) > 1:
            scatters.append(deviations.T @ deviations / len(deviations))
    scatter = np.mean(scatters, axis=0) if scatters else np.eye(width)
    scatter = (1 - _SHRINKAGE) * scatter + _SHRINKAGE * scatter.trace() / width * np.eye(width)
    values, vectors = np.linalg.eigh(scatter)
    whitening: NDArray[np.float64] = vectors / np.sqrt(values)
    return whitening


def _telling(courses: Collection[_Courses], whitening: NDArray[np.float64]) -> NDArray[np.float64]:
    """Keep the axes along which the moments of a class differ most, in the mean of the classes."""
    if not courses:
        return whitening
    spreads = np.mean([(np.concatenate(each.moving) @ whitening).var(axis=0) for each in courses], axis=0)
    kept = np.sort(spreads.argsort()[-_AXES:])
    return np.ascontiguousarray(whitening[:, kept])


def _moments(courses: _Courses, whitening: NDArray[np.float64]) -> Moments:
    """Put the recordings of one class together."""
    lengths = np.array([len(each) for each in courses.moving])
    mean = float(lengths.mean())
    half = len(whitening) // 2
    squares = [(each[:, half:] ** 2).sum(axis=1) * (len(each) / mean) ** 2 for each in courses.moving]
    phases, speeds = np.concatenate(courses.phases), np.concatenate(squares)
    return Moments(
        vectors=np.ascontiguousarray((np.concatenate(courses.moving) @ whitening).T, dtype=np.float32),
        phases=phases,
        starts=np.cumsum([0, *lengths[:-1]]),
        speeds=speeds,
        usual_speeds=_usual(phases, speeds),
        usual_swings=_usual(phases, np.concatenate(courses.swings)),
        seconds=(mean - 1) / MOMENTS_PER_SECOND,
        cyclic=courses.cyclic,
    )


def _usual(phases: NDArray[np.float64], numbers: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give at each moment the mean over all moments at the same phase."""
    bins = np.minimum((phases * BINS).astype(np.intp), BINS - 1)
    means: NDArray[np.float64] = np.bincount(bins, weights=numbers) / np.bincount(bins).clip(1)
    return means[bins]


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
    """Log of the swing over the last second at each moment; at the beginning over the time that has passed."""
    span = round(SWING_SECONDS * MOMENTS_PER_SECOND)
    windows = (points[max(0, end - span) : end + 1] for end in range(len(points)))
    return np.array([log_swing(float(each.var(axis=0).sum())) for each in windows])


def log_swing(variance: float) -> float:
    """Log of the swing of points whose variances in all directions add up to this."""
    return 0.5 * math.log(variance + 1e-6)
