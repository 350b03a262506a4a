"""Commands among a feed's packets: who may give them, what is counted, and frames that come in the same bundle."""

from collections.abc import Iterator
from contextlib import closing
from ipaddress import ip_network

import numpy as np
import pytest

from kinespace.stream import osc
from kinespace.stream.frame import Frame
from kinespace.stream.inputs import OscDecoder, Source
from kinespace.stream.inputs.commands import CommandReader
from kinespace.stream.osc.packet import encode_bundle, encode_message
from kinespace.stream.teaching import Asked, commands

HERE, ELSEWHERE = ("127.0.0.1", 5), ("192.0.2.9", 5)
STOP, WRONG = encode_message("/motion/teach/stop"), encode_message("/motion/teach/fly")
FRAME = osc.encode_frame(Frame("ann", 1.0, np.ones((5, 3), dtype=np.float32)))


def test_commands_are_read_from_senders_that_may_give_them() -> None:
    """A packet without a command is not for the reader; a mistake and a stranger are commands that are refused."""
    reader = CommandReader([ip_network("192.0.2.7")])
    assert reader.read(FRAME, HERE) is None
    assert reader.read(encode_bundle(FRAME), HERE) is None
    assert (reader.received, reader.refused) == (0, 0)
    for sender in (HERE, ("192.0.2.7", 1), ("::1", 1), ("key ann", 0)):
        (asked,) = reader.read(STOP, sender) or ()
        assert (asked.command, asked.refusal, asked.reply) == (commands.Stop(), "", None)
    for sender, named in ((ELSEWHERE, "192.0.2.9"), (None, "elsewhere")):
        (asked,) = reader.read(STOP, sender) or ()
        assert (asked.command, asked.refusal) == (None, f"a control message from {named}: see --allow-from")
    (asked,) = reader.read([b"topic", WRONG], HERE) or ()
    assert asked.command is None
    assert "expected one of" in asked.refusal
    assert (reader.received, reader.refused) == (7, 2)


def test_where_nobody_may_command_the_first_who_does_hears_why() -> None:
    """Once, also among frames, which are read as ever; the packet counts as foreign."""
    made = Source(osc.OscReceiver("127.0.0.1", 0), OscDecoder())
    made.no_commands = "teaching is off"
    assert isinstance(made.receiver, osc.OscReceiver)
    with closing(made), closing(osc.OscSender(*made.receiver.address[:2])) as sender:
        for packet in (FRAME, STOP, STOP, FRAME):
            sender.send(packet)
        taken = [event for _ in range(4) for event in made.take(1.0) or ()]
    (refused,) = [(each.command, each.refusal) for each in taken if isinstance(each, Asked)]
    assert refused == (None, "teaching is off")
    assert sum(isinstance(each, Frame) for each in taken) == 2
    assert (made.counts.received, made.counts.foreign) == (4, 2)


@pytest.fixture
def source() -> Iterator[Source]:
    """Give a port whose packets may hold commands."""
    made = Source(osc.OscReceiver("127.0.0.1", 0), OscDecoder())
    made.commands = CommandReader()
    yield made
    made.close()


def test_a_source_gives_commands_and_the_frames_beside_them(source: Source) -> None:
    """Commands come before the frames of their bundle; a packet of commands alone is not counted as foreign."""
    receiver = source.receiver
    assert isinstance(receiver, osc.OscReceiver)
    with closing(osc.OscSender(*receiver.address[:2])) as sender:
        for packet, kinds in (
            (STOP, [Asked]),
            (FRAME, [Frame]),
            (encode_bundle(STOP, FRAME, STOP), [Asked, Asked, Frame]),
        ):
            sender.send(packet)
            given = source.take(1.0)
            assert given is not None
            assert [type(each) for each in given] == kinds
    assert source.take(1.0) is None
    counts = source.counts
    # The bundle is a packet of commands and a packet of frames; its commands are not frames.
    assert (counts.received, counts.malformed) == (4, 0)
