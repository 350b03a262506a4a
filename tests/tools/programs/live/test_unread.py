"""Packets of which no frame comes: the feed that they look like, and the command that reads it."""

import time
from collections.abc import Iterator

import pytest
from golden import LAYOUTS, Moment, message
from programs import PATIENCE, ghost_cues

from kinespace.library.naming.hdm05 import SKELETON
from kinespace.stream.feeds import builtin_preset
from kinespace.stream.inputs.decoder import FeedDecoder
from kinespace.stream.inputs.source import Source
from kinespace.tools.programs.ends import Unread, _lacking

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
