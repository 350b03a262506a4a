"""Commands among a feed's packets: who may give them, what is counted, and frames that come in the same bundle."""

from collections.abc import Iterator
from contextlib import closing
from ipaddress import ip_network

import numpy as np
import pytest

from kinespace.stream import Frame, osc
from kinespace.stream.inputs import OscDecoder, Source
from kinespace.stream.inputs.commands import CommandReader
from kinespace.stream.osc import encode_message
from kinespace.stream.osc.packet import encode_bundle
from kinespace.stream.teaching import Asked, commands

HERE, ELSEWHERE = ("127.0.0.1", 5), ("192.0.2.9", 5)
STOP, WRONG = encode_message("/motion/teach/stop"), encode_message("/motion/teach/fly")
FRAME = osc.encode_frame(Frame("ann", 1.0, np.ones((5, 3), dtype=np.float32)))


def test_commands_are_read_from_senders_that_may_give_them() -> None:
    """A packet without a command is not for the reader; a mistake and a stranger are commands that are refused."""
    reader = CommandReader([ip_network("192.0.2.7")])
    assert reader.read(FRAME, HERE, 1.0) is None
    assert reader.read(encode_bundle(FRAME), HERE, 1.0) is None
    assert (reader.received, reader.refused) == (0, 0)
    for sender in (HERE, ("192.0.2.7", 1), ("::1", 1), ("key ann", 0)):
        (asked,) = reader.read(STOP, sender, 1.0) or ()
        assert (asked.command, asked.refusal, asked.reply) == (commands.Stop(), "", None)
    for sender, named in ((ELSEWHERE, "192.0.2.9"), (None, "elsewhere")):
        (asked,) = reader.read(STOP, sender, 1.0) or ()
        assert (asked.command, asked.refusal) == (None, f"a control message from {named}: see --allow-from")
    (asked,) = reader.read([b"topic", WRONG], HERE, 1.0) or ()
    assert asked.command is None
    assert "expected one of" in asked.refusal
    assert (reader.received, reader.refused) == (7, 3)


def test_a_senders_commands_are_counted() -> None:
    """Twenty a second are obeyed, and eight of a packet; the rest is refused, and costs no other sender anything."""
    reader, eight, here_too = CommandReader(), encode_bundle(*[STOP] * 8), ("127.0.0.1", 6)
    given = [reader.read(eight, sender, 1.0) or () for sender in (HERE, here_too, HERE, here_too)]
    assert [len(each) for each in given] == [8, 8, 1, 1]
    assert [each[0].refusal for each in given[2:]] == ["too many commands: expected at most 20 a second"] * 2
    assert len(reader.read(eight, ("::1", 5), 1.0) or ()) == 8
    # A program of this machine has sixteen million addresses to send from.
    assert [len(reader.read(eight, (f"127.0.1.{place}", 5), 1.0) or ()) for place in range(5)] == [1] * 5
    assert len(reader.read(eight, HERE, 1.2) or ()) == 8
    (asked,) = reader.read(encode_bundle(*[STOP] * 9), HERE, 9.0) or ()
    assert asked.refusal == "packet: expected at most 8 commands, got 9"
    steady = [reader.read(STOP, HERE, 10.0 + number / 20) or () for number in range(200)]
    assert all(each[0].command for each in steady)
    assert (reader.received, reader.refused) == (212, 8)


def test_counting_anew_is_a_command_that_is_obeyed_without_lessons() -> None:
    """A stranger's is refused; so is every other command, where nobody may teach."""
    reader, reset = CommandReader(no_lessons="teaching is off"), encode_message("/motion/*/count/reset")
    assert [each.command for each in reader.read(reset, HERE, 1.0) or ()] == [commands.Reset()]
    for packet, sender, refusal in (
        (reset, ELSEWHERE, "a control message from 192.0.2.9: see --allow-from"),
        (STOP, HERE, "teaching is off"),
        (encode_bundle(reset, STOP), HERE, "teaching is off"),
    ):
        assert [(each.command, each.refusal) for each in reader.read(packet, sender, 1.0) or ()] == [(None, refusal)]
    named = osc.encode_frame(Frame("a/count/reset", 1.0, np.ones((5, 3), dtype=np.float32)))
    assert reader.read(named, ELSEWHERE, 1.0) is None


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
    with closing(osc.OscSender(*receiver.address[:2])) as sender:
        for packet, kinds in (
            (STOP, [Asked]),
            (FRAME, [Frame]),
            (encode_bundle(STOP, FRAME, STOP), [Asked, Asked, Frame]),
            (encode_bundle(STOP, STOP), [Asked, Asked]),
        ):
            sender.send(packet)
            given = source.take(1.0)
            assert [type(each) for each in given] == kinds
    assert source.take(1.0) is None
    counts = source.counts
    # The bundle is a packet of commands and a packet of frames; its commands are not frames.
    assert (counts.received, counts.malformed, counts.foreign) == (5, 0, 2)
