"""Our OSC: packets decoded as by python-osc, answers that it reads, and the two sockets."""

import dataclasses
import select
import sys
import threading
from collections.abc import Iterator
from contextlib import closing

import numpy as np
import pytest
from fakes import NAMED, params_of
from programs import LOOPBACK

from kinespace.stream import Event, EventKind, osc
from kinespace.stream.osc import decode_packet, udp
from kinespace.stream.osc import messages as osc_answers
from kinespace.stream.osc.packet import Message
from kinespace.stream.osc.udp import RECEIVE_BUFFER, LookedUp
from kinespace.stream.status import InputCounts, PerformerCounts, Status

# --- packets byte by byte ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("packet", "expected"),
    [
        *((packet, ("/a", [])) for packet in (b"/a\0\0", b"/a\0\0,\0\0\0")),
        (b"/a\0\0,t\0\0\xff\xff\xff\xff\xff\xff\xff\xff", ("/a", [2**64 - 1])),
        (b"/a\0\0,cmi\0\0\0\0\0\0\0A\1\2\3\4\0\0\0\7", ("/a", [65, 0x01020304, 7])),
        (b"/a\0\0,rh\0\xff\0\0\1\xff\xff\xff\xff\xff\xff\xff\xfe", ("/a", [0xFF000001, -2])),
        (b"/a\0\0,s\0\0abcd\0\0\0\0", ("/a", ["abcd"])),
        *((b"/a\0\0," + tag + bytes(6), ("/a", [none])) for tag, none in ((b"S", ""), (b"b", b""))),
        (b"/a\0\0,bi\0\0\0\0\1\xff\0\0\0\0\0\0\2", ("/a", [b"\xff", 2])),
        (b"/a\0\0,TFNI\0\0\0", ("/a", [True, False, None, float("inf")])),
        (b"/a\0\0,[i[T]]\0\0\0\0\7", ("/a", [7, True])),
    ],
)
def test_types_that_pythonosc_does_not_write(packet: bytes, expected: tuple[str, list[object]]) -> None:
    """Further type tags, and ends of strings and blobs, are read from the bytes that OSC 1.0 gives."""
    address, arguments = expected
    assert decode_packet(packet) == [Message(address, arguments)]
    assert [type(each) for each in decode_packet(packet)[0].arguments] == [type(each) for each in arguments]


# --- osc --------------------------------------------------------------------------------------------------------------


# --- answers -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("time", [1e300, -1e300])
def test_a_time_beyond_all_floats_is_the_largest(time: float) -> None:
    """A clock that makes no sense ends no answer."""
    (params,) = params_of(osc_answers.encode_event(Event("p", EventKind.END, "bow", 0, 0.5, time))).values()
    assert params[-1] == pytest.approx(np.copysign(3.4028235e38, time))


@pytest.mark.parametrize(
    ("performer", "part"),
    [
        *(("Ada", "Ada"), ("7", "7"), ("a b", "a%20b"), ("a/b", "a%2Fb"), ("a%2Fb", "a%252Fb"), ("#*", "%23%2A")),
        *(("Zoë", "Zoë"), ("佐藤", "佐藤"), ("\t", "%09"), ("a_b", "a_b")),
    ],
)
def test_performers_stand_in_addresses(performer: str, part: str) -> None:
    """Letters of any script stay; what OSC reserves is written as in a URL, so that no two names are one."""
    assert osc.address_part(performer) == part
    addresses = params_of(osc.messages.encode_recognition(dataclasses.replace(NAMED, performer=performer)))
    assert set(addresses) == {f"/motion/{part}/{last}" for last in ("class", "guess", "sofar", "label", "scores")}


def test_the_status_is_sent() -> None:
    """The status holds a sign of life, frames per second, the number of performers, and losses up to OSC's largest."""
    counts = PerformerCounts(no_room=10, other_joints=20)
    counts.recognizers.out_of_order = 30
    inputs = InputCounts(received=9999, malformed=1, foreign=500, overrun=2, missing=3)
    status = Status(inputs, counts, 7, {"a": 119.5, "b": 30.0}, 0.1, 0.2)
    assert params_of(osc_answers.encode_status(status)) == {"/motion/status": [1, 149.5, 2, 66]}
    inputs.missing = 10**15
    assert params_of(osc_answers.encode_status(status))["/motion/status"][-1] == 2**31 - 1


