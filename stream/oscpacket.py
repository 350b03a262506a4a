"""OSC 1.0 packets, decoded: bytes in, addresses and arguments out, nothing else known about them.

python-osc decodes the same, and is what the tests hold this against. On the way of every frame it costs too much (a
message of 94 arguments ten times as much as here), its dispatcher sleeps on time tags in the future, and a packet
that is no OSC can raise out of it; here time tags are passed over and there is one error. Packets are encoded with
python-osc.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

#: A bundle in a bundle in a bundle ... nobody sends this deep; a hostile packet would exhaust the stack.
DEEPEST_BUNDLE = 16

_BUNDLE = b"#bundle\0"
_FIXED = {"i": struct.Struct(">i"), "h": struct.Struct(">q"), "f": struct.Struct(">f"), "d": struct.Struct(">d")}
_FIXED |= {"t": struct.Struct(">Q"), "r": struct.Struct(">I")}
_VALUES: dict[str, object] = {"T": True, "F": False, "N": None, "I": float("inf")}


class PacketError(ValueError):
    """A datagram is not an OSC packet."""


class Message(NamedTuple):
    """One OSC message: its address, and its arguments as Python values (arrays as lists)."""

    address: str
    arguments: list[object]


def decode_packet(packet: bytes) -> list[Message]:
    """Decode a message, or a bundle with all bundles in it, in the order of the bytes.

    Time tags of bundles are passed over: a frame is of use now or never, and clocks of two machines differ.

    Raises
    ------
    PacketError
        The bytes are not an OSC packet.
    """
    messages = list[Message]()
    _decode_element(packet, messages, 0)
    return messages


def _decode_element(element: bytes, messages: list[Message], depth: int) -> None:
    if element[:1] == b"/":
        messages.append(decode_message(element))
        return
    if element[:8] != _BUNDLE or len(element) < 16:
        raise PacketError("neither a message nor a bundle")
    if depth > DEEPEST_BUNDLE:
        raise PacketError(f"bundles nested deeper than {DEEPEST_BUNDLE}")
    place = 16
    while place < len(element):
        size = _number(element, place, "i")
        place += 4
        if not 0 <= size <= len(element) - place:
            raise PacketError(f"an element of {size} bytes in a bundle with {len(element) - place} left")
        _decode_element(element[place : place + size], messages, depth + 1)
        place += size


def decode_message(packet: bytes) -> Message:
    """Decode one OSC message.

    Raises
    ------
    PacketError
        The bytes are not an OSC message, or hold a type that OSC 1.0 does not know.
    """
    address, place = _string(packet, 0)
    if not address.startswith("/"):
        raise PacketError("an address that does not begin with /")
    if place == len(packet):
        return Message(address, [])
    tags, place = _string(packet, place)
    if not tags.startswith(","):
        raise PacketError("type tags that do not begin with ,")
    return Message(address, _arguments(packet, place, tags))


def _arguments(packet: bytes, place: int, tags: str) -> list[object]:
    stack: list[list[object]] = [[]]
    index = 1
    while index < len(tags):
        tag = tags[index]
        index += 1
        if tag == "f":
            # Joint positions are long runs of floats: one call takes a whole run.
            count = 1
            while index < len(tags) and tags[index] == "f":
                index += 1
                count += 1
            if place + 4 * count > len(packet):
                raise PacketError("cut off in its arguments")
            stack[-1].extend(struct.unpack_from(f">{count}f", packet, place))
            place += 4 * count
        elif tag == "[":
            inner: list[object] = []
            stack[-1].append(inner)
            stack.append(inner)
        elif tag == "]":
            if len(stack) < 2:
                raise PacketError("an array ends that never began")
            stack.pop()
        else:
            value, place = _argument(packet, place, tag)
            stack[-1].append(value)
    if len(stack) != 1:
        raise PacketError("an array that never ends")
    return stack[0]


def _argument(packet: bytes, place: int, tag: str) -> tuple[object, int]:
    if tag in _FIXED:
        return _number(packet, place, tag), place + _FIXED[tag].size
    if tag in _VALUES:
        return _VALUES[tag], place
    match tag:
        case "s" | "S":
            return _string(packet, place)
        case "c":
            return chr(_number(packet, place, "r") & 0x7F), place + 4
        case "m":
            return tuple(packet[place : place + 4]), _end(packet, place + 4)
        case "b":
            size = _number(packet, place, "i")
            if size < 0:
                raise PacketError(f"a blob of {size} bytes")
            end = _end(packet, place + 4 + size)
            return packet[place + 4 : end], min(end + -size % 4, len(packet))
        case _:
            raise PacketError(f"an argument of unknown type {tag!r}")


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
