"""Senders that take more than their share lose packets: others' are never kept waiting behind theirs."""

from types import SimpleNamespace

import numpy as np
import pytest

from kinespace.stream import osc
from kinespace.stream.frame import Announcement, Frame
from kinespace.stream.inputs import OscDecoder, Source
from kinespace.stream.inputs.source import MAX_AT_ONCE, MAX_WAIT, PER_EVENT, SHARE, Shares
from kinespace.stream.status import InputCounts, Refusals

ANN, EVE = ("10.0.0.1", 4000), ("10.0.0.2", 4000)


def greedy(shares: Shares, now: float) -> None:
    """Let Eve take a second, of which no more is held against her than takes half a second to pay off."""
    shares.is_greedy(ANN, now)
    shares.is_greedy(EVE, now)
    shares.charge(EVE, 1.0, 0, now)


def test_a_greedy_sender_is_greedy_until_its_debt_is_paid() -> None:
    """A sender within its share is not greedy; one that took too much is, and not for long after it stops."""
    shares = Shares()
    for step in range(1000):
        now = step / 100
        assert not shares.is_greedy(ANN, now)
        assert not shares.is_greedy(EVE, now)
        shares.charge(ANN, 0.9 * SHARE / 100, 0, now)
    greedy(shares, 10.0)
    assert shares.is_greedy(EVE, 10.0)
    assert not shares.is_greedy(ANN, 10.1)
    assert shares.in_debt(10.1) == [EVE]
    assert not shares.is_greedy(EVE, 11.0)


def test_the_price_of_a_frame_is_its_time() -> None:
    """The time of recognition is part of a packet's price: a few thousand frames are too many."""
    shares = Shares()
    shares.charge(ANN, 0.0, 1, 1.0)
    shares.is_greedy(EVE, 1.0)
    shares.charge(EVE, 0.0, round(MAX_AT_ONCE / PER_EVENT) - 1, 1.0)
    assert not shares.is_greedy(EVE, 1.0)
    shares.charge(EVE, 0.0, 2, 1.0)
    assert shares.is_greedy(EVE, 1.0)


def test_a_single_sender_never_is_greedy() -> None:
    """A single sender keeps no other waiting."""
    shares = Shares()
    for step in range(100):
        assert not shares.is_greedy(EVE, 10 + step / 10)
        shares.charge(EVE, 0.1, 100, 10 + step / 10)


class Receiver:
    """Gives packets with their senders."""

    waited, kernel_drops = 0.0, 0

    def __init__(self) -> None:
        self.packets: list[tuple[bytes, tuple[str, int]]] = []
        self.sender: tuple[str, int] | None = None

    def broken(self) -> int:
        """Have no connections."""
        return 0

    def receive(self) -> bytes | None:
        """Give the next packet."""
        if not self.packets:
            return None
        packet, self.sender = self.packets.pop(0)
        return packet


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
    made = Source(Receiver(), Costly())  # type: ignore[arg-type]  # fakes
    made.receiver.packets = [(b"a", ANN), (b"e" * 2000, EVE)]  # type: ignore[attr-defined]
    assert made.take(1.0)
    assert made.take(1.0)
    return made


def test_a_greedy_senders_packets_are_dropped_while_others_wait(source: Source) -> None:
    """Only while packets wait; the sender is named, and what was dropped is counted."""
    receiver = source.receiver
    packets = [(b"e" * 2000, EVE), (b"a", ANN), (b"e" * 2000, EVE), (b"b", ANN)]
    for waited, read in ((MAX_WAIT / 2, [2000, 1, 2000, 1]), (2 * MAX_WAIT, [0, 1, 0, 1])):
        receiver.packets, receiver.waited = [*packets], waited  # type: ignore[attr-defined]
        assert [len(source.take(1.01) or ()) for _ in packets] == read
    assert source.notes == ["10.0.0.2:4000 sends more than its share, which is dropped while others wait"]
    assert source.counts.thrown_away == 2
    receiver.packets = [*packets]  # type: ignore[attr-defined]
    assert len(source.take(2.0) or ()) == 2000


def test_a_packet_is_kept_at_its_arrival() -> None:
    """What a packet waited in the system is taken off before it is recorded and decoded."""
    kept, receiver = [], Receiver()
    receiver.packets, receiver.waited = [(b"a", ANN)], 0.25
    keeper = SimpleNamespace(note="", keep=lambda *packet: kept.append(packet))
    source = Source(receiver, Costly(), keeper)  # type: ignore[arg-type]  # fakes
    assert source.take(2.0) == [b"a"]
    assert (kept, source.waited) == ([(b"a", 1.75, ANN)], 0.25)


def test_frames_that_follow_closely_are_dropped_while_thinned() -> None:
    """Of each performer and sender; other packets are read, and all are counted."""
    receiver, joints = Receiver(), tuple("abcde")
    source = Source(receiver, OscDecoder())  # type: ignore[arg-type]  # a fake

    def taken(time: float) -> int:
        frames = [osc.encode_frame(Frame(name, time, np.zeros((5, 3)))) for name in ("p", "q")]
        packets = [*frames, osc.encode_announcement(Announcement("p", joints))]
        receiver.packets = [(packet, sender) for packet in packets for sender in (ANN, EVE)]
        return sum(len(source.take(100.0) or ()) for _ in range(len(receiver.packets)))

    assert [taken(1.0), taken(1.01)] == [6, 6]
    source.patience = 0.2
    assert [taken(1.02), taken(1.04), taken(1.06), taken(0.5)] == [6, 2, 6, 6]
    receiver.waited = 0.21
    assert taken(2.0) == 2
    assert (source.counts.stale, source.counts.received) == (8, 42)
