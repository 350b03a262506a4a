"""The crew: answers and events are those of one process, whatever happens to the workers."""

from __future__ import annotations

import time
from collections import Counter
from contextlib import closing
from itertools import pairwise
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from crews import FakeProcess
from synthetic import STICK, STICK_CLASSES, stick_clip

from kinespace.library.windows.index import opened
from kinespace.stream.frame import Announcement, Frame
from kinespace.stream.recognition import EventKind
from kinespace.stream.recognizer import Performers, SentJoints, Settings
from kinespace.stream.workers import crew as crew_module
from kinespace.stream.workers.crew import MAX_SILENT, Crew

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from kinespace.library.motion_library import MotionLibrary
    from kinespace.stream.recognition import Event, Recognition

NAMES = ("ann", "bob", "cleo", "dan", "eve", "fay")
RATE = 60
#: Frames of each class that a performer plays, one class after the other.
PLAYED = 3 * RATE


@pytest.fixture(scope="module")
def feed() -> list[list[Frame]]:
    """Give each moment's frames: every performer plays every class, each from another one on."""
    clips = {name: stick_clip(name, seed=80, frames=2 * PLAYED).positions[::2] for name in STICK_CLASSES}
    order = [np.roll(np.arange(len(STICK_CLASSES)), place) for place in range(len(NAMES))]
    played = [np.concatenate([clips[STICK_CLASSES[each]] for each in own]) for own in order]
    moments = range(len(played[0]))
    return [[Frame(name, 1 + k / RATE, own[k]) for name, own in zip(NAMES, played, strict=True)] for k in moments]


@pytest.fixture(scope="module")
def expected(sticks: MotionLibrary, feed: Sequence[Sequence[Frame]]) -> list[Recognition]:
    """Give the answers of one process."""
    performers = Performers(opened(sticks))
    return [each for frames in feed for each in performers.push_all(frames, frames[0].time) if each]


class Stage:
    """A crew with a clock of its own, and what came back."""

    def __init__(self, library: MotionLibrary, count: int, most: int = 32) -> None:
        self.now = 1.0
        self.heard: list[Recognition] = []
        self.crew = Crew(count, opened(library), Settings(), most=most, joints=SentJoints(), clock=lambda: self.now)

    @property
    def processes(self) -> list[FakeProcess]:
        """The processes now, in the order of the workers."""
        return [source.process for source in self.crew.sources]  # type: ignore[misc]

    def turn(self, frames: Sequence[Frame | Announcement] = (), seconds: float = 1 / RATE) -> None:
        """Send some frames, let everybody work, read the answers."""
        self.now += seconds
        self.crew.push_all(frames, self.now)
        for process in self.processes:
            if process:
                process.work()
        self.read()

    def read(self) -> None:
        """Look after the workers, and take the answers as the service would."""
        for source in self.crew.sources:
            source.tend(self.now)
            while (taken := source.take(self.now)) is not None:
                self.heard += [each for each in self.crew.push_all(taken, self.now) if each]


@pytest.fixture
def stage(sticks: MotionLibrary, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Stage]]:
    """Make stages whose workers are in this process."""
    monkeypatch.setattr(crew_module, "_Process", FakeProcess)
    monkeypatch.setattr(FakeProcess, "all", [])
    # The fakes report when they work. Python's own `time` stays: threads of other tests may sleep.
    stepping = SimpleNamespace(sleep=lambda _: [each.work() for each in FakeProcess.all])
    monkeypatch.setattr(crew_module, "time", stepping)
    made: list[Stage] = []

    def make(count: int = 2, most: int = 32) -> Stage:
        made.append(Stage(sticks, count, most))
        return made[-1]

    yield make
    for each in made:
        for source in each.crew.sources:
            source.close()


def described(recognitions: Sequence[Recognition]) -> dict[tuple[str, float], tuple[object, ...]]:
    """Describe answers by performer and time."""
    return {(each.performer, each.time): (each.label, *each.scores.tolist(), each.events) for each in recognitions}


