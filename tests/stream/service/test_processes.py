"""Workers on this machine: they start, answer as one process does, and are replaced."""

import math
import multiprocessing
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from multiprocessing.connection import Connection
from operator import attrgetter
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from fakes import assert_same
from programs import until
from synthetic import STICK_CLASSES, stick_clip

from kinespace.library import MotionLibrary, WindowIndex, by_joints, opened
from kinespace.library.windows.opening import MAX_VIEWS
from kinespace.stream import Announcement, BackgroundViews, Frame, Performers, Recognition, Settings
from kinespace.stream.frame import Admitted, NewSender
from kinespace.stream.service import workers
from kinespace.stream.service.background import leave_signals_to_parent, signals_held
from kinespace.stream.service.workers import Gateway, Terms, Worker

RATE = 60
#: Seconds between two answers, and a frame: another worker's hops are others.
HOP = 1 / 30 + 1 / RATE + 0.001
NAMES = ("ann", "bob", "cleo", "dan")
FOLLOWED = Settings(progress=True)


class Patient(Worker):
    """A worker that is never too late, so that it leaves no answer out on a busy machine."""

    def take(self, arrival: float) -> Sequence[Admitted] | None:
        """Take in a message as if it had come just now."""
        self.patience = math.inf
        taken = super().take(arrival)
        self.lag = self.waited = 0.0
        return taken


def _without_hurry(name: str, place: str) -> None:
    """Work without hurry; what a process does."""
    workers.Worker = Patient  # type: ignore[misc]
    workers.work(name, place)


