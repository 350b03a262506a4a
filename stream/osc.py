"""OSC: what comes in over UDP as frames, what goes out as answers; pure functions first, then the two endpoints.

Frames and answers, of which there are many a second, are written and read here, byte by byte as python-osc would at a
twentieth of its cost; it builds the rest.

In:  `/motion/skeleton s performer s*J joint names`, at the start and every second;
     `/motion/frame s performer d time f*3J positions`, metres, time 0 for "on arrival".
Out: `/motion/<performer>/class i index f score f margin`, `/motion/<performer>/label s` and
     `/motion/<performer>/scores f*K` in one bundle per recognition, `/motion/<performer>/event s start or end s label
     i index f score d time` when a motion starts or ends, `/motion/classes s*K`, `/motion/status`.

Every bundle's time tag is "immediately". The class message holds numbers only, because TouchDesigner's OSC In CHOP
takes nothing else; its index is the moment's best guess, in the order of `/motion/classes`, and -1 where there is
nothing to guess from. The label says "unknown" of a guess that is not near enough.
"""

from __future__ import annotations

import re
import socket
import struct
import sys
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from pythonosc.osc_message_builder import OscMessageBuilder

from kinespace.stream.answer import Answer
from kinespace.stream.frame import LONGEST_PERFORMER, Announcement, Frame
from kinespace.stream.oscpacket import Message, PacketError, decode_packet

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.stream.recognition import Event, Recognition
    from kinespace.stream.status import Status

#: Datagrams above this are cut into fragments on most networks, and one lost fragment loses them whole.
LARGEST_ANSWER = 1200
#: Bytes asked of the system to keep datagrams in while we compute; the usual default holds 0.2 s of a busy feed.
RECEIVE_BUFFER = 4 << 20

_FRAME = "/motion/frame"
SKELETON = "/motion/skeleton"
_FRAME_START = b"/motion/frame\0\0\0,sd"
_DOUBLE = struct.Struct(">d")
#: As they stand in packets; made once, for numpy takes as long to find out what a name means as to read them.
_FLOATS = np.dtype(np.float32)
_SWAPPED = sys.byteorder == "little"
#: Beginnings of frames remembered: several for each performer there may be.
_MOST_LAYOUTS = 1024
_SIZE, _CLASS, _EVENT = struct.Struct(">i"), struct.Struct(">iff"), struct.Struct(">ifd")
#: Every answer's beginning: a bundle to be used immediately.
_BUNDLE = b"#bundle\0\0\0\0\0\0\0\0\1"
_LARGEST_INTEGER = 2**31 - 1
#: Linux tells with each datagram how many were thrown away before it; Python has no name for the option.
_SO_RXQ_OVFL = 40
_COUNTS_DROPS = sys.platform == "linux"
#: Characters that OSC 1.0 keeps for itself in addresses, and those that do not print.
_NOT_IN_ADDRESS = re.compile(r"[^!-~]|[#*,/?\[\]{}]")


@dataclass(slots=True)
class Received:
    """What one datagram held. Neither frozen nor a tuple: one is made for every frame, and those take longer to make.

    Attributes
    ----------
    events
        Frames and announcements, in order.
    malformed
        Messages with our addresses that make no sense, and packets that are no OSC.
    foreign
        Messages with other addresses: somebody else's, passed over.
    """

    events: list[Frame | Announcement]
    malformed: int = 0
    foreign: int = 0


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
    except PacketError:
        return Received([], malformed=1)
    events, malformed, foreign = list[Frame | Announcement](), 0, 0
    for message in messages:
        try:
            event = _understood(message, arrival)
        except (TypeError, ValueError, OverflowError):
            malformed += 1
        else:
            if event is None:
                foreign += 1
            else:
                events.append(event)
    return Received(events, malformed, foreign)


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
        if len(layout.performer) > LONGEST_PERFORMER:
            return None
        if len(self.known) >= _MOST_LAYOUTS:
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
    if message.address == _FRAME:
        performer, time, *numbers = message.arguments
        if any(type(number) not in (float, int) for number in (time, *numbers)):
            raise TypeError("numbers: expected floats or integers")
        positions = np.array(numbers, dtype=np.float64)
        if positions.size % 3:
            raise ValueError(f"positions: expected three numbers per joint, got {positions.size}")
        moment = float(time)  # type: ignore[arg-type]  # checked above
        return Frame(_performer(performer), moment or arrival, positions.reshape(-1, 3))
    if message.address == SKELETON:
        performer, *joints = message.arguments
        if not all(isinstance(joint, str) for joint in joints):
            raise TypeError("joints: expected strings")
        return Announcement(_performer(performer), tuple(map(str, joints)))
    return None