def successive(recognitions: Sequence[Recognition]) -> Iterator[tuple[Recognition, Recognition]]:
    """Give each answer with the performer's next."""
    for name in NAMES:
        yield from pairwise(each for each in recognitions if each.performer == name)


def events(recognitions: Sequence[Recognition]) -> dict[str, list[tuple[str, str]]]:
    """List each performer's events in order: what happened, and to which class."""
    told: dict[str, list[tuple[str, str]]] = {}
    for each in recognitions:
        told.setdefault(each.performer, []).extend((str(event.kind), event.label) for event in each.events)
    return told


def test_answers_equal_one_processs(
    stage: Callable[..., Stage], feed: Sequence[Sequence[Frame]], expected: Sequence[Recognition]
) -> None:
    """Two workers give the answers of one process, each once, bit by bit, and both work."""
    on = stage(2)
    for frames in feed:
        on.turn(frames)
    assert described(on.heard) == described(expected)
    assert len(on.heard) == len(expected)
    on.turn()
    assert on.crew.counts.recognizers.frames == sum(map(len, feed))
    assert on.crew.names == NAMES
    assert len({process.name for process in FakeProcess.all if process.channel}) == 2


def test_a_pause_of_the_feed_ends_motions_by_the_clock(
    stage: Callable[..., Stage], feed: Sequence[Sequence[Frame]], expected: Sequence[Recognition]
) -> None:
    """A motion whose performer sends nothing for a second ends without a further frame, as in one process, and once."""
    on = stage(2)
    for frames in feed:
        on.turn(frames)
    going_on = {name: told[-1][1] for name, told in events(expected).items() if told[-1][0] == "start"}
    assert going_on
    assert on.crew.end_paused(on.now + 0.5) == []
    ended = on.crew.end_paused(on.now + 1.0)
    assert {event.performer: event.label for event in ended} == going_on
    assert {str(event.kind) for event in ended} == {"end"}
    assert on.crew.end_paused(on.now + 1.0) == []


@pytest.mark.slow
@pytest.mark.parametrize("moment", range(70, len(STICK_CLASSES) * PLAYED, 234))
def test_a_killed_worker_costs_no_event(
    stage: Callable[..., Stage], feed: Sequence[Sequence[Frame]], expected: Sequence[Recognition], moment: int
) -> None:
    """Killed at any moment, with frames unread: the events are those of one process, and no frame stays unanswered.

    Hops begin anew with the first frame that the other worker sees, so that one may fall on the frame beside it.
    """
    on = stage(2)
    for k, frames in enumerate(feed):
        if k == moment:
            # The worker dies with two moments' frames in its queue.
            on.crew.push_all(frames, on.now)
            on.processes[0].kill()
            on.read()
            assert on.processes[0] is None
            continue
        on.turn(frames)
    assert events(on.heard) == events(expected)
    counts = [Counter(each.performer for each in heard) for heard in (on.heard, expected)]
    assert all(abs(counts[0][name] - counts[1][name]) <= 1 for name in NAMES)
    gaps = [[later.time - earlier.time for earlier, later in successive(heard)] for heard in (on.heard, expected)]
    assert max(gaps[0]) < max(gaps[1]) + 1.5 / RATE
    assert len(FakeProcess.all) == 3
    assert on.crew.notes == ["workers replaced so far: 1; last: worker 1 ended"]


@pytest.mark.slow
def test_a_hung_worker_is_replaced(
    stage: Callable[..., Stage], feed: Sequence[Sequence[Frame]], expected: Sequence[Recognition]
) -> None:
    """A worker that says nothing for a second is killed; its performers' answers come after all."""
    on = stage(2)
    for k, frames in enumerate(feed):
        if k == 150:
            on.processes[1].hangs = True
        on.turn(frames)
    assert events(on.heard) == events(expected)
    assert len(on.heard) == len(expected)
    assert on.crew.notes == ["workers replaced so far: 1; last: worker 2 hung and was killed"]


def test_a_stopped_parent_kills_no_worker(stage: Callable[..., Stage], feed: Sequence[Sequence[Frame]]) -> None:
    """When the receiving process itself was stopped, its workers are not taken for hung."""
    on = stage(2)
    on.turn(feed[0])
    on.now += 10 * MAX_SILENT
    on.read()
    assert None not in on.processes
    assert on.crew.notes == []


