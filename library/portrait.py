"""What a library keeps of a class so that it can be shown: a mean posture and the few ways in which it swings.

A library keeps no recording. A portrait is the mean row of one second of a motion and its leading principal axes; each
axis swings as one sine, of the strength the axis has and the harmonic of that second that is strongest along it. It
moves like the motion and looks like nobody. Positions with these distances are found by `library.embedding`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from library.distances import distance_rows
from library.embedding import embedded
from library.measures import measured
from library.metric import halved

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from library.clip import Clip
    from library.skeleton import Skeleton
    from library.windowtable import WindowTable

#: Length of the stretch that is portrayed, seconds.
_STRETCH = 1.0
#: Principal axes that are kept, and the highest harmonic that an axis swings in.
AXES, _HARMONICS = 4, 3
#: Stretches of a class that are tried, at most.
_TRIED = 24
#: When tried: frames per second, and the frames at whose ends the portrait is compared.
_TRIED_RATE = 60.0
_TRIED_ENDS = (120, 130, 140, 150)
#: Metres a second that no joint of a body moves at, and the frames per second at which a flip is faster than that.
_FASTEST, _LOOKED_AT_RATE = 15.0, 240.0
_TURN = 2 * np.pi


@dataclass(frozen=True, slots=True, eq=False)
class Portrait:
    """One second of a motion, as its mean row and a few swinging axes.

    Attributes
    ----------
    mean
        Shape (pairs,), metres.
    axes
        Each axis times its amplitude, shape (4, pairs), metres.
    harmonics
        How often each axis swings in the time of one cycle, shape (4,).
    phases
        Turns by which each axis is ahead, shape (4,), 0 to 1.

    Raises
    ------
    ValueError
        Shapes do not fit, or a number is not finite.
    """

    mean: NDArray[np.float32] = field(repr=False)
    axes: NDArray[np.float32] = field(repr=False)
    harmonics: NDArray[np.float32]
    phases: NDArray[np.float32]

    def __post_init__(self) -> None:
        shapes = [part.shape for part in (self.mean, self.axes, self.harmonics, self.phases)]
        if shapes != [(pairs := len(self.mean),), (AXES, pairs), (AXES,), (AXES,)]:
            raise ValueError(f"portrait: expected (pairs,), ({AXES}, pairs), ({AXES},) and ({AXES},), got {shapes}")
        if not all(np.isfinite(part).all() for part in (self.mean, self.axes, self.harmonics, self.phases)):
            raise ValueError("portrait: expected finite numbers, got NaN or infinity")

    @classmethod
    def of_rows(cls, rows: NDArray[np.float64]) -> Portrait:
        """Portray a stretch of distance rows, shape (frames, pairs), metres; axes there are not are 0."""
        mean = rows.mean(axis=0)
        _, strengths, axes = np.linalg.svd(rows - mean, full_matrices=False)
        kept = np.zeros((AXES, rows.shape[1]))
        kept[: len(axes)] = (strengths[:, None] * axes)[:AXES]
        courses = np.fft.rfft((rows - mean) @ kept.T, n=max(len(rows), 2 * _HARMONICS), axis=0)[1 : _HARMONICS + 1]
        strongest = np.abs(courses).argmax(axis=0)
        turns = np.angle(courses[strongest, np.arange(AXES)]) / _TURN
        # A sine's variance is half its amplitude's square.
        return cls(
            mean=halved(mean),
            axes=halved(kept * np.sqrt(2 / max(len(rows) - 1, 1))),
            harmonics=halved(strongest + 1.0),
            phases=halved(turns % 1.0),
        )

    def restricted_to(self, pairs: NDArray[np.intp]) -> Portrait:
        """Give what is seen of it by some of its pairs, shape (fewer pairs,)."""
        return Portrait(self.mean[pairs], self.axes[:, pairs], self.harmonics, self.phases)

    def rows(self, cycles: NDArray[np.float64]) -> NDArray[np.float64]:
        """Let it move: distance rows, shape (frames, pairs), metres, never below 0, at so many cycles, (frames,)."""
        swings = np.cos(_TURN * (np.outer(cycles, self.harmonics) + self.phases))
        rows: NDArray[np.float64] = np.maximum(self.mean + swings @ self.axes, 0.0)
        return rows


def portraits_of(clips: Sequence[Clip], table: WindowTable) -> tuple[Portrait, ...]:
    """Portray each class of a library, by the stretch whose portrait is clearest nearest to its own class.

    Portraits in space in which a joint flips over to the other side of its neighbours come last.

    Parameters
    ----------
    clips
        The library's.
    table
        Its windows.

    Returns
    -------
    One for each class, in the order of class names.
    """
    skeleton = clips[0].skeleton
    portraits = []
    for index, class_name in enumerate(sorted({clip.class_name for clip in clips})):
        stretches = [stretch for clip in clips if clip.class_name == class_name for stretch in _stretches(clip)]
        tried = stretches[:: -(-len(stretches) // _TRIED)]
        candidates = [Portrait.of_rows(stretch) for stretch in tried]
        unlike = [_unlike(each, index, skeleton, table) for each in candidates]
        clearest = sorted(range(len(candidates)), key=unlike.__getitem__)
        steady = (each for each in clearest if _fastest(candidates[each], skeleton) < _FASTEST)
        portraits.append(candidates[next(steady, clearest[0])])
    return tuple(portraits)


def _stretches(clip: Clip) -> list[NDArray[np.float64]]:
    """Cut a clip's distance rows into stretches that overlap by half; a clip too short for two is one."""
    rows = distance_rows(clip.positions, clip.skeleton)
    length = max(round(_STRETCH * clip.frame_rate), 2)
    starts = range(0, max(len(rows) - length, 0) + 1, max(length // 2, 1))
    return [rows[start : start + length] for start in starts]


def _fastest(portrait: Portrait, skeleton: Skeleton) -> float:
    """Say how fast any joint of a moving portrait ever is, metres a second."""
    positions = embedded(portrait.rows(np.arange(0.0, 1.0, 1 / _LOOKED_AT_RATE) / _STRETCH), skeleton)
    return float(np.linalg.norm(np.diff(positions, axis=0), axis=-1).max()) * _LOOKED_AT_RATE


def _unlike(portrait: Portrait, index: int, skeleton: Skeleton, table: WindowTable) -> float:
    """Say how far a moving portrait is from its class, and how little farther from the nearest other."""
    cycles = np.arange(_TRIED_ENDS[-1]) / _TRIED_RATE / _STRETCH
    rows = distance_rows(embedded(portrait.rows(cycles), skeleton), skeleton)
    ends = np.array(_TRIED_ENDS)
    measures = {
        measure: measured(rows, _TRIED_RATE, ends, measure, body=table.comparison.body, basis=table.comparison.basis)
        for measure in table.measures
    }
    distances = np.array(
        [table.log_distances({measure: each[k] for measure, each in measures.items()}) for k in range(len(ends))]
    )
    own = distances[:, index]
    others = np.delete(distances, index, axis=1)
    return float((2 * own - others.min(axis=1) if others.size else own).max())
