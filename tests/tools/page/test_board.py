"""The board: what pages are told of a recogniser's messages, newest only, and of the last minute."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kinespace.library.skeleton import Skeleton
from kinespace.stream import zeromq
from kinespace.stream.frame import Frame
from kinespace.stream.recognition import Done, Event, EventKind, Outcome, Recognition
from kinespace.stream.recognizer.performers import PerformerCounts
from kinespace.stream.status import InputCounts, Status
from kinespace.stream.teaching.commands import State, Step, Taught, as_json
from kinespace.stream.zeromq import messages as zeromq_answers
from kinespace.stream.zeromq.messages import encode_body
from kinespace.tools.page.board import MAX_SHOWN, Board
from kinespace.tools.terminal.live_table import COUNTERS, counts

CLASSES = ("bow", "wave")
STICK = Skeleton(("hip", "neck", "head"), (-1, 0, 1))
POSE = np.array([[0.0, 1.0, 0.0], [0.0, 1.5, 0.0], [0.0, 1.7, 0.0]])


def _answer(performer: str, class_name: str = "bow", score: float = 0.8) -> list[bytes]:
    place = CLASSES.index(class_name)
    scores = np.array([score if index == place else 0.2 for index in range(len(CLASSES))])
    return zeromq.encode_recognition(Recognition(performer, 1.0, Outcome.NAMED, CLASSES, scores, 0.1, guess=place))


def _event(performer: str, kind: EventKind, class_name: str, time: float) -> list[bytes]:
    return zeromq_answers.encode_event(Event(performer, kind, class_name, CLASSES.index(class_name), 0.8, time))


def _notice(notice: State | Taught) -> list[bytes]:
    return [b"teach/", json.dumps(as_json(notice)).encode()]


def _status(**fields: Any) -> list[bytes]:  # noqa: ANN401 - a status has fields of all kinds
    known: dict[str, Any] = {"inputs": InputCounts(), "outcomes": PerformerCounts(), "unsent": 0, "performers": {}}
    return zeromq_answers.encode_status(Status(**(known | {"hop_p50": 0.001, "hop_p99": 0.002} | fields)))


def _told(board: Board, seen: int = 0, now: float = 0.0) -> tuple[dict[str, Any], bytes]:
    """Read what a page reads: the JSON, and the bodies behind it."""
    message = board.news(seen, now)
    size = int.from_bytes(message[:4], "little")
    assert size % 4 == 0
    return json.loads(message[4 : 4 + size]), message[4 + size :]


def _board(*messages: list[bytes], now: float = 0.0) -> Board:
    board = Board()
    for message in messages:
        board.take(message, now)
    assert board.unread == 0
    return board


def test_motions_that_were_done_are_shown_once() -> None:
    """A page gets each with its count, and with its span on our clock."""
    done = Done("ann", "bow", 0, 7.0, 1.5, 0.9, 1.0, 1.0, 4)
    board = _board(_answer("ann"), zeromq_answers.encode_done(done), now=10.0)
    told, _ = _told(board)
    assert told["done"] == [["ann", "bow", 4, 8.5, 10.0]]
    assert "done" not in _told(board, seen=told["number"])[0]


def test_bodies_and_answers_are_the_newest() -> None:
    """A page that looks after three bodies and two answers gets the last of each, and then nothing until more comes."""
    poses = [POSE + shift for shift in (0.0, 1.0, 2.0)]
    board = _board(
        *(encode_body(Frame("ann", 1.0, pose), STICK) for pose in poses), _answer("ann"), _answer("ann", "wave")
    )
    told, bodies = _told(board)
    assert told["bodies"] == [["ann", 3]]
    assert np.array_equal(np.frombuffer(bodies, "<f4").reshape(-1, 3), poses[-1].astype(np.float32))
    assert told["skeleton"] == {"ann": {"names": ["hip", "neck", "head"], "parents": [-1, 0, 1]}}
    assert (told["answer"]["ann"]["label"], told["answer"]["ann"]["scores"]) == ("wave", [0.2, 0.8])
    assert [guess for _, _, guess in told["guesses"]] == ["bow", "wave"]
    again, none = _told(board, told["number"])
    assert (set(again), none) == ({"number", "now"}, b"")
    board.take(_answer("ann", score=0.5), 1.0)
    later, _ = _told(board, told["number"])
    assert later["answer"]["ann"]["score"] == 0.5
    assert "skeleton" not in later


def test_motions_are_kept_for_a_minute_with_their_beginnings_and_ends() -> None:
    """A page that wakes up gets every motion of the last minute, as long as the sender's clock says; no older ones."""
    board = Board()
    for second in range(0, 200, 10):
        board.take(_event("ann", EventKind.START, "bow", 1.0 + second), float(second))
        # The end is told late: no frames came for two seconds.
        board.take(_event("ann", EventKind.END, "bow", 5.0 + second), second + 6.0)
    board.take(_event("ann", EventKind.START, "wave", 0.0), 200.0)
    motions = _told(board)[0]["motions"]
    assert [(name, begin, end) for _, _, name, begin, end, _ in motions][-2:] == [
        ("bow", 190, 194),
        ("wave", 200, None),
    ]
    assert min(end for *_, end, _ in motions if end is not None) >= 200 - 70
    assert len(motions) == 7


