"""OSC that is not ours on both ends of the wire: liblo sends to us and reads what we send."""

import socket
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from types import ModuleType

import numpy as np
import pytest
from golden import LAYOUTS, Moment
from programs import LOOPBACK, PATIENCE, builtin_library, ghost_cues

from kinespace.library.naming.hdm05 import SKELETON
from kinespace.stream import osc
from kinespace.stream.feeds import builtin_preset
from kinespace.stream.frame import Announcement, Frame
from kinespace.stream.inputs import OscDecoder, Source
from kinespace.stream.osc.packet import decode_packet
from kinespace.stream.outputs import layouts
from kinespace.stream.recognition import Event, EventKind, Recognition
from kinespace.stream.recognizer import Recognizer
from kinespace.stream.recognizer.performers import PerformerCounts
from kinespace.stream.status import InputCounts, Status

pytestmark = pytest.mark.slow

CLASSES = builtin_library().classes
STATUS = Status(InputCounts(), PerformerCounts(), 0, {"ghost": 120.0}, 0.0, 0.0)
START = Event("ghost", EventKind.START, "squat1Reps", CLASSES.index("squat1Reps"), 0.75, 4.25)


@pytest.fixture(scope="module")
def recognition() -> Recognition:
    """Give the recognition of a ghost's last window."""
    recognizer = Recognizer(builtin_library())
    answers = [recognizer.push(cue.frame) for cue in ghost_cues("squat1Reps", 1.5)]
    return [answer for answer in answers if answer][-1]


def taken(source: Source, packets: int) -> list[Frame | Announcement]:
    """Take so many packets, waiting for them."""
    events: list[Frame | Announcement] = []
    until = time.monotonic() + PATIENCE
    while source.counts.received < packets and time.monotonic() < until:
        events += source.take(1.0) or ()
    assert source.counts.received == packets
    return events


def test_liblo_announces_joints_and_sends_a_frame(pyliblo: ModuleType) -> None:
    """Liblo's messages arrive as an announcement and a frame, number for number; others are counted."""
    positions = ghost_cues("squat1Reps", 0.1)[0].frame.positions
    with closing(Source(osc.OscReceiver(LOOPBACK, 0), OscDecoder())) as source:
        to, who = pyliblo.Address(LOOPBACK, source.receiver.address[1]), ("Ada Ä", ("d", 2.5))
        pyliblo.send(to, "/motion/skeleton", "Ada Ä", *SKELETON.joints)
        pyliblo.send(to, "/motion/frame", *who, *(("f", number) for number in positions.ravel().tolist()))
        pyliblo.send(to, "/motion/frame", *who, 1.0, 2.0)
        pyliblo.send(to, "/elsewhere", 1, ("T", None))
        announced, frame = taken(source, 4)
        assert (source.counts.malformed, source.counts.foreign) == (1, 1)
    assert announced == Announcement("Ada Ä", SKELETON.joints)
    assert isinstance(frame, Frame)
    assert (frame.performer, frame.time) == ("Ada Ä", 2.5)
    np.testing.assert_array_equal(frame.positions.astype(np.float32), positions)


Understood = tuple[str, list[object]]


@pytest.fixture
def understood(pyliblo: ModuleType) -> Iterator[Callable[[bytes], list[Understood]]]:
    """Give liblo's reading of a datagram: addresses and arguments."""
    server, came = pyliblo.Server(None), list[Understood]()
    server.add_method(None, None, lambda address, arguments: came.append((address, arguments)))

    def take(datagram: bytes) -> list[Understood]:
        came.clear()
        sender.sendto(datagram, (LOOPBACK, server.port))
        assert server.recv(int(PATIENCE * 1000))
        return [*came]

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        yield take
    server.free()


def ours(datagram: bytes) -> list[Understood]:
    """Read a datagram with our decoder."""
    return [(each.address, [*each.arguments]) for each in decode_packet(datagram)]


@pytest.mark.parametrize("name", [name for name in LAYOUTS if builtin_preset(LAYOUTS[name][0]).packing == "osc"])
def test_liblo_reads_other_products_packets_as_we_do(
    name: str, understood: Callable[[bytes], list[Understood]]
) -> None:
    """Each golden packet, bundles unpacked, is read by liblo as by our decoder."""
    (cue,) = ghost_cues("squat1Reps", 0.1)[:1]
    for packet in LAYOUTS[name][1](Moment(dict(zip(SKELETON.joints, cue.frame.positions, strict=True)), 1.0, 0)):
        assert understood(packet) == ours(packet)


@pytest.mark.parametrize("name", layouts.LAYOUTS)
def test_liblo_reads_our_answers_in_every_layout(
    name: str, understood: Callable[[bytes], list[Understood]], recognition: Recognition
) -> None:
    """Answers, events, classes and status of each layout are read by liblo as they were written."""
    layout = layouts.LAYOUTS[name]()
    told = (layout.recognition(recognition), layout.event(START), layout.classes(CLASSES), layout.status(STATUS))
    packets = [packet for packet in told if packet is not None]
    assert packets
    for packet in packets:
        assert understood(packet) == ours(packet)
