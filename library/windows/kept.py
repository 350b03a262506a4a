"""Basis and metrics kept in a library's file, so that opening the library need not learn them from its motions."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinespace.library.motion_library import MotionLibrary
from kinespace.library.motion_library.learned import TAUGHT, Learned
from kinespace.library.signature.basis import MAX_DIRECTIONS, Basis
from kinespace.library.signature.parts import Kind
from kinespace.library.windows.comparison import (
    ACROSS_LABORATORIES,
    MAX_AXES,
    WITHIN_LABORATORY,
    Comparison,
    Metric,
    Weighing,
)

#: Raised when basis or metrics are learned in another way: numbers of another version are learned again.
_VERSION = 1
#: The weighings whose metrics are kept, by the beginning of their arrays' names.
WEIGHINGS = {"across": ACROSS_LABORATORIES, "within": WITHIN_LABORATORY}
#: The name of the array that identifies the motions that taught.
_BY = f"{TAUGHT}by"
#: The beginning of the names of the basis's arrays.
_BASIS = f"{TAUGHT}basis "


class Kept(NamedTuple):
    """The basis and the comparison that a library's motions taught."""

    basis: Basis
    comparison: Comparison


def kept_of(teacher: MotionLibrary, weighing: Weighing) -> Kept | None:
    """Give the basis and metrics in a library's file; None if it has none for this weighing and these motions.

    Raises
    ------
    ValueError
        The file keeps an array of another shape, or more directions or axes than are ever learned.
    """
    learned = teacher.learned.named if teacher.learned else {}
    name = next((name for name, each in WEIGHINGS.items() if each == weighing), None)
    if name is None or _BY not in learned or not np.array_equal(learned[_BY], _taught_by(teacher)):
        return None
    pairs = len(teacher.skeleton.pairs)
    directions = _array(learned, f"{_BASIS}directions", pairs, MAX_DIRECTIONS)
    weights, share = _array(learned, f"{_BASIS}weights", pairs), _array(learned, f"{_BASIS}share", 1)
    count = directions.shape[1]
    parts = {
        part: _metric(learned, f"{name} {part.name}", count * (count + 1) // 2 if part.kind is Kind.EIGEN else pairs)
        for part in weighing.measured
    }
    groups = tuple(
        _metric(learned, f"{name} group {place}", sum(parts[part].axes.shape[1] for part in group))
        if len(group) > 1
        else None
        for place, group in enumerate(weighing.groups)
    )
    return Kept(Basis.of(directions, weights, float(share[0])), Comparison(weighing, parts, groups))


def with_kept(library: MotionLibrary, basis: Basis, comparisons: Mapping[str, Comparison]) -> MotionLibrary:
    """Give a library that keeps the numbers learned from its motions: the basis, and a comparison by `WEIGHINGS`."""
    learned = dict(library.learned.named) if library.learned else {}
    numbers = {"directions": basis.directions, "weights": basis.weights, "share": np.array([basis.share])}
    learned |= {f"{_BASIS}{name}": array.astype(np.float32) for name, array in numbers.items()}
    for name, comparison in comparisons.items():
        metrics = {f"{name} {part.name}": metric for part, metric in comparison.parts.items()}
        metrics |= {f"{name} group {place}": each for place, each in enumerate(comparison.groups) if each}
        for each, metric in metrics.items():
            learned |= {f"{TAUGHT}{each} origin": metric.origin, f"{TAUGHT}{each} axes": metric.axes}
    return replace(library, learned=Learned(learned | {_BY: _taught_by(library)}))


def _metric(learned: Mapping[str, NDArray[np.float32]], name: str, numbers: int) -> Metric:
    begin = f"{TAUGHT}{name}"
    return Metric(_array(learned, f"{begin} origin", numbers), _array(learned, f"{begin} axes", numbers, MAX_AXES))


def _array(
    learned: Mapping[str, NDArray[np.float32]], name: str, rows: int, most: int | None = None
) -> NDArray[np.float32]:
    """Give an array of shape (rows,), or with up to so many columns."""
    array = learned.get(name)
    shape = () if array is None else array.shape
    fits = shape == (rows,) if most is None else len(shape) == 2 and shape[0] == rows and 1 <= shape[1] <= most
    if array is None or not fits:
        expected = f"({rows},)" if most is None else f"({rows}, at most {most})"
        raise ValueError(f"{name}: expected {expected} numbers, got {shape or 'none'}")
    return array


def _taught_by(library: MotionLibrary) -> NDArray[np.float32]:
    """Identify the motions that taught, by numbers that single precision holds exactly."""
    described = [library.skeleton.joints, *((each.class_name, each.actor, each.frame_rate) for each in library.motions)]
    checksum = zlib.crc32(repr(described).encode())
    for motion in library.motions:
        # A file holds millimetres.
        checksum = zlib.crc32(np.round(motion.positions.astype(np.float64), 3).tobytes(), checksum)
    return np.array([_VERSION, len(library.motions), checksum >> 16, checksum & 0xFFFF], dtype=np.float32)