def test_a_lesson_becomes_a_bar() -> None:
    """What is kept of a lesson stands on the timeline, marked as taught, as long as the table says."""
    board = _board(_answer("ann"))
    for moment, notice in (
        (5.0, State("ann", Step.COUNTDOWN, 3.0)),
        (8.0, State("ann", Step.RECORDING)),
        (10.0, State("ann", Step.CHECKING, 1.8)),
        (10.5, Taught("wave", 1, 1.8, "good")),
    ):
        board.take(_notice(notice), moment)
    told = _told(board)[0]
    assert told["motions"][0][2:6] == ["wave", 8.0, 9.8, "taught"]
    assert [each["state"] for each in told["notices"]] == ["countdown", "recording", "checking", ""]


def test_performers_come_and_go() -> None:
    """Eight are shown, more are counted; who has gone, or was silent for long, is no longer told."""
    board = Board()
    for number in range(MAX_SHOWN + 2):
        board.take(_answer(f"p{number}"), 0.0)
    board.take(_status(), 0.0)
    told = _told(board)[0]
    assert told["here"] == [f"p{number}" for number in range(MAX_SHOWN)]
    assert told["status"]["further"] == 2
    board.take(zeromq_answers.encode_gone("p0"), 1.0)
    board.take(_answer("p1"), 12.0)
    board.take(_status(), 12.0)
    assert _told(board)[0]["here"] == ["p1"]


def test_the_counters_have_the_words_of_the_table() -> None:
    """The page counts with the words that `live` prints, in the same order, and the same numbers."""
    inputs = InputCounts(received=9, malformed=8, foreign=7, overrun=6, missing=5)
    status = Status(inputs, PerformerCounts(no_room=3, other_joints=2), 0, {}, 0.001, 0.002)
    told = _told(_board(zeromq_answers.encode_status(status)))[0]
    assert counts(status) == ", ".join(f"{words} {count}" for words, count in told["status"]["counters"])
    everything = Status(
        InputCounts(*[4] * 8), PerformerCounts(1, 1), 1, {}, 0.0, 0.0, notes=("a note",), refused={"ann": "3 joints"}
    )
    everything = replace(everything, listening=("OSC 127.0.0.1:9310",))
    told = _told(_board(zeromq_answers.encode_status(everything)))[0]
    shown = dict(told["status"]["counters"])
    assert shown["incomplete"] == 4
    assert all(words in counts(everything) for words in shown if words != "answers not sent")
    assert set(shown) <= {words for words, _ in COUNTERS}
    assert "ann" in told["status"]["notes"][0]
    assert told["status"]["notes"][1] == "a note"
    assert told["status"]["listening"] == ["OSC 127.0.0.1:9310"]


@pytest.mark.slow
@given(
    st.sampled_from([b"class/a/", b"event/", b"classes/", b"status/", b"teach/", b"body/a/", b"other/", b""]),
    st.binary(max_size=60),
)
def test_rubbish_is_counted(topic: bytes, rest: bytes) -> None:
    """A message that cannot be read changes nothing but the count."""
    board = _board(_answer("ann"))
    before = _told(board)[0]["here"]
    board.take([topic, rest], 1.0)
    assert _told(board)[0]["here"] == before