def _performer(argument: object) -> str:
    # Patchers send ids as numbers as often as names.
    if isinstance(argument, bool) or not isinstance(argument, (str, int)):
        raise TypeError(f"performer: expected a name or an integer, got {type(argument).__name__}")
    return str(argument)


def encode_frame(frame: Frame) -> bytes:
    """Encode a frame as `/motion/frame`, positions as float32."""
    positions = np.asarray(frame.positions, dtype=">f4")
    head = _FRAME_START + b"f" * positions.size
    return b"".join(
        [head, b"\0" * (4 - len(head) % 4), _padded(frame.performer), _DOUBLE.pack(frame.time), positions.tobytes()]
    )


def _padded(text: str) -> bytes:
    encoded = text.encode()
    return encoded + b"\0" * (4 - len(encoded) % 4)


def encode_announcement(announcement: Announcement) -> bytes:
    """Encode which joints a performer's frames hold, as `/motion/skeleton`."""
    return _message(SKELETON, announcement.performer, *announcement.joints)


def encode_recognition(recognition: Recognition) -> bytes:
    """Encode an answer as one bundle of at most 1200 bytes.

    The scores of a library with too many classes for that (some 200) are left out; class and label never are.
    """
    class_head, label_head, scores_head = _answer_heads(recognition.performer, len(recognition.scores))
    label = _padded(recognition.label)
    parts = [
        _BUNDLE,
        _SIZE.pack(len(class_head) + _CLASS.size),
        class_head,
        _CLASS.pack(recognition.guess_index, recognition.score, recognition.margin),
        _SIZE.pack(len(label_head) + len(label)),
        label_head,
        label,
    ]
    scores = recognition.scores.astype(">f4").tobytes()
    size = sum(map(len, parts)) + _SIZE.size + len(scores_head) + len(scores)
    if size <= LARGEST_ANSWER:
        parts += [_SIZE.pack(len(scores_head) + len(scores)), scores_head, scores]
    return b"".join(parts)


@lru_cache(maxsize=1024)
def _answer_heads(performer: str, classes: int) -> tuple[bytes, bytes, bytes]:
    """Give what stands before the arguments of class, label and scores: the same in each of a performer's answers."""
    start = f"/motion/{address_part(performer)}"
    layouts = {"class": ",iff", "label": ",s", "scores": "," + "f" * classes}
    heads = [_padded(f"{start}/{last}") + _padded(types) for last, types in layouts.items()]
    return heads[0], heads[1], heads[2]


def encode_event(event: Event) -> bytes:
    """Encode `/motion/<performer>/event s start or end, s label, i index, f score, d time`."""
    address = f"/motion/{address_part(event.performer)}/event"
    numbers = _EVENT.pack(event.index, event.score, event.time)
    return b"".join([_padded(address), b",ssifd\0\0", _padded(event.kind), _padded(event.label), numbers])


def encode_classes(classes: Sequence[str]) -> bytes:
    """Encode the class names in the order their indices count, as `/motion/classes`."""
    return _message("/motion/classes", *classes)


def encode_status(status: Status) -> bytes:
    """Encode `/motion/status i alive f frames per second i performers i lost`, numbers only."""
    # A sender's sequence numbers may skip more than an OSC integer holds.
    lost = min(status.lost, _LARGEST_INTEGER)
    return _message("/motion/status", 1, status.frames_per_second, len(status.performers), lost)


def address_part(performer: str) -> str:
    """Give a performer's name as it stands in addresses: what OSC keeps for itself becomes an underscore."""
    return _NOT_IN_ADDRESS.sub("_", performer)


def _message(address: str, *arguments: object) -> bytes:
    builder = OscMessageBuilder(address)
    for argument in arguments:
        # Without a type python-osc asks each number its size, and sends some integers as 64 bits.
        kind = {float: "f", int: "i", str: "s"}[type(argument)]
        builder.add_arg(argument, kind)  # type: ignore[arg-type]  # one of the three
    encoded: bytes = builder.build().dgram
    return encoded


