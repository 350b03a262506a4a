"""Processes and threads of our own: they start, answer as one process does, and are replaced."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import time
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from synthetic import STICK_CLASSES, stick_clip

from kinespace.library.windows.index import MAX_VIEWS, WindowIndex, opened
from kinespace.stream.frame import Frame
from kinespace.stream.recognition import Recognition
from kinespace.stream.recognizer import Performers, Settings
from kinespace.stream.workers import local
from kinespace.stream.workers.background_opener import BackgroundViews
from kinespace.stream.workers.child_process import leave_signals_to_parent, signals_held
from kinespace.stream.workers.terms import Terms

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from multiprocessing.connection import Connection

    from kinespace.library.motion_library import MotionLibrary


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
    process.join(10.0)
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


# --- local workers ----------------------------------------------------------------------------------------------------


pytest.importorskip("zenoh")
RATE, PATIENCE = 60, 60.0
NAMES = ("ann", "bob", "cleo", "dan")


class Fed:
    """A gateway with workers of its own, the feed, and the answers of one process."""

    def __init__(self, library: MotionLibrary, gateway: local.LocalGateway) -> None:
        self.gateway, self._one = gateway, Performers(opened(library))
        clips = [stick_clip(name, seed=80, frames=4 * RATE).positions[::2] for name in STICK_CLASSES]
        self._moments = [
            [Frame(name, 1 + k / RATE, each) for name in NAMES]
            for k, each in enumerate(p for clip in clips for p in clip)
        ]
        self.heard, self.expected = list[Recognition](), list[Recognition]()

    def play(self, count: int) -> None:
        """Send some moments' frames."""
        for frames in [self._moments.pop(0) for _ in range(count)]:
            self.gateway.push_all(frames, time.monotonic())
            self.expected += [each for each in self._one.push_all(frames, frames[0].time) if each]
            self.read()

    def read(self) -> None:
        """Look after the workers, and take their answers."""
        self.gateway.source.tend(time.monotonic())
        while (taken := self.gateway.source.take(time.monotonic())) is not None:
            self.heard += [each for each in self.gateway.push_all(taken, time.monotonic()) if each]

    def until(self, reached: Callable[[], bool]) -> None:
        """Read until something is reached."""
        end = time.monotonic() + PATIENCE
        while not reached():
            assert time.monotonic() < end, (self.gateway.notes, len(self.heard), len(self.expected))
            self.read()
            time.sleep(0.001)

    @property
    def events(self) -> list[list[tuple[str, str]]]:
        """The events that came, and those of one process, by performer."""
        return [
            sorted((event.performer, event.kind, event.label) for each in answers for event in each.events)
            for answers in (self.heard, self.expected)
        ]


def process_ids(gateway: local.LocalGateway) -> dict[str, int]:
    """Give the number of each worker's process."""
    return {name: each.process.pid for name, each in gateway._workers.items()}  # noqa: SLF001 - who is killed


@pytest.mark.slow
def test_processes_answer_and_are_replaced(sticks: MotionLibrary, monkeypatch: pytest.MonkeyPatch) -> None:
    """No event is lost when one of two workers is killed, or hangs; another process takes its place, under its name."""
    monkeypatch.setattr(local, "_MAX_ABSENT", 0.5)
    with closing(local.LocalGateway(2, opened(sticks), Terms(settings=Settings(), most=8))) as gateway:
        fed = Fed(sticks, gateway)
        fed.play(60)
        for name, number in (
            ("1", signal.SIGKILL),
            ("2", signal.SIGSTOP if sys.platform != "win32" else signal.SIGTERM),
        ):
            before = process_ids(gateway)[name]
            os.kill(before, number)
            fed.play(60)
            fed.until(lambda name=name, old=before: process_ids(gateway)[name] != old and len(gateway.ready) == 2)
        fed.play(60)
        fed.until(lambda: len(fed.heard) == len(fed.expected))
        found, expected = fed.events
        assert found == expected
        # On a busy machine a worker that does not hang may be silent for a second, too; then it is replaced as well.
        (lost,) = [int(each.split()[4].rstrip(";")) for each in gateway.notes if each.startswith("workers lost so far")]
        assert lost >= 2
        assert [event.kind for event in gateway.end()] == ["end"] * len(NAMES)
        order = STICK_CLASSES[:0:-1]
        gateway.exchange(opened(sticks.without(classes=STICK_CLASSES[:1])), order)
        fed.until(lambda: (fed.play(1), fed.heard[-1].classes == order)[1])
        processes = process_ids(gateway).values()
    if Path("/proc").is_dir():
        assert not [each for each in processes if Path(f"/proc/{each}").exists()]


def test_a_worker_that_cannot_begin_is_an_error(sticks: MotionLibrary, monkeypatch: pytest.MonkeyPatch) -> None:
    """No gateway waits for a worker that ends before it is ready."""
    monkeypatch.setattr(local, "_work", sys.exit)
    with pytest.raises(ChildProcessError, match="worker 1 ended before it was ready"):
        local.LocalGateway(1, opened(sticks), Terms(settings=Settings(), most=8))