class Fed:
    """A gateway with workers of its own, the feed, and the answers of one process."""

    def __init__(self, library: MotionLibrary, gateway: Gateway, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self.gateway, self._one = gateway, Performers(opened(library), FOLLOWED)
        clips = [stick_clip(name, seed=80, frames=4 * RATE).positions[::2] for name in STICK_CLASSES]
        self._moments = [
            [Frame(name, 1 + k / RATE, each.astype(kind)) for name, kind in zip(NAMES, ["f4", "f8"] * 2, strict=True)]
            for k, each in enumerate(p for clip in clips for p in clip)
        ]
        self.heard, self.expected = list[Recognition](), list[Recognition]()
        gateway.publish = lambda recognition, _: self.heard.append(recognition)

    def play(self, count: int) -> None:
        """Send some moments' frames; read until the last of them are answered."""
        for frames in [self._moments.pop(0) for _ in range(count)]:
            self.gateway.push_all(frames, self._clock())
            self.expected += [each for each in self._one.push_all(frames, frames[0].time) if each]
            self.gateway.tend(self._clock())
        newest = {each.performer: each.time for each in self.expected}
        self.until(lambda: {one.performer for one in self.heard if one.time > newest[one.performer] - HOP} == {*NAMES})

    def until(self, reached: Callable[[], bool]) -> None:
        """Read until something is reached."""
        until(lambda: reached() or self.gateway.tend(self._clock()))

    @property
    def events(self) -> list[list[tuple[str, str, str]]]:
        """The events that came, and those of one process, by performer."""
        return [
            sorted((event.performer, event.kind, event.label) for each in answers for event in each.events)
            for answers in (self.heard, self.expected)
        ]


@pytest.mark.slow
def test_answers_equal_one_processs(sticks: MotionLibrary, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two workers give the answers of one process, each once; a gateway that stood still drops none."""
    monkeypatch.setattr(workers, "work", _without_hurry)
    with closing(Gateway(2, opened(sticks), Terms(FOLLOWED, 8))) as gateway:
        # By a clock that stands still no motion ends because the machine does.
        now = time.monotonic()
        fed = Fed(sticks, gateway, lambda: now)
        fed.play(150)
        fed.until(lambda: len(fed.heard) == len(fed.expected))
        heard, expected = (sorted(each, key=attrgetter("performer", "time")) for each in (fed.heard, fed.expected))
        # Who is answered together differs, and with it the last digits.
        assert_same(heard, expected, within=1e-4)
        assert any(each.progress for each in fed.heard)
        assert gateway.skeleton_of("nobody") is gateway.carried("ann") is None
        fed.until(lambda: gateway.counts.recognizers.frames == 150 * len(NAMES))
        gateway.set_sensitivity(0.0)
        assert gateway.sensitivity == 0.0
        gateway.tend(time.monotonic() + 10 * workers.MAX_SILENT)
        assert len(gateway.ready) == 2


@pytest.mark.slow
def test_processes_answer_and_are_replaced(sticks: MotionLibrary, monkeypatch: pytest.MonkeyPatch) -> None:
    """No event is lost when one of two workers is killed, or hangs; another process takes its place."""
    monkeypatch.setattr(workers, "_MAX_ABSENT", 0.5)
    monkeypatch.setattr(workers, "work", _without_hurry)
    # However long a new process takes to start, what was sent meanwhile is answered.
    monkeypatch.setattr(workers, "DUE", math.inf)
    with closing(Gateway(2, opened(sticks), Terms(FOLLOWED, 8))) as gateway:
        fed, processes = Fed(sticks, gateway), gateway._workers  # noqa: SLF001 - who is killed
        fed.play(60)
        for number in (signal.SIGKILL, signal.SIGSTOP if sys.platform != "win32" else signal.SIGTERM):
            lost = min(gateway.ready)
            os.kill(processes[lost].process.pid, number)
            fed.play(60)
            fed.until(lambda lost=lost: lost not in processes and len(gateway.ready) == 2)
        fed.play(60)
        found, expected = fed.events
        assert found == expected
        assert [event.kind for event in gateway.end()] == ["end"] * len(NAMES)
        order = STICK_CLASSES[:0:-1]
        gateway.exchange(opened(sticks.without(classes=STICK_CLASSES[:1])), order)
        fed.until(lambda: (fed.play(1), fed.heard[-1].classes == order)[1])
        numbers = [each.process.pid for each in processes.values()]
    if Path("/proc").is_dir():
        assert not [each for each in numbers if Path(f"/proc/{each}").exists()]


def test_a_worker_that_cannot_begin_is_an_error(sticks: MotionLibrary, monkeypatch: pytest.MonkeyPatch) -> None:
    """No gateway waits for a worker that ends before it is ready."""
    monkeypatch.setattr(workers, "work", sys.exit)
    with pytest.raises(ChildProcessError, match="worker 1 ended before it was ready"):
        Gateway(1, opened(sticks), Terms(settings=Settings(), most=8))


def test_a_worker_that_opens_a_library_hears_of_the_next(
    sticks: MotionLibrary, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A worker that has not asked for a library yet gets the newest one when it does."""
    told = list[str]()
    with closing(Gateway(0, opened(sticks), Terms(Settings(), most=3))) as gateway:
        monkeypatch.setattr(gateway, "_send", lambda worker, *_: told.append(worker))
        opens, begins = (SimpleNamespace(has_asked=asked, report=None) for asked in (True, False))
        monkeypatch.setattr(gateway, "_workers", {"opens": opens, "begins": begins})
        gateway.exchange(opened(sticks))
        monkeypatch.undo()
    assert told == ["opens"]


def test_a_further_performer_has_no_room_and_joints_are_put_in_order(sticks: MotionLibrary) -> None:
    """Its frames are counted until they come steadily, and somebody was not answered for a second."""
    positions = stick_clip(STICK_CLASSES[0], seed=80, frames=8).positions[0]
    names = ("ann", "bob", "cleo")
    with closing(Gateway(0, sticks, Terms(Settings(), most=3))) as gateway:
        gateway.push_all([Frame(name, 1.0, positions) for name in names], 1.0)
        assert gateway.push_all([Frame("dan", 1.0, positions)], 1.9) == [None]
        assert (gateway.names, gateway.counts.no_room) == (names, 1)
        gateway.push_all([Announcement("ann", sticks.skeleton.joints[::-1])], 1.0)
        assert np.array_equal(gateway.ordered(Frame("ann", 9.0, positions[::-1])).positions, positions)
        assert gateway.ordered(Frame("ann", 9.0, positions[1:])) is None
        for index in range(12):
            # One packet of a stranger drops nobody.
            assert gateway.names == names
            gateway.push_all([Frame("dan", 1.0 + index / 30, positions)], 3.0 + index / 30)
        assert (gateway.names, gateway.take_gone()) == (("bob", "cleo", "dan"), ["ann"])
        gateway.push_all([NewSender("dan")], 2.5)
        assert (gateway.names, gateway.take_gone()) == (("bob", "cleo"), [])
        assert gateway.drop_silent(100.0) == gateway.end_paused(100.0) == []
        assert (gateway.names, gateway.take_gone(), gateway.counts.dropped) == ((), ["bob", "cleo"], 4)


# --- background opener ------------------------------------------------------------------------------------------------


def _wait(views: BackgroundViews) -> None:
    views._thread.join()  # noqa: SLF001 - the test waits for the thread instead of asking again and again


def test_windows_are_given_once_they_are_open(sticks: MotionLibrary) -> None:
    """Windows that were asked for are not ready at first; then they are the index's."""
    views, index, joints = BackgroundViews(), WindowIndex.of(sticks), sticks.skeleton.joints[:5]
    assert views(index, joints) is None
    _wait(views)
    assert views(index, joints) is by_joints(index, joints)
    assert by_joints(index, joints).library.skeleton.joints == joints


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
