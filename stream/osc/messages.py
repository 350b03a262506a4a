"""Frames and answers as OSC messages: pure functions between them and bytes.

Frames as OSC messages: bytes in, frames and announcements out, and back.

`/motion/skeleton s performer s*J joint names`, at the start and every second.
`/motion/frame s performer d time f*3J positions`, metres; time 0 means "the time of arrival".

Hundreds of frames arrive each second, so their packets are read directly with struct and numpy.

Answers as OSC messages.

`/motion/<performer>/class i index f score f margin`, `/motion/<performer>/guess i index`,
`/motion/<performer>/sofar i index`, `/motion/<performer>/label s` and `/motion/<performer>/scores f*K` in one bundle
for each recognition, and with them, while a motion is followed,
`/motion/<performer>/progress i index of its class f phase f speed f amplitude f sure f scrub i cycles`;
`/motion/<performer>/event s start or end s label i index f score f time` when a motion starts or ends;
`/motion/classes s*K`; `/motion/status`.

The class message holds numbers only, because TouchDesigner's OSC In CHOP reads only numbers. Its index is the named
class's, in the order of `/motion/classes`, and -1 when no class is named. The label then says why: "unknown" when the
guess is not near enough to the library, "gone" once when the performer has left. The guess is the moment's best class,
-1 when there is no guess; "sofar" is the class that the movement of the last seconds is nearest to. Score and margin
belong to the guess. No number is larger than a float, because Pure Data and many libraries know no double.
"""

import struct
import sys
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple
from urllib.parse import quote

import numpy as np

from kinespace.stream.frame import MAX_PERFORMER_LENGTH, Announcement, Frame, Input
from kinespace.stream.osc import packet
from kinespace.stream.recognition import GONE, Answer, Done, Event, Outcome, Recognition
from kinespace.stream.status import Status

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


class Received(NamedTuple):
    """The content of one datagram.

    Attributes
    ----------
    events
        Frames and announcements, in order.
    refused
        For each message that was refused the kind of refusal and the reason: `malformed`, a message with one of our
        addresses that cannot be read, or a packet that is no OSC; `foreign`, a message with another address.
    """

    events: list[Input]
    refused: Sequence[tuple[str, str]] = ()


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
        parts = packet.split_packet(datagram)
        if sum(part.startswith(_FRAME_ADDRESS) for part in parts) > MAX_FRAMES:
            raise packet.PacketError(f"more than {MAX_FRAMES} frames in one packet")  # noqa: TRY301 - as the decoder raises it
        plain = [_decode_plain_frame(part, arrival) for part in parts]
        messages = iter(packet.decode_messages(part for part, frame in zip(parts, plain, strict=True) if frame is None))
    except packet.PacketError as error:
        return Received([], [("malformed", str(error))])
    events, refused = list[Input](), list[tuple[str, str]]()
    for frame in plain:
        if frame is not None:
            events.append(frame)
            continue
        message = next(messages)
        try:
            event = _understood(message, arrival)
        except (TypeError, ValueError, OverflowError) as error:
            who = f" of {message.arguments[0]}" if message.arguments and isinstance(message.arguments[0], str) else ""
            refused.append(("malformed", f"{message.address}{who}: {error}"))
        else:
            if event is None:
                refused.append(("foreign", message.address))
            else:
                events.append(event)
    return Received(events, refused)


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


def _understood(message: packet.Message, arrival: float) -> Input | None:
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
    positions = np.array([packet.number_of(number) for number in numbers], dtype=np.float64)
    if positions.size % 3:
        raise ValueError(f"positions: expected three numbers per joint, got {positions.size}")
    return Frame(performer, packet.number_of(time) or arrival, positions.reshape(-1, 3))


def _performer(argument: object) -> str:
    # Patchers send ids as numbers as often as names.
    if isinstance(argument, bool) or not isinstance(argument, (str, int)):
        raise TypeError(f"performer: expected a name or an integer first, got a {type(argument).__name__}")
    return str(argument)


def encode_frame(frame: Frame) -> bytes:
    """Encode a frame as `/motion/frame`, positions as float32."""
    positions = np.asarray(frame.positions, dtype=">f4")
    head = _FRAME_START + b"f" * positions.size
    head += b"\0" * (4 - len(head) % 4) + packet.padded(frame.performer)
    return head + _DOUBLE.pack(frame.time) + positions.tobytes()


def encode_announcement(announcement: Announcement) -> bytes:
    """Encode the names of the joints in a performer's frames, as `/motion/skeleton`."""
    return packet.encode_message(SKELETON, announcement.performer, *announcement.joints)


#: Bytes of an answer, at most. Most networks cut larger datagrams into fragments, and one lost fragment loses all.
MAX_ANSWER = 1200
_MAX_INTEGER = 2**31 - 1
#: The largest number that OSC holds as a float.
_MAX_FLOAT = (2 - 2**-23) * 2.0**127
#: Characters that OSC 1.0 reserves in addresses, and the sign by which they are written.
_RESERVED = frozenset(" #*,/?[]{}%")

#: A label's bytes: a performer's answers have the same few.
_label = lru_cache(maxsize=1024)(packet.padded)