@pytest.mark.slow
def test_a_worker_alone_comes_back(stage: Callable[..., Stage], feed: Sequence[Sequence[Frame]]) -> None:
    """With one worker frames are counted as lost until the new process is ready; then answers go on."""
    on = stage(1)
    for k, frames in enumerate(feed[:300]):
        if k == 100:
            on.processes[0].kill()
            on.read()
        on.turn(frames)
    assert on.crew.unsent == 0 or "no worker took" in on.crew.notes[0]
    assert {each.performer for each in on.heard if each.time > 1 + 250 / RATE} == set(NAMES)
    starts = [event for each in on.heard for event in each.events if event.kind is EventKind.START]
    assert len({(each.performer, each.label) for each in starts}) == len(starts)


def test_a_silent_performers_motion_ends_once(stage: Callable[..., Stage], feed: Sequence[Sequence[Frame]]) -> None:
    """A performer who leaves in a motion: its end is told once, and on coming back the motion starts anew."""
    on = stage(2)
    own = [[frame for frame in frames if frame.performer == "ann"] for frames in feed[: PLAYED - 10]]
    for frames in own:
        on.turn(frames)
    (start,) = [event for each in on.heard for event in each.events]
    on.turn(seconds=6.0)
    (end,) = on.crew.drop_silent(on.now)
    assert (end.kind, end.label, end.time) == (EventKind.END, start.label, own[-1][0].time)
    assert on.crew.take_gone() == ["ann"]
    assert on.crew.drop_silent(on.now) == []
    assert on.crew.names == ()
    before = len(on.heard)
    for frames in own:
        on.turn(frames)
    again = [event for each in on.heard[before:] for event in each.events]
    assert [(event.kind, event.label) for event in again] == [(EventKind.START, start.label)]
    assert [event.kind for event in on.crew.end()] == [EventKind.END]


def test_performers_are_bounded(stage: Callable[..., Stage], feed: Sequence[Sequence[Frame]]) -> None:
    """No more performers than allowed are followed by all workers together; the others' frames are counted."""
    on = stage(2, most=4)
    for frames in feed[:60]:
        on.turn(frames)
    assert on.crew.names == NAMES[:4]
    assert on.crew.counts.no_room == 2 * 60


@pytest.mark.slow
def test_announced_joints_survive_a_worker(
    stage: Callable[..., Stage], feed: Sequence[Sequence[Frame]], expected: Sequence[Recognition]
) -> None:
    """Joints announced once, in another order, are known to the worker that takes over."""
    on = stage(2)
    turned = [Announcement(name, STICK.joints[::-1]) for name in NAMES]
    on.crew.push_all(turned, on.now)
    for k, frames in enumerate(feed):
        if k == 200:
            on.processes[0].kill()
        on.turn([Frame(each.performer, each.time, each.positions[::-1].copy()) for each in frames])
    assert events(on.heard) == events(expected)
    frame = on.crew.ordered(Frame("ann", 9.0, feed[0][0].positions[::-1]))
    assert frame is not None
    assert np.array_equal(frame.positions, feed[0][0].positions)


@pytest.mark.slow
def test_another_library_reaches_every_worker(stage: Callable[..., Stage], sticks: MotionLibrary, feed: list) -> None:
    """After an exchange all answers have the new classes, also of a worker that is started later; lost motions end."""
    on = stage(2)
    for frames in feed[: PLAYED - 10]:
        on.turn(frames)
    gone = on.heard[-1].classes[0]
    fewer = sticks.without(classes=[gone])
    ended: list[Event] = on.crew.exchange(opened(fewer), fewer.classes)
    assert {event.label for event in ended} == {gone}
    assert {event.kind for event in ended} == {EventKind.END}
    assert on.crew.classes == fewer.classes
    on.processes[0].kill()
    on.turn(feed[PLAYED - 10])
    before = len(on.heard)
    for frames in feed[PLAYED - 9 : PLAYED + 60]:
        on.turn(frames)
    assert {each.classes for each in on.heard[before:]} == {fewer.classes}
    assert {each.performer for each in on.heard[before:]} == set(NAMES)