# --- the sockets -------------------------------------------------------------------------------------------------


@pytest.fixture
def sender(receiver: osc.OscReceiver) -> Iterator[osc.OscSender]:
    """Open a sender to the receiver."""
    with closing(osc.OscSender(*receiver.address)) as sender:
        yield sender


def _receive(receiver: osc.OscReceiver) -> bytes | None:
    """Wait for a datagram that was sent."""
    readable, _, _ = select.select([receiver.socket], [], [], 60.0)
    assert readable
    return receiver.receive()


def test_datagrams_arrive_in_order(receiver: osc.OscReceiver, sender: osc.OscSender) -> None:
    """Datagrams come one at a time and in order, an empty one and the largest possible too; then there is none."""
    packets = [b"first", b"", np.random.default_rng(0).bytes(65_507), osc.messages.encode_recognition(NAMED)]
    for packet in packets:
        sender.send(packet)
    assert [_receive(receiver) for _ in packets] == packets
    assert receiver.receive() is None
    assert receiver.waited > 0.0 or sys.platform != "linux"
    assert (sender.failed, sender.unheard, receiver.counts.overrun) == (0, 0, 0)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells how many datagrams it threw away")
def test_packets_dropped_by_the_system_are_counted(receiver: osc.OscReceiver, sender: osc.OscSender) -> None:
    """When more comes than the buffer holds, the counter gives exactly the number of lost packets."""
    sent = 4 * RECEIVE_BUFFER // 60_000
    for _ in range(sent):
        sender.send(bytes(60_000))
    came = 0
    while receiver.receive() is not None:
        came += 1
    assert 0 < came < sent
    sender.send(b"one more")
    assert _receive(receiver) == b"one more"
    assert receiver.counts.overrun == sent - came


def test_datagrams_that_cannot_be_sent_are_counted(receiver: osc.OscReceiver, sender: osc.OscSender) -> None:
    """A datagram that the system does not take is counted, and the next one goes out."""
    sender.send(bytes(70_000))
    sender.send(b"small")
    assert sender.failed == 1
    assert (receiver.send_to(bytes(70_000), receiver.address), str(sender)) == (False, str(receiver)[4:])
    assert _receive(receiver) == b"small"


@pytest.mark.skipif(sys.platform != "linux", reason="other systems report lost datagrams later")
def test_datagrams_that_reach_no_program_are_counted_on_request(receiver: osc.OscReceiver) -> None:
    """A sender that asks counts each datagram that came back; one that does not ask counts none, and neither fails."""
    place = receiver.address
    receiver.close()
    with closing(osc.OscSender(*place, asks=True)) as asking, closing(osc.OscSender(*place)) as sender:
        for _ in range(3):
            asking.send(b"x")
            sender.send(b"x")
        assert [(each.unheard, each.failed) for each in (asking, asking, sender)] == [(3, 0), (3, 0), (0, 0)]


def test_a_host_is_looked_up_without_waiting(monkeypatch: pytest.MonkeyPatch) -> None:
    """Numbers are an address at once; a name becomes one in a thread, when the name server answers."""
    assert LookedUp(LOOPBACK, 9).address == (LOOPBACK, 9)
    resolved, failing = udp._resolved, [True, True]  # noqa: SLF001 - in place of a name server

    def answer(host: str, port: int) -> object:
        # An earlier test's look-up may still be trying.
        if failing and host == "stage.local":
            failing.pop()
            raise OSError
        return resolved(LOOPBACK, port)

    monkeypatch.setattr(udp, "_resolved", answer)
    pauses: list[float] = []
    monkeypatch.setattr(udp.time, "sleep", pauses.append)
    others, found = {*threading.enumerate()}, LookedUp("stage.local", 9)
    for thread in {*threading.enumerate()} - others:
        thread.join()
    assert (found.address, pauses) == ((LOOPBACK, 9), [5.0, 5.0])


def test_this_machines_addresses_are_known() -> None:
    """An address that can be bound is this machine's."""
    assert [osc.is_ours(host) for host in (LOOPBACK, "192.0.2.1", "2001:db8::1")] == [True, False, False]
