"""Frames as OSC messages: bytes in, frames and announcements out, and back.

`/motion/skeleton s performer s*J joint names`, at the start and every second.
`/motion/frame s performer d time f*3J positions`, metres; time 0 means "the time of arrival".

Hundreds of frames arrive each second, so their packets are read directly with struct and numpy.
"""

from __future__ import annotations

import struct
import sys
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kinespace.stream.frame import MAX_PERFORMER_LENGTH, Announcement, Frame
from kinespace.stream.osc.packet import Message, PacketError, decode_packet, encode_message, padded

if TYPE_CHECKING:
    from kinespace.stream.frame import Input

_FRAME = "/motion/frame"
SKELETON = "/motion/skeleton"
_FRAME_START = b"/motion/frame\0\0\0,sd"
_DOUBLE = struct.Struct(">d")
#: Made once: numpy takes as long to look a type's name up as to read the positions.
_FLOATS = np.dtype(np.float32)
_SWAPPED = sys.byteorder == "little"
#: Beginnings of frames that are remembered: several for each performer.
_MAX_LAYOUTS = 1024


@dataclass(slots=True)
class Received:
    """What one datagram held. It is not frozen: one is made for every frame, and a frozen one takes longer to make.

    Attributes
    ----------
    events
        Frames and announcements, in order.
    malformed
        Messages with our addresses that make no sense, and packets that are no OSC.
    foreign
        Messages with addresses that are not ours.
    """

    events: list[Input]
    malformed: int = 0
    foreign: int = 0
    #: Why the last of the malformed is malformed, and what the last of the foreign is.
    why_malformed: str = field(default="", compare=False)
    why_foreign: str = field(default="", compare=False)


def decode(datagram: bytes, arrival: float) -> Received:
    """Decode whatever came in; never raises.

    Parameters
    ----------
    datagram
        As received.
    arrival
        When, seconds: the time of frames that say 0.
    """
    frame = _decode_plain_frame(datagram, arrival)
    if frame is not None:
        return Received([frame])
    try:
        messages = decode_packet(datagram)
    except PacketError as error:
        return Received([], malformed=1, why_malformed=str(error))
    received = Received([])
    for message in messages:
        try:
            event = _understood(message, arrival)
        except (TypeError, ValueError, OverflowError) as error:
            received.malformed += 1
            who = f" of {message.arguments[0]}" if message.arguments and isinstance(message.arguments[0], str) else ""
            received.why_malformed = f"{message.address}{who}: {error}"
        else:
            if event is None:
                received.foreign += 1
                received.why_foreign = message.address
            else:
                received.events.append(event)
    return received


class _Layout(NamedTuple):
    """What the bytes of a plain frame before its time say, and how many they and all bytes are."""

    performer: str
    floats: int
    place: int
    size: int


class _Layouts:
    """The beginnings of plain frames: a sender's packets all begin alike, so each beginning is made sense of once.

    Attributes
    ----------
    known
        Layouts by the beginning's bytes.
    places
        By a packet's size how long its beginning was when one of that size was last looked at.
    """

    def __init__(self) -> None:
        self.known: dict[bytes, _Layout] = {}
        self.places: dict[int, int] = {}

    def learn(self, datagram: bytes) -> _Layout | None:
        """Make sense of a beginning and remember it; None when it is no plain frame's, or not quite right."""
        if not datagram.startswith(_FRAME_START):
            return None
        floats = datagram.find(b"\0", 19) - 19
        start = (19 + floats) // 4 * 4 + 4
        end = datagram.find(b"\0", start)
        place = end // 4 * 4 + 4
        if floats < 6 or floats % 3 or end < 0 or len(datagram) != place + 8 + 4 * floats:
            return None
        if datagram.count(b"f", 19, 19 + floats) != floats:
            return None
        try:
            layout = _Layout(datagram[start:end].decode(), floats, place, len(datagram))
        except UnicodeDecodeError:
            return None
        if len(layout.performer) > MAX_PERFORMER_LENGTH:
            return None
        if len(self.known) >= _MAX_LAYOUTS:
            self.known.clear()  # only somebody who makes up names gets here
            self.places.clear()
        self.known[datagram[:place]] = layout
        self.places[len(datagram)] = place
        return layout


_layouts = _Layouts()


def _decode_plain_frame(datagram: bytes, arrival: float) -> Frame | None:
    """Decode the one packet that comes hundreds of times a second; None when it is any other, or not quite right."""
    size = len(datagram)
    layout = _layouts.known.get(datagram[: _layouts.places.get(size, 0)])
    # Two beginnings may be of one length and announce different numbers of floats.
    if layout is None or layout.size != size:
        layout = _layouts.learn(datagram)
        if layout is None:
            return None
    performer, floats, place, _ = layout
    (time,) = _DOUBLE.unpack_from(datagram, place)
    # To read numbers as if they were the machine's own and turn them over costs less than to convert them.
    positions = np.ndarray((floats // 3, 3), _FLOATS, datagram, place + 8)
    positions = positions.byteswap() if _SWAPPED else positions.copy()
    try:
        return Frame(performer, time or arrival, positions)
    except ValueError:
        return None


def _understood(message: Message, arrival: float) -> Frame | Announcement | None:
    """Read our two messages; None for another's. Raises TypeError, ValueError or OverflowError for a wrong one."""
    if message.address in (_FRAME, SKELETON) and not message.arguments:
        raise ValueError("performer: expected a name or an integer, got nothing")
    if message.address == _FRAME:
        if len(message.arguments) < 2:
            raise ValueError("time: expected seconds behind the performer, got nothing")
        performer, time, *numbers = message.arguments
        performer = _performer(performer)
        if any(type(number) not in (float, int) for number in (time, *numbers)):
            raise TypeError("numbers: expected floats or integers")
        positions = np.array(numbers, dtype=np.float64)
        if positions.size % 3:
            raise ValueError(f"positions: expected three numbers per joint, got {positions.size}")
        moment = float(time)  # type: ignore[arg-type]  # checked above
        return Frame(performer, moment or arrival, positions.reshape(-1, 3))
    if message.address == SKELETON:
        performer, *joints = message.arguments
        if not all(isinstance(joint, str) for joint in joints):
            raise TypeError("joints: expected strings")
        return Announcement(_performer(performer), tuple(map(str, joints)))
    return None


def _performer(argument: object) -> str:
    # Patchers send ids as numbers as often as names.
    if isinstance(argument, bool) or not isinstance(argument, (str, int)):
        raise TypeError(f"performer: expected a name or an integer first, got a {type(argument).__name__}")
    return str(argument)


def encode_frame(frame: Frame) -> bytes:
    """Encode a frame as `/motion/frame`, positions as float32."""
    positions = np.asarray(frame.positions, dtype=">f4")
    head = _FRAME_START + b"f" * positions.size
    return b"".join(
        [head, b"\0" * (4 - len(head) % 4), padded(frame.performer), _DOUBLE.pack(frame.time), positions.tobytes()]
    )


def encode_announcement(announcement: Announcement) -> bytes:
    """Encode which joints a performer's frames hold, as `/motion/skeleton`."""
    return encode_message(SKELETON, announcement.performer, *announcement.joints)
