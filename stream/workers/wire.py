"""The messages between a gateway and its workers, in msgpack: bytes in, checked values out, and back.

| key | content | from |
|---|---|---|
| `kin/gateway/<gateway>`, `kin/worker/<worker>` | liveliness tokens | both |
| `kin/<gateway>/terms`, `kin/<gateway>/library` | queries: `Terms`, and the library that they name | gateway |
| `kin/<gateway>/to/<worker>` | `Orders`: frames | gateway |
| `kin/<gateway>/back/<worker>` | `Answers`: answers, reports | worker |
"""

from __future__ import annotations

from typing import Annotated, Any, TypeVar
from urllib.parse import quote, unquote

import msgspec
import numpy as np

from kinespace.stream.frame import Admitted, Announcement, Frame, NewSender
from kinespace.stream.recognition import Recognition
from kinespace.stream.recognizer.performers import PerformerCounts
from kinespace.stream.workers.terms import Terms

GATEWAYS = "kin/gateway"
WORKERS = "kin/worker"
_FLOATS: np.dtype[np.floating] = np.dtype("<f4")
_DOUBLES: np.dtype[np.floating] = np.dtype("<f8")
_Count = Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)]


class FormatError(ValueError):
    """A message is not one of ours; the text says why."""


class SentFrame(msgspec.Struct, array_like=True, gc=False):
    """A frame on its way to a worker.

    Attributes
    ----------
    performer, time
        As in `Frame`.
    positions, doubles
        Numbers of three for each joint, little-endian, and whether they are doubles.
    joints
        Their names; None where they are as before.
    begins
        Whether the performer begins: the worker forgets an earlier performer of this name.
    """

    performer: str
    time: float
    positions: bytes
    doubles: bool = False
    joints: tuple[str, ...] | None = None
    begins: bool = False

    @classmethod
    def of(cls, frame: Frame) -> SentFrame:
        """Make the message of a frame; positions keep their precision."""
        doubles = frame.positions.dtype.itemsize == _DOUBLES.itemsize
        positions = frame.positions.astype(_DOUBLES if doubles else _FLOATS, copy=False)
        return cls(frame.performer, frame.time, positions.tobytes(), doubles)

    def events(self) -> list[Admitted]:
        """Give the frame, behind what it says of its performer; FormatError for an impossible one."""
        try:
            positions = np.frombuffer(self.positions, _DOUBLES if self.doubles else _FLOATS).reshape(-1, 3)
            frame = Frame(self.performer, self.time, positions)
            named = [] if self.joints is None else [Announcement(self.performer, self.joints)]
        except ValueError as error:
            raise FormatError(f"frame: {error}") from error
        return [*([NewSender(self.performer)] if self.begins else []), *named, frame]


class Orders(msgspec.Struct, omit_defaults=True):
    """A message to a worker.

    Attributes
    ----------
    frames
        Frames, in order.
    seen
        Frames of the last seconds of a performer, all or all but the newest of which another worker has answered.
    number
        The number of a message that may be lost on the way, counted from 1; 0 for a message that must arrive.
    at
        When the message was sent, seconds on the gateway's clock; 0 for a message that must arrive.
    changed
        Whether the terms have changed.
    """

    frames: list[SentFrame] = []
    seen: list[SentFrame] = []
    number: _Count = 0
    at: float = 0.0
    changed: bool = False


class Report(msgspec.Struct, array_like=True, frozen=True):
    """A worker's counters; it also shows that the worker is alive.

    Attributes
    ----------
    counts
        Counts of its frames, without those that another worker has answered.
    refused, doubted, compared
        The same as in `Performers`.
    stale, missing
        Frames that were dropped because the worker was busy, and messages that were lost on the way.
    leaves
        Whether the worker ends now.
    """

    counts: PerformerCounts
    refused: dict[str, str] = {}
    doubted: dict[str, str] = {}
    compared: dict[str, str] = {}
    stale: _Count = 0
    missing: _Count = 0
    leaves: bool = False


class Answers(msgspec.Struct, array_like=True, frozen=True):
    """A worker's answers, in order, and from time to time its report, which travel together."""

    answers: list[Recognition] = []
    report: Report | None = None


_Read = TypeVar("_Read", Orders, Answers, Terms)


def _encoded(value: object) -> object:
    """Encode numbers of numpy's."""
    return value.astype(_DOUBLES, copy=False).tobytes() if isinstance(value, np.ndarray) else float(value)  # type: ignore[arg-type]


def _decoded(kind: object, value: Any) -> object:  # noqa: ANN401 - of any message
    """Decode a recognition's scores; no other field is of a kind that msgspec does not know."""
    if isinstance(value, bytes):
        return np.frombuffer(value, _DOUBLES)
    raise ValueError(f"expected bytes for {kind}, got {type(value).__name__}")


encode = msgspec.msgpack.Encoder(enc_hook=_encoded).encode
_decoders: dict[type, msgspec.msgpack.Decoder[Any]] = {
    kind: msgspec.msgpack.Decoder(kind, dec_hook=_decoded) for kind in (Orders, Answers, Terms)
}


def decode(kind: type[_Read], message: bytes) -> _Read:
    """Decode a message of a kind; FormatError for any other."""
    try:
        read: _Read = _decoders[kind].decode(message)
    except (ValueError, RecursionError) as error:
        raise FormatError(f"message: {error}") from error
    return read


def key(*parts: str) -> str:
    """Give a key; a part may be any text."""
    return "/".join(["kin", *(quote(part, safe="", errors="surrogatepass") for part in parts)])


def last_of(sample: Any) -> str:  # noqa: ANN401 - Zenoh's
    """Give the name at the end of a message's key."""
    return unquote(str(sample.key_expr).rpartition("/")[2])
