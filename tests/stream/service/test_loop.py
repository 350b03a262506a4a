"""The loop: packets of every source are counted and answered to every sink, and none stops the loop."""

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import closing

import numpy as np
import pytest
from fakes import Bench, FakeClock, FakeSink, FakeSource, pushed, shown
from synthetic import STICK, STICK_CLASSES, stick_clip

from kinespace.library import MotionLibrary
from kinespace.stream import Announcement, Done, Event, Frame, Outcome, Performers, Recognition, Recognizer, osc
from kinespace.stream.outputs import Sink
from kinespace.stream.outputs.sink import Message
from kinespace.stream.recognizer import performers
from kinespace.stream.recognizer.decision import Events
from kinespace.stream.service import loop as service_module
from kinespace.stream.service.loop import LATE, MAX_AGE, MAX_PERFORMERS, MAX_WAITING, Overload, Service, Taken
from kinespace.stream.service.workers import DUE, HISTORY, SentFrame, Track
from kinespace.stream.status import Status
from kinespace.stream.teaching import Asked, State, commands

#: Seconds a test waits for something that must happen, before it gives up.
PATIENCE = 60.0


def _frames(class_name: str, performer: str = "p", *, frames: int = 200, start: float = 1.0) -> list[Frame]:
    positions = stick_clip(class_name, seed=80, frames=frames).positions.astype(np.float32)
    return shown(positions, begin=start, performer=performer)


def _expected(sticks: MotionLibrary, frames: Sequence[Frame]) -> list[Recognition]:
    return pushed(Recognizer(sticks), frames)


@pytest.fixture
def source() -> Iterator[FakeSource]:
    """Open a source that gives what a test puts into it."""
    source = FakeSource()
    yield source
    source.close()


@pytest.fixture
def bench(sticks: MotionLibrary, source: FakeSource) -> Bench:
    """Give a service with one source."""
    return Bench(Performers(sticks), source)


# --- the loop, among fakes ---------------------------------------------------------------------------------------


class Watching(FakeSink):
    """Keeps the frames, too."""

    notes = ("one frame at a time",)

    def publish_frame(self, frame: Frame) -> None:
        """Keep a frame."""
        self.told.append(frame)


def test_all_that_waits_is_answered_to_all(sticks: MotionLibrary, source: FakeSource) -> None:
    """Every sink gets the recogniser's answers, each with its events behind it, and the frames if it asks for them."""
    frames = [*_frames("bow"), *_frames("jump", start=1.0 + 200 / 120)]
    source.waiting.extend([frame] for frame in frames)
    sinks = [FakeSink(), Watching()]
    service = Service(Performers(sticks), [source], sinks)
    while source.waiting:
        service.step(0.0)
    answers = [each for answer in _expected(sticks, frames) for each in (answer, *answer.events)]
    expected = [(type(each), each.time, each.label) for each in answers]
    assert [label for kind, _, label in expected if kind is Event] == ["bow", "bow", "jump"]
    for sink in sinks:
        assert [(type(each), each.time, each.label) for each in sink.of(Recognition | Event)] == expected
    assert sinks[1].of(Frame) == frames
    assert (service.status().notes, service.status().unsent) == (Watching.notes, 0)


def test_a_program_whose_reader_has_gone_ends(sticks: MotionLibrary, source: FakeSource) -> None:
    """As `kinespace live --log json | head` does."""

    class Unread(FakeSink):
        def send(self, message: Message) -> None:
            raise BrokenPipeError(message)

    with pytest.raises(BrokenPipeError):
        Service(Performers(sticks), [source], [Unread()]).step(0.0)


class Broken(Sink):
    """Raises whatever it is told."""

    def send(self, message: Message) -> None:
        """Raise."""
        raise OverflowError(type(message).__name__)


def test_a_sinks_error_is_counted_and_ends_nothing(sticks: MotionLibrary, source: FakeSource) -> None:
    """The other sinks get all that they get without it; the status says what the sink raised."""
    frames = _frames("bow")
    source.waiting.extend([[frame] for frame in frames] + [[Asked(None, "why")]])
    sinks = [Broken(), FakeSink()]
    service = Service(Performers(sticks), [source], sinks)
    while source.waiting:
        service.step(0.0)
    service.stop()
    service.run()
    assert sinks[1].of(Event)
    assert sinks[1].gone == ["p"]
    assert service.status().unsent >= len(sinks[1].told)
    assert "Broken: OverflowError: Gone" in service.status().notes


