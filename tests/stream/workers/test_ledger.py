"""The receiving process's notes: which answers are news, and which events listeners hear."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from kinespace.stream.frame import Frame
from kinespace.stream.recognition import Event, EventKind, Outcome
from kinespace.stream.recognizer.recognizer import MAX_PAUSE
from kinespace.stream.workers.ledger import Ledger
from kinespace.stream.workers.partition import PARTITIONS
from kinespace.stream.workers.wire import Answered

SQUAT = Event("ann", EventKind.START, "squat", 0, 1.0, 1.0)


def answer(seq: int, *events: Event) -> Answered:
    """Make a worker's answer to a frame of Ann's."""
    numbers = (0.0, 0.0, None, 0.0, 0.0, 0.0, None, None)
    return Answered("ann", seq, 0.0, 0, 1.0, Outcome.NAMED, b"", *numbers, events, ())


def last_word(seq: int, *going_on: Event, at: float = 2.2) -> Answered:
    """Make an answer that says which motion goes on; it is an answer to a frame at 2 s."""
    return msgspec.structs.replace(answer(seq), at=at, time=2.0, going_on=going_on)


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


def settling(*events: Event) -> Ledger:
    """Give a ledger that was told of events and must settle which motion goes on."""
    ledger = Ledger(most=1, silence=5.0)
    ledger.note(answer(sent(ledger, 1.0), *events))
    (partition,) = (each for each in range(PARTITIONS) if ledger.entries([each]))
    ledger.settle(partition)
    return ledger


@pytest.mark.parametrize(
    ("told", "goes_on", "hear"),
    [
        ([], [SQUAT], [replace(SQUAT, time=2.0)]),
        ([SQUAT], [], [replace(SQUAT, kind=EventKind.END, time=2.0)]),
        ([SQUAT], [SQUAT], []),
        ([], [], []),
        (
            [SQUAT],
            [replace(SQUAT, label="jog", index=1)],
            [replace(SQUAT, kind=EventKind.END, time=2.0), replace(SQUAT, label="jog", index=1, time=2.0)],
        ),
    ],
)
def test_an_event_is_told_that_each_of_two_workers_told_too_late(
    told: list[Event], goes_on: list[Event], hear: list[Event]
) -> None:
    """Each told it with the second answer to a frame; a second later the worker that goes on by itself is asked."""
    ledger = settling(*told)
    early = ledger.send(Frame("ann", 1.9, np.ones((3, 3))), 1.9)
    assert early
    assert not early[1].asks
    assert ledger.note(last_word(early[1].seq or 0, *goes_on, at=1.9)) == ()
    numbered = ledger.send(Frame("ann", 2.0, np.ones((3, 3))), 2.0)
    assert numbered
    assert numbered[1].asks
    seq = numbered[1].seq or 0
    assert ledger.note(last_word(seq, *goes_on)) == tuple(hear)
    later = ledger.send(Frame("ann", 2.3, np.ones((3, 3))), 2.3)
    assert later
    assert not later[1].asks
    assert ledger.note(last_word(later[1].seq or 0)) == ()


def test_the_former_workers_last_answers_settle_nothing() -> None:
    """They are answers to frames that came while two workers answered."""
    ledger = Ledger(most=1, silence=5.0)
    first, second = sent(ledger, 1.0), sent(ledger, 1.1)
    assert ledger.note(answer(first)) == ()
    (partition,) = (each for each in range(PARTITIONS) if ledger.entries([each]))
    ledger.settle(partition)
    assert ledger.note(last_word(second, SQUAT, at=1.1)) == ()
    assert ledger.note(last_word(sent(ledger, 2.2), SQUAT)) == (replace(SQUAT, time=2.0),)


def test_a_motion_that_ended_at_a_pause_does_not_start_again() -> None:
    """A worker that has not heard of the pause says that the motion goes on."""
    ledger = settling(SQUAT)
    late = sent(ledger, 1.1)
    assert len(ledger.end_paused(1.1 + 2 * MAX_PAUSE)) == 1
    assert ledger.note(last_word(late, SQUAT)) == ()
    ledger = settling()
    late = sent(ledger, 1.1)
    assert ledger.end_paused(1.1 + 2 * MAX_PAUSE) == []
    assert ledger.note(last_word(late, SQUAT)) == ()


def test_a_motion_whose_class_is_no_more_goes_on_for_no_listener() -> None:
    """The worker may not have heard of the new library."""
    ledger = settling()
    assert ledger.note(last_word(sent(ledger, 1.1), SQUAT), ("jog",)) == ()
    assert ledger.end() == []
