"""A service in a process of its own ends with the block that began it."""

import multiprocessing

import pytest

from kinespace.tools.feeding.service import BackgroundService

pytestmark = pytest.mark.slow


def test_an_error_in_the_process_is_raised_here() -> None:
    """An error in the other process is raised in this one, and no process or socket stays behind."""
    with (
        pytest.raises(ChildProcessError, match="most: expected 1 to 10000 performers, got 0"),
        BackgroundService("osc", performers=0),
    ):
        pytest.fail("started without room for anybody")
    assert multiprocessing.active_children() == []


def test_an_error_inside_the_block_stops_the_child() -> None:
    """A program that fails while the service runs takes it down with it."""
    with pytest.raises(RuntimeError, match="ours"), BackgroundService("osc"):
        raise RuntimeError("ours")
    assert multiprocessing.active_children() == []
