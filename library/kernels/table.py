"""The kernels: the arrays and numbers of each, and the check of a call's arguments.

A kernel's arrays are written as `name:shape`, with a letter or digit for each dimension; a letter that stands again
means the same length. Then come a point and the type, if it is not float64 (`i` index, `H` uint16, `e` half, `f`
float32), `<` and a letter where the indices must be below that length (`<=` where they may also be its end), `_` where
there may be room between rows, and `!` where the kernel writes. Numbers are named: constants are given when the kernel
is bound, the others at each call, and may be as large as the length of the letter behind `<`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

#: Windows that the comparison takes at once: a library's windows are laid out in lanes of so many.
LANE = 64
#: Vectors that `read_eigen` takes over from one window to the next.
BLOCK = 8
#: Numbers that `follow_phase` needs in addition to those of the moments: a register of floats.
REGISTER = 16
#: A number without a limit of its own.
_UNLIMITED = 1e15
_ARRAY = re.compile(r"(\w+):([a-z0-9]+)(?:\.([iHef]))?(?:<(=?)(\w))?(_?)(!?)$")
_DTYPES: dict[str | None, np.dtype[np.generic]] = {each: np.dtype(each or "d") for each in (None, *"Hef")}
_DTYPES["i"] = np.dtype(np.intp)


@dataclass(frozen=True, slots=True)
class _Array:
    name: str
    shape: str
    dtype: np.dtype[np.generic]
    below: str
    is_reached: bool
    room: bool
    written: bool

    @classmethod
    def of(cls, text: str) -> Self:
        name, shape, kind, reached, below, room, written = _ARRAY.fullmatch(text).groups()  # type: ignore[union-attr]
        return cls(name, shape, _DTYPES[kind], below or "", bool(reached), bool(room), bool(written))

    def check(self, array: NDArray[np.generic], lengths: dict[str, int]) -> None:
        """Check one array against the lengths of the arrays before it, and add its own."""
        if array.dtype != self.dtype or array.ndim != len(self.shape):
            expected = f"{len(self.shape)} dimensions of {self.dtype}"
            raise ValueError(f"{self.name}: expected {expected}, got {array.ndim} of {array.dtype}")
        for letter, length in zip(self.shape, array.shape, strict=True):
            expected_length = int(letter) if letter.isdigit() else lengths.setdefault(letter, length)
            if length != expected_length:
                raise ValueError(f"{self.name}: expected {expected_length}, got {length}")
        rows = array[0] if self.room and len(array) else array
        if not rows.flags.c_contiguous or (self.room and array.strides[0] % array.itemsize):
            raise ValueError(f"{self.name}: expected numbers side by side, got strides {array.strides}")
        if not array.flags.aligned or (self.written and not array.flags.writeable):
            raise ValueError(f"{self.name}: expected {'writable' if self.written else 'aligned'} memory")
        end = max(lengths[self.below], 1) + self.is_reached if self.below else 0
        if self.below and array.size and not 0 <= int(array.min()) <= int(array.max()) < end:
            raise ValueError(f"{self.name}: expected indices below {end}, got {array.max()}")


@dataclass(frozen=True, slots=True)
class Kernel:
    """The arguments of a kernel.

    Attributes
    ----------
    arrays
        Its arrays, in their order.
    constants
        The names of the numbers that are given when it is bound.
    numbers
        For each number of a call the letter of the length that it may not exceed; empty for no limit.
    """

    arrays: tuple[_Array, ...]
    constants: tuple[str, ...]
    numbers: tuple[str, ...]

    @classmethod
    def of(cls, arrays: str, constants: str = "", numbers: str = "") -> Self:
        """Read the table's text."""
        limits = (each.partition("<")[2] for each in numbers.split())
        return cls(tuple(map(_Array.of, arrays.split())), tuple(constants.split()), tuple(limits))

    def lengths(self, arrays: Sequence[NDArray[np.generic]]) -> dict[str, int]:
        """Check arrays, and give their lengths by letter; then by name from one row to the next, where there is room.

        Raises
        ------
        ValueError
            An array has another type, shape or layout, holds an index out of range, or shares memory that is written.
        """
        if len(arrays) != len(self.arrays):
            raise ValueError(f"arrays: expected {len(self.arrays)}, got {len(arrays)}")
        lengths: dict[str, int] = {}
        for described, array in zip(self.arrays, arrays, strict=True):
            described.check(array, lengths)
        for described, array in zip(self.arrays, arrays, strict=True):
            if described.written and any(np.may_share_memory(array, each) for each in arrays if each is not array):
                raise ValueError(f"{described.name}: expected memory that is in no other array")
            if described.room:
                lengths[described.name] = array.strides[0] // array.itemsize
        return lengths

    def most(self, lengths: dict[str, int]) -> tuple[float, ...]:
        """Give the largest value of each number of a call."""
        return tuple(float(lengths[letter]) if letter else _UNLIMITED for letter in self.numbers)


_SUMS = "seconds most tolerance no_movement", "end<n moved"
#: Every kernel. `j` stands for joints and `d` for directions: larger bodies and bases are left to numpy.
KERNELS = {
    "distances": Kernel.of("positions:fj3 pairs:p2.i<j rows:fp_!", numbers="frames<f"),
    "follow": Kernel.of("rows:nw_ times:n places:2.i! drift:2! sums:4w! clock:3!", *_SUMS),
    "follow_products": Kernel.of("points:nd_ times:n places:2.i! drift:2! sums:2d! products:dd!", *_SUMS),
    "read_parts": Kernel.of(
        "sums:4w clock:3 places:2.i sizing:w segments:s.i<w above:sj ends:3w.H<j spread:w! posture:p! trend:t!",
        "floor level",
    ),
    "read_eigen": Kernel.of("sums:2d products:dd places:2.i drift:2 values:k! vectors:kd! scaled:kd! block:d8!"),
    "eigenpairs": Kernel.of("covariances:mdd values:mk! vectors:mkd!"),
    "place": Kernel.of("numbers:n origin:n.f axes:na.e vector:k!"),
    "compare": Kernel.of(
        "groups:g4.i windows:h.e lengths:gl.f weights:vg.f blocks:b.i<=l classes:c.i<b vectors:n products:vl.f! "
        "logs:vk! named:k!",
        "nearest by_products naming",
    ),
    "scores": Kernel.of("windows:adw.f products:p.f! starts:c.i<=p eigenvector:d scores:k!"),
    "follow_phase": Kernel.of(
        "course:4n indices:2n.i starts:r.i<n vectors:an.f lengths:n.f expected:kn constants:8 live:a.f belief:n! "
        "after:n! room:m.f! found:t!"
    ),
    "moving": Kernel.of("points:pd_ whitening:wa live:a.f! found:2!", "factor", "begin<p end<p back"),
    "steps": Kernel.of("positions:fj3 last:j3 steps:fj3! farthest:1!", numbers="frames<f"),
}