def encode_recognition(recognition: Recognition) -> bytes:
    """Encode an answer as one bundle of at most 1200 bytes.

    In a library of more than some 200 classes the scores do not fit and are left out; class and label always fit.
    """
    name = recognition.performer
    messages = [
        encode_numbers(name, "class", "iff", recognition.class_index, recognition.score, recognition.margin),
        encode_numbers(name, "guess", "i", recognition.guess_index),
        encode_numbers(name, "sofar", "i", recognition.so_far),
        _head(name, "label", "s") + _label(recognition.label),
    ]
    if recognition.progress:
        messages.append(encode_progress(recognition))
    return with_scores(messages, recognition)


def with_scores(messages: Sequence[bytes], recognition: Recognition) -> bytes:
    """Encode a bundle of messages, and an answer's scores behind them where they fit into 1200 bytes."""
    scores = recognition.scores
    head = _head(recognition.performer, "scores", "f" * len(scores))
    whole = packet.encode_bundle(*messages, head + scores.astype(">f4").tobytes())
    return whole if len(whole) <= MAX_ANSWER else packet.encode_bundle(*messages)


@lru_cache(maxsize=8192)
def _head(performer: str, last: str, types: str) -> bytes:
    """Give the bytes before a message's arguments; all of a performer's answers share them."""
    return packet.padded(f"/motion/{address_part(performer)}/{last}") + packet.padded(f",{types}")


def encode_numbers(performer: str, last: str, types: str, *numbers: float) -> bytes:
    """Encode `/motion/<performer>/<last>` with numbers of some types."""
    return _head(performer, last, types) + struct.pack(f">{types}", *numbers)


def encode_progress(recognition: Recognition) -> bytes:
    """Encode `/motion/<performer>/progress` by itself; empty when no motion is followed."""
    progress = recognition.progress
    if progress is None:
        return b""
    index = recognition.classes.index(progress.class_name)
    numbers = (progress.phase, progress.speed, progress.amplitude, progress.sure, progress.scrub, progress.cycles)
    return encode_numbers(recognition.performer, "progress", "ifffffi", index, *numbers)


def encode_gone(performer: str) -> bytes:
    """Encode that a performer has left: an answer without a class, without scores."""
    return packet.encode_bundle(
        encode_numbers(performer, "class", "iff", -1, 0.0, 0.0),
        encode_numbers(performer, "guess", "i", -1),
        encode_numbers(performer, "sofar", "i", -1),
        _head(performer, "label", "s") + _label(GONE),
    )


def encode_event(event: Event, since: float = 0.0) -> bytes:
    """Encode `/motion/<performer>/event s start or end, s label, i index, f score, f time`.

    Parameters
    ----------
    event
        Start or end.
    since
        The moment from which the time is counted, seconds, on the clock of the frames. A float holds some hours to the
        millisecond, but no clock that began in 1970.
    """
    elapsed = min(max(event.time - since, -_MAX_FLOAT), _MAX_FLOAT)
    place = f"/motion/{address_part(event.performer)}/event"
    return packet.encode_message(place, str(event.kind), event.label, event.index, float(event.score), float(elapsed))


def encode_done(done: Done, since: float = 0.0) -> bytes:
    """Encode `/motion/<performer>/done s label i index i count f start f duration f score f speed f amplitude`.

    Parameters
    ----------
    done
        The motion.
    since
        As in `encode_event`.
    """
    start = min(max(done.start - since, -_MAX_FLOAT), _MAX_FLOAT)
    numbers = done.duration, done.score, done.speed, done.amplitude
    place = f"/motion/{address_part(done.performer)}/done"
    return packet.encode_message(place, done.label, done.index, done.count, start, *numbers)


def encode_classes(classes: Sequence[str]) -> bytes:
    """Encode the class names in the order their indices count, as `/motion/classes`."""
    return packet.encode_message("/motion/classes", *classes)


def encode_status(status: Status) -> bytes:
    """Encode `/motion/status i alive f frames per second i performers i lost`, numbers only."""
    # A sender's sequence numbers may skip more than an OSC integer holds.
    lost = min(status.lost, _MAX_INTEGER)
    return packet.encode_message("/motion/status", 1, status.frames_per_second, len(status.performers), lost)


@lru_cache(maxsize=1024)
def address_part(performer: str) -> str:
    """Give a performer's name for use in addresses, another for each name.

    Letters of any script stay, in UTF-8; characters that OSC reserves or that do not print are written as in a URL
    (`a b` is `a%20b`).
    """
    return "".join(
        each if each.isprintable() and each not in _RESERVED else quote(each, safe="", errors="replace")
        for each in performer
    )


def decode_answer(datagram: bytes) -> Answer | None:
    """Decode a recognition's bundle, for programs that listen to the answers; None for any other packet."""
    try:
        found = {message.address.rpartition("/")[2]: message for message in packet.decode_packet(datagram)}
        index, score, margin = map(packet.number_of, found["class"].arguments)
        (label,) = found["label"].arguments
        performer = found["class"].address.split("/")[2]
        named, outcome = (str(label), Outcome.NAMED) if index >= 0 else (None, str(label))
        return Answer(performer, named, int(index), outcome, score, margin)
    except (KeyError, TypeError, ValueError, IndexError, OverflowError):
        return None