def test_motions_that_were_done_are_counted(monkeypatch: pytest.MonkeyPatch, bench: Bench) -> None:
    """For each performer and class from 1, until somebody resets the count, by OSC, or the performer leaves.

    A class that is renamed keeps its index and its count.
    """
    classes = ["bow", "wave"]

    def answered(frame: Frame) -> Recognition:
        index = int(frame.time >= 4)
        done = Done(frame.performer, classes[index], index, 0.0, 1.0, 0.9, 1.0, 1.0)
        return Recognition(frame.performer, frame.time, Outcome.STILL, tuple(classes), np.ones(2), 0.0, done=done)

    monkeypatch.setattr(Recognizer, "take", lambda _, frame: frame)
    monkeypatch.setattr(performers, "answers_to", lambda due: [answered(each) for each in due])

    def perform(performer: str, *times: float) -> None:
        bench.perform([Frame(performer, time, _frames("bow")[0].positions) for time in times])

    def reset(address: str) -> None:
        asked = commands.decode(commands.said_in(osc.encode_message(address))[0])
        bench.sources[0].waiting.append([Asked(each) for each in asked])
        bench.step()

    perform("Ada 1", 1.0, 2.0, 5.0)
    perform("bob", 1.0)
    classes[0] = "dip"
    perform("Ada 1", 2.5)
    classes[0] = "bow"
    reset("/motion/Ada%201/count/reset")
    perform("Ada 1", 3.0)
    perform("bob", 2.0)
    reset("/motion/*/count/reset")
    perform("bob", 3.0)
    bench.step(6.0)
    perform("bob", 3.5)
    told = [(each.performer, each.label, each.count) for each in bench.sink.of(Done)]
    ada = [("Ada 1", "bow", 1), ("Ada 1", "bow", 2), ("Ada 1", "wave", 1)]
    again = [("Ada 1", "bow", 1), ("bob", "bow", 2), ("bob", "bow", 1), ("bob", "bow", 1)]
    assert told == [*ada, ("bob", "bow", 1), ("Ada 1", "dip", 3), *again]


@pytest.mark.parametrize(
    ("waited", "number", "all_answered"),
    [(LATE, 200, True), (1.01 * LATE, 200, False), (MAX_AGE, 64, True), (1.01 * MAX_AGE, 64, False)],
)
def test_of_old_packets_the_newest_is_answered(
    sticks: MotionLibrary,
    waited: float,
    number: int,
    all_answered: bool,  # noqa: FBT001
) -> None:
    """A few late packets are all answered; of many, or much older ones, a performer's newest, and the rest counted."""
    frames = _frames("bow", frames=number)
    with closing(FakeSource([[frame] for frame in frames])) as source:
        source.waited = source.lag = waited
        bench, expected = Bench(Performers(sticks), source), _expected(sticks, frames)
        bench.step()
    status, times = bench.service.status(), [each.time for each in bench.sink.of(Recognition)]
    assert times == ([each.time for each in expected] if all_answered else [frames[-1].time])
    assert (status.inputs.stale == 0) is all_answered
    assert waited < status.hop_p50 < waited + PATIENCE


def test_classes_and_status_are_sent_on_time(bench: Bench) -> None:
    """Both are sent at the start, then the status every second and the classes every five."""
    bench.step()
    assert (len(bench.sink.of(tuple)), len(bench.sink.of(Status))) == (1, 1)
    for _ in range(80):
        bench.step(0.125)
    assert (len(bench.sink.of(tuple)), len(bench.sink.of(Status))) == (1 + 2, 1 + 10)
    assert set(bench.sink.of(tuple)) == {STICK_CLASSES}


def test_a_stopped_service_answers_first(bench: Bench, sticks: MotionLibrary, monkeypatch: pytest.MonkeyPatch) -> None:
    """A service stopped before or while it runs returns after it has answered all waiting packets."""
    monkeypatch.setattr(service_module, "MAX_ENDING", PATIENCE)
    frames = _frames("bow", frames=1200)
    bench.sources[0].waiting.extend([frame] for frame in frames)
    bench.service.stop()
    bench.service.run()
    assert not bench.sources[0].waiting
    assert len(bench.sink.of(Recognition)) == len(_expected(sticks, frames))


