"""Overload, on a machine whose slowness is given: answers get rarer for all alike, and stay fresh."""

from collections import Counter
from collections.abc import Sequence

import numpy as np
import pytest
from fakes import Bench, FakeClock, FakeSink, FakeSource
from performed import shown
from synthetic import STICK, stick_clip

from kinespace.library import MotionLibrary
from kinespace.stream import Announcement, Frame, Performers, Recognition
from kinespace.stream.service.loop import MAX_PERFORMERS, MAX_WAITING, Overload, Taken

#: Seconds that a packet and an answer take.
_PACKET, _ANSWER = 2e-4, 5e-3
#: Seconds of the load; performers, and their frames a second, in it.
_LOAD, _CROWD, _RATE = 6.0, 20, 60


class Feed(FakeSource):
    """Packets that come at moments on a clock, and each takes its time."""

    def __init__(self, clock: FakeClock, frames: Sequence[Frame]) -> None:
        super().__init__([[frame] for frame in frames])
        self._clock = clock

    def take(self, arrival: float) -> Sequence[Frame | Announcement] | None:
        """Give the next packet if it has come."""
        if not self.waiting or self.waiting[0][0].time > arrival:  # type: ignore[union-attr]  # a frame
            return None
        self.lag = self.waited = arrival - self.waiting[0][0].time  # type: ignore[union-attr]
        self._clock.now += _PACKET
        return super().take(arrival)


class SlowSink(FakeSink):
    """Each answer takes its time; notes when it came."""

    def __init__(self, clock: FakeClock) -> None:
        super().__init__()
        self.clock, self.ages, self.came = clock, list[float](), list[float]()

    def publish(self, recognition: Recognition) -> None:
        """Keep a recognition, its age and its moment."""
        super().publish(recognition)
        self.clock.now += _ANSWER
        self.came.append(self.clock.now)
        self.ages.append(self.clock.now - recognition.time)


@pytest.mark.slow
def test_answers_get_rarer_for_all_alike_and_stay_fresh(sticks: MotionLibrary) -> None:
    """All get a fair share of what the machine can do, none is old, and afterwards all is as it was."""
    frames = list[Frame]()
    for number in range(_CROWD):
        seconds = _LOAD + 3.0 if number == 0 else _LOAD
        positions = stick_clip("bow", seed=number, frames=round(seconds * _RATE)).positions.astype(np.float32)
        each = shown(positions, begin=1000.0, performer=f"p{number}")
        frames += [Frame(frame.performer, 1000.0 + place / _RATE, frame.positions) for place, frame in enumerate(each)]
    frames.sort(key=lambda frame: frame.time)
    source = Feed(clock := FakeClock(), frames)
    bench, sink = Bench(Performers(sticks), source), SlowSink(clock)
    bench.service._clock = clock  # noqa: SLF001 - the clock of a slow machine
    bench.service.sinks = [sink]
    while source.waiting:
        bench.service.step(0.0)
        clock.now += 1e-3
        if clock.now < 1000.0 + _LOAD:
            worst = bench.service.status().answered
    source.close()
    # The load asks for 600 answers a second, of which the machine gives 150 or so.
    during = Counter(each.performer for each, at in zip(sink.recognitions, sink.came, strict=True) if at < 1000 + _LOAD)
    assert len(during) == _CROWD
    assert min(during.values()) > 4 * _LOAD
    assert max(during.values()) < 1.5 * min(during.values())
    assert max(sink.ages) < 0.3
    assert worst < 0.5
    after = [at - 1000 - _LOAD for at in sink.came if at >= 1000 + _LOAD]
    assert after[0] < 0.1
    assert sum(2.0 <= at < 3.0 for at in after) >= 29
    status = bench.service.status()
    assert status.inputs.stale + status.outcomes.recognizers.frames == len(frames)
    assert (status.answered, status.lost) == (1.0, status.inputs.stale)


def _taken(performer: str, time: float) -> Taken:
    return Taken(Frame(performer, time, np.zeros((len(STICK.joints), 3))), 0.0, 0.0)


def test_of_a_performers_frames_some_wait() -> None:
    """The newest frame, those before at a distance, as many as an answer needs; and all announcements."""
    overload = Overload()
    named = Taken(Announcement("a", STICK.joints), 0.0, 0.0)
    overload.keep([named, *(_taken("a", place / 120) for place in range(240))], 0.0)
    kept = overload.turns(1)
    assert kept[0] == named
    times = [each.event.time for each in kept[1:]]  # type: ignore[union-attr]  # frames
    assert len(kept) == MAX_WAITING
    assert times[-1] == 239 / 120
    assert np.diff(times[:-1]) == pytest.approx(3 / 120)
    assert overload.stale == 240 - len(times)


def test_who_has_waited_for_longest_is_first() -> None:
    """Each gets a turn before anybody gets another one, however many frames it sends."""
    overload = Overload()
    overload.keep([_taken(name, time) for time in range(50) for name in ("a", "a", "b")], 0.0)
    first = overload.turns(1)
    overload.keep([_taken("a", 51), _taken("c", 51)], 0.0)
    rest = [overload.turns(1) for _ in range(3)]
    assert [[*{each.event.performer for each in turn}] for turn in (first, *rest)] == [["a"], ["b"], ["a"], ["c"]]
    assert overload.turns(1) == []


def test_names_are_bounded() -> None:
    """Frames of further performers are dropped and counted."""
    overload = Overload()
    overload.keep([_taken(f"n{number}", 0.0) for number in range(MAX_PERFORMERS + 7)], 0.0)
    assert (len(overload.turns(2 * MAX_PERFORMERS)), overload.stale) == (MAX_PERFORMERS, 7)
