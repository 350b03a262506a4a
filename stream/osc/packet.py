"""OSC 1.0 packets: bytes to addresses and arguments, and back. This module does not know the meaning of messages.

python-osc encodes messages. The packets of live feeds are decoded here: our plain frames take a fourteenth of the time
that python-osc takes (`kinespace bench stages`), and it sorts by time tags and raises several kinds of errors for
packets that are no OSC. Here time tags are ignored and there is one error. The tests compare both.
"""

import re
import struct
from collections.abc import Iterable
from typing import NamedTuple

from pythonosc.osc_message_builder import build_msg

#: Levels of bundles in bundles. No sender needs as many; a hostile packet with more would exhaust the stack.
MAX_BUNDLE_DEPTH = 16
#: Messages in one packet, and values in one packet that are not floats. A bundle of four performers' joints has 240
#: messages, and one message in doubles of a hundred joints 300 values. Each takes time in the one loop.
MAX_MESSAGES = 256
MAX_VALUES = 1024

_BUNDLE = b"#bundle\0"
#: The beginning of every bundle that we send: its time tag says "immediately".
BUNDLE_START = _BUNDLE + b"\0\0\0\0\0\0\0\1"
_FIXED = {"i": struct.Struct(">i"), "h": struct.Struct(">q"), "f": struct.Struct(">f"), "d": struct.Struct(">d")}
#: Time tags, and colours, characters and MIDI messages, which no frame has: all are read as whole numbers.
_FIXED |= {"t": struct.Struct(">Q"), **dict.fromkeys("rcm", struct.Struct(">I"))}
#: A type tag, or a run of floats.
_RUN = re.compile(r"f+|.", re.DOTALL)
_VALUES: dict[str, object] = {"T": True, "F": False, "N": None, "I": float("inf")}


class PacketError(ValueError):
    """A datagram is not an OSC packet."""


class Message(NamedTuple):
    """One OSC message: its address, and its arguments as Python values; those of arrays stand among the others."""

    address: str
    arguments: list[object]


def number_of(argument: object) -> float:
    """Give an argument as a number, also one that patchers and `toFixed` send as text; TypeError for any other."""
    if isinstance(argument, str):
        try:
            return float(argument.replace(",", "."))
        except ValueError:
            raise TypeError(f"expected a number, got {argument[:40]!r}") from None
    if type(argument) not in (float, int):
        raise TypeError(f"expected a number, got a {type(argument).__name__}")
    return float(argument)  # type: ignore[arg-type]  # checked above


def encode_message(address: str, *arguments: str | float) -> bytes:
    """Encode one message; floats as float32, integers as int32, which all receivers know."""
    return build_msg(address, [_whole(each) if isinstance(each, str) else each for each in arguments]).dgram


def encode_bundle(*elements: bytes) -> bytes:
    """Encode a bundle whose time tag is "immediately"."""
    return BUNDLE_START + b"".join(len(element).to_bytes(4) + element for element in elements)


def _whole(text: str) -> str:
    """Give a text that OSC does not end early: whatever stands behind a zero would be read as the next argument."""
    return text.replace("\0", "\N{REPLACEMENT CHARACTER}")


def padded(text: str) -> bytes:
    """Encode a string as OSC does: UTF-8, then 1 to 4 zeros up to a multiple of 4 bytes."""
    encoded = _whole(text).encode()
    return encoded + b"\0" * (4 - len(encoded) % 4)


def decode_packet(packet: bytes) -> list[Message]:
    """Decode a message, or a bundle with all bundles in it, in the order of the bytes.

    Time tags of bundles are ignored: a frame that waits is useless, and the clocks of two machines differ.

    Raises
    ------
    PacketError
        The bytes are not an OSC packet.
    """
    return decode_messages(split_packet(packet))