def test_an_endless_feed_does_not_keep_it_from_stopping(sticks: MotionLibrary, monkeypatch: pytest.MonkeyPatch) -> None:
    """When packets come faster than they are taken, it stops all the same, at the latest after half a second."""

    class Endless(FakeSource):
        def take(self, arrival: float) -> Sequence[Frame | Announcement] | None:
            self.arrivals.append(arrival)
            if len(self.arrivals) == 1000:
                bench.service.stop()
            return ()

    with closing(Endless()) as source:
        bench = Bench(Performers(sticks), source)
        bench.service.run()
        taken = len(source.arrivals)
        assert taken > 1000
        monkeypatch.setattr(service_module, "MAX_ENDING", 0.0)
        bench = Bench(Performers(sticks), source)
        bench.service.stop()
        bench.service.run()
        assert len(source.arrivals) == taken


# --- over real sockets -------------------------------------------------------------------------------------------


class FakeControl:
    """Keeps the commands it gets."""

    classes = ("taught",)
    muted = ""

    def __init__(self) -> None:
        self.answers, self.carried_out, self.tended = True, [], 0

    def carry_out(self, asked: Asked) -> None:
        """Keep a command; `Stop` ends answers, and another one begins them."""
        self.carried_out.append(asked.command)
        self.answers = not isinstance(asked.command, commands.Stop)

    def tend(self, now: float) -> None:  # noqa: ARG002 - as the service calls it
        """Count the turns."""
        self.tended += 1


def test_commands_are_carried_out_and_may_switch_answers_off(sticks: MotionLibrary) -> None:
    """A command among frames, or a key's, reaches the control, which is tended; it says when nothing is known."""
    frames = _frames(STICK_CLASSES[0])
    off, on = Asked(commands.Stop()), Asked(commands.Undo())
    for packets, answers in (([*frames], True), ([off, *frames], False), ([off, frames[0], on, *frames[1:]], True)):
        control, sink = FakeControl(), FakeSink()
        with closing(FakeSource([[each] for each in packets])) as source:
            service = Service(Performers(sticks), [source], [sink], control=control)
            service.step(0.0)
            service.ask(Asked(commands.Save()))
            service.stop()
            service.run()
        assert control.carried_out == [*(each.command for each in packets if isinstance(each, Asked)), commands.Save()]
        assert control.tended
        assert set(sink.of(tuple)) == {("taught",)}
        assert sink.of(Recognition)
        assert any(each.class_name for each in sink.of(Recognition)) is answers
        assert bool(sink.of(Event)) is answers
        if not answers:
            assert {(one.label, one.score, one.guess_index) for one in sink.of(Recognition)} == {("unknown", 0.0, -1)}


def test_of_commands_without_end_some_wait(sticks: MotionLibrary) -> None:
    """The others are refused, at most one of them in a second is said: neither memory nor Ctrl-C pays for them."""
    control, sink = FakeControl(), FakeSink()
    with closing(FakeSource([[Asked(commands.Undo())] * 5000])) as source:
        service = Service(Performers(sticks), [source], [sink], control=control)
        service.step(0.0)
        service.stop()
        service.run()
    assert len(control.carried_out) == service_module.MAX_ASKED
    assert [each.reason for each in sink.of(State)] == [
        f"too many commands: expected at most {service_module.MAX_ASKED} that wait"
    ]


@pytest.mark.parametrize(
    ("first", "then", "kinds"),
    [
        (("", True), ("", True), ["start", "end"]),
        (("p", True), ("", True), []),
        (("", False), ("", True), []),
        (("", True), ("p", True), ["start", "end"]),
        (("", True), ("", False), ["start", "end"]),
        (("q", True), ("q", True), ["start", "end"]),
    ],
)
def test_an_end_is_said_if_the_start_was(
    first: tuple[str, bool], then: tuple[str, bool], kinds: list[str], sticks: MotionLibrary, source: FakeSource
) -> None:
    """A performer who is muted, and one before anything is known, start nothing; what had started ends all the same."""
    control, sink = FakeControl(), FakeSink()
    service = Service(Performers(sticks), [source], [sink], control=control)
    source.waiting.extend([frame] for frame in _frames("jump", frames=240))
    control.muted, control.answers = first
    service.step(0.0)
    control.muted, control.answers = then
    service.stop()
    service.run()
    assert [str(event.kind) for event in sink.of(Event)] == kinds
    assert bool(sink.of(Done)) is bool(kinds)


