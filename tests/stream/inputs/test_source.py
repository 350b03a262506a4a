"""Senders that take more than their share are served last: others' packets are never kept waiting behind theirs."""

import socket
from contextlib import closing
from ipaddress import ip_network
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from fakes import FakeReceiver
from golden import message
from programs import LOOPBACK

from kinespace.stream import Announcement, Frame, osc
from kinespace.stream.feeds.preset import parse_preset
from kinespace.stream.inputs import OwnDecoder, Source
from kinespace.stream.inputs.commands import CommandReader
from kinespace.stream.inputs.source import MAX_ASIDE, SHARE, FeedSource, Turns, Waiting
from kinespace.stream.osc import OscReceiver, decode_packet, encode_message
from kinespace.stream.osc.packet import Message, encode_bundle
from kinespace.stream.status import InputCounts, Refusals
from kinespace.stream.teaching import Asked, commands

ANN, EVE = ("10.0.0.1", 4000), ("10.0.0.2", 4000)


def test_a_greedy_sender_comes_last_until_its_debt_is_paid() -> None:
    """A sender within its share never comes last. A sender that took too much does, and not for long after it stops."""
    turns = Turns()
    for step in range(1000):
        now = step / 100
        assert not turns.comes_last(ANN, now)
        assert not turns.comes_last(EVE, now)
        turns.charge(ANN, 0.9 * SHARE / 100, 0, now)
    # Eve takes a second, of which no more is held against her than takes half a second to pay off.
    assert not turns.comes_last(ANN, 10.0)
    assert not turns.comes_last(EVE, 10.0)
    turns.charge(EVE, 1.0, 0, 10.0)
    assert turns.comes_last(EVE, 10.0)
    assert not turns.comes_last(ANN, 10.1)
    assert turns.last(10.1) == [EVE]
    assert not turns.comes_last(EVE, 11.0)


def test_the_packets_put_aside_are_bounded() -> None:
    """The oldest packets make room for new ones, and are counted."""
    turns = Turns()
    for number in range(100):
        turns.put_aside(Waiting([bytes([number]), bytes(65_000)], 1.0, 0.0, EVE))
    assert len(turns.aside) == MAX_ASIDE // 65_001
    assert turns.thrown_away == 100 - len(turns.aside)
    assert turns.take().packet[0] == bytes([turns.thrown_away])


class Costly:
    """Makes as many events of a packet as its bytes say."""

    expires = False
    counts, refusals = InputCounts(), Refusals()

    def decode(self, packet: bytes, arrival: float, sender: object) -> list[bytes]:  # noqa: ARG002 - as a decoder has it
        """Give the packet so many times."""
        return [packet] * len(packet)


@pytest.fixture
def source() -> Source:
    """Give a source in whose account Ann and Eve stand, and Eve has taken too much."""
    made = Source(FakeReceiver(), Costly())  # type: ignore[arg-type]  # fakes
    made.receiver.packets.extend([(b"a", ANN), (b"e" * 2000, EVE)])  # type: ignore[attr-defined]
    assert made.take(1.0)
    assert made.take(1.0)
    return made


def test_others_go_before_a_greedy_sender(source: Source) -> None:
    """Other senders' packets are taken first; then one packet of the greedy sender, and again the others'."""
    receiver = source.receiver
    receiver.packets.extend([(b"e" * 2000, EVE)] * 3 + [(b"a", ANN), (b"b", ANN)])  # type: ignore[attr-defined]
    assert source.take(1.01) == [b"a"]
    assert source.has_put_aside
    assert source.notes == ["10.0.0.2:4000 sends more than its share: served last"]
    assert source.take(1.01) == [b"b"]
    assert len(source.take(1.02) or ()) == 2000
    assert source.waited == pytest.approx(0.01)
    assert source.take(1.02) is None
    receiver.packets.extend([(b"c", ANN)])  # type: ignore[attr-defined]
    assert source.take(1.03) == [b"c"]
    assert [len(source.take(1.04) or ()) for _ in range(4)] == [2000, 0, 2000, 0]
    assert not source.has_put_aside
    assert source.counts.thrown_away == 0


def test_who_invents_joints_comes_last() -> None:
    """New names are compared with every convention's, which takes long; those that come again cost nothing."""
    receiver = FakeReceiver()
    source = Source(receiver, OwnDecoder())  # type: ignore[arg-type]  # a fake
    frame = osc.encode_frame(Frame("ann", 1.0, np.ones((5, 3))))
    for now, end, who in ((1.0, "a", "eve ann ann eve"), (3.0, "a", "eve ann eve ann"), (5.0, "b", "eve ann ann eve")):
        named = osc.encode_announcement(Announcement("eve", tuple(f"{n}{end}" for n in range(250))))
        receiver.packets.extend([(named, EVE), (frame, ANN)] * 2)
        assert [event.performer for _ in range(4) for event in source.take(now) or ()] == who.split()
        assert source.take(now) is None
    # Nor do many skeletons by turns: the names are remembered for a few of them alone.
    for number in range(120):
        named = osc.encode_announcement(Announcement("eve", tuple(f"{n} {number % 40}" for n in range(250))))
        receiver.packets.extend([(named, EVE), (frame, ANN)] * 2)
        taken = [event.performer for _ in range(4) for event in source.take(7.0 + 2 * number) or ()]
        assert taken == ["eve", "ann", "ann", "eve"]
        assert source.take(7.0 + 2 * number) is None


