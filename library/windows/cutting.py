"""Windows cut from whole motions, all windows of a motion at once, and mapped to the vectors that are compared."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinespace.library.clip import Clip
from kinespace.library.distances import distance_rows
from kinespace.library.motion_library import MotionLibrary
from kinespace.library.signature.basis import Basis
from kinespace.library.signature.body import Body
from kinespace.library.signature.parts import FORMULAS, Kind, Moments, Part, eigen, lengths_of
from kinespace.library.windows.comparison import FIRST_WINDOW, Comparison, Weighing

#: Seconds between two windows that are kept of a motion in a library of one person.
_EVERY_ONE = 0.1
#: The same in a library of several persons.
EVERY_SEVERAL = 0.4
#: Frames per second of the motions when their windows are computed.
_MEASURED_AT = 30.0
#: Windows whose numbers are in memory at once, about.
_PIECE = 4_000
#: Seconds of another motion before a motion, as long as the longest window (`Measured.behind_others`).
_BEHIND = 2.0
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


#: The numbers of each part, (windows, numbers), and the leading eigenvectors of the longest windows in the basis,
#: (windows, directions).
Cut = tuple[dict[Part, NDArray[np.float64]], NDArray[np.float64]]


def cut_windows(
    clips: Sequence[Clip], ends: Sequence[NDArray[np.intp]], body: Body, basis: Basis, weighing: Weighing
) -> Cut:
    """Compute the numbers of some motions' windows.

    Parameters
    ----------
    clips
        The motions, all of one skeleton.
    ends
        For each motion the frames before which its windows end (`window_ends`).
    body, basis
        The body and the basis of the skeleton.
    weighing
        Says which parts are wanted, with how many eigenvectors.
    """
    of_distances, in_basis = lengths_of(weighing.parts)
    found = {seconds: list[Moments]() for seconds in of_distances}
    pairs = {seconds: list[_Eigenpairs]() for seconds in in_basis}
    for clip, end in zip(clips, ends, strict=True):
        rows = distance_rows(clip.positions, clip.skeleton)
        for own, each in zip(found.values(), _moments(rows, clip.frame_rate, end, of_distances), strict=True):
            own.append(each)
        points = rows @ basis.directions
        for seconds, others in pairs.items():
            others.append(_eigenpairs(window_covariances(points, clip, end, seconds), weighing.eigenvectors))
    moments = {seconds: Moments(*map(np.concatenate, zip(*each, strict=True))) for seconds, each in found.items()}
    eigenpairs = {seconds: [*map(np.concatenate, zip(*each, strict=True))] for seconds, each in pairs.items()}
    numbers = {
        part: eigen(*eigenpairs[part.seconds])
        if part.kind is Kind.EIGEN
        else FORMULAS[part.kind](moments[part.seconds], body)
        for part in weighing.parts
    }
    return numbers, eigenpairs[in_basis[-1]][1][:, 0]


#: Eigenvalues (windows, k) and eigenvectors (windows, k, directions).
_Eigenpairs = tuple[NDArray[np.float64], NDArray[np.float64]]


def _eigenpairs(covariances: NDArray[np.float64], most: int) -> _Eigenpairs:
    """Find the leading eigenvalues and eigenvectors of covariances (windows, directions, directions), all finite."""
    values, vectors = np.linalg.eigh(covariances)
    return values[:, : -most - 1 : -1], vectors.transpose(0, 2, 1)[:, : -most - 1 : -1]


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


# --- a library's motions ----------------------------------------------------------------------------------------------


def every_in(library: MotionLibrary) -> float:
    """Give the seconds between two windows that are kept of a motion."""
    return EVERY_SEVERAL if len(library.actors) > 1 else _EVERY_ONE


class Measured(NamedTuple):
    """The motions of a library, cut into windows.

    Attributes
    ----------
    clips
        The motions at the frame rate of the computation.
    ends
        For each motion the frames before which its windows end.
    """

    clips: list[Clip]
    ends: list[NDArray[np.intp]]

    @classmethod
    def of(cls, library: MotionLibrary, every: float, first: float = FIRST_WINDOW) -> "Measured":
        """Cut a library's motions into windows.

        Parameters
        ----------
        library
            The motions.
        every, first
            Seconds between two windows, and from a motion's start to the end of its first window.

        Raises
        ------
        ValueError
            No motion is long enough for a window.
        """
        clips = [thinned(clip, _MEASURED_AT) for clip in library.motions]
        measured = cls(clips, [window_ends(clip, every, first) for clip in clips])
        if not len(measured.motions):
            raise ValueError("library: expected a motion long enough for a window, got none")
        return measured

    @property
    def motions(self) -> NDArray[np.intp]:
        """The index of each window's motion, shape (windows,)."""
        return np.repeat(np.arange(len(self.clips)), [*map(len, self.ends)])

    def thinned(self, most: int) -> "Measured":
        """Keep at most so many windows, evenly spread."""
        counts = [*map(len, self.ends)]
        kept = np.arange(sum(counts)) % -(-sum(counts) // most) == 0
        of_motions = np.split(kept, np.cumsum(counts)[:-1])
        return Measured(self.clips, [each[some] for each, some in zip(self.ends, of_motions, strict=True)])

    def behind_others(self) -> "Measured":
        """Give the same windows as if each motion was played right behind another motion of the same person."""
        clips, ends, before = [*self.clips], [*self.ends], dict[tuple[str, float], "NDArray[np.floating]"]()
        for place in np.random.default_rng(0).permutation(len(clips)).tolist():
            clip, own = self.clips[place], self.ends[place]
            most, key = round(_BEHIND * clip.frame_rate), (clip.actor, clip.frame_rate)
            # Distances are cut, so the body may stand elsewhere.
            last = before.get(key, clip.positions)[-most:]
            clips[place] = replace(clip, positions=np.concatenate([last, clip.positions]))
            # Later windows hold nothing of the other motion.
            ends[place] = own[own <= most] + len(last)
            before[key] = clip.positions
        return Measured(clips, ends)

    def cut(self, weighing: Weighing, body: Body, basis: Basis) -> Iterator[Cut]:
        """Compute the windows' numbers, some motions at a time, because they take much memory."""
        begin = 0
        pieces_of = np.cumsum([0, *map(len, self.ends)]) // _PIECE
        # With the last motion a piece may be full.
        for end in sorted({*(np.flatnonzero(np.diff(pieces_of)) + 1), len(self.clips)}):
            yield cut_windows(self.clips[begin:end], self.ends[begin:end], body, basis, weighing)
            begin = end


def placed(
    comparison: Comparison, windows: Iterable[Cut]
) -> tuple[tuple[NDArray[np.float16], ...], NDArray[np.float32]]:
    """Give windows' vectors, and their leading eigenvectors, as `WindowIndex` keeps them."""
    pieces = []
    for numbers, leading in windows:
        joined = comparison.joined(numbers, comparison.placed(numbers))
        vectors = (each.astype(np.float16, order="C") for each in joined)
        pieces.append((leading.astype(np.float32), *vectors))
    eigenvectors, *of_groups = map(np.concatenate, zip(*pieces, strict=True))
    return tuple(of_groups), eigenvectors


def thinned(clip: Clip, frame_rate: float) -> Clip:
    """Give a clip with every so many frames alone, that it has about so many a second."""
    step = max(1, round(clip.frame_rate / frame_rate))
    return replace(clip, positions=clip.positions[::step], frame_rate=clip.frame_rate / step)
