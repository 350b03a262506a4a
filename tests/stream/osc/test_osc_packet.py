"""OSC packets decoded: the same messages as by python-osc, and one kind of error for other bytes."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pythonosc.osc_message_builder import OscMessageBuilder

from kinespace.stream.osc.packet import Message, PacketError, decode_packet

# --- packets built with python-osc -------------------------------------------------------------------------------


@given(values=st.lists(st.floats(width=32), min_size=1, max_size=100), before=st.booleans())
def test_long_runs_of_floats(values: list[float], *, before: bool) -> None:
    """A run of floats of any length, NaN and infinities among them, is read bit for bit."""
    arguments = [("s", "p")] * before + [("f", value) for value in values] + [("i", 5)]
    builder = OscMessageBuilder("/motion/frame")
    for kind, value in arguments:
        builder.add_arg(value, kind)
    (message,) = decode_packet(builder.build().dgram)
    found = message.arguments[before:-1]
    assert struct.pack(f">{len(values)}f", *found) == struct.pack(f">{len(values)}f", *values)
    assert message.arguments[-1] == 5


# --- packets byte by byte ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("packet", "expected"),
    [
        (b"/a\0\0", ("/a", [])),
        (b"/a\0\0,\0\0\0", ("/a", [])),
        (b"/a\0\0,t\0\0\xff\xff\xff\xff\xff\xff\xff\xff", ("/a", [2**64 - 1])),
        (b"/a\0\0,cmi\0\0\0\0\0\0\0A\1\2\3\4\0\0\0\7", ("/a", ["A", (1, 2, 3, 4), 7])),
        (b"/a\0\0,rh\0\xff\0\0\1\xff\xff\xff\xff\xff\xff\xff\xfe", ("/a", [0xFF000001, -2])),
        (b"/a\0\0,s\0\0abcd\0\0\0\0", ("/a", ["abcd"])),
        (b"/a\0\0,S\0\0\0\0\0\0", ("/a", [""])),
        (b"/a\0\0,b\0\0\0\0\0\0", ("/a", [b""])),
        (b"/a\0\0,bi\0\0\0\0\1\xff\0\0\0\0\0\0\2", ("/a", [b"\xff", 2])),
        (b"/a\0\0,TFNI\0\0\0", ("/a", [True, False, None, float("inf")])),
        (b"/a\0\0,[]\0", ("/a", [[]])),
        (b"/a\0\0,[i[T]]\0\0\0\0\7", ("/a", [[7, [True]]])),
        (b"/a\0\0,ff[f]f\0\x3f\x80\0\0\x40\0\0\0\x40\x40\0\0\x40\x80\0\0", ("/a", [1.0, 2.0, [3.0], 4.0])),
    ],
)
def test_types_that_pythonosc_does_not_write(packet: bytes, expected: tuple[str, list[object]]) -> None:
    """Further type tags, and ends of strings and blobs, are read from the bytes that OSC 1.0 gives."""
    address, arguments = expected
    assert decode_packet(packet) == [Message(address, arguments)]
    assert [type(each) for each in decode_packet(packet)[0].arguments] == [type(each) for each in arguments]


# --- hostile packets ---------------------------------------------------------------------------------------------


@given(tags=st.text("ifhdsSbcrmtTFNI[]x", max_size=20), rest=st.binary(max_size=60))
@settings(max_examples=150)
def test_any_tags_with_any_arguments_raise_nothing_else(tags: str, rest: bytes) -> None:
    """Type tags in any order, followed by any bytes, are read or are a PacketError."""
    encoded = f",{tags}".encode()
    _decode_or_refuse(b"/a\0\0" + encoded + bytes(4 - len(encoded) % 4) + rest)


def _decode_or_refuse(packet: bytes) -> None:
    try:
        messages = decode_packet(packet)
    except PacketError:
        return
    assert all(message.address.startswith("/") for message in messages)
