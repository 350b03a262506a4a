"""Frames as OSC messages: bytes in, frames and announcements out, and back.

`/motion/skeleton s performer s*J joint names`, at the start and every second.
`/motion/frame s performer d time f*3J positions`, metres; time 0 means "the time of arrival".

Hundreds of frames arrive each second, so their packets are read directly with struct and numpy.
"""

from __future__ import annotations

import struct
import sys
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from kinespace.stream.frame import MAX_PERFORMER_LENGTH, Announcement, Frame, Input
from kinespace.stream.osc.packet import (
    Message,
    PacketError,
    decode_messages,
    encode_message,
    number_of,
    padded,
    split_packet,
)

_FRAME = "/motion/frame"
SKELETON = "/motion/skeleton"
_FRAME_ADDRESS = b"/motion/frame\0"
_FRAME_START = _FRAME_ADDRESS + b"\0\0,sd"
#: Frames in one packet, at most: each is recognised before the next packet is looked at. As many performers
#: can share a packet.
MAX_FRAMES = 32
_DOUBLE = struct.Struct(">d")
#: Made once: numpy needs as long to look up a type's name as to read the positions.
_FLOATS = np.dtype(np.float32)
_SWAPPED = sys.byteorder == "little"
#: Beginnings of frames that are remembered: several for each performer.
_MAX_BEGINNINGS = 1024


@dataclass(slots=True)
class Received:
    """The content of one datagram. It is not frozen, because one is made for every frame and freezing takes time.

    Attributes
    ----------
    events
        Frames and announcements, in order.
    malformed
        Messages with our addresses that cannot be read, and packets that are no OSC.
    foreign
        Messages with addresses that are not ours.
    """

    events: list[Input]
    malformed: int = 0
    foreign: int = 0
    #: The reason why the last malformed message is malformed, and the last foreign message.
    why_malformed: str = field(default="", compare=False)
    why_foreign: str = field(default="", compare=False)


def decode(datagram: bytes, arrival: float) -> Received:
    """Decode any datagram; never raises.

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
        parts = split_packet(datagram)
        if sum(part.startswith(_FRAME_ADDRESS) for part in parts) > MAX_FRAMES:
            raise PacketError(f"more than {MAX_FRAMES} frames in one packet")  # noqa: TRY301 - as the decoder raises it
        plain = [_decode_plain_frame(part, arrival) for part in parts]
        messages = iter(decode_messages(part for part, frame in zip(parts, plain, strict=True) if frame is None))
    except PacketError as error:
        return Received([], malformed=1, why_malformed=str(error))
    received = Received([])
    for frame in plain:
        if frame is not None:
            received.events.append(frame)
            continue
        message = next(messages)
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


@lru_cache(maxsize=_MAX_BEGINNINGS)
def _performer_in(beginning: bytes, floats: int, start: int) -> str | None:
    """Read the performer's name at the end of a plain frame's beginning; None where it, or a type, is none of ours.

    A sender's packets all begin alike, so each beginning is read once.
    """
    try:
        performer = beginning[start:].decode()
    except UnicodeDecodeError:
        return None
    plain = beginning.count(b"f", 19, 19 + floats) == floats and len(performer) <= MAX_PERFORMER_LENGTH
    return performer if plain else None


def _decode_plain_frame(datagram: bytes, arrival: float) -> Frame | None:
    """Decode the packet that comes hundreds of times a second, a plain frame; None for any other packet."""
    if not datagram.startswith(_FRAME_START):
        return None
    floats = datagram.find(b"\0", 19) - 19
    start = (19 + floats) // 4 * 4 + 4
    end = datagram.find(b"\0", start)
    place = end // 4 * 4 + 4
    if floats < 6 or floats % 3 or end < 0 or len(datagram) != place + 8 + 4 * floats:
        return None
    performer = _performer_in(datagram[:end], floats, start)
    if performer is None:
        return None
    (time,) = _DOUBLE.unpack_from(datagram, place)
    # Reading numbers in the machine's byte order and swapping their bytes afterwards is quicker than converting them.
    positions = np.ndarray((floats // 3, 3), _FLOATS, datagram, place + 8)
    positions = positions.byteswap() if _SWAPPED else positions.copy()
    try:
        return Frame(performer, time or arrival, positions)
    except ValueError:
        return None


def beginning_of(datagram: bytes) -> tuple[bytes, float]:
    """Give the bytes before a plain frame's time, the same for all frames of a performer, and the time as sent.

    It costs a fifth of reading the frame. Of other packets the bytes are empty.
    """
    place = len(datagram) - 8 - 4 * (datagram.find(b"\0", 19) - 19)
    if place < len(_FRAME_START) or not datagram.startswith(_FRAME_START):
        return b"", 0.0
    return datagram[:place], _DOUBLE.unpack_from(datagram, place)[0]


def _understood(message: Message, arrival: float) -> Input | None:
    """Read our messages; None for any other. Raises TypeError, ValueError or OverflowError for a malformed one."""
    if message.address not in (_FRAME, SKELETON):
        return None
    if not message.arguments:
        raise ValueError("performer: expected a name or an integer, got nothing")
    performer = _performer(message.arguments[0])
    if message.address == SKELETON:
        joints = message.arguments[1:]
        if not all(isinstance(joint, str) for joint in joints):
            raise TypeError("joints: expected strings")
        return Announcement(performer, tuple(map(str, joints)))
    if len(message.arguments) < 2:
        raise ValueError("time: expected seconds behind the performer, got nothing")
    time, *numbers = message.arguments[1:]
    positions = np.array([number_of(number) for number in numbers], dtype=np.float64)
    if positions.size % 3:
        raise ValueError(f"positions: expected three numbers per joint, got {positions.size}")
    return Frame(performer, number_of(time) or arrival, positions.reshape(-1, 3))


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
    """Encode the names of the joints in a performer's frames, as `/motion/skeleton`."""
    return encode_message(SKELETON, announcement.performer, *announcement.joints)
