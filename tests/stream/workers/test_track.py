"""One performer as the gateway knows it: which answers are news, and which events listeners get."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kinespace.stream.frame import Frame
from kinespace.stream.recognition import Outcome, Recognition
from kinespace.stream.recognizer.decision import Decision
from kinespace.stream.workers.track import Track
from kinespace.stream.workers.wire import Answered, SentFrame

if TYPE_CHECKING:
    from kinespace.stream.recognition import Event

CLASSES = ("squat", "jog")


class Ann:
    """A performer's track, with numbers for its frames; every second frame is answered."""

    def __init__(self, first: int = 1, hop: float = 0.0) -> None:
        self.track = Track(1.0, 1.0, first - 1, Decision(0.01), hop=hop)
        self.number = first - 1

    def frame(self, now: float) -> SentFrame:
        """Send a frame."""
        self.number += 1
        return self.track.send(Frame("ann", now, np.ones((3, 3))), self.number, now, None)

    def answer(
        self, seq: int, time: float, named: str = "squat", classes: tuple[str, ...] = CLASSES, at: float | None = None
    ) -> tuple[Event, ...] | None:
        """Take in an answer; give the events that listeners get, None where it is no news."""
        scores, guess = np.full(len(classes), 0.5), classes.index(named)
        made = Recognition("ann", time, Outcome.NAMED, classes, scores, 0.1, lead=1.0, guess=guess)
        return self.track.accept(Answered(seq, time if at is None else at, made), CLASSES)

    def play(self, begin: float, end: float, named: str, classes: tuple[str, ...] = CLASSES) -> list[tuple[str, str]]:
        """Send frames and answer them; give what started and ended."""
        found = list[tuple[str, str]]()
        for time in np.arange(begin, end, 0.05):
            events = self.answer(self.frame(time).seq, time, named, classes)
            assert events is not None
            found += [(event.kind.value, event.label) for event in events]
        return found


def test_only_the_first_answer_to_an_own_frame_is_news() -> None:
    """No second answer, none to a frame before it, to a former performer's of this name, or to one never sent."""
    ann = Ann(first=6)
    first, second = ann.frame(1.0).seq, ann.frame(1.1).seq
    assert ann.answer(5, 1.0) is ann.answer(second + 1, 1.2) is None
    assert ann.answer(second, 1.1) == ()
    assert ann.answer(second, 1.1) is ann.answer(first, 1.0) is None


def test_an_answer_has_its_frames_times() -> None:
    """What a worker says of a frame's time and arrival is compared with the frame."""
    ann = Ann()
    seq = ann.frame(1.0).seq
    for time, at in ((np.nan, 1.0), (np.inf, 1.0), (1.01, 1.0), (1.0, np.nan), (1.0, 0.9)):
        assert ann.answer(seq, time, at=at) is None
    assert ann.answer(seq, 1.0) == ()


def test_one_answer_a_hop_counts() -> None:
    """A worker that answers every frame is believed as often as one that answers once a hop, late or not."""
    ann, generator = Ann(hop=0.1), np.random.default_rng(3)
    times = np.cumsum(generator.uniform(0.01, 0.03, 400))
    heard = sum(ann.answer(ann.frame(time).seq, time) is not None for time in times.tolist())
    assert heard <= times[-1] / 0.1 + 3
    honest, due = Ann(hop=0.1), 0.0
    for time in times.tolist():
        seq = honest.frame(time).seq
        if time >= due:
            assert honest.answer(seq, time) is not None
            due = max(due + 0.1, time) if due + 0.1 > time else time + 0.1


def test_motions_start_and_end_once() -> None:
    """A motion starts and ends with the next; a pause in the sender's time ends it, and so does an exchange."""
    ann = Ann()
    assert ann.play(1.0, 2.0, "squat") == [("start", "squat")]
    assert ann.play(2.0, 3.0, "jog") == [("end", "squat"), ("start", "jog")]
    assert ann.play(9.0, 10.0, "jog") == [("end", "jog"), ("start", "jog")]
    assert ann.play(10.0, 11.0, "gone", ("gone", "jog")) == []
    assert ann.track.exchange(("jog", "squat"), 0.01) is None
    assert ann.track.decision.going_on
    assert ann.track.decision.going_on.index == 0
    ended = ann.track.exchange(("squat",), 0.01)
    assert ended
    assert (ended.kind, ended.label, ended.time) == ("end", "jog", ann.track._time)  # noqa: SLF001 - of the last frame
    assert ann.track.end() is None


def test_frames_carry_joints_from_time_to_time_and_old_frames_are_forgotten() -> None:
    """A worker that takes over gets the last seconds with the joints, and knows which of them need an answer."""
    track, joints = Track(0.0, 0.0, 0, Decision(1.0)), ("a", "b", "c")
    sent = [track.send(Frame("ann", k / 10, np.ones((3, 3))), k + 1, k / 10, joints) for k in range(100)]
    assert [each.begins for each in sent] == [True] + [False] * 99
    assert sum(each.joints is not None for each in sent) == 10
    done, due = track.recent(joints)
    assert (len(done), len(due)) == (0, 41)
    assert (due[0].begins, due[0].joints, due[0].take_over) == (True, joints, track.past)
    made = Recognition("ann", 9.5, Outcome.STILL, CLASSES, np.zeros(2), 0.0)
    track.accept(Answered(96, 9.5, made), CLASSES)
    done, due = track.recent(joints)
    assert ([each.seq for each in done], [each.seq for each in due]) == ([*range(71, 97)], [97, 98, 99, 100])
    assert track.past.time == 9.5
    other = track.send(Frame("ann", 10.0, np.ones((3, 3))), 101, 10.0, joints[::-1])
    assert other.joints == joints[::-1]
