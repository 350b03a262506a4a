"""A fake live feed: the times of its frames, faults on request, and the two senders."""

import multiprocessing
import time
from contextlib import closing
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from programs import LOOPBACK
from synthetic import STICK, stick_clip

from kinespace.stream import Announcement, Frame, osc, zeromq
from kinespace.stream.recognition import Answer
from kinespace.stream.zeromq import Endpoint
from kinespace.tools.feeding.feed import Cue, Pace, ZmqFrameSender, clip_cues, without_pause
from kinespace.tools.feeding.service import AnswerMatcher, Expected, Listener, background_service

POSITIONS = np.zeros((6, 3))


def cues(count: int) -> list[Cue]:
    """Cue some frames at 120 Hz."""
    return [Cue(index / 120, Frame("me", 1.0 + index / 120, POSITIONS), index) for index in range(count)]


@pytest.mark.parametrize(("speed", "pause"), [(1.0, 1.0), (0.5, 0.7), (4.0, 0.0)])
def test_clips_are_cued_at_their_own_pace(speed: float, pause: float) -> None:
    """Frames are due one after the other at the speed asked for; the time in them is the recordings', and never 0."""
    clips = [stick_clip("wave", frames=24), stick_clip("jump", frames=12)]
    moments = np.append(np.arange(24), np.arange(24, 36) + 120 * pause) / 120
    cued = list(clip_cues(clips, "me", speed=speed, pause=pause))
    assert [cue.seq for cue in cued] == list(range(36))
    assert [(cue.class_name, cue.recording) for cue in cued] == [("wave", 0)] * 24 + [("jump", 1)] * 12
    assert {cue.frame.performer for cue in cued} == {"me"}
    np.testing.assert_allclose([cue.due for cue in cued], moments / speed, atol=1e-12)
    np.testing.assert_allclose([cue.frame.time for cue in cued], 1.0 + moments, rtol=1e-12)
    np.testing.assert_array_equal([cue.frame.positions for cue in cued], [*clips[0].positions, *clips[1].positions])


def test_clips_are_put_one_after_the_other() -> None:
    """All frames of all clips at the rate asked for, in order; with a limit no more clips are read than it needs."""
    first, second = stick_clip("wave", frames=48), stick_clip("bow", frames=25)
    whole = without_pause([first, second], 60.0)
    assert whole.dtype == np.float32
    expected = np.concatenate([first.positions[::2], second.positions[::2]]).astype(np.float32)
    np.testing.assert_allclose(whole, expected, atol=1e-6)
    endless = iter(lambda: first, None)
    cut = without_pause(endless, 120.0, 1.0)
    np.testing.assert_array_equal(cut, np.tile(first.positions, (3, 1, 1))[:120].astype(np.float32))
    np.testing.assert_array_equal(next(endless).positions, first.positions)


@dataclass
class FakeTime:
    """A clock that moves when slept on, each time a little longer than asked."""

    now: float = 1000.0
    oversleep: float = 0.003
    slept: float = 0.0

    def perf_counter(self) -> float:
        """Read the clock."""
        return self.now

    def sleep(self, seconds: float) -> None:
        """Let time pass."""
        assert seconds > 0
        self.now += seconds + self.oversleep
        self.slept += seconds


def test_a_pace_does_not_drift(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sleeps may be too long at any time: the ten thousandth frame is no later than the first."""
    clock = FakeTime()
    monkeypatch.setattr("kinespace.tools.feeding.feed.time", clock)
    pace = Pace()
    for index in range(1, 10_001):
        pace.wait_for(index / 120)
        lateness = clock.now - (1000.0 + index / 120)
        assert -1e-9 <= lateness <= clock.oversleep + 1e-9


def test_a_zmq_sender_tells_the_joints_with_the_next_frame_only() -> None:
    """The joint names ride with the first frame after an announcement, and every frame carries its number."""
    sender = ZmqFrameSender(Endpoint(f"tcp://{LOOPBACK}:*", bind=True))
    try:
        before = sender.encode(cues(1)[0])
        sender.announce(Announcement("me", STICK.joints))
        after = [sender.encode(cue) for cue in cues(3)[1:]]
    finally:
        sender.close()
    decoded = [zeromq.decode(parts, 0.0) for parts in (before, *after)]
    assert [each.seq for each in decoded] == [0, 1, 2]
    assert [each.announcement for each in decoded] == [None, Announcement("me", STICK.joints), None]


def test_every_packet_is_received_in_order_with_its_moment(stage: osc.OscReceiver) -> None:
    """Datagrams that wait are all collected, in order, each with the receiver it came in on and when it was taken."""
    listener, before = Listener(stage), time.perf_counter()
    with closing(osc.OscSender(*stage.address)) as sender:
        for number in range(20):
            sender.send(b"%d" % number)
        received = listener.listen_until(before + 0.02)
        after = time.perf_counter()
        assert [each.packet for each in received] == [b"%d" % number for number in range(20)]
        assert all(each.receiver is stage for each in received)
        arrivals = [each.arrival for each in received]
        assert [before, *arrivals, after] == sorted([before, *arrivals, after])
        # A moment that is past is not waited for, but what waits is taken.
        assert listener.listen_until(0.0) == []
        sender.send(b"late")
        assert [each.packet for each in listener.listen_until(0.0)] == [b"late"]


def answer(label: str, score: float) -> Answer:
    """Make a received answer."""
    return Answer("me", 0, score, 0.1, label)


@given(st.lists(st.booleans(), max_size=40))
def test_answers_find_their_frames_and_the_missing_are_counted(arrived: list[bool]) -> None:
    """Whichever answers get lost, each that arrives is paired with its own frame, and the rest is lost or waiting."""
    expected = [Expected(3 * index, "wave", 0.5 + index / 1000) for index in range(len(arrived))]
    matcher = AnswerMatcher(expected)
    for each, has_arrived in zip(expected, arrived, strict=True):
        if has_arrived:
            assert matcher.match(answer(each.label, each.score + 4e-6)) == each
    assert matcher.lost + matcher.waiting == arrived.count(False)


@pytest.mark.slow
def test_an_error_in_the_process_is_raised_here() -> None:
    """An error in the other process is raised in this one, and no process or socket stays behind."""
    with (
        pytest.raises(ChildProcessError, match="most: expected 1 to 10000 performers, got 0"),
        background_service("osc", performers=0),
    ):
        pytest.fail("started without room for anybody")
    assert multiprocessing.active_children() == []


@pytest.mark.slow
def test_an_error_inside_the_block_stops_the_child() -> None:
    """A program that fails while the service runs takes it down with it."""
    with pytest.raises(RuntimeError, match="ours"), background_service("osc"):
        raise RuntimeError("ours")
    assert multiprocessing.active_children() == []
