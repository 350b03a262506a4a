"""A child process's start: signals wait, and then they are the parent's business."""

from __future__ import annotations

import multiprocessing
import os
import signal
from typing import TYPE_CHECKING

import pytest

from kinespace.stream.workers.child_process import leave_signals_to_parent, signals_held

if TYPE_CHECKING:
    from collections.abc import Iterator
    from multiprocessing.connection import Connection

pytestmark = pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="this system cannot hold signals back")


def _serve(told: Connection, termination: bool) -> None:  # noqa: FBT001 - of a process
    """Get signals before and after; say what is left of this process."""
    os.kill(os.getpid(), signal.SIGINT)
    leave_signals_to_parent(termination=termination)
    told.send("began")
    os.kill(os.getpid(), signal.SIGHUP)
    os.kill(os.getpid(), signal.SIGTERM)
    told.send("went on")


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
    process.join(10.0)
    assert process.exitcode == (0 if termination else -signal.SIGTERM)
    ours.close()


@pytest.fixture
def interrupts() -> Iterator[None]:
    """Ctrl-C interrupts here, whatever a program that ran before in this process made of it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


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
