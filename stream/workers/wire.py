"""The messages between a gateway and its workers, in msgpack: bytes in, checked values out, and back.

A frame is our ZeroMQ message of one part (`kinespace.stream.zeromq.single_part`) with two further fields, and several
frames travel together as a list. Times named `at` are seconds on the gateway's clock.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, TypeVar

import msgspec
import numpy as np

from kinespace.stream.frame import MAX_PERFORMER_LENGTH, Announcement, Frame
from kinespace.stream.recognition import Event, Outcome, Progress, Recognition
from kinespace.stream.recognizer.joints.carried import Carried  # noqa: TC001 - msgspec reads annotations
from kinespace.stream.recognizer.joints.mending import LongAgo  # noqa: TC001 - msgspec reads annotations
from kinespace.stream.recognizer.performers import PerformerCounts  # noqa: TC001 - msgspec reads annotations
from kinespace.stream.zeromq.frames import MAX_SEQ, VERSION, FormatError, NumberedFrame, positions_of
from kinespace.stream.zeromq.single_part import Packed

if TYPE_CHECKING:
    from collections.abc import Callable

#: The first byte of a message to a worker: frames; performers whom it takes over, whose last frames follow; the same
#: performers, whose next frames it answers; a question, to be answered by its number; the gateway's terms, which have
#: changed; the worker's membership, and the end of it.
FRAMES, TAKE_OVER, GO_ON, ASK, TERMS, WELCOME, REJOIN = b"F", b"T", b"G", b"A", b"C", b"W", b"J"
#: Frames in a message, at most.
MAX_TOGETHER = 256
#: Seconds of a sender's clock, at most: more are a mistake.
MAX_SECONDS = 1e300
_Seq = Annotated[int, msgspec.Meta(ge=0, le=MAX_SEQ)]
_Name = Annotated[str, msgspec.Meta(min_length=1, max_length=MAX_PERFORMER_LENGTH)]
_Index = Annotated[int, msgspec.Meta(ge=-1)]


class SentFrame(Packed, kw_only=True, omit_defaults=True, gc=False):
    """A frame on its way to a worker.

    Attributes
    ----------
    at
        When its packet came.
    begins
        Whether the performer begins: the worker forgets an earlier performer of this name.
    asks
        Whether the next answer must say which joints carry it.
    """

    performer: _Name
    t: Annotated[float, msgspec.Meta(ge=-MAX_SECONDS, le=MAX_SECONDS)] = 0.0
    at: float = 0.0
    begins: bool = False
    asks: bool = False


class Entry(msgspec.Struct, array_like=True, frozen=True):
    """A performer whom a worker takes over.

    Attributes
    ----------
    performer
        The performer's name.
    answered
        Whether a frame was answered.
    going_on
        The start of the motion that listeners believe to go on.
    joints
        The joints that the sender announced.
    time
        The time of the last answered frame, on the sender's clock.
    long_ago
        Knowledge of the feed that these frames need not show; None if there is none.
    """

    performer: _Name
    answered: bool
    going_on: Event | None
    joints: tuple[str, ...] | None
    time: float = 0.0
    long_ago: LongAgo | None = None


class Answered(msgspec.Struct, array_like=True, frozen=True):
    """A recognition, with the number and the arrival of its frame, and the number of the terms (`terms.Terms.number`).

    An answer to a frame that asks has the joints that carry it.
    """

    performer: _Name
    seq: _Seq
    at: float
    terms: int
    time: float
    outcome: Outcome
    scores: bytes
    movement: float
    lead: float
    eigenvector_class: str | None
    eigenvector_score: float
    share: float
    gap: float
    guess: _Index | None
    progress: Progress | None
    events: tuple[Event, ...]
    doubted: tuple[str, ...]
    long_ago: LongAgo | None = None
    carried: Carried | None = None

    def recognition(self, classes: tuple[str, ...]) -> Recognition:
        """Give the recognition; FormatError if it does not fit the classes."""
        scores = np.frombuffer(self.scores, "<f8") if len(self.scores) == 8 * len(classes) else np.zeros(0)
        indices = [self.guess or 0, *(event.index for event in self.events)]
        if not len(scores) or not all(0 <= index < len(classes) for index in indices):
            raise FormatError(f"answer: expected scores of {len(classes)} classes, got {len(self.scores)} bytes")
        return Recognition(
            self.performer,
            self.time,
            self.outcome,
            classes,
            scores,
            self.movement,
            self.lead,
            self.eigenvector_class,
            self.eigenvector_score,
            self.share,
            self.gap,
            self.guess,
            None,
            self.progress,
            self.events,
            self.doubted,
        )


class Report(msgspec.Struct, array_like=True, frozen=True):
    """A worker's counters; it also shows that the worker is alive.

    Attributes
    ----------
    counts
        Counts of its frames, without the frames of warming up.
    refused, doubted, compared
        The same as in `Performers`.
    dropped
        Frames or messages that were lost on the way or dropped because the worker was busy.
    leaves
        Whether the worker wants to end: it goes on until its performers are with others.
    """

    counts: PerformerCounts
    refused: dict[str, str]
    doubted: dict[str, str]
    compared: dict[str, str]
    dropped: int = 0
    leaves: bool = False


class Answers(msgspec.Struct, array_like=True, frozen=True):
    """A worker's answers and report, which travel together.

    Attributes
    ----------
    member
        The number of the worker's membership; a worker without one sends 0 and asks for it.
    answered, report
        As they are.
    last
        The number of a question before which it has dealt with everything; 0 where there was no question.
    """

    member: int
    answered: list[Answered]
    report: Report | None = None
    last: int = 0


_Read = TypeVar("_Read")
encode = msgspec.msgpack.Encoder().encode


def decoder(decode: Callable[[bytes], _Read]) -> Callable[[bytes], _Read]:
    """Make a function that decodes a message of one kind; FormatError for any other."""

    def read(message: bytes) -> _Read:
        try:
            return decode(message)
        except (ValueError, RecursionError) as error:
            raise FormatError(f"message: {error}") from error

    return read


_read_frames = decoder(
    msgspec.msgpack.Decoder(Annotated[list[SentFrame], msgspec.Meta(max_length=MAX_TOGETHER)]).decode
)
decode_entries = decoder(msgspec.msgpack.Decoder(list[Entry]).decode)
#: Of a question or of a membership.
decode_number = decoder(msgspec.msgpack.Decoder(int).decode)
decode_answers = decoder(msgspec.msgpack.Decoder(Answers).decode)


def decode_frames(message: bytes) -> list[tuple[SentFrame, NumberedFrame]]:
    """Decode frames; FormatError for a message that is not ours."""
    return [(each, _numbered(each)) for each in _read_frames(message)]


def _numbered(sent: SentFrame) -> NumberedFrame:
    if sent.seq is None or sent.v != VERSION:
        raise FormatError(f"v, seq: expected version {VERSION} and a number, got {sent.v}, {sent.seq}")
    # The gateway has checked the frame and converted its time.
    frame = Frame.unchecked(sent.performer, sent.t, positions_of(sent, sent.data))
    announcement = None if sent.joints is None else Announcement(sent.performer, tuple(sent.joints))
    return NumberedFrame(frame, sent.seq, announcement)


def sent_frame(frame: Frame, seq: int, at: float, joints: tuple[str, ...] | None = None, *, begins: bool) -> SentFrame:
    """Make the message of a frame; positions keep their precision."""
    positions = frame.positions
    dtype = "<f8" if positions.dtype.itemsize == 8 else "<f4"
    return SentFrame(
        v=VERSION,
        shape=(len(positions), 3),
        dtype=dtype,
        seq=seq,
        t=frame.time,
        joints=None if joints is None else list(joints),
        performer=frame.performer,
        data=positions.astype(dtype, copy=False).tobytes(),
        at=at,
        begins=begins,
    )


def answered(recognition: Recognition, seq: int, at: float, terms: int, long_ago: LongAgo | None = None) -> Answered:
    """Make the message of a recognition, without its evidence, and of the knowledge of the feed."""
    return Answered(
        recognition.performer,
        seq,
        at,
        terms,
        float(recognition.time),
        recognition.outcome,
        recognition.scores.astype("<f8", copy=False).tobytes(),
        float(recognition.movement),
        float(recognition.lead),
        recognition.eigenvector_class,
        float(recognition.eigenvector_score),
        float(recognition.share),
        float(recognition.gap),
        recognition.guess,
        recognition.progress,
        recognition.events,
        recognition.doubted,
        long_ago,
    )