def test_carried_joints_come_on_request(
    stage: Callable[..., Stage], sticks: MotionLibrary, feed: Sequence[Sequence[Frame]]
) -> None:
    """A sink that draws bodies is told the skeleton and what carries the decision, as in one process."""
    on, performers = stage(2), Performers(opened(sticks))
    assert (on.crew.carried("ann"), on.crew.skeleton_of("ann")) == (None, None)
    told = {}
    for frames in feed[:60]:
        asks = on.crew.carried("ann")
        on.turn(frames)
        if any(performers.push_all(frames, 1.0)[:1]):
            told[frames[0].time] = performers.carried("ann")
    assert asks in [*told.values()][-3:]
    assert asks is not None
    assert on.crew.skeleton_of("ann") == performers.skeleton_of("ann")


def test_another_sensitivity_reaches_every_worker(
    stage: Callable[..., Stage], sticks: MotionLibrary, feed: Sequence[Sequence[Frame]]
) -> None:
    """Answers are those of one process whose sensitivity is changed at the same moment, in all workers."""
    on, performers = stage(2), Performers(opened(sticks))
    assert on.crew.sensitivity == performers.sensitivity
    expected = []
    for k, frames in enumerate(feed[:240]):
        if k == 100:
            on.crew.set_sensitivity(0.0)
            performers.set_sensitivity(0.0)
        on.turn(frames)
        expected += [each for each in performers.push_all(frames, frames[0].time) if each]
    assert (on.crew.sensitivity, on.crew.settings.sensitivity) == (0.0, 0.0)
    assert described(on.heard) == described(expected)


def test_a_worker_that_starts_hears_of_another_sensitivity(
    stage: Callable[..., Stage], feed: Sequence[Sequence[Frame]]
) -> None:
    """The sensitivity may change between a process's start and its first report, when it owns no performer yet."""
    on = stage(2)
    on.turn(feed[0])
    source = on.crew.sources[0]
    on.crew.replace(source, on.now + 10.0, "ended")
    on.crew.tend(source, on.now + 11.0)
    on.crew.set_sensitivity(0.0)
    on.turn(feed[1])
    assert [process.sensitivity for process in on.processes] == [0.0, 0.0]


def test_unreadable_messages_are_counted(stage: Callable[..., Stage], feed: Sequence[Sequence[Frame]]) -> None:
    """Broken messages and answers of nobody's frames are counted and change nothing."""
    on = stage(2)
    on.turn(feed[0])
    on.processes[0].channel.back.append(b"\xc1broken")
    on.read()
    assert (on.crew.unread, on.crew.former) == (1, 0)
    assert on.crew.notes == ["1 messages of workers that cannot be read"]


@pytest.mark.slow
def test_real_processes_work_and_are_replaced(
    sticks: MotionLibrary, feed: Sequence[Sequence[Frame]], expected: Sequence[Recognition]
) -> None:
    """Two real processes answer as one does; one that is killed is replaced, and no event is lost."""
    heard: list[Recognition] = []
    crew = Crew(2, opened(sticks), Settings(), most=32, joints=SentJoints())

    def read() -> None:
        for source in crew.sources:
            source.tend(time.monotonic())
            while (taken := source.take(time.monotonic())) is not None:
                heard.extend(each for each in crew.push_all(taken, time.monotonic()) if each)

    with closing(crew.sources[0]), closing(crew.sources[1]):
        for k, frames in enumerate(feed):
            crew.push_all(frames, time.monotonic())
            if k == 250:
                process = crew.sources[0].process
                assert process is not None
                process._process.kill()  # noqa: SLF001 - as the system would
            read()
        until = time.monotonic() + 60
        while time.monotonic() < until and not (len(heard) == len(expected) and all(crew.process_ids)):
            read()
        assert len(heard) == len(expected)
        assert events(heard) == events(expected)
        assert "workers replaced so far: 1; last: worker 1 ended" in crew.notes
