"""Work that rests while other threads are busy."""

from __future__ import annotations

import sys

import pytest

from kinespace.stream.service.yielding import BUSY, PIECE, REST, yielding


class FakeCore:
    """A core whose time goes on by half a piece at each look; other threads use a share of it."""

    def __init__(self, share: float) -> None:
        self.now, self.used, self.share = 0.0, 0.0, share
        self.rests: list[float] = []

    def clock(self) -> float:
        """Give the time."""
        self.now += PIECE / 2
        self.used += self.share * PIECE / 2
        return self.now

    def others(self) -> float:
        """Give the other threads' seconds."""
        return self.used


def _called() -> None:
    """Be a function that is called."""


@pytest.mark.parametrize(("share", "rests"), [(0.0, False), (BUSY - 0.1, False), (BUSY + 0.1, True), (1.0, True)])
def test_a_thread_rests_only_while_others_are_busy(share: float, *, rests: bool) -> None:
    """A thread goes on while the others are idle, and rests after a piece of time in which they were not."""
    core = FakeCore(share)
    before = sys.getprofile()
    with yielding(core.clock, core.others, core.rests.append):
        for _ in range(20):
            _called()
    assert bool(core.rests) is rests
    assert set(core.rests) <= {REST}
    assert len(core.rests) <= core.now / PIECE
    assert sys.getprofile() is before


def test_the_profiler_comes_back_after_an_error() -> None:
    """An error in the block leaves the thread as it was."""
    before = sys.getprofile()
    with pytest.raises(ValueError, match="broken"), yielding():
        raise ValueError("broken")
    assert sys.getprofile() is before
