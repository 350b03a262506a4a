"""Packets of which no frame comes: the feed that they look like, and the command that reads it."""

import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest
from golden import LAYOUTS, Moment, message
from programs import PATIENCE, ghost_cues

from kinespace.library.naming.hdm05 import SKELETON
from kinespace.stream import Frame
from kinespace.stream.feeds import builtin_preset
from kinespace.stream.inputs import OscDecoder
from kinespace.stream.inputs.decoder import FeedDecoder
from kinespace.stream.inputs.source import Source
from kinespace.stream.osc.frames import encode_frame
from kinespace.tools.programs.live.unread import Unread, _lacking

PLACE = "127.0.0.1", 9310


def packets_of(layout: str) -> Iterator[tuple[bytes, float]]:
    """Give two seconds of a product's packets with their arrivals."""
    cues = ghost_cues("squat1Reps", 0.5)[::4]
    for number in range(60):
        places = dict(zip(SKELETON.joints, cues[number % len(cues)].frame.positions, strict=True))
        for packet in LAYOUTS[layout][1](Moment(places, 1 + number / 30, number)):
            yield packet, 1 + number / 30


def note_of(unread: Unread, now: float) -> str:
    """Wait for a note: it is made in a thread."""
    until = time.monotonic() + PATIENCE
    while not (note := unread.note(now)) and time.monotonic() < until:
        time.sleep(0.01)
    return note


@pytest.mark.slow
@pytest.mark.parametrize(("layout", "run"), [("vmc", "--feed vmc"), ("osceleton", "--feed osceleton")])
def test_a_known_feed_is_named_with_the_command_that_reads_it(layout: str, run: str) -> None:
    """As `listen` says it, with the port that the packets come to; after a silence nothing is said."""
    unread = Unread(PLACE, None)
    for packet, arrival in packets_of(layout):
        unread.keep(packet, arrival, ("127.0.0.1", 5000))
    assert f"end this and run: kinespace live {run} --osc-in 127.0.0.1:9310" in note_of(unread, 3.0)
    assert unread.note(60.0) == ""


def test_addresses_of_no_known_feed_are_listed() -> None:
    """The note says how a preset is begun."""
    unread = Unread(PLACE, None)
    for place in range(50):
        unread.keep(message("/knob/1", "f", 0.5), 1 + place / 30, None)
    said = note_of(unread, 3.0)
    assert said.startswith("no frames, but /knob/#: no feed that is known")
    assert "kinespace feeds native > my.toml" in said


def test_of_our_own_messages_nothing_is_said() -> None:
    """Why they cannot be read stands in their refusal."""
    unread = Unread(PLACE, None)
    for place in range(50):
        unread.keep(message("/motion/frame", "s", "ann"), 1 + place / 30, None)
    for thread in threading.enumerate():
        if thread.name == "kinespace unread":
            thread.join(PATIENCE)
    assert unread.note(3.0) == ""


def test_a_feed_that_lacks_joints_is_advised_as_by_listen() -> None:
    """The source reads the right feed, and no frame comes of it: the missing joints are named."""
    unread = Unread(PLACE, builtin_preset("osceleton"))
    for packet, arrival in packets_of("osceleton"):
        if not any(joint in packet for joint in (b"hip", b"knee", b"foot", b"hand", b"elbow")):
            unread.keep(packet, arrival, None)
    assert "missing for recognition: " in note_of(unread, 3.0)


class _Receiver:
    """Gives a packet each time."""

    sender, waited, kernel_drops, packet = ("127.0.0.1", 5000), 0.0, 0, b""

    def receive(self) -> bytes:
        return self.packet


class _Asked:
    """Counts what it is asked to look at."""

    kept = 0

    def keep(self, *_: object) -> None:
        self.kept += 1

    def note(self, now: float) -> str:
        del now
        return "looks like another"


def test_a_source_asks_only_while_no_frame_comes() -> None:
    """A second after the last frame, packets without frames are looked at, and the note takes their refusal's place."""
    receiver, asked = _Receiver(), _Asked()
    source = Source(receiver, OscDecoder())  # type: ignore[arg-type] # all that is used
    source.unread = asked
    receiver.packet = encode_frame(Frame("ann", 0.0, np.zeros((31, 3))))
    source.take(10.0)
    receiver.packet = message("/knob", "f", 0.5)
    source.take(10.9)
    assert (asked.kept, source.notes[0][:12]) == (0, "last foreign")
    source.take(11.1)
    assert (asked.kept, source.notes) == (1, ["looks like another"])


def test_a_frame_that_time_completes_is_a_frame() -> None:
    """Where a body's joints come one by one, packets make no frames themselves; they are not looked at all the same."""
    receiver, asked = _Receiver(), _Asked()
    source = Source(receiver, FeedDecoder(builtin_preset("joints")))  # type: ignore[arg-type] # all that is used
    source.unread = asked
    for number in range(40):
        receiver.packet = message("/Head", "fff", 0.0, 1.0, number / 100)
        source.take(10 + number / 20)
        source.tend(10 + number / 20 + 0.04)
    # Until the first frame nothing is known.
    assert asked.kept <= 1


def test_joints_that_wait_for_a_coordinate_are_named() -> None:
    """A sender that sends only what changes may never send a coordinate that stands still."""
    came = ["/p#/knee_l:ty", "/p#/knee_l:tz", *(f"/p#/head:t{axis}" for axis in "xyz"), "/p#/hand_l/x", "/p#/id"]
    assert _lacking(came) == ["/p#/knee_l waits for x", "/p#/hand_l waits for y and z"]