def decode_answer(datagram: bytes) -> Answer | None:
    """Decode a recognition's bundle, for programs that listen to the answers; None for any other packet."""
    try:
        found = {message.address.rpartition("/")[2]: message for message in decode_packet(datagram)}
        index, score, margin = found["class"].arguments
        (label,) = found["label"].arguments
        performer = found["class"].address.split("/")[2]
        return Answer(performer, int(index), float(score), float(margin), str(label))  # type: ignore[call-overload, arg-type]
    except (PacketError, KeyError, TypeError, ValueError, IndexError, OverflowError, RecursionError):
        return None


def _resolved(host: str, port: int) -> tuple[int, int, tuple[Any, ...]]:
    """Look a host up: address family, socket kind and socket address; raises OSError naming the host."""
    try:
        family, kind, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
    except OSError as error:
        raise OSError(error.errno, f"{host}:{port}: {error.strerror}") from error
    return family, kind, address


class OscReceiver:
    """A UDP socket that frames come in on.

    Parameters
    ----------
    host, port
        Where to listen; port 0 lets the system choose (`address` tells).

    Attributes
    ----------
    kernel_drops
        Datagrams the system threw away because they came faster than they were received (known on Linux only).
    sender
        Host and port the last datagram came from; None before the first.

    Raises
    ------
    OSError
        The port is taken, or the host is not this machine's.
    """

    def __init__(self, host: str, port: int) -> None:
        family, kind, address = _resolved(host, port)
        self.socket = socket.socket(family, kind)
        try:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
            if _COUNTS_DROPS:
                self.socket.setsockopt(socket.SOL_SOCKET, _SO_RXQ_OVFL, 1)
            self.socket.settimeout(0.0)
            self.socket.bind(address)
        except OSError as error:
            self.socket.close()
            raise OSError(error.errno, f"{host}:{port}: {error.strerror}") from error
        self.kernel_drops = 0
        self.sender: tuple[str, int] | None = None

    @property
    def address(self) -> tuple[str, int]:
        """Host and port it listens on."""
        host, port = self.socket.getsockname()[:2]
        return host, port

    def broken(self) -> int:
        """Count nothing: UDP has no connections."""
        return 0

    def receive(self) -> bytes | None:
        """Take the next datagram; None when there is none now."""
        try:
            if not _COUNTS_DROPS:
                datagram, sender = self.socket.recvfrom(65535)
                self.sender = sender[:2]
                return datagram
            datagram, ancillary, _, sender = self.socket.recvmsg(65535, 64)
        except (BlockingIOError, InterruptedError):
            return None
        except ConnectionError:
            return b""  # Windows says here that somebody who was sent to is not there: a packet like any bad one.
        for _, kind, value in ancillary:
            if kind == _SO_RXQ_OVFL:
                self.kernel_drops = int.from_bytes(value[:4], sys.byteorder)
        self.sender = sender[:2]
        return datagram

    def send_to(self, datagram: bytes, target: tuple[str, int]) -> bool:
        """Send from the port listened on, as a sender expects that is to answer here; False when it cannot be."""
        try:
            _, _, address = _resolved(*target)
            self.socket.sendto(datagram, address)
        except OSError:
            return False
        return True

    def close(self) -> None:
        """Give the port back."""
        self.socket.close()


class OscSender:
    """A UDP socket that sends to one place.

    Parameters
    ----------
    host, port
        Where to.

    Attributes
    ----------
    failed
        Datagrams the system would not take (nobody there, buffer full).

    Raises
    ------
    OSError
        The host's name cannot be resolved.
    """

    def __init__(self, host: str, port: int) -> None:
        family, kind, address = _resolved(host, port)
        self.target: tuple[Any, ...] = address
        self.socket = socket.socket(family, kind)
        self.socket.settimeout(0.0)
        self.failed = 0

    def send(self, datagram: bytes) -> None:
        """Send one datagram; a failure is counted, never raised: the next one may succeed."""
        try:
            self.socket.sendto(datagram, self.target)
        except OSError:
            self.failed += 1

    def close(self) -> None:
        """Give the socket back."""
        self.socket.close()
