"""Memory: rows that begin where a line of the processor's cache begins, and memory given back to the system."""

from __future__ import annotations

import ctypes
import sys
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import DTypeLike

#: Bytes of a cache line.
_LINE = 64


def numbers_per_row(width: int, dtype: DTypeLike = np.float64) -> int:
    """Say how many numbers lie from the beginning of a row to the beginning of the next row.

    Parameters
    ----------
    width
        Numbers in a row.
    dtype
        Of a number: its size divides 64 bytes.
    """
    line = _LINE // np.dtype(dtype).itemsize
    return -(-width // line) * line


def give_back_memory() -> None:
    """Give free memory back to the system; glibc's allocator keeps it otherwise."""
    if sys.platform == "linux":
        # Other C libraries than glibc have no such function.
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(0)
