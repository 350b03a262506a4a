"""The messages of workers: what goes out comes back, and what is not ours is refused."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic import STICK_CLASSES, stick_clip

from kinespace.stream.frame import Frame
from kinespace.stream.recognition import Event, EventKind, Progress
from kinespace.stream.recognizer import Recognizer
from kinespace.stream.recognizer.joints.mending import LongAgo
from kinespace.stream.workers import wire
from kinespace.stream.zeromq import FormatError
from kinespace.stream.zeromq.single_part import decode as decode_single

if TYPE_CHECKING:
    from collections.abc import Callable

    from kinespace.library.motion_library import MotionLibrary
    from kinespace.stream.recognition import Recognition

POSITIONS = np.arange(18.0).reshape(6, 3) / 7


def sent(**changes: Any) -> wire.SentFrame:  # noqa: ANN401 - any field
    """Give a frame as it is sent, with some fields changed."""
    frame = wire.sent_frame(Frame("ann", 3.0, POSITIONS), 7, 5.0, ("a", "b", "c", "d", "e", "f"), begins=True)
    return msgspec.structs.replace(frame, **changes)


@pytest.mark.parametrize("kind", ["f4", "f8"])
def test_frames_come_back_to_the_last_bit(kind: str) -> None:
    """Positions keep their precision, and number, times and joints are those that were sent."""
    frames = [
        wire.sent_frame(Frame("ann", 0.0, POSITIONS.astype(kind)), 7, 5.0, begins=False),
        sent(seq=8),
    ]
    (first, second) = wire.decode_frames(wire.encode(frames))
    assert (first[0].at, first[1].seq, first[1].frame.time, first[1].announcement) == (5.0, 7, 0.0, None)
    assert first[1].frame.positions.dtype == np.dtype(kind)
    assert np.array_equal(first[1].frame.positions, POSITIONS.astype(kind))
    assert second[0].begins
    assert second[1].announcement is not None
    assert second[1].announcement.joints == ("a", "b", "c", "d", "e", "f")


def test_a_frame_is_our_zeromq_message() -> None:
    """The decoder of ZeroMQ messages of one part reads a frame from the list."""
    (packed,) = msgspec.msgpack.decode(wire.encode([sent()]))
    numbered = decode_single(msgspec.msgpack.encode(packed), 1.0)
    assert (numbered.frame.performer, numbered.frame.time, numbered.seq) == ("ann", 3.0, 7)
    assert np.array_equal(numbered.frame.positions, POSITIONS)


@pytest.mark.parametrize(
    "changes",
    [{"v": 2}, {"seq": None}, {"shape": (7, 3)}, {"dtype": "<f2"}, {"data": b""}, {"performer": ""}, {"t": np.inf}],
)
def test_an_impossible_frame_is_refused(changes: dict[str, Any]) -> None:
    """A frame of another version, without a number, or whose positions do not fit is a format error."""
    with pytest.raises(FormatError):
        wire.decode_frames(wire.encode([sent(**changes)]))


@pytest.mark.parametrize("decode", [wire.decode_frames, wire.decode_entries, wire.decode_answers])
@given(message=st.binary(max_size=200))
def test_bytes_of_strangers_are_refused(decode: Callable[[bytes], object], message: bytes) -> None:
    """Whatever the bytes are: they are read, or refused by a format error."""
    try:
        decode(message)
    except FormatError:
        return


@pytest.fixture(scope="module")
def recognition(sticks: MotionLibrary) -> Recognition:
    """Give a recognition of a real window."""
    recognizer = Recognizer(sticks)
    clip = stick_clip(STICK_CLASSES[0], seed=80, frames=120)
    answers = [recognizer.push(Frame("ann", k / 120, each)) for k, each in enumerate(clip.positions)]
    return [each for each in answers if each][-1]


def test_answers_come_back_to_the_last_bit(recognition: Recognition) -> None:
    """Every number of a recognition, its progress and events come back; its evidence stays with the worker."""
    event = Event("ann", EventKind.START, recognition.classes[1], 1, 0.5, 2.0)
    progress = Progress(recognition.classes[1], 0.5, 0.4, 1.0, 1.1, 0.9, 2)
    whole = msgspec.structs.replace(
        wire.answered(recognition, 9, 5.0, 0, LongAgo(mirrored=True, last_jump=1.5)),
        events=(event,),
        progress=progress,
        doubted=("c",),
        eigenvector_class=None,
    )
    report = wire.Report(wire.PerformerCounts(), {"bob": "why"}, {}, {}, 4)
    back = wire.decode_answers(wire.encode(wire.Answers(3, [whole], report)))
    assert (back.member, back.report) == (3, report)
    (answer,) = back.answered
    assert (answer.seq, answer.at, answer.long_ago) == (9, 5.0, LongAgo(mirrored=True, last_jump=1.5))
    again = answer.recognition(recognition.classes)
    assert np.array_equal(again.scores, recognition.scores)
    assert (again.events, again.progress, again.doubted, again.evidence) == ((event,), progress, ("c",), None)
    for name in ("performer", "time", "outcome", "classes", "movement", "lead", "share", "gap", "guess", "label"):
        assert getattr(again, name) == getattr(recognition, name)


@pytest.mark.parametrize("changes", [{"guess": 99}, {"scores": b""}, {"scores": b"12345678"}])
def test_an_answer_that_does_not_fit_the_classes_is_refused(recognition: Recognition, changes: dict[str, Any]) -> None:
    """An index beyond the classes, or another number of scores, is a format error."""
    answer = msgspec.structs.replace(wire.answered(recognition, 9, 5.0, 0), **changes)
    with pytest.raises(FormatError):
        answer.recognition(recognition.classes)
