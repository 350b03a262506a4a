"""The messages between a gateway and its workers, in msgpack."""

from __future__ import annotations

from typing import Annotated, Any

import msgspec
import numpy as np

from kinespace.stream.frame import Admitted, Announcement, Frame, NewSender
from kinespace.stream.recognition import Recognition
from kinespace.stream.recognizer.performers import PerformerCounts

_FLOATS: np.dtype[np.floating] = np.dtype("<f4")
_DOUBLES: np.dtype[np.floating] = np.dtype("<f8")
_Count = Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)]


class SentFrame(msgspec.Struct, array_like=True, gc=False):
    """A frame on its way to a worker.

    Attributes
    ----------
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
        """Give the frame, behind what it says of its performer."""
        positions = np.frombuffer(self.positions, _DOUBLES if self.doubles else _FLOATS).reshape(-1, 3)
        named = [] if self.joints is None else [Announcement(self.performer, self.joints)]
        begun = [NewSender(self.performer)] if self.begins else []
        return [*begun, *named, Frame(self.performer, self.time, positions)]


class Orders(msgspec.Struct, omit_defaults=True):
    """Frames for a worker.

    Attributes
    ----------
    frames
        Frames to be answered, in order.
    seen
        Frames of the last seconds of a performer, all or all but the newest of which another worker has answered.
    at
        When the message was sent, seconds on the machine's clock; 0 for one that is late by its nature.
    """

    frames: list[SentFrame] = []
    seen: list[SentFrame] = []
    at: float = 0.0


class Report(msgspec.Struct, array_like=True, frozen=True):
    """A worker's counters; it also shows that the worker is alive.

    Attributes
    ----------
    counts
        Counts of its frames, without those that another worker has answered.
    refused, doubted, compared
        The same as in `Performers`.
    stale
        Frames that were dropped because the worker was busy.
    """

    counts: PerformerCounts
    refused: dict[str, str] = {}
    doubted: dict[str, str] = {}
    compared: dict[str, str] = {}
    stale: _Count = 0


class Answers(msgspec.Struct, array_like=True, frozen=True):
    """A worker's answers, in order, and from time to time its report, which travel together."""

    answers: list[Recognition] = []
    report: Report | None = None


def _encoded(value: object) -> object:
    """Encode numbers of numpy's."""
    return value.astype(_DOUBLES, copy=False).tobytes() if isinstance(value, np.ndarray) else float(value)  # type: ignore[arg-type]


def _decoded(_: object, value: Any) -> object:  # noqa: ANN401 - of any message
    """Decode a recognition's scores; no other field is of a kind that msgspec does not know."""
    return np.frombuffer(value, _DOUBLES)


encode = msgspec.msgpack.Encoder(enc_hook=_encoded).encode
decode_orders = msgspec.msgpack.Decoder(Orders).decode
decode_answers = msgspec.msgpack.Decoder(Answers, dec_hook=_decoded).decode
