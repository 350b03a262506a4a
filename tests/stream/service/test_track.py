"""One performer as the gateway knows it: which answers are news, and which events listeners get."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kinespace.stream.frame import Frame
from kinespace.stream.recognition import Outcome, Recognition
from kinespace.stream.recognizer.decision import Decision
from kinespace.stream.service.gateway import DUE, HISTORY, Track

if TYPE_CHECKING:
    from kinespace.stream.service.worker import SentFrame

CLASSES = ("squat", "jog")
JOINTS = ("a", "b", "c")


class Ann:
    """A performer's track."""

    def __init__(self) -> None:
        self.track = Track(0.0, 0.0, Decision(0.01))

    def frame(self, now: float, joints: tuple[str, ...] | None = None) -> SentFrame:
        """Send a frame."""
        self.track.newest = now
        return self.track.send(Frame("ann", now, np.ones((3, 3))), joints)

    def answer(
        self, time: float, named: str = "squat", classes: tuple[str, ...] = CLASSES
    ) -> list[tuple[str, str]] | None:
        """Take in an answer; give what started and ended, None where it is no news."""
        scores, guess = np.full(len(classes), 0.5), classes.index(named)
        made = Recognition("ann", time, Outcome.NAMED, classes, scores, 0.1, lead=1.0, guess=guess)
        accepted = self.track.accept(made, CLASSES)
        if accepted is None:
            return None
        assert accepted[1] == time
        return [(event.kind.value, event.label) for event in accepted[0].events]

    def play(self, begin: float, end: float, named: str, classes: tuple[str, ...] = CLASSES) -> list[tuple[str, str]]:
        """Send frames and answer them; give what started and ended."""
        found = list[tuple[str, str]]()
        for time in np.arange(begin, end, 0.05).tolist():
            self.frame(time)
            found += self.answer(time, named, classes) or []
        return found


def test_only_the_first_answer_to_an_own_frame_is_news() -> None:
    """No second answer, none to a frame before it, and none to a frame that was never sent."""
    ann = Ann()
    assert ann.answer(1.0) is None
    for time in (1.0, 1.1, 1.2):
        ann.frame(time)
    assert ann.answer(1.15) is ann.answer(np.nan) is None
    assert ann.answer(1.1) == []
    assert ann.answer(1.1) is ann.answer(1.0) is None
    assert ann.answer(1.2) is not None


def test_motions_start_and_end_once() -> None:
    """A motion starts and ends with the next, and ends with an exchange; other classes start none."""
    ann = Ann()
    assert ann.play(1.0, 2.0, "squat") == [("start", "squat")]
    assert ann.play(2.0, 3.0, "jog") == [("end", "squat"), ("start", "jog")]
    assert ann.play(3.0, 4.0, "gone", ("gone", "jog")) == []
    assert ann.track.exchange(("jog", "squat"), 0.01) is None
    assert ann.track.decision.going_on
    assert ann.track.decision.going_on.index == 0
    ended = ann.track.exchange(("squat",), 0.01)
    assert ended
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
    assert (seen[-1].time, due[0].time, due[-1].time) == (now - DUE - 0.125, now - DUE, now + 0.125)
    ann.answer(9.75)
    seen, due = ann.track.past(JOINTS, now)
    assert (seen[0].time, seen[-1].time, due[0].time) == (9.75 - HISTORY, 9.75, 9.875)
    assert (seen[0].begins, seen[0].joints, seen[1].begins) == (True, JOINTS, False)
    assert ann.track.is_owed(0.1)
    ann.answer(now + 0.125)
    assert not ann.track.is_owed(0.1)
