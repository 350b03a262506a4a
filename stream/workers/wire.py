"""The messages between a gateway and its workers, in msgpack: bytes in, checked values out, and back.

| key | content | from |
|---|---|---|
| `kin/gateway/<gateway>`, `kin/worker/<worker>` | liveliness tokens | both |
| `kin/<gateway>/library` | a query: the library | gateway |
| `kin/<gateway>/to/<worker>` | `Orders`: terms, frames, questions | gateway |
| `kin/<gateway>/back/<worker>` | `Answers`: answers, reports | worker |

Times named `at` are seconds on the gateway's clock.
"""

from __future__ import annotations

from typing import Annotated, Any, TypeVar
from urllib.parse import quote, unquote

import msgspec
import numpy as np

from kinespace.stream.frame import MAX_PERFORMER_LENGTH, Announcement, Frame
from kinespace.stream.recognition import Recognition  # noqa: TC001 - msgspec reads annotations
from kinespace.stream.recognizer.joints.carried import Carried  # noqa: TC001 - as above
from kinespace.stream.recognizer.joints.mending import LongAgo  # noqa: TC001 - as above
from kinespace.stream.recognizer.performers import PerformerCounts  # noqa: TC001 - as above
from kinespace.stream.workers.terms import Terms  # noqa: TC001 - as above

GATEWAYS = "kin/gateway"
WORKERS = "kin/worker"
#: Seconds of a sender's clock, at most: more are a mistake.
MAX_SECONDS = 1e300
_FLOATS: np.dtype[np.floating] = np.dtype("<f4")
_DOUBLES: np.dtype[np.floating] = np.dtype("<f8")
_Count = Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)]


class FormatError(ValueError):
    """A message is not one of ours; the text says why."""


class Past(msgspec.Struct, array_like=True, frozen=True):
    """What the last seconds of a performer's frames need not show.

    Attributes
    ----------
    time
        The time of the last answered frame, on the sender's clock; None before the first answer.
    long_ago
        The last worker's knowledge of the feed; None if there is none.
    """

    time: float | None = None
    long_ago: LongAgo | None = None


class SentFrame(msgspec.Struct, array_like=True, gc=False):
    """A frame on its way to a worker.

    Attributes
    ----------
    performer, time
        As in `Frame`.
    seq
        Its number among all frames of the gateway.
    at
        When its packet came.
    positions, doubles
        Numbers of three for each joint, little-endian, and whether they are doubles.
    joints
        Their names; None where they are as before.
    asks
        Whether the next answer must say which joints carry it.
    begins
        Whether the performer begins: the worker forgets an earlier performer of this name.
    take_over
        With the first of the last seconds of a performer of another worker: no frame is answered until one has `go_on`.
    go_on
        With the first frame that the worker answers in another worker's place.
    """

    performer: Annotated[str, msgspec.Meta(min_length=1, max_length=MAX_PERFORMER_LENGTH)]
    time: Annotated[float, msgspec.Meta(ge=-MAX_SECONDS, le=MAX_SECONDS)]
    seq: _Count
    at: float
    positions: bytes
    doubles: bool = False
    joints: tuple[str, ...] | None = None
    asks: bool = False
    begins: bool = False
    take_over: Past | None = None
    go_on: Past | None = None

    @classmethod
    def of(cls, frame: Frame, seq: int, at: float) -> SentFrame:
        """Make the message of a frame; positions keep their precision."""
        doubles = frame.positions.dtype.itemsize == _DOUBLES.itemsize
        positions = frame.positions.astype(_DOUBLES if doubles else _FLOATS, copy=False)
        return cls(frame.performer, frame.time, seq, at, positions.tobytes(), doubles)

    def frame(self) -> Frame:
        """Give the frame, which the gateway has checked; FormatError if its positions are not three for each joint."""
        try:
            positions = np.frombuffer(self.positions, _DOUBLES if self.doubles else _FLOATS).reshape(-1, 3)
        except ValueError as error:
            raise FormatError(f"positions: {error}") from error
        return Frame.unchecked(self.performer, self.time, positions)

    def announcement(self) -> Announcement | None:
        """Give the joints' names, if the frame has them; FormatError if they are none."""
        try:
            return None if self.joints is None else Announcement(self.performer, self.joints)
        except ValueError as error:
            raise FormatError(str(error)) from error


