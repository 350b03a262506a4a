"""A fake live feed: the times of its frames, faults on request, and the two senders."""

import multiprocessing
from contextlib import closing
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic import stick_clip

from kinespace.stream import Frame, zeromq
from kinespace.stream.recognition import Answer
from kinespace.tools.feeding.feed import Pace, ZmqFrameSender, clip_cues
from kinespace.tools.feeding.service import AnswerMatcher, Expected, background_service


@pytest.mark.parametrize(("speed", "pause"), [(1.0, 1.0), (0.5, 0.7), (4.0, 0.0)])
def test_clips_are_cued_at_their_own_pace(speed: float, pause: float) -> None:
    """Frames are due one after the other at the speed asked for; the time in them is the recordings', and never 0."""
    clips = [stick_clip("wave", frames=24), stick_clip("jump", frames=12)]
    moments = np.append(np.arange(24), np.arange(24, 36) + 120 * pause) / 120
    cued = list(clip_cues(clips, "me", speed=speed, pause=pause))
    assert [(cue.class_name, cue.recording) for cue in cued] == [("wave", 0)] * 24 + [("jump", 1)] * 12
    assert {cue.frame.performer for cue in cued} == {"me"}
    np.testing.assert_allclose([cue.due for cue in cued], moments / speed, atol=1e-12)
    np.testing.assert_allclose([cue.frame.time for cue in cued], 1.0 + moments, rtol=1e-12)
    np.testing.assert_array_equal([cue.frame.positions for cue in cued], [*clips[0].positions, *clips[1].positions])


def test_each_performers_frames_are_numbered_by_themselves() -> None:
    """A receiver counts a number that it lacks as a lost frame: of two performers in turn it lacks none."""
    with closing(ZmqFrameSender(zeromq.Endpoint("tcp://127.0.0.1:*", bind=True))) as sender:
        frames = [Frame(name, 1.0, np.zeros((2, 3))) for name in ("ann", "ben") * 3]
        numbered = [zeromq.decode(sender.encode(frame), 0.0) for frame in frames]
    counted = [(each.frame.performer, each.seq) for each in numbered]
    assert counted == [(name, number) for number in range(3) for name in ("ann", "ben")]


@dataclass
class FakeTime:
    """A clock that moves when slept on, each time a little longer than asked."""

    now: float = 1000.0
    oversleep: float = 0.003

    def perf_counter(self) -> float:
        """Read the clock."""
        return self.now

    def sleep(self, seconds: float) -> None:
        """Let time pass."""
        assert seconds > 0
        self.now += seconds + self.oversleep


def test_a_pace_does_not_drift(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sleeps may be too long at any time: the ten thousandth frame is no later than the first."""
    clock = FakeTime()
    monkeypatch.setattr("kinespace.tools.feeding.feed.time", clock)
    pace = Pace()
    for index in range(1, 10_001):
        pace.wait_for(index / 120)
        assert -1e-9 <= clock.now - (1000.0 + index / 120) <= clock.oversleep + 1e-9


def answer(label: str, score: float) -> Answer:
    """Make a received answer."""
    return Answer("me", label, 0, "named", score, 0.1)


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
    with pytest.raises(ValueError, match="most: expected 1 to 10000"), background_service("osc", performers=0):
        pytest.fail("started without room for anybody")
    assert multiprocessing.active_children() == []
