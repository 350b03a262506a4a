"""Rows that begin with a cache line: the same numbers, at other places."""

from __future__ import annotations

import numpy as np
import pytest

from kinespace.library.kernels.aligned import aligned, aligned_zeros, numbers_per_row


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("shape", [(1, 1), (3, 8), (5, 465), (2, 16), (0, 7)])
def test_every_row_begins_with_a_cache_line(shape: tuple[int, int], dtype: type) -> None:
    """Each row's first number is at a multiple of 64 bytes, its numbers side by side, all zero."""
    rows = aligned_zeros(*shape, dtype)
    assert rows.shape == shape
    assert rows.dtype == dtype
    assert not rows.any()
    assert all(row.ctypes.data % 64 == 0 and row.flags.c_contiguous for row in rows)


@pytest.mark.parametrize(
    ("width", "dtype", "expected"), [(465, np.float64, 472), (465, np.float32, 480), (8, float, 8)]
)
def test_rows_are_as_long_as_whole_lines(width: int, dtype: type, expected: int) -> None:
    """No more than is needed to fill the last line is added."""
    assert numbers_per_row(width, dtype) == expected


def test_a_copy_is_one() -> None:
    """The copy holds the numbers, and shares nothing with what it was made of."""
    rows = np.random.default_rng(1).random((6, 11)).astype(np.float32)
    copy = aligned(rows)
    assert np.array_equal(copy, rows)
    assert copy.dtype == rows.dtype
    rows[2, 3] += 1.0
    assert copy[2, 3] != rows[2, 3]