#: Seconds that an answer takes; seconds of the load, and each performer's frames a second in it.
_ANSWER, _LOAD, _RATE = 5e-3, 5.0, 60


class Feed(FakeSource):
    """Packets that come at moments on a clock, each of which takes some seconds."""

    def __init__(self, clock: FakeClock, frames: Sequence[Frame], each: float) -> None:
        super().__init__([[frame] for frame in frames])
        self._clock, self._each = clock, each

    def take(self, arrival: float) -> Sequence[Frame | Announcement] | None:
        """Give the next packet if it has come."""
        if not self.waiting or self.waiting[0][0].time > arrival:  # type: ignore[union-attr]  # a frame
            return None
        self.lag = self.waited = arrival - self.waiting[0][0].time  # type: ignore[union-attr]
        self._clock.now += self._each
        return super().take(arrival)


class SlowSink(FakeSink):
    """Each answer takes its time; notes when it came."""

    def __init__(self, clock: FakeClock) -> None:
        super().__init__()
        self.clock, self.ages, self.came = clock, list[float](), list[float]()

    def send(self, message: Message) -> None:
        """Keep a message; of a recognition its age and its moment."""
        super().send(message)
        if isinstance(message, Recognition):
            self.clock.now += _ANSWER
            self.came.append(self.clock.now)
            self.ages.append(self.clock.now - message.time)


@pytest.mark.slow
@pytest.mark.parametrize(("crowd", "packet", "least"), [(20, 2e-4, 4.0), (90, 6e-5, 0.7)])
def test_answers_get_rarer_alike_and_stay_fresh(crowd: int, packet: float, least: float, sticks: MotionLibrary) -> None:
    """All get a fair share of what the machine can do, none is old, no window begins again; then all is as it was."""
    frames = list[Frame]()
    for number in range(crowd):
        seconds = _LOAD + 3.0 if number == 0 else _LOAD
        positions = stick_clip("bow", seed=number, frames=round(seconds * _RATE)).positions.astype(np.float32)
        each = shown(positions, begin=1000.0, performer=f"p{number}")
        frames += [Frame(frame.performer, 1000.0 + place / _RATE, frame.positions) for place, frame in enumerate(each)]
    frames.sort(key=lambda frame: frame.time)
    source = Feed(clock := FakeClock(), frames, packet)
    bench, sink = Bench(Performers(sticks, most=crowd), source), SlowSink(clock)
    bench.service._clock = clock  # noqa: SLF001 - the clock of a slow machine
    bench.service.sinks = [sink]
    while source.waiting:
        bench.service.step(0.0)
        clock.now += 1e-3
        if clock.now < 1000.0 + _LOAD:
            worst = bench.service.status().answered
    source.close()
    # The load asks for 600 answers a second or 2,700, of which the machine gives 150 or so.
    during = Counter(r.performer for r, at in zip(sink.of(Recognition), sink.came, strict=True) if at < 1000 + _LOAD)
    assert len(during) == crowd
    assert min(during.values()) > least * _LOAD
    assert max(during.values()) < 1.5 * min(during.values())
    assert max(age for age, at in zip(sink.ages, sink.came, strict=True) if at < 1000 + _LOAD) < 0.3
    assert worst < 0.5
    after = [at - 1000 - _LOAD for at in sink.came if at >= 1000 + _LOAD]
    assert after[0] < 0.1
    assert sum(2.0 <= at < 3.0 for at in after) >= 29
    status = bench.service.status()
    assert status.inputs.stale + status.outcomes.recognizers.frames == len(frames)
    assert (status.answered, status.lost) == (1.0, status.inputs.stale)
    assert status.outcomes.recognizers.restarts == 0


def _taken(performer: str, time: float) -> Taken:
    return Taken(Frame(performer, time, np.zeros((len(STICK.joints), 3))), 0.0)


