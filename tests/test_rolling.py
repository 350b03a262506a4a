"""What all that follows a window has in common: counted rows, nothing taken in that does not add up."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from stream.covariance import RollingCovariance
from stream.gram import RollingGram
from stream.variance import RollingVariance

if TYPE_CHECKING:
    from stream.rolling import Rolling

ALL = pytest.mark.parametrize("kind", [RollingCovariance, RollingVariance, RollingGram])
ROWS = 1.0 + 0.1 * np.random.default_rng(8).normal(size=(60, 6))


@ALL
def test_rows_are_counted(kind: type[Rolling]) -> None:
    """As many rows are counted as entered and did not leave, and none after a clear."""
    rolling = kind(6)
    for begin, end, before, after in ((0, 10, 0, 0), (0, 25, 0, 10), (5, 25, 0, 25), (20, 40, 5, 25), (40, 40, 20, 40)):
        rolling.update(ROWS[max(after, begin) : end], ROWS[before : min(begin, after)], ROWS[begin:end])
        assert len(rolling) == end - begin
    rolling.update(ROWS[:9], ROWS[:0], ROWS[:9])
    rolling.clear()
    assert len(rolling) == 0


@ALL
def test_only_rows_all_new_are_computed_afresh(kind: type[Rolling]) -> None:
    """The first rows and those after a clear are computed from the window alone, others from what changed."""
    rolling, counted = kind(6), []
    for end in (10, 12, 30, 31):
        rolling.update(ROWS[len(rolling) : end], ROWS[:0], ROWS[:end])
        counted.append(rolling.refreshes)
    rolling.clear()
    rolling.update(ROWS[:5], ROWS[:0], ROWS[:5])
    rolling.update(ROWS[50:], ROWS[:5], ROWS[50:])
    assert [*counted, rolling.refreshes] == [1, 1, 1, 1, 3]


@ALL
@pytest.mark.parametrize("window", [0, 9, 11])
def test_a_window_of_other_rows_is_refused(kind: type[Rolling], window: int) -> None:
    """A window that does not hold what was added and not removed is the caller's mistake, and nothing is taken in."""
    rolling = kind(6)
    rolling.update(ROWS[:8], ROWS[:0], ROWS[:8])
    with pytest.raises(ValueError, match=f"window: expected 10 rows, got {window}"):
        rolling.update(ROWS[8:12], ROWS[:2], ROWS[:window])
    assert len(rolling) == 8
    rolling.update(ROWS[8:12], ROWS[:2], ROWS[2:12])
    assert len(rolling) == 10
