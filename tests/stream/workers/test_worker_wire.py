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
from kinespace.stream.frame import Announcement, Frame
from kinespace.stream.recognition import Done, Event, EventKind, Progress
from kinespace.stream.recognizer import Recognizer, Settings
from kinespace.stream.recognizer.joints.carried import Carried
from kinespace.stream.recognizer.joints.mending import LongAgo
from kinespace.stream.workers import router, wire
from kinespace.stream.workers import terms as agreed

if TYPE_CHECKING:
    from collections.abc import Callable

    from kinespace.library.motion_library import MotionLibrary
    from kinespace.stream.recognition import Recognition

POSITIONS = np.arange(18.0).reshape(6, 3) / 7
TERMS = agreed.Terms(settings=Settings(hop=0.05), most=32, digest="d" * 64)


@pytest.mark.parametrize("kind", ["f4", "f8"])
def test_frames_come_back_to_the_last_bit(kind: str) -> None:
    """Positions keep their precision, and all else is as it was sent."""
    sent = wire.SentFrame.of(Frame("ann", 3.0, POSITIONS.astype(kind)), 7, 5.0)
    sent.joints, sent.go_on = ("a", "b"), wire.Past(1.0, LongAgo(mirrored=True, last_jump=1.5))
    (found,) = wire.decode_orders(wire.encode(wire.Orders("me", frames=[sent]))).frames
    assert found == sent
    assert (found.frame().performer, found.frame().time) == ("ann", 3.0)
    assert found.frame().positions.dtype == np.dtype(kind)
    assert np.array_equal(found.frame().positions, POSITIONS.astype(kind))
    assert found.announcement() == Announcement("ann", ("a", "b"))


@pytest.mark.parametrize(
    "changes", [{"positions": b"1234"}, {"performer": ""}, {"time": np.inf}, {"seq": -1}, {"joints": ("a", "a")}]
)
def test_an_impossible_frame_is_refused(changes: dict[str, Any]) -> None:
    """A frame without a name, whose numbers are impossible, or whose positions are not three for each joint."""
    sent = msgspec.structs.replace(wire.SentFrame.of(Frame("ann", 3.0, POSITIONS), 7, 5.0), **changes)
    with pytest.raises(wire.FormatError):
        [
            (each.frame(), each.announcement())
            for each in wire.decode_orders(wire.encode(wire.Orders(frames=[sent]))).frames
        ]


@pytest.mark.parametrize("decode", [wire.decode_orders, wire.decode_answers])
@given(message=st.binary(max_size=200))
def test_bytes_of_strangers_are_refused(decode: Callable[[bytes], object], message: bytes) -> None:
    """Whatever the bytes are: they are read, or refused by a format error."""
    try:
        decode(message)
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
    answer = wire.Answered(9, 5.0, whole, LongAgo(mirrored=True, last_jump=1.5))
    report = wire.Report(wire.PerformerCounts(), {"bob": "why"}, dropped=4)
    back = wire.decode_answers(wire.encode(wire.Answers("me", [answer], report, 3)))
    assert (back.member, back.report, back.question) == ("me", report, 3)
    (found,) = back.answered
    assert (found.seq, found.at, found.long_ago, found.carried) == (9, 5.0, answer.long_ago, None)
    assert np.array_equal(found.recognition.scores, whole.scores)
    assert {**asdict(found.recognition), "scores": ()} == {**asdict(whole), "scores": ()}


NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize(
    "changes",
    [
        *({name: value} for name in ("time", "movement", "share", "gap", "eigenvector_score") for value in (NAN, INF)),
        *({"lead": NAN}, {"guess": 99}, {"guess": -1}, {"classes": ()}, {"scores": np.array([NAN] * 3)}),
        {"progress": Progress("somebody's", 0.5, 0.4, 1.0, 1.1, 0.9, 2)},
        *({"progress": Progress(STICK_CLASSES[0], *(INF,) * 5, 2)}, {"evidence": Evidence((NAN,), (0.0,))}),
        *({"done": Done("p", STICK_CLASSES[0], *each)} for each in ((0, NAN, 1, 1, 1, 1), (9, 0, 1, 1, 1, 1))),
        *({"long_ago": LongAgo(factor=INF)}, {"long_ago": LongAgo(last_jump=NAN)}, {"carried": Carried((NAN,), ())}),
    ],
    ids=str,
)
def test_no_answer_that_is_not_finite_is_believed(recognition: Recognition, changes: dict[str, Any]) -> None:
    """A worker's answer names classes that are there, and no number of it is NaN or infinite, but a lead."""
    assert router._is_whole(wire.Answered(9, 5.0, replace(recognition, lead=INF), LongAgo()))  # noqa: SLF001 - the check itself
    beside = {name: changes[name] for name in changes if name in ("long_ago", "carried")}
    told = replace(recognition, **{name: changes[name] for name in changes if name not in beside})
    assert not router._is_whole(wire.Answered(9, 5.0, told, **beside))  # noqa: SLF001 - as above


def test_terms_come_back() -> None:
    """Everything in them, the settings too, is what was sent; impossible settings are a format error."""
    message = wire.encode(wire.Orders("me", TERMS))
    assert wire.decode_orders(message).terms == TERMS
    hop = msgspec.msgpack.encode(0.05)
    assert message.count(hop) == 1
    with pytest.raises(wire.FormatError, match="hop"):
        wire.decode_orders(message.replace(hop, msgspec.msgpack.encode(-1.0)))


def test_a_library_is_known_by_its_motions(sticks: MotionLibrary) -> None:
    """The same motions give the same digest, other motions another."""
    digest = agreed.digest_of(agreed.file_of(sticks))
    assert agreed.digest_of(agreed.file_of(sticks)) == digest
    fewer = sticks.without(classes=[sticks.classes[0]])
    assert agreed.digest_of(agreed.file_of(fewer)) != digest


def test_any_name_is_part_of_a_key() -> None:
    """What means something in Zenoh's keys is written otherwise in ours."""
    assert wire.key("g", "to", "a/b*?#$ é") == "kin/g/to/a%2Fb%2A%3F%23%24%20%C3%A9"