def test_of_a_performers_frames_some_wait() -> None:
    """The newest frame, those before at a distance, as many as an answer needs; and all announcements."""
    overload, named = Overload(), Taken(Announcement("a", STICK.joints), 0.0)
    overload.keep([named, *(_taken("a", place / 120) for place in range(240))], 0.0)
    kept = overload.turns(1)
    assert kept[0] == named
    times = [each.event.time for each in kept[1:]]  # type: ignore[union-attr]  # frames
    assert len(kept) == MAX_WAITING
    assert times[-1] == 239 / 120
    assert np.diff(times[:-1]) == pytest.approx(5 / 120)
    assert overload.stale == 240 - len(times)


def test_names_are_bounded() -> None:
    """Frames of further performers are dropped and counted."""
    overload = Overload()
    overload.keep([_taken(f"n{number}", 0.0) for number in range(MAX_PERFORMERS + 7)], 0.0)
    assert (len(overload.turns(2 * MAX_PERFORMERS)), overload.stale) == (MAX_PERFORMERS, 7)


CLASSES = ("squat", "jog")
JOINTS = ("a", "b", "c")


class Ann:
    """A performer's track."""

    def __init__(self) -> None:
        self.track = Track(0.0, 0.0, Events(0.01))

    def frame(self, now: float, joints: tuple[str, ...] | None = None) -> SentFrame:
        """Send a frame."""
        self.track.newest = now
        return self.track.send(Frame("ann", now, np.ones((3, 3))), joints)

    def take(self, at: float, named: str = "squat", classes: tuple[str, ...] = CLASSES) -> list[tuple[str, str]] | None:
        """Take in an answer; give what started and ended, None where it is no news."""
        scores, guess = np.full(len(classes), 0.5), classes.index(named)
        made = Recognition("ann", at, Outcome.NAMED, classes, scores, 0.1, lead=1.0, guess=guess)
        accepted = self.track.accept(made, CLASSES)
        if accepted is None:
            return None
        assert accepted[1] == at
        return [(event.kind.value, event.label) for event in accepted[0].events]

    def play(self, begin: float, end: float, named: str, classes: tuple[str, ...] = CLASSES) -> list[tuple[str, str]]:
        """Send frames and answer them; give what started and ended."""
        found = list[tuple[str, str]]()
        for time in np.arange(begin, end, 0.05).tolist():
            self.frame(time)
            found += self.take(time, named, classes) or []
        return found


def test_motions_start_and_end_once() -> None:
    """A motion starts and ends with the next, and ends with an exchange; other classes start none."""
    ann = Ann()
    assert ann.play(1.0, 2.0, "squat") == [("start", "squat")]
    assert ann.play(2.0, 3.0, "jog") == [("end", "squat"), ("start", "jog")]
    assert ann.play(3.0, 4.0, "gone", ("gone", "jog")) == []
    assert ann.track.exchange(("jog", "squat"), 0.01) is None
    assert ann.track.events.going_on.index == 0
    ended = ann.track.exchange(("squat",), 0.01)
    assert (ended.kind, ended.label) == ("end", "jog")
    assert ann.track.end() is None


def test_another_worker_is_shown_what_was_answered_and_answers_the_rest() -> None:
    """It gets the last seconds before the last answer, with the joints; of the rest what is young enough is due."""
    ann, now = Ann(), 10.0
    sent = [ann.frame(k / 8, JOINTS) for k in range(81)]
    assert [each.begins for each in sent] == [True] + [False] * 80
    assert 9 <= sum(each.joints is not None for each in sent) <= 11
    assert ann.frame(now + 0.125, JOINTS[::-1]).joints == JOINTS[::-1]
    seen, due = ann.track.past(JOINTS, now)
    assert (seen[-1].frame.time, due[0].frame.time, due[-1].frame.time) == (now - DUE - 0.125, now - DUE, now + 0.125)
    ann.take(9.75)
    seen, due = ann.track.past(JOINTS, now)
    assert (seen[0].frame.time, seen[-1].frame.time, due[0].frame.time) == (9.75 - HISTORY, 9.75, 9.875)
    assert (seen[0].begins, seen[0].joints, seen[1].begins) == (True, JOINTS, False)
