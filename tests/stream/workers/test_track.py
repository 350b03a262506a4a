"""One performer as the gateway knows it: which answers are news, and which events listeners get."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kinespace.stream.frame import Frame
from kinespace.stream.recognition import Event, EventKind, Outcome
from kinespace.stream.workers.track import Track
from kinespace.stream.workers.wire import Answered, SentFrame

SQUAT = Event("ann", EventKind.START, "squat", 0, 1.0, 1.0)
CLASSES = ("squat", "jog")


class Ann:
    """A performer's track, with numbers for its frames."""

    def __init__(self) -> None:
        self.track = Track(1.0, 1.0, 0)
        self.number = 0

    def frame(self, now: float) -> SentFrame:
        """Send a frame."""
        self.number += 1
        self.track.newest = now
        return self.track.send(Frame("ann", now, np.ones((3, 3))), self.number, now, None)

    def answer(self, seq: int, *events: Event) -> object:
        """Take in an answer; give the events that listeners get, None where it is no news."""
        numbers = (0.0, 0.0, None, 0.0, 0.0, 0.0, None, None)
        made = Answered("ann", seq, 0.0, 0, 1.0, Outcome.NAMED, b"", *numbers, events, ())
        return self.track.accept(made, CLASSES)

    def new(self, *events: Event) -> object:
        """Take in an answer to a new frame."""
        return self.answer(self.frame(1.0).seq or 0, *events)


def test_the_first_of_two_answers_counts() -> None:
    """A second answer to a frame is no news, nor one to a frame before it; what began once begins no second time."""
    ann = Ann()
    first, second = ann.frame(1.0).seq or 0, ann.frame(1.1).seq or 0
    assert ann.answer(second, SQUAT) == (SQUAT,)
    assert ann.answer(second, SQUAT) is ann.answer(first) is None
    assert ann.new(SQUAT) == ()


def test_an_answer_to_another_performers_frame_is_no_news() -> None:
    """Numbers go on when the sender has changed: what the former sender's performer did concerns nobody."""
    ann = Ann()
    ann.number = 5
    own = ann.frame(1.1).seq or 0
    assert ann.answer(5, SQUAT) is ann.answer(own + 1, SQUAT) is None
    assert ann.answer(own, SQUAT) == (SQUAT,)


def test_no_motion_starts_whose_class_is_no_more() -> None:
    """A worker that compares with the library before may still give such a start; nobody would give its end."""
    ann = Ann()
    assert ann.new(replace(SQUAT, label="gone")) == ()
    assert ann.track.end() is None
    ann.new(SQUAT)
    assert ann.track.end_unless(CLASSES) is None
    ended = ann.track.end_unless(("jog",))
    assert ended
    assert (ended.kind, ended.label) == (EventKind.END, "squat")


def test_frames_carry_joints_from_time_to_time_and_old_frames_are_forgotten() -> None:
    """The last seconds, with which another worker takes over, hold the joints; older frames are not sent again."""
    track, joints = Track(0.0, 0.0, 0), ("a", "b", "c")
    sent = [track.send(Frame("ann", k / 10, np.ones((3, 3))), k + 1, k / 10, joints) for k in range(100)]
    assert [each.begins for each in sent] == [True] + [False] * 99
    assert sum(each.joints is not None for each in sent) == 10
    done, due = track.recent()
    assert (len(done), len(due)) == (0, 41)
    assert any(each.joints for each in due)
    other = track.send(Frame("ann", 10.0, np.ones((3, 3))), 101, 10.0, joints[::-1])
    assert other.joints == list(joints[::-1])
