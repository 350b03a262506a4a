"""Bad feeds: all that a sender does wrong is counted, nothing raises, and valid frames are recognised."""

from contextlib import closing

import numpy as np
import pytest
import zmq
from fuzzfeeds import PACKETS, run, run_messages
from golden import LAYOUTS, moments
from numpy.typing import NDArray
from programs import LOOPBACK, ghost_cues, until

from kinespace.library.naming.hdm05 import SKELETON
from kinespace.library.signature.landmark_body import body_of
from kinespace.stream import Announcement, Frame, zeromq
from kinespace.stream.feeds import FrameAssembler, builtin_names, builtin_preset
from kinespace.stream.feeds.unpackers import LOOSE, UNPACKERS
from kinespace.stream.inputs import OwnDecoder, Source
from kinespace.stream.zeromq import Endpoint, ZmqReceiver

# --- hostile packets --------------------------------------------------------------------------------------------------


def test_a_message_of_a_hundred_thousand_parts_is_passed_over() -> None:
    """It is thrown away a little at a time, and frames before and after it are read."""
    receiver, events = ZmqReceiver(Endpoint(f"tcp://{LOOPBACK}:*", bind=True)), list[Frame]()
    publisher = zmq.Context.instance().socket(zmq.XPUB)
    publisher.linger = 0
    publisher.set_hwm(0)
    with closing(publisher), closing(Source(receiver, OwnDecoder())) as source:
        publisher.connect(receiver.address)
        until(lambda: (source.take(0.0), publisher.poll(10))[1])
        publisher.send_multipart(zeromq.encode_frame(Frame("ann", 1.0, np.ones((5, 3))), 0))
        publisher.send_multipart([b"x"] * 100_000)
        publisher.send_multipart(zeromq.encode_frame(Frame("ann", 1.01, np.ones((5, 3))), 1))
        until(lambda: (events.extend(source.take(1.0) or ()), source.counts.received >= 3)[1])
        assert ([event.time for event in events], source.counts.foreign) == ([1.0, 1.01], 1)


# --- fuzzfeeds --------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("name", builtin_names())
def test_no_packet_raises_and_all_are_counted(name: str) -> None:
    """Golden packets cut, changed, joined and nested, in any order: nothing raises, every one is counted."""
    source = run(builtin_preset(name), PACKETS, seed=builtin_names().index(name))
    counts, made = source.counts, source.decoder.assembler.counts
    assert counts.received == PACKETS
    assert counts.malformed > 0
    assert made.frames + made.incomplete + made.late > 0


@pytest.mark.slow
def test_no_message_raises_and_all_are_counted() -> None:
    """ZeroMQ messages with broken parts, parts missing, repeated and swapped: nothing raises, every one is counted."""
    counts = run_messages(PACKETS, seed=len(builtin_names())).counts
    assert counts.received == PACKETS
    assert min(counts.malformed, counts.foreign) > 0
    assert counts.malformed + counts.foreign < PACKETS


#: Seconds by which a frame's time may be wrong where a sender rounds it: Xsens to whole milliseconds.
_TIME = {"xsens": 6e-4}
#: Layouts in which a body stands elsewhere: OSCeleton's shares do not tell from where.
_ELSEWHERE = ("osceleton", "osceleton -q")
#: The performers that layouts name.
_NAMED = {"native": "jan", "kinectv2": "72057594037928017", "captury": "John-Doe", "rokoko": "Dimitris", "xsens": "0"}
_NAMED |= {"qtm": "Jan", "natnet2osc": "Jan", "zigsim": "iPhone", "zigsim osc": "B8-27", "mediapipe": "webcam"}


def assembled(layout: str, positions: NDArray[np.floating], rate: float) -> tuple[FrameAssembler, list[Frame]]:
    """Make frames of a product's packets."""
    preset = builtin_preset(LAYOUTS[layout][0])
    assembler, unpack = FrameAssembler(preset), UNPACKERS[preset.packing]()
    events: list[Frame | Announcement] = []
    for moment, packets in moments(layout, positions, rate):
        for place, packet in enumerate(packets):
            bundle = preset.packing not in LOOSE or packet.startswith(b"#")
            events += assembler.push(unpack(packet), moment + place * 1e-6, bundle=bundle)
    events += assembler.expire(moment + 1.0)
    announced = [event for event in events if isinstance(event, Announcement)]
    assert announced == [Announcement(announced[0].performer, assembler.preset.joints)]
    return assembler, [event for event in events if isinstance(event, Frame)]


def test_every_preset_has_golden_packets() -> None:
    """Each preset has a layout that feeds it."""
    assert {preset for preset, _ in LAYOUTS.values()} == set(builtin_names())


@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_sent_frame_is_made(layout: str) -> None:
    """In each layout every frame comes out once, whole, in time, with the performer and the positions sent."""
    positions = np.array([cue.frame.positions for cue in ghost_cues("squat1Reps", 0.15)])
    assembler, frames = assembled(layout, positions, 120.0)
    counts, preset = assembler.counts, assembler.preset
    assert len(frames) == len(positions)
    assert (counts.malformed, counts.incomplete, counts.late, counts.held, counts.absurd) == (0, 0, 0, 0, 0)
    kept = positions[:, [SKELETON.joints.index(joint) for joint in preset.sent]]
    if preset.guessed:
        kept = np.array([body_of(preset.sent, frame) for frame in kept])
    made = np.array([frame.positions for frame in frames])
    if layout in _ELSEWHERE:
        made, kept = (each - each.mean(axis=1, keepdims=True) for each in (made, kept))
    np.testing.assert_allclose(made, kept, atol=4e-6)
    assert {frame.performer for frame in frames} == {_NAMED.get(layout, frames[0].performer)}
    times = np.array([frame.time for frame in frames])
    np.testing.assert_allclose(times, 1.0 + np.arange(len(positions)) / 120.0, atol=_TIME.get(layout, 1e-4))