def test_a_packet_is_kept_at_its_arrival() -> None:
    """What a packet waited in the system is taken off before it is recorded and decoded."""
    kept, receiver = [], FakeReceiver()
    receiver.packets.append((b"a", ANN))
    receiver.waited = 0.25
    keeper = SimpleNamespace(note="", keep=lambda *packet: kept.append(packet))
    source = Source(receiver, Costly())  # type: ignore[arg-type]  # fakes
    source.recorder = keeper  # type: ignore[assignment]  # as above
    assert source.take(2.0) == [b"a"]
    assert (kept, source.waited) == ([(b"a", 1.75, ANN)], 0.25)


def test_frames_that_follow_closely_are_dropped_while_thinned() -> None:
    """Of each performer and sender; other packets are read, and all are counted."""
    receiver, joints = FakeReceiver(), tuple("abcde")
    source = Source(receiver, OwnDecoder())  # type: ignore[arg-type]  # a fake

    def taken(time: float) -> int:
        frames = [osc.encode_frame(Frame(name, time, np.zeros((5, 3)))) for name in ("p", "q")]
        packets = [*frames, osc.encode_announcement(Announcement("p", joints))]
        receiver.packets.extend([(packet, sender) for packet in packets for sender in (ANN, EVE)])
        return sum(len(source.take(100.0) or ()) for _ in range(len(receiver.packets)))

    assert [taken(1.0), taken(1.01)] == [6, 6]
    source.patience = 0.2
    assert [taken(1.02), taken(1.06), taken(1.07), taken(0.5)] == [6, 2, 6, 6]
    receiver.waited = 0.21
    assert taken(2.0) == 2
    assert (source.counts.stale, source.counts.received) == (8, 42)


def test_the_source_asks_from_its_own_port() -> None:
    """When tended, the source asks from the port that it listens on; it stops while frames come, and says goodbye."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.bind((LOOPBACK, 0))
        sender.settimeout(5.0)
        text = Path(__file__).with_name("asks.toml").read_text(encoding="utf-8")
        text = text.replace("port = 9", f"port = {sender.getsockname()[1]}")
        source = FeedSource(OscReceiver(LOOPBACK, 0), parse_preset(text, "asks", "asks.toml"))
        port = source.receiver.address[1]
        assert source.tend(0.0) == []
        packet, came_from = sender.recvfrom(1000)
        assert decode_packet(packet) == [Message("/please", [port, f"to {port}", 1.5])]
        assert came_from[1] == port
        for place, name in enumerate("ab"):
            sender.sendto(message(f"/{name}", "fff", 1.0, 2.0, 3.0 + place), came_from)
        made = [event for _ in range(2) for event in wait_for(source, 1.5)]
        assert [type(event) is Frame for event in made] == [False, True]
        source.tend(1.9)
        source.tend(2.2)
        sender.sendto(b"nothing in between", sender.getsockname())
        assert sender.recv(1000) == b"nothing in between"
        source.tend(4.5)
        assert decode_packet(sender.recv(1000))[0].address == "/please"
        source.close()
        assert decode_packet(sender.recv(1000))[0].address == "/bye"


def wait_for(source: FeedSource, arrival: float) -> list[object]:
    """Take in one datagram, waiting for it."""
    source.receiver.socket.settimeout(5.0)
    while (taken := source.take(arrival)) is None:
        pass
    return list(taken)


# --- commands among a feed's packets ----------------------------------------------------------------------------------


HERE, ELSEWHERE = ("127.0.0.1", 5), ("192.0.2.9", 5)
STOP, WRONG = encode_message("/motion/teach/stop"), encode_message("/motion/teach/fly")
FRAME = osc.encode_frame(Frame("ann", 1.0, np.ones((5, 3), dtype=np.float32)))


def test_commands_are_read_from_senders_that_may_give_them() -> None:
    """A packet without a command is not for the reader; a mistake and a stranger are commands that are refused."""
    reader = CommandReader([ip_network("192.0.2.7")])
    assert reader.read(FRAME, HERE, 1.0) is None
    assert reader.read(encode_bundle(FRAME), HERE, 1.0) is None
    assert (reader.counts.received, reader.counts.foreign) == (0, 0)
    for sender in (HERE, ("192.0.2.7", 1), ("::1", 1), ("key ann", 0)):
        (asked,) = reader.read(STOP, sender, 1.0) or ()
        assert (asked.command, asked.refusal, asked.reply) == (commands.Stop(), "", None)
    for sender, named in ((ELSEWHERE, "192.0.2.9"), (None, "elsewhere")):
        (asked,) = reader.read(STOP, sender, 1.0) or ()
        assert (asked.command, asked.refusal) == (None, f"a control message from {named}: see --allow-from")
    (asked,) = reader.read([b"topic", WRONG], HERE, 1.0) or ()
    assert asked.command is None
    assert "expected one of" in asked.refusal
    assert (reader.counts.received, reader.counts.foreign) == (7, 3)


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
    assert (reader.counts.received, reader.counts.foreign) == (212, 8)


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


def test_a_source_gives_commands_and_the_frames_beside_them() -> None:
    """Commands come before the frames of their bundle; a packet of commands alone is not counted as foreign."""
    receiver = osc.OscReceiver(LOOPBACK, 0)
    with closing(Source(receiver, OwnDecoder())) as port, closing(osc.OscSender(*receiver.address[:2])) as sender:
        port.commands = CommandReader()
        for packet, kinds in (
            (STOP, [Asked]),
            (FRAME, [Frame]),
            (encode_bundle(STOP, FRAME, STOP), [Asked, Asked, Frame]),
            (encode_bundle(STOP, STOP), [Asked, Asked]),
        ):
            sender.send(packet)
            given = port.take(1.0)
            assert [type(each) for each in given] == kinds
        assert port.take(1.0) is None
        counts = port.counts
    # The bundle is a packet of commands and a packet of frames; its commands are not frames.
    assert (counts.received, counts.malformed, counts.foreign) == (5, 0, 2)
