"""Rows that begin with a cache line."""

from __future__ import annotations

import numpy as np
import pytest

from kinespace.library.kernels.aligned import numbers_per_row


@pytest.mark.parametrize(
    ("width", "dtype", "expected"), [(465, np.float64, 472), (465, np.float32, 480), (8, float, 8)]
)
def test_rows_are_as_long_as_whole_lines(width: int, dtype: type, expected: int) -> None:
    """No more than is needed to fill the last line is added."""
    assert numbers_per_row(width, dtype) == expected
