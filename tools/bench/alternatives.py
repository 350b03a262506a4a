"""What a user would take instead: the same feed answered by well-kept libraries, each in its plain way.

All are given what we have for nothing: the window's rows side by side, distances by our own function, the library's
axes compared by one product. What differs is the computation at a hop.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np
from scipy.sparse.linalg import eigsh

from library.distances import DistanceMeasurer
from library.signature import similarity
from stream.recognition import Outcome, Recognition
from stream.window import MOST_PENDING, SlidingWindow

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from library import Clip, MotionLibrary
    from library.skeleton import Skeleton
    from stream.frame import Frame
    from tools.bench.recorded import Feed

#: Rows that incremental PCA is given at once, and components it keeps: as many as frames come in a hop of 1/30 s.
_COMPONENTS = 4
#: Half width of a DTW band, as a share of the window.
_BAND = 0.1


class Alternative(Protocol):
    """Another way to compare the last second with a library."""

    #: What must be installed for it, or nothing.
    needs: ClassVar[str]

    def push(self, frame: Frame) -> None:
        """Take in a frame."""

    def read(self) -> NDArray[np.floating]:
        """Compare the window that ends with the newest frame: a score of each class, higher is nearer, (classes,)."""


class _BestOfClass:
    """Scores of motions to the best of each class."""

    def __init__(self, library: MotionLibrary) -> None:
        self._starts = np.unique(library.class_indices, return_index=True)[1]

    def of(self, scores: NDArray[np.floating]) -> NDArray[np.floating]:
        best: NDArray[np.floating] = np.maximum.reduceat(scores, self._starts)
        return best


class AxisAlternative(ABC):
    """The paper's comparison of leading axes, whoever computes the axis."""

    needs: ClassVar[str] = ""

    def __init__(self, library: MotionLibrary, seconds: float) -> None:
        self._library = library
        self._best = _BestOfClass(library)
        self._window = SlidingWindow(seconds, len(library.skeleton.pairs))
        self._measurer = DistanceMeasurer(library.skeleton, 1)
        self._row = np.empty((1, len(library.skeleton.pairs)))

    def push(self, frame: Frame) -> None:
        """Measure the frame's distances and put them into the window."""
        if self._window.pending >= MOST_PENDING:
            self.learn(self._window.take_change().entered)
        self._measurer.measure(frame.positions[None], self._row)
        self._window.push([frame.time], self._row)

    def learn(self, rows: NDArray[np.float64]) -> None:  # noqa: B027 - most keep no state and have nothing to learn
        """Take in rows that are new, shape (rows, pairs); for those that keep a state."""

    def read(self) -> NDArray[np.floating]:
        """Compare the window's leading axis with every motion's."""
        axis = self.axis().astype(np.float32)
        return self._best.of(similarity(self._library.axes, axis))

    @abstractmethod
    def axis(self) -> NDArray[np.float64]:
        """Give the leading axis, shape (pairs,), unit length."""


class SvdOfWindow(AxisAlternative):
    """The paper's way: the window is centred and its singular value decomposition taken at every hop."""

    def axis(self) -> NDArray[np.float64]:
        """Give the first right singular vector."""
        rows = self._window.rows
        axis: NDArray[np.float64] = np.linalg.svd(rows - rows.mean(axis=0), full_matrices=False)[2][0]
        return axis


class CovarianceAndEigh(AxisAlternative):
    """`np.cov`, then `np.linalg.eigh`."""

    def axis(self) -> NDArray[np.float64]:
        """Give the last eigenvector."""
        axis: NDArray[np.float64] = np.linalg.eigh(np.cov(self._window.rows, rowvar=False))[1][:, -1]
        return axis


class Arpack(AxisAlternative):
    """`np.cov`, then scipy's `eigsh`, started from the last hop's axis."""

    def __init__(self, library: MotionLibrary, seconds: float) -> None:
        super().__init__(library, seconds)
        self._last = np.ones(len(library.skeleton.pairs))

    def axis(self) -> NDArray[np.float64]:
        """Give the eigenvector of the largest eigenvalue."""
        _, vectors = eigsh(np.cov(self._window.rows, rowvar=False), k=1, v0=self._last)
        self._last = vectors[:, 0]
        return self._last


class IncrementalPca(AxisAlternative):
    """scikit-learn's `IncrementalPCA`, given each hop's new rows; it never forgets, so its window is the whole feed.

    Attributes
    ----------
    model
        scikit-learn's.
    """

    needs: ClassVar[str] = "scikit-learn"

    def __init__(self, library: MotionLibrary, seconds: float) -> None:
        from sklearn.decomposition import IncrementalPCA  # noqa: PLC0415 - of the bench extra

        super().__init__(library, seconds)
        self.model: Any = IncrementalPCA(n_components=_COMPONENTS)

    def learn(self, rows: NDArray[np.float64]) -> None:
        """Fit the rows that are new, at least as many as there are components."""
        self.model.partial_fit(rows)

    def axis(self) -> NDArray[np.float64]:
        """Give the first component."""
        if self._window.pending >= _COMPONENTS:
            self.learn(self._window.take_change().entered)
        axis: NDArray[np.float64] = self.model.components_[0]
        return axis


