"""The messages of workers: what goes out comes back, and what is not ours is refused."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic import STICK_CLASSES, stick_clip

from kinespace.library.windows.rejection import Evidence
from kinespace.stream.frame import Frame
from kinespace.stream.recognition import Done, Event, EventKind, Progress
from kinespace.stream.recognizer import Recognizer, Settings
from kinespace.stream.workers import gateway, wire
from kinespace.stream.workers import terms as agreed

if TYPE_CHECKING:
    from kinespace.library.motion_library import MotionLibrary
    from kinespace.stream.recognition import Recognition

POSITIONS = np.arange(18.0).reshape(6, 3) / 7
TERMS = agreed.Terms(settings=Settings(hop=0.05), most=32, digest="d" * 64)


@pytest.mark.parametrize(
    "changes", [{"positions": b"1234"}, {"performer": ""}, {"time": np.inf}, {"joints": ("a", "a")}]
)
def test_an_impossible_frame_is_refused(changes: dict[str, Any]) -> None:
    """A frame without a name, whose numbers are impossible, or whose positions are not three for each joint."""
    sent = msgspec.structs.replace(wire.SentFrame.of(Frame("ann", 3.0, POSITIONS)), **changes)
    message = wire.encode(wire.Orders(frames=[sent]))
    with pytest.raises(wire.FormatError):
        [each.events() for each in wire.decode(wire.Orders, message).frames]


@pytest.mark.parametrize("kind", [wire.Orders, wire.Answers, agreed.Terms])
@given(message=st.binary(max_size=200))
def test_bytes_of_strangers_are_refused(kind: type[wire.Orders], message: bytes) -> None:
    """Whatever the bytes are: they are read, or refused by a format error."""
    try:
        wire.decode(kind, message)
    except wire.FormatError:
        return


@pytest.fixture(scope="module")
def recognition(sticks: MotionLibrary) -> Recognition:
    """Give a recognition of a real window."""
    recognizer = Recognizer(sticks)
    clip = stick_clip(STICK_CLASSES[0], seed=80, frames=120)
    answers = [recognizer.push(Frame("ann", k / 120, each)) for k, each in enumerate(clip.positions)]
    return [each for each in answers if each][-1]


def test_answers_come_back_to_the_last_bit(recognition: Recognition) -> None:
    """Every number of a recognition, its progress and events come back, and the report with it."""
    event = Event("ann", EventKind.START, recognition.classes[1], 1, 0.5, 2.0)
    progress = Progress(recognition.classes[1], 0.5, 0.4, 1.0, 1.1, 0.9, 2)
    whole = replace(recognition, events=(event,), progress=progress, doubted=("c",))
    report = wire.Report(wire.PerformerCounts(), {"bob": "why"}, stale=4)
    back = wire.decode(wire.Answers, wire.encode(wire.Answers([whole], report)))
    (found,) = back.answers
    assert back.report == report
    assert np.array_equal(found.scores, whole.scores)
    assert {**asdict(found), "scores": ()} == {**asdict(whole), "scores": ()}


NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize(
    "changes",
    [
        *({name: value} for name in ("time", "movement", "share", "gap", "eigenvector_score") for value in (NAN, INF)),
        *(
            {"lead": NAN},
            {"guess": 99},
            {"guess": -1},
            {"so_far": 99},
            {"so_far": -2},
            {"classes": ()},
            {"scores": np.array([NAN] * 3)},
        ),
        {"progress": Progress("somebody's", 0.5, 0.4, 1.0, 1.1, 0.9, 2)},
        *({"progress": Progress(STICK_CLASSES[0], *(INF,) * 5, 2)}, {"evidence": Evidence((NAN,), (0.0,))}),
        *({"done": Done("p", STICK_CLASSES[0], *each)} for each in ((0, NAN, 1, 1, 1, 1), (9, 0, 1, 1, 1, 1))),
    ],
    ids=str,
)
def test_no_answer_that_is_not_finite_is_believed(recognition: Recognition, changes: dict[str, Any]) -> None:
    """A worker's answer names classes that are there, and no number of it is NaN or infinite, but a lead."""
    assert gateway._is_whole(replace(recognition, lead=INF))  # noqa: SLF001 - the check itself
    assert not gateway._is_whole(replace(recognition, **changes))  # noqa: SLF001 - as above


def test_terms_come_back() -> None:
    """Everything in them, the settings too, is what was sent; impossible settings are a format error."""
    message = wire.encode(TERMS)
    assert wire.decode(agreed.Terms, message) == TERMS
    hop = msgspec.msgpack.encode(0.05)
    assert message.count(hop) == 1
    with pytest.raises(wire.FormatError, match="hop"):
        wire.decode(agreed.Terms, message.replace(hop, msgspec.msgpack.encode(-1.0)))
