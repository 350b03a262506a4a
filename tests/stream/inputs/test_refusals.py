"""Refusals are described with the last packet's sender and beginning."""

from __future__ import annotations

import re

import numpy as np
import pytest

from kinespace.stream import osc
from kinespace.stream.feeds import builtin_preset
from kinespace.stream.feeds.decoder import FeedDecoder
from kinespace.stream.inputs import OscDecoder, ZmqDecoder

SENDER = ("10.0.0.5", 4000)
NOWHERE = osc.encode_message("/motion/frame", "ann", 1.0, *[0.0] * 5, float("inf"), *[0.0] * 3)
WRONG = b'{"v":1,"t":1.0,"shape":[1,3],"dtype":"float64"}'


@pytest.mark.parametrize(
    ("decoder", "packet", "told"),
    [
        (OscDecoder(), b"hello", "last malformed: neither a message nor a bundle, from 10.0.0.5:4000: 'hello'"),
        (OscDecoder(), NOWHERE, "last malformed: /motion/frame of ann: positions: .* joint 2 of 3 at 0, 0, inf, from"),
        (OscDecoder(), osc.encode_message("/VMC/Ext/OK", 1), "last foreign: /VMC/Ext/OK, from 10.0.0.5:4000: "),
        (
            ZmqDecoder(),
            [b"frame/ann/", WRONG, bytes(24)],
            "last malformed: dtype: expected <f4 or <f8, got 'float64', ",
        ),
        (ZmqDecoder(), [b"hello/", b""], "last foreign: neither a frame nor one part in msgpack or OSC, from"),
        (
            FeedDecoder(builtin_preset("osceleton")),
            osc.encode_message("/joint", "head"),
            "last malformed: /joint: exp",
        ),
    ],
)
def test_the_last_refusal_names_reason_and_sender(decoder: OscDecoder, packet: bytes | list[bytes], told: str) -> None:
    """The reason, the sender and an excerpt of the packet, in one line without control characters."""
    assert decoder.refusals.lines() == []
    assert not decoder.decode(packet, 1.0, SENDER)
    (line,) = decoder.refusals.lines()
    assert line.isprintable()
    assert re.match(told, line)


def test_text_from_outside_does_not_steer_a_terminal() -> None:
    """Control characters in a reason are replaced, and long reasons cut."""
    decoder = OscDecoder()
    decoder.decode(osc.encode_message("/\x1b[2J" + "x" * 500), 1.0, None)
    (line,) = decoder.refusals.lines()
    assert line.isprintable()
    assert len(line) < 300


def test_frames_cost_no_refusal() -> None:
    """A valid packet leaves no refusal."""
    decoder = OscDecoder()
    frame = osc.encode_message("/motion/frame", "ann", 1.0, *np.zeros(9).tolist())
    assert decoder.decode(frame, 1.0, SENDER)
    assert decoder.refusals.lines() == []
