"""A recording gives the answers of the live feed, every time it is played."""

import dataclasses
import time
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import numpy as np
import pytest
import zmq
from fakes import FakeSink
from golden import LAYOUTS, Moment
from programs import ghost_cues
from synthetic import STICK, STICK_CLASSES, stick_clip, stick_clips

from kinespace.library import MotionLibrary
from kinespace.library.naming.hdm05 import SKELETON
from kinespace.stream import Announcement, Frame, Performers, Recognition, osc, zeromq
from kinespace.stream.feeds import builtin_preset
from kinespace.stream.frame import Input
from kinespace.stream.inputs import OscDecoder, Source, ZmqDecoder
from kinespace.stream.inputs.kinerec import RawFile, RawPacket, RawWriter, Recorder, source_name
from kinespace.stream.inputs.takes import decoded
from kinespace.stream.service.loop import Service
from kinespace.stream.zeromq import Endpoint

LOOPBACK = "127.0.0.1"
PATIENCE = 60.0


def recognitions(performers: Performers, stream: Iterable[tuple[float, Input]]) -> Iterator[Recognition]:
    """Push a recording's frames through recognisers, at its own times; give every answer."""
    for arrival, event in stream:
        yield from (answer for answer in performers.push_all([event], arrival) if answer)


def assert_same(first: list[Recognition], second: list[Recognition]) -> None:
    """Hold every number of every answer against the other's, bit for bit."""
    assert len(first) == len(second)
    for one, other in zip(first, second, strict=True):
        for field in dataclasses.fields(one):
            mine, theirs = getattr(one, field.name), getattr(other, field.name)
            if field.name == "evidence" and mine is not None:
                mine, theirs = np.hstack(mine), np.hstack(theirs)
            np.testing.assert_array_equal(mine, theirs, err_msg=field.name)


def a_feed() -> list[bytes]:
    """Make datagrams of two performers, one with the sender's times and one timed on arrival, and rubbish between."""
    datagrams = [osc.encode_announcement(Announcement("ann", STICK.joints[::-1])), b"rubbish"]
    clips = [stick_clip(name, seed=50, frames=120).positions.astype(np.float32) for name in STICK_CLASSES]
    for index in range(120):
        datagrams += [
            osc.encode_frame(Frame("ann", 1.0 + index / 120, clips[0][index, ::-1])),
            osc.encode_frame(Frame("bob", 0.0, clips[1][index])),
        ]
    return datagrams


@pytest.mark.slow
def test_a_recording_is_answered_as_the_feed_was(tmp_path: Path) -> None:
    """A recording by OSC and ZeroMQ at once gives the live answers twice again, number for number."""
    library = MotionLibrary.of_clips(stick_clips(actors=("aa", "bb", "cc")))
    path, sink = tmp_path / "a.kinerec", FakeSink()
    with ExitStack() as opened:
        datagrams = osc.OscReceiver(LOOPBACK, 0)
        messages = zeromq.ZmqReceiver(Endpoint(f"tcp://{LOOPBACK}:*", bind=True))
        writer = RawWriter(path, [source_name(datagrams), source_name(messages)])
        opened.callback(writer.close)
        sources = [
            Source(datagrams, OscDecoder(), Recorder(writer, 0)),
            Source(messages, ZmqDecoder(), Recorder(writer, 1)),
        ]
        service = opened.enter_context(Service(Performers(library), sources, [sink]))
        sender = osc.OscSender(*datagrams.address)
        opened.callback(sender.close)
        publisher = zmq.Context.instance().socket(zmq.XPUB)
        publisher.linger = 0
        opened.callback(publisher.close)
        publisher.connect(messages.address)
        while not publisher.poll(10):
            service.step(0.01)
        waved = stick_clip("wave", seed=51, frames=120).positions.astype(np.float32)
        for index, datagram in enumerate(a_feed()):
            sender.send(datagram)
            # Bob's frames are timed on arrival, so they must take their time.
            time.sleep(0.004)
            if index < 120:
                publisher.send_multipart(zeromq.encode_frame(Frame("eve", 1 + index / 120, waved[index]), index))
            service.step(0.05)
        until = time.monotonic() + PATIENCE
        while writer.written < 362 and time.monotonic() < until:
            service.step(0.05)
        counts = service.status().outcomes
    recording = RawFile(path)
    assert len(list(recording.packets())) == 362
    again = []
    for _ in range(2):
        performers = Performers(library)
        again.append(list(recognitions(performers, decoded(recording.header, recording.packets()))))
        assert performers.counts == counts
    assert {answer.performer for answer in sink.recognitions} == {"ann", "bob", "eve"}
    assert_same(again[0], sink.recognitions)
    assert_same(again[0], again[1])


def packets_of(layout: str) -> list[tuple[bytes, float]]:
    """Send a ghost as a product would, at 30 frames a second: datagrams, and when they come."""
    packets = []
    for number, cue in enumerate(ghost_cues("kickLFront1Reps", 2.0)[::4]):
        places = dict(zip(SKELETON.joints, cue.frame.positions, strict=True))
        arrival = 5.0 + number / 30
        datagrams = LAYOUTS[layout][1](Moment(places, arrival, number))
        packets += [(datagram, arrival + place * 1e-6) for place, datagram in enumerate(datagrams)]
    return packets


def test_a_recording_is_read_by_the_preset_it_was_made_with(tmp_path: Path) -> None:
    """A preset of one's own called like a built-in one is kept in the recording, and goes before the built-in one."""
    packets = [RawPacket(arrival, 0, "10.0.0.7:9", (datagram,)) for datagram, arrival in packets_of("osceleton")]
    builtin = builtin_preset("osceleton")
    mine = builtin.text.replace("/joint", "/elsewhere")
    assert mine != builtin.text
    sources, path = ["osc here feed osceleton"], tmp_path / "a.kinerec"
    found = dict[str, int]()
    for name, presets in {"older": {}, "same": {"osceleton": builtin.text}, "mine": {"osceleton": mine}}.items():
        path.unlink(missing_ok=True)
        with closing(RawWriter(path, sources, presets)) as writer:
            for packet in packets:
                writer.write(packet)
        recording = RawFile(path)
        assert recording.header.presets == presets
        events = decoded(recording.header, recording.packets())
        found[name] = sum(isinstance(event, Frame) for _, event in events)
    assert found == {"older": 60, "same": 60, "mine": 0}