class DynamicTimeWarping:
    """Nearest clip of the same library by dtaidistance's C implementation, on poses in the body's own frame.

    Every clip is brought to the window's number of frames once, as is usual; positions rather than distances, because
    five times fewer numbers make it five times faster.

    Parameters
    ----------
    library
        Whose classes are asked for.
    clips
        What the library was made of.
    frames
        In the window.
    band
        How far a warping path may leave the diagonal, in frames; None for any distance.
    """

    needs: ClassVar[str] = "dtaidistance"

    def __init__(self, library: MotionLibrary, clips: Sequence[Clip], frames: int, band: int | None) -> None:
        from dtaidistance import dtw_ndim  # noqa: PLC0415 - of the bench extra

        self._distance: Callable[..., float] = dtw_ndim.distance
        self._skeleton = library.skeleton
        self._band = band
        ordered = sorted(clips, key=lambda clip: clip.class_name)
        self._templates = [_stretched(poses_in_body_frame(clip.positions, self._skeleton), frames) for clip in ordered]
        self._classes = np.searchsorted(library.classes, [clip.class_name for clip in ordered])
        self._count = len(library.classes)
        self._poses: deque[NDArray[np.float64]] = deque(maxlen=frames)

    def push(self, frame: Frame) -> None:
        """Turn the frame's pose into the body's own frame and keep it."""
        self._poses.append(poses_in_body_frame(frame.positions[None], self._skeleton)[0])

    def read(self) -> NDArray[np.floating]:
        """Compare the window with every clip."""
        window = np.array(self._poses)
        distances = [self._distance(window, each, window=self._band, use_c=True) for each in self._templates]
        nearest = np.full(self._count, np.inf)
        np.minimum.at(nearest, self._classes, distances)
        return 1 / (1 + nearest)


def poses_in_body_frame(positions: NDArray[np.floating], skeleton: Skeleton) -> NDArray[np.float64]:
    """Put the root at the origin and turn the hips to face one way about the vertical (y) axis.

    Parameters
    ----------
    positions
        Shape (frames, joints, 3), metres.
    skeleton
        HDM05's.

    Returns
    -------
    Shape (frames, 3 · joints), metres.
    """
    left, right = (skeleton.joints.index(name) for name in ("lhipjoint", "rhipjoint"))
    centred = np.asarray(positions, dtype=np.float64) - positions[:, :1]
    across = centred[:, right] - centred[:, left]
    length = np.maximum(np.hypot(across[:, 0], across[:, 2]), 1e-9)
    cosine, sine = (across[:, axis, None] / length[:, None] for axis in (0, 2))
    x, y, z = np.moveaxis(centred, -1, 0)
    turned = np.stack([cosine * x + sine * z, y, cosine * z - sine * x], axis=-1)
    return np.ascontiguousarray(turned.reshape(len(turned), -1))


def _stretched(poses: NDArray[np.float64], frames: int) -> NDArray[np.float64]:
    places = np.linspace(0, len(poses) - 1, frames)
    before = np.minimum(places.astype(np.intp), len(poses) - 2)
    share = (places - before)[:, None]
    stretched: NDArray[np.float64] = (1 - share) * poses[before] + share * poses[before + 1]
    return stretched


def makers(
    library: MotionLibrary, clips: Sequence[Clip], *, window: float, frame_rate: float
) -> Mapping[str, tuple[str, Callable[[], Alternative]]]:
    """Give, by name, what each alternative needs installed and how to make one.

    Parameters
    ----------
    library, clips
        The library, and the recordings it was made of.
    window
        Seconds.
    frame_rate
        Of the feed, frames per second.
    """
    frames = round(window * frame_rate)
    axes: dict[str, type[SvdOfWindow | CovarianceAndEigh | Arpack | IncrementalPca]] = {
        "SVD of the window": SvdOfWindow,
        "np.cov + eigh": CovarianceAndEigh,
        "ARPACK eigsh": Arpack,
        "IncrementalPCA": IncrementalPca,
    }
    bands = {"DTW": None, f"DTW, {_BAND:.0%} band": round(_BAND * frames)}

    def of_axis(kind: Callable[[MotionLibrary, float], Alternative]) -> Callable[[], Alternative]:
        return lambda: kind(library, window)

    def of_band(band: int | None) -> Callable[[], Alternative]:
        return lambda: DynamicTimeWarping(library, clips, frames, band)

    return {
        **{name: (kind.needs, of_axis(kind)) for name, kind in axes.items()},
        **{name: (DynamicTimeWarping.needs, of_band(band)) for name, band in bands.items()},
    }


def is_installed(package: str) -> bool:
    """Say whether what an alternative needs can be imported."""
    module = {"scikit-learn": "sklearn"}.get(package, package)
    return not module or find_spec(module) is not None


class AlternativeRecognizer:
    """An alternative asked at every hop, with the recogniser's own way to say what came out.

    Parameters
    ----------
    alternative
        Who is asked.
    classes
        The library's.
    window, hop
        Frames before the first answer, and between two.
    every
        Ask at every so many hops only, when time is short.
    """

    def __init__(
        self, alternative: Alternative, classes: tuple[str, ...], *, window: int, hop: int, every: int = 1
    ) -> None:
        self._alternative = alternative
        self._classes = classes
        self._window = window
        self._hop = hop * every
        self._frames = 0

    def push(self, frame: Frame) -> Recognition | None:
        """Take in a frame; an answer when one is due."""
        self._alternative.push(frame)
        self._frames += 1
        if self._frames <= self._window or (self._frames - self._window - 1) % self._hop:
            return None
        scores = self._alternative.read()
        return Recognition(frame.performer, frame.time, Outcome.NAMED, self._classes, scores, float("nan"))

    def fill(self, feed: Feed) -> None:
        """Take in frames until the next one is answered."""
        while self._frames < self._window or (self._frames - self._window) % self._hop:
            self._alternative.push(feed.next())
            self._frames += 1
