"""The receiving process's notes: which answers are news, and which events listeners hear."""

from __future__ import annotations

import numpy as np

from kinespace.stream.frame import Frame
from kinespace.stream.recognition import Event, EventKind, Outcome
from kinespace.stream.workers.ledger import Ledger
from kinespace.stream.workers.wire import Answered

SQUAT = Event("ann", EventKind.START, "squat", 0, 1.0, 1.0)


def answer(seq: int, *events: Event) -> Answered:
    """Make a worker's answer to a frame of Ann's."""
    numbers = (0.0, 0.0, None, 0.0, 0.0, 0.0, None, None)
    return Answered("ann", seq, 0.0, 0, 1.0, Outcome.NAMED, b"", *numbers, events, ())


def sent(ledger: Ledger, now: float) -> int:
    """Send a frame of Ann's; give its number."""
    numbered = ledger.send(Frame("ann", now, np.ones((3, 3))), now)
    assert numbered
    return numbered[1].seq or 0


def test_the_first_of_two_answers_counts() -> None:
    """A second answer to a frame is no news, nor one to a frame before it; what began once begins no second time."""
    ledger = Ledger(most=1, silence=5.0)
    first, second = sent(ledger, 1.0), sent(ledger, 1.1)
    assert ledger.note(answer(second, SQUAT)) == (SQUAT,)
    assert ledger.note(answer(second, SQUAT)) is None
    assert ledger.note(answer(first)) is None
    assert ledger.note(answer(sent(ledger, 1.2), SQUAT)) == ()


def test_a_late_answer_to_a_former_senders_frame_is_no_news() -> None:
    """Where the sender has changed, what the former sender's performer did concerns nobody."""
    ledger = Ledger(most=1, silence=5.0)
    late = sent(ledger, 1.0)
    ledger.change_sender("ann")
    own = sent(ledger, 1.1)
    assert ledger.note(answer(late, SQUAT)) is None
    assert ledger.note(answer(own, SQUAT)) == (SQUAT,)


def test_no_motion_starts_whose_class_is_no_more() -> None:
    """A worker that compares with the library before may still tell such a start; nobody would tell its end."""
    ledger = Ledger(most=1, silence=5.0)
    assert ledger.note(answer(sent(ledger, 1.0), SQUAT), ("jog",)) == ()
    assert ledger.end() == []
