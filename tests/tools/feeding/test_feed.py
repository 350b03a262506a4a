"""A fake live feed: the times of its frames, faults on request, and the two senders."""

from dataclasses import dataclass

import numpy as np
import pytest
from programs import LOOPBACK
from synthetic import STICK, stick_clip

from kinespace.stream import Announcement, Frame, zeromq
from kinespace.stream.zeromq import Endpoint
from kinespace.tools.feeding.feed import Cue, Pace, ZmqFrameSender, clip_cues, without_pause

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
