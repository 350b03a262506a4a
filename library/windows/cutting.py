"""Windows cut from whole motions, all windows of a motion at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from kinespace.library.clip import Clip
from kinespace.library.distances import distance_rows
from kinespace.library.signature.basis import Basis
from kinespace.library.signature.body import Body
from kinespace.library.signature.parts import (
    EIGENVECTORS,
    FORMULAS,
    PARTS,
    Eigenpairs,
    Kind,
    Moments,
    Part,
    eigen,
    lengths_of,
)

#: Seconds after which a feed is first answered, and at which a motion's first window ends.
FIRST_WINDOW = 0.15
#: Windows of a motion whose sums are computed together.
_TOGETHER = 8


def window_ends(clip: Clip, every: float, first: float = FIRST_WINDOW) -> NDArray[np.intp]:
    """Say before which frames the windows of a motion end: one window every so many seconds, the last with the motion.

    Parameters
    ----------
    clip
        The motion.
    every, first
        Seconds between two windows, and from the motion's start to the end of the first window.

    Returns
    -------
    Indices of frames, ascending; none when the motion is shorter than the shortest window allowed (`FIRST_WINDOW`).
    """
    earliest = round(min(first, clip.duration) * clip.frame_rate)
    if clip.duration < FIRST_WINDOW or earliest < 2:
        return np.empty(0, dtype=np.intp)
    step = max(1, round(every * clip.frame_rate))
    return np.arange(clip.frames, earliest - 1, -step)[::-1]


class CutWindows:
    """The numbers of some motions' windows.

    Parameters
    ----------
    clips
        The motions, all of one skeleton.
    ends
        For each motion the frames before which its windows end (`window_ends`).
    body, basis
        The body and the basis of the skeleton.
    parts, eigenvectors
        The parts that are wanted, and the eigenvectors of an eigen part.

    Attributes
    ----------
    numbers
        The numbers of each part, (windows, numbers).
    leading
        The leading eigenvector of each of the longest windows in the basis, shape (windows, directions).
    """

    def __init__(  # noqa: PLR0913, PLR0917 - motions, and how windows are read
        self,
        clips: Sequence[Clip],
        ends: Sequence[NDArray[np.intp]],
        body: Body,
        basis: Basis,
        parts: Sequence[Part] = PARTS,
        eigenvectors: int = EIGENVECTORS,
    ) -> None:
        of_distances, in_basis = lengths_of(parts)
        moments: dict[float, list[Moments]] = {seconds: [] for seconds in of_distances}
        pairs: dict[float, list[Eigenpairs]] = {seconds: [] for seconds in in_basis}
        for clip, end in zip(clips, ends, strict=True):
            rows = distance_rows(clip.positions, clip.skeleton)
            for seconds, found in zip(of_distances, _moments(rows, clip.frame_rate, end, of_distances), strict=True):
                moments[seconds].append(found)
            points = rows @ basis.directions
            for seconds, each in pairs.items():
                each.append(eigenpairs_of(window_covariances(points, clip, end, seconds), eigenvectors))
        joined = {each: Moments(*map(np.concatenate, zip(*found, strict=True))) for each, found in moments.items()}
        eigenpairs = {each: Eigenpairs(*map(np.concatenate, zip(*found, strict=True))) for each, found in pairs.items()}
        self.numbers = {
            part: eigen(eigenpairs[part.seconds])
            if part.kind is Kind.EIGEN
            else FORMULAS[part.kind](joined[part.seconds], body)
            for part in parts
        }
        self.leading = eigenpairs[in_basis[-1]].vectors[:, 0]


def eigenpairs_of(covariances: NDArray[np.float64], most: int = EIGENVECTORS) -> Eigenpairs:
    """Find the leading eigenpairs of covariances (windows, directions, directions).

    Raises
    ------
    ValueError
        A covariance holds NaN or infinity.
    """
    if not np.isfinite(covariances).all():
        raise ValueError("covariances: expected finite numbers")
    values, vectors = np.linalg.eigh(covariances)
    return Eigenpairs(values[:, : -most - 1 : -1], vectors.transpose(0, 2, 1)[:, : -most - 1 : -1])


def _moments(
    rows: NDArray[np.float64], frame_rate: float, ends: NDArray[np.intp], lengths: Sequence[float]
) -> list[Moments]:
    """Compute the moments of all windows of one motion, for each length."""
    found = [Moments(*np.empty((3, len(ends), rows.shape[1]))) for _ in lengths]
    if not found:
        return found
    # Windows that end near each other share most of their frames, so their sums are one matrix product.
    for begin in range(0, len(ends), _TOGETHER):
        some = slice(begin, begin + _TOGETHER)
        starts = [_starts(ends[some], frame_rate, seconds) for seconds in lengths]
        first, last = min(int(each.min()) for each in starts), int(ends[some][-1])
        frames = np.arange(first, last)
        reference = rows[first:last].mean(axis=0)
        centred = rows[first:last] - reference
        squared = np.square(centred)
        for each, moments in zip(starts, found, strict=True):
            weights = ((frames >= each[:, None]) & (frames < ends[some, None])).astype(np.float64)
            weights /= weights.sum(axis=1, keepdims=True)
            times = frames / frame_rate - (weights @ frames)[:, None] / frame_rate
            swing = np.sqrt((weights * times**2).sum(axis=1, keepdims=True))
            mean = weights @ centred
            variance = weights @ squared - mean**2
            moments.mean[some] = mean + reference
            np.sqrt(np.maximum(variance, 0.0, out=variance), out=moments.deviation[some])
            np.matmul(weights * times / np.where(swing > 0, swing, np.inf), centred, out=moments.trend[some])
    return found


def window_covariances(
    points: NDArray[np.float64], clip: Clip, ends: NDArray[np.intp], seconds: float
) -> NDArray[np.float64]:
    """Compute the covariances of a motion's windows of one length.

    Parameters
    ----------
    points
        The motion's points in the basis, shape (frames, directions).
    clip
        The motion, for its frame rate.
    ends
        The frames before which the windows end.
    seconds
        Length of the windows.

    Returns
    -------
    Shape (windows, directions, directions).
    """
    starts = _starts(ends, clip.frame_rate, seconds)
    counts = ends - starts
    frames = starts[:, None] + np.arange(counts.max(initial=0))
    inside = frames < ends[:, None]
    windows = points[np.minimum(frames, len(points) - 1)] * inside[:, :, None]
    windows -= (windows.sum(axis=1) / counts[:, None])[:, None]
    windows *= (inside / np.sqrt(counts)[:, None])[:, :, None]
    covariances: NDArray[np.float64] = np.matmul(windows.transpose(0, 2, 1), windows)
    return covariances


def _starts(ends: NDArray[np.intp], frame_rate: float, seconds: float) -> NDArray[np.intp]:
    """Say where windows of so many seconds start."""
    return np.maximum(ends - round(seconds * frame_rate), 0)
