"""OSC packets decoded: the same messages as by python-osc, and one kind of error for other bytes."""

from __future__ import annotations

import struct
from collections import Counter
from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
from pythonosc.osc_message_builder import OscMessageBuilder
from pythonosc.osc_packet import OscPacket

from kinespace.stream.osc.packet import Message, PacketError, decode_message, decode_packet

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pythonosc.osc_bundle import OscBundle
    from pythonosc.osc_message import OscMessage

#: Time tags: at once, long ago, and in the year 2036, when the era of the 32-bit seconds ends.
TAGS = [IMMEDIATELY, 1e9, 2.08e9]

# --- packets built with python-osc -------------------------------------------------------------------------------

_TEXT = st.text(st.characters(exclude_characters="\0", codec="utf-8"), max_size=9)
_SCALARS = st.one_of(
    st.tuples(st.just("i"), st.integers(-(2**31), 2**31 - 1)),
    st.tuples(st.just("h"), st.integers(-(2**63), 2**63 - 1)),
    st.tuples(st.just("f"), st.floats(width=32, allow_nan=False)),
    st.tuples(st.just("d"), st.floats(allow_nan=False)),
    st.tuples(st.just("s"), _TEXT),
    st.tuples(st.just("b"), st.binary(min_size=1, max_size=9)),
    st.tuples(st.just("r"), st.integers(0, 2**32 - 1)),
    st.tuples(st.just("m"), st.tuples(*[st.integers(0, 255)] * 4)),
    st.tuples(st.sampled_from("TFN"), st.none()),
)
_ARGUMENTS = st.recursive(_SCALARS, lambda inner: st.tuples(st.just("["), st.lists(inner, max_size=4)), max_leaves=8)
_ADDRESSES = _TEXT.map("/{}".format)
_MESSAGES = st.tuples(_ADDRESSES, st.lists(_ARGUMENTS, max_size=8))
_ELEMENTS = st.recursive(
    _MESSAGES, lambda inner: st.tuples(st.sampled_from(TAGS), st.lists(inner, max_size=3)), max_leaves=6
)


def _kinds(argument: tuple[str, object]) -> str | list[object]:
    kind, value = argument
    return [_kinds(each) for each in value] if kind == "[" else kind


def _values(argument: tuple[str, object]) -> object:
    kind, value = argument
    return [_values(each) for each in value] if kind == "[" else value


def _message(address: str, arguments: Sequence[tuple[str, object]] = ()) -> OscMessage:
    builder = OscMessageBuilder(address)
    for argument in arguments:
        # python-osc takes an array without a type for no array at all.
        if argument == ("[", []):
            builder.args.extend([("[", None), ("]", None)])
        else:
            builder.add_arg(_values(argument), _kinds(argument))
    return builder.build()


def _bundle(tag: float, elements: Sequence[OscMessage | OscBundle]) -> OscBundle:
    builder = OscBundleBuilder(tag)
    for element in elements:
        builder.add_content(element)
    return builder.build()


def _built(element: tuple[object, list[object]]) -> OscMessage | OscBundle:
    head, content = element
    return _message(head, content) if isinstance(head, str) else _bundle(head, [_built(each) for each in content])


def _of_pythonosc(packet: bytes) -> list[Message]:
    """Decode with python-osc, which sorts messages by their time."""
    return [Message(timed.message.address, timed.message.params) for timed in OscPacket(packet).messages]


def _in_order(element: OscMessage | OscBundle) -> list[Message]:
    """Give python-osc's messages of a packet, in the order of the bytes."""
    if hasattr(element, "params"):
        return [Message(element.address, element.params)]
    return [message for content in element for message in _in_order(content)]


@pytest.mark.slow
@given(element=_ELEMENTS)
@settings(max_examples=100)
def test_bundles_are_read_like_pythonosc(element: tuple[object, list[object]]) -> None:
    """Bundles in bundles of any time tags hold python-osc's messages, in the order of the bytes."""
    built = _built(element)
    found = decode_packet(built.dgram)
    assert found == _in_order(built)
    assert Counter(map(repr, found)) == Counter(map(repr, _of_pythonosc(built.dgram)))


@given(values=st.lists(st.floats(width=32), min_size=1, max_size=100), before=st.booleans())
def test_long_runs_of_floats(values: list[float], *, before: bool) -> None:
    """A run of floats of any length, NaN and infinities among them, is read bit for bit."""
    arguments = [("s", "p")] * before + [("f", value) for value in values] + [("i", 5)]
    (message,) = decode_packet(_message("/motion/frame", arguments).dgram)
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
        (b"/a\0\0,c\0\0\0\0\0A", ("/a", ["A"])),
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
    assert [type(each) for each in decode_message(packet).arguments] == [type(each) for each in arguments]


def test_only_a_message_is_decoded_as_one() -> None:
    """A bundle, or an address without its slash, is no message."""
    for packet in (_bundle(IMMEDIATELY, [_message("/a")]).dgram, b"a\0\0\0"):
        with pytest.raises(PacketError, match="address"):
            decode_message(packet)


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