class Orders(msgspec.Struct, omit_defaults=True):
    """A message to a worker. Its fields have names, so that a worker of another version can read the terms.

    Attributes
    ----------
    member
        The membership, as the worker named it: orders to another one are somebody else's.
    terms
        The gateway's terms, when the worker begins and when they have changed.
    begins
        Whether the worker forgets all performers: the gateway had given them to others.
    frames
        Frames, in order.
    number
        The number of a message that may be lost on the way, counted from 1; 0 for a message that must arrive.
    question
        A number that a report must give back once all before it is dealt with; 0 for none.
    let_go
        Whether the worker, which wanted to end, may end.
    """

    member: str = ""
    terms: Terms | None = None
    begins: bool = False
    frames: list[SentFrame] = []
    number: _Count = 0
    question: _Count = 0
    let_go: bool = False


class Answered(msgspec.Struct, array_like=True, frozen=True):
    """An answer of a worker.

    Attributes
    ----------
    seq, at
        The number and the arrival of the frame that is answered.
    recognition
        The answer. Its events do not count: the gateway knows which motions go on.
    long_ago
        Knowledge of the feed.
    carried
        The joints that carry the answer, if the frame, or one before, asked.
    """

    seq: _Count
    at: float
    recognition: Recognition
    long_ago: LongAgo | None = None
    carried: Carried | None = None


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
    refused: dict[str, str] = {}
    doubted: dict[str, str] = {}
    compared: dict[str, str] = {}
    dropped: int = 0
    leaves: bool = False


class Answers(msgspec.Struct, array_like=True, frozen=True):
    """A worker's answers and report, which travel together.

    Attributes
    ----------
    member
        The membership, a name that the worker made up.
    answered
        Answers, in order.
    report
        None where the worker has no library yet, and asks for terms.
    question
        The number of a question before which it has dealt with everything; 0 where there was no question.
    """

    member: str
    answered: list[Answered] = []
    report: Report | None = None
    question: int = 0


_Read = TypeVar("_Read", Orders, Answers)


def _encoded(value: object) -> object:
    """Encode numbers of numpy's."""
    return value.astype(_DOUBLES, copy=False).tobytes() if isinstance(value, np.ndarray) else float(value)  # type: ignore[arg-type]


def _decoded(kind: object, value: Any) -> object:  # noqa: ANN401 - of any message
    """Decode a recognition's scores; no other field is of a kind that msgspec does not know."""
    if isinstance(value, bytes):
        return np.frombuffer(value, _DOUBLES)
    raise ValueError(f"expected bytes for {kind}, got {type(value).__name__}")


encode = msgspec.msgpack.Encoder(enc_hook=_encoded).encode
_orders = msgspec.msgpack.Decoder(Orders)
_answers = msgspec.msgpack.Decoder(Answers, dec_hook=_decoded)


def decode_orders(message: bytes) -> Orders:
    """Decode a message to a worker; FormatError for any other."""
    return _read(_orders, message)


def decode_answers(message: bytes) -> Answers:
    """Decode a worker's message; FormatError for any other."""
    return _read(_answers, message)


def _read(decoder: msgspec.msgpack.Decoder[_Read], message: bytes) -> _Read:
    try:
        return decoder.decode(message)
    except (ValueError, RecursionError) as error:
        raise FormatError(f"message: {error}") from error


def key(*parts: str) -> str:
    """Give a key; a part may be any text."""
    return "/".join(["kin", *(quote(part, safe="", errors="surrogatepass") for part in parts)])


def last_of(sample: Any) -> str:  # noqa: ANN401 - Zenoh's
    """Give the name at the end of a message's key."""
    return unquote(str(sample.key_expr).rpartition("/")[2])
