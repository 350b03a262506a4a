"""Threads and processes of our own: windows that a thread opens, and children that survive their parent's signals."""

import multiprocessing
import os
import signal
from collections.abc import Iterator
from multiprocessing.connection import Connection

import pytest

from kinespace.library import MotionLibrary, WindowIndex
from kinespace.library.windows.index import MAX_VIEWS
from kinespace.stream import BackgroundViews
from kinespace.stream.service.background import leave_signals_to_parent, signals_held

# --- background opener ------------------------------------------------------------------------------------------------


def _wait(views: BackgroundViews) -> None:
    thread = views._thread  # noqa: SLF001 - the test waits for the thread instead of asking again and again
    assert thread is not None
    thread.join()


def test_windows_are_given_once_they_are_open(sticks: MotionLibrary) -> None:
    """Windows that were asked for are not ready at first; then they are the index's."""
    views, index, joints = BackgroundViews(), WindowIndex.of(sticks), sticks.skeleton.joints[:5]
    assert views(index, joints) is None
    _wait(views)
    assert views(index, joints) is index.by_joints(joints)
    assert index.by_joints(joints).library.skeleton.joints == joints


def test_joints_that_cannot_be_compared_are_not_tried_again(sticks: MotionLibrary) -> None:
    """The reason is raised each time, and no second thread is started, until so many others were refused."""
    views, index, joints = BackgroundViews(), WindowIndex.of(sticks), sticks.skeleton.joints
    assert views(index, joints[:3]) is None
    _wait(views)
    tried = views._thread  # noqa: SLF001 - the test compares threads
    for _ in range(2):
        with pytest.raises(ValueError, match="expected at least 5"):
            views(index, joints[:3])
    assert views._thread is tried  # noqa: SLF001 - as above
    for place in range(MAX_VIEWS):
        assert views(index, (f"joint {place}",)) is None
        _wait(views)
    assert views(index, joints[:3]) is None
    _wait(views)


# --- child process ----------------------------------------------------------------------------------------------------


def _serve(told: Connection, termination: bool) -> None:  # noqa: FBT001 - of a process
    """Get signals before and after; say what is left of this process."""
    os.kill(os.getpid(), signal.SIGINT)
    leave_signals_to_parent(termination=termination)
    told.send("began")
    os.kill(os.getpid(), signal.SIGHUP)
    os.kill(os.getpid(), signal.SIGTERM)
    told.send("went on")


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="this system cannot hold signals back")
@pytest.mark.parametrize("termination", [True, False])
def test_a_child_survives_signals_that_are_its_parents(termination: bool) -> None:  # noqa: FBT001 - a case
    """A signal that comes before the child can heed it waits; SIGTERM ends the child unless it ignores that, too."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(theirs, termination), daemon=True)
    with signals_held():
        process.start()
    theirs.close()
    assert ours.recv() == "began"
    if termination:
        assert ours.recv() == "went on"
    process.join()
    assert process.exitcode == (0 if termination else -signal.SIGTERM)
    ours.close()


@pytest.fixture
def interrupts() -> Iterator[None]:
    """Ctrl-C interrupts here, whatever a program that ran before in this process made of it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="this system cannot hold signals back")
@pytest.mark.usefixtures("interrupts")
def test_an_interrupt_waits_until_the_start_is_done() -> None:
    """It comes at the end of the block, and later ones come at once."""
    done = []

    def start() -> None:
        with signals_held():
            signal.raise_signal(signal.SIGINT)
            done.append("started")

    with pytest.raises(KeyboardInterrupt):
        start()
    assert done == ["started"]
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)