def split_packet(packet: bytes, depth: int = 0) -> list[bytes]:
    """Give the bytes of each message of a packet, before any is read: a packet with too many is refused at once.

    Raises
    ------
    PacketError
        The bytes are neither a message nor a bundle, or the bundle has too many messages, or has bundles in it that are
        nested too deep; `depth` says how many bundles these bytes are in.
    """
    if packet.startswith(b"/") or _is_bare(packet):
        return [packet]
    if not packet.startswith(_BUNDLE) or len(packet) < 16:
        raise PacketError("neither a message nor a bundle")
    if depth > MAX_BUNDLE_DEPTH:
        raise PacketError(f"bundles nested deeper than {MAX_BUNDLE_DEPTH}")
    found = list[bytes]()
    place, elements = 16, 0
    while place < len(packet):
        size = _number(packet, place, "i")
        place += 4
        if not 0 <= size <= len(packet) - place:
            raise PacketError(f"an element of {size} bytes in a bundle with {len(packet) - place} left")
        found += split_packet(packet[place : place + size], depth + 1)
        place += size
        elements += 1
        if len(found) > MAX_MESSAGES or elements > MAX_MESSAGES:
            raise PacketError(f"more than {MAX_MESSAGES} messages in one packet")
    return found


def _is_bare(packet: bytes) -> bool:
    """Say whether a message begins whose address lacks its slash: a word, and behind its zeros the type tags."""
    stop = packet.find(b"\0")
    return stop > 0 and packet[:stop].isascii() and packet.startswith(b",", stop + 4 - stop % 4)


def decode_messages(messages: Iterable[bytes]) -> list[Message]:
    """Decode the messages of one packet.

    Raises
    ------
    PacketError
        One of them is not an OSC message, or together they have too many values.
    """
    decoded = list[Message]()
    left = MAX_VALUES
    for each in messages:
        message, values = _decode_message(each, left)
        left -= values
        decoded.append(message)
    return decoded


def _decode_message(packet: bytes, left: int) -> tuple[Message, int]:
    """Decode a message of at most `left` values that are not floats; give it and the number of these values."""
    address, place = _string(packet, 0)
    # Some programs write no slash in front, or one behind.
    address = "/" + address.strip("/")
    if place == len(packet):
        return Message(address, []), 0
    tags, place = _string(packet, place)
    if not tags.startswith(","):
        raise PacketError("type tags that do not begin with ,")
    # A run of floats is read in one step; every other value takes a step of its own.
    values = len(tags) - 1 - tags.count("f")
    if values > left:
        raise PacketError(f"more than {MAX_VALUES} values in one packet that are not floats")
    return Message(address, _arguments(packet, place, tags)), values


def _arguments(packet: bytes, place: int, tags: str) -> list[object]:
    values = list[object]()
    # Joint positions are long runs of floats: one call takes a whole run.
    for tag in _RUN.findall(tags, 1):
        if tag[0] == "f":
            end = _end(packet, place + 4 * len(tag))
            values.extend(struct.unpack_from(f">{len(tag)}f", packet, place))
            place = end
        elif tag not in "[]":
            value, place = _argument(packet, place, tag)
            values.append(value)
    return values


def _argument(packet: bytes, place: int, tag: str) -> tuple[object, int]:
    if tag in _FIXED:
        return _number(packet, place, tag), place + _FIXED[tag].size
    if tag in _VALUES:
        return _VALUES[tag], place
    if tag in "sS":
        return _string(packet, place)
    if tag != "b":
        raise PacketError(f"an argument of unknown type {tag!r}")
    size = _number(packet, place, "i")
    if size < 0:
        raise PacketError(f"a blob of {size} bytes")
    end = _end(packet, place + 4 + size)
    return packet[place + 4 : end], min(end + -size % 4, len(packet))


def _number(packet: bytes, place: int, tag: str) -> int:
    form = _FIXED[tag]
    _end(packet, place + form.size)
    number: int = form.unpack_from(packet, place)[0]
    return number


def _string(packet: bytes, place: int) -> tuple[str, int]:
    stop = packet.find(b"\0", place)
    if stop < 0:
        raise PacketError("a string that never ends")
    end = _end(packet, stop + 4 - (stop - place) % 4)
    try:
        return packet[place:stop].decode(), end
    except UnicodeDecodeError as error:
        raise PacketError("a string that is not UTF-8") from error


def _end(packet: bytes, end: int) -> int:
    if end > len(packet):
        raise PacketError("cut off in its arguments")
    return end
