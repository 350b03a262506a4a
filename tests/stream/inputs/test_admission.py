"""Admission: a performer's own sender, times that go on, and allowed performers and networks."""

import ipaddress
import time
from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
import pytest
import zmq
from numpy.typing import NDArray
from programs import LOOPBACK, PATIENCE, until
from synthetic import stick_clip

from kinespace.library import MotionLibrary
from kinespace.stream import Announcement, Frame, Performers, osc, zeromq
from kinespace.stream.frame import NewSender
from kinespace.stream.inputs import Admission
from kinespace.stream.inputs.clock import SenderClock

ANN, EVE = ("10.0.0.5", 4000), ("10.0.0.7", 4000)


def frame(time: float, performer: str = "ann") -> Frame:
    """Make a frame."""
    return Frame(performer, time, np.zeros((3, 3)))


def said(admitted: Iterable[object]) -> list[object]:
    """Give the times of frames, and all else as it is."""
    return [each.time if isinstance(each, Frame) else each for each in admitted]


def test_a_performer_belongs_to_the_first_sender_until_it_is_silent() -> None:
    """Another sender's frames under the same name are counted and told; after a silence they are used."""
    admission = Admission(silence=5.0)
    for step in range(40):
        moment = step / 10
        assert len(admission.admit([frame(moment)], moment, ANN)) == 1
        assert admission.admit([frame(1e18)], moment, EVE) == []
    assert admission.admit([Announcement("ann", ("x", "y", "z"))], 3.9, EVE) == []
    assert admission.counts.other_sender == 41
    admission.replies_go_to([frame(4.0)], ANN)
    assert (admission.senders("ann"), admission.senders(), admission.senders("eve")) == ([ANN], [ANN], [])
    named = Announcement("ann", ("a", "b", "c"))
    assert admission.admit([named], 4.0, ANN) == [named]
    assert admission.notes(4.0) == ["two senders are called ann: 10.0.0.5:4000, 10.0.0.7:4000; only the first is used"]
    assert admission.notes(20.0) == []
    assert admission.admit([frame(7.0)], 8.0, EVE) == []
    assert said(admission.admit([frame(11.0)], 12.0, EVE)) == [NewSender("ann"), 11.0]


def test_another_program_of_the_same_host_is_refused() -> None:
    """Packets of another program of the same host are refused at once; after a new beginning the first is let in."""
    admission = Admission()
    mine, other, anew = (("10.0.0.5", port) for port in (4000, 5000, 6000))
    for step in range(120):
        moment = step / 120
        assert admission.admit([frame(moment)], moment, mine)
        if step > 2:
            assert not admission.admit([Announcement("ann", ("a", "b")), frame(1e18)], moment, other)
    assert said(admission.admit([frame(2.0)], 2.0, anew)) == [2.0]


def test_joints_announced_from_another_port_hold_for_nobody_else(sticks: MotionLibrary) -> None:
    """Announced before a performer comes, in a pause, or with frames of its own: the performer's frames are used."""
    admission, performers = Admission(), Performers(sticks)
    other, spoofed = ("10.0.0.5", 5000), Announcement("ann", ("some", "other", "joints"))
    mine = Frame("ann", 1.0, stick_clip("wave", seed=3, frames=1).positions[0])

    def pushed(moment: float, *events: Announcement | Frame, sender: tuple[str, int] = ANN) -> int:
        performers.drop_silent(moment)
        performers.push_all(admission.admit(events, moment, sender), moment)
        return performers.counts.recognizers.frames

    pushed(0.0, spoofed, sender=other)
    assert [pushed(1 + step, replace(mine, time=1.0 + step)) for step in range(4)] == [1, 2, 3, 4]
    # The performer pauses; the other program announces, and later sends frames after a silence.
    pushed(5.0, spoofed, spoofed, sender=other)
    assert pushed(5.5, replace(mine, time=5.5)) == 5
    for step in range(5):
        pushed(12 + step / 10, spoofed, frame(12 + step / 10), sender=other)
    assert performers.counts.other_joints == 5
    assert pushed(18.0, replace(mine, time=18.0)) == 6


def test_an_announcement_waits_for_frames_no_longer_than_a_silence() -> None:
    """Of its own port; a frame from there later comes without it."""
    announced = Announcement("ann", ("a", "b", "c"))
    for later, admitted in ((4.0, [announced]), (5.1, [])):
        admission = Admission(silence=5.0)
        assert admission.admit([announced], 0.0, ANN) == []
        assert said(admission.admit([frame(later)], later, ANN)) == [*admitted, later]
    # A sender that begins again at another port announces its joints there.
    admission, anew = Admission(), ("10.0.0.5", 6000)
    for step in range(4):
        admission.admit([frame(step / 100)], step / 100, ANN)
    assert said(admission.admit([announced, frame(1.0)], 1.0, anew)) == [announced, 1.0]


@pytest.mark.parametrize("odd", [1e18, -1e18, 100.0, 1e-3])
def test_one_odd_time_restarts_nothing(odd: float) -> None:
    """A frame whose time jumps is admitted only with a second frame that agrees with it."""
    admission, times = Admission(), []
    for step in range(200):
        told = odd if step % 10 == 5 else 50 + step / 10
        times += [each.time for each in admission.admit([frame(told)], step / 10, ANN)]
    assert times == [50 + step / 10 for step in range(200) if step % 10 != 5]
    assert admission.counts.odd_times == 20


def test_a_clock_that_is_set_is_followed() -> None:
    """Frames after a jump are all let in, the first of them with the second; a pause and a stop are no jumps."""
    admission, times = Admission(), [1.0, 1.1, 900.0, 900.1, 900.2, 3.0, 3.1]
    assert admission.admit([frame(1.0)], 0.0, EVE)
    assert admission.admit([frame(6.0)], 0.0, EVE)
    assert admission.admit([frame(11.1)], 0.0, EVE) == []
    admission = Admission()
    let_in = [each.time for step, told in enumerate(times) for each in admission.admit([frame(told)], step / 10, ANN)]
    assert let_in == times
    # The sender pauses for a minute; we are stopped for a minute and find everything at once.
    assert admission.admit([frame(63.1)], 60.6, ANN)
    assert admission.admit([frame(63.2)], 120.6, ANN)
    assert admission.admit([frame(63.3)], 120.6, ANN)
    assert admission.counts.odd_times == 0


def test_only_allowed_performers_are_let_in() -> None:
    """With a list of names, frames of other names are counted and not recognised."""
    admission = Admission(allowed=["ann"])
    assert said(admission.admit([frame(1.0, "bob"), Announcement("bob", ("a",)), frame(1.0)], 1.0, ANN)) == [1.0]
    assert admission.counts.not_allowed == 2


def test_invented_names_do_not_pile_up() -> None:
    """The number of remembered names is bounded, for any number of invented ones."""
    admission = Admission()
    for number in range(5000):
        admission.admit([Announcement(f"{number}", ("a",)), frame(1.0, f"{number}")], 1.0, EVE)
        admission.admit([Announcement(f"{number}", ("a",)), frame(1.0, f"{number}")], 1.0, ANN)
        admission.admit([Announcement(f"x{number}", ("a",))], 1.0, ANN)
    assert max(map(len, (admission._owners, admission._pending, admission._conflicts))) <= 1024  # noqa: SLF001 - unseen


@pytest.mark.parametrize(("network", "received"), [("127.0.0.0/8", b"x"), ("192.168.0.0/24", b"")])
def test_datagrams_from_elsewhere_are_not_read(network: str, received: bytes) -> None:
    """With a list of networks, datagrams from other networks come as empty ones."""
    receiver = osc.OscReceiver(LOOPBACK, 0, [ipaddress.ip_network(network)])
    sender = osc.OscSender(*receiver.address)
    sender.send(b"x")
    assert until(lambda: [*iter(receiver.receive, None)]) == [received]
    sender.close()
    receiver.close()


@pytest.mark.parametrize(("network", "let_in"), [("127.0.0.0/8", True), ("192.168.0.0/24", False)])
def test_peers_from_elsewhere_do_not_connect(network: str, *, let_in: bool) -> None:
    """Where networks are given, ZeroMQ closes the connections of others."""
    endpoint = zeromq.Endpoint(f"tcp://{LOOPBACK}:*", bind=True)
    receiver = zeromq.ZmqReceiver(endpoint, networks=[ipaddress.ip_network(network)])
    publisher = zmq.Context.instance().socket(zmq.XPUB)
    publisher.linger = 0
    publisher.connect(receiver.address)
    end = time.monotonic() + (PATIENCE if let_in else 0.5)
    while not publisher.poll(10) and time.monotonic() < end:
        receiver.receive()
    assert bool(publisher.poll(0)) == let_in
    publisher.close()
    receiver.close()


def test_a_subscription_is_bounded() -> None:
    """A subscriber to a topic longer than any of ours is cut off, and an ordinary one goes on hearing."""
    sender = zeromq.ZmqSender(zeromq.Endpoint(f"tcp://{LOOPBACK}:*", bind=True))
    greedy, ordinary = (zmq.Context.instance().socket(zmq.SUB) for _ in range(2))
    events = greedy.get_monitor_socket(zmq.EVENT_DISCONNECTED)
    for subscriber, topic in ((greedy, b"class/" + b"x" * 2000), (ordinary, b"class/")):
        subscriber.linger = 0
        subscriber.connect(sender.address)
        subscriber.subscribe(topic)
    until(lambda: (sender.send([b"class/ann/", b"x" * 100_000]), ordinary.poll(10) and events.poll(0))[1])
    greedy.disable_monitor()
    events.close()
    for each in (greedy, ordinary, sender):
        each.close()


#: From the moments at which frames are made, seconds (frames,), to the times that are sent with them.
Clock = Callable[[NDArray[np.float64]], NDArray[np.float64]]

EPOCH, BOOT = 1_795_000_000.0, 40_000.0


def numbered(moments: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give each frame its number."""
    return np.arange(len(moments)) + 17.0


def in_32_bits(begun: float) -> Clock:
    """Make a clock that is sent as a 32-bit float."""
    return lambda moments: (begun + moments).astype(np.float32).astype(np.float64)


#: Kinds of clocks: the times sent, and the beginning of the remark on them.
CLOCKS: dict[str, tuple[Clock, str]] = {
    "seconds": (lambda moments: moments + BOOT, ""),
    "seconds of 1970": (lambda moments: moments + EPOCH, ""),
    "seconds from 0": (lambda moments: moments, ""),
    "seconds since boot in 32 bits": (in_32_bits(100.0), ""),
    "milliseconds": (lambda moments: 1e3 * (moments + 12), "times are milliseconds"),
    "whole milliseconds": (lambda moments: np.round(1e3 * (moments + EPOCH)), "times are milliseconds"),
    "microseconds": (lambda moments: 1e6 * moments + 5, "times are microseconds"),
    ".NET's ticks": (lambda moments: 1e7 * moments + 5, "times are ticks"),
    "nanoseconds": (lambda moments: 1e9 * moments + 5, "times are nanoseconds"),
    "frame numbers": (numbered, "times are frame numbers"),
    "every second frame number": (lambda moments: 2 * numbered(moments), "times are frame numbers"),
    "a constant": (lambda moments: np.full(len(moments), 3.25), "times stand still"),
    "1970 in 32 bits": (in_32_bits(EPOCH), "times stand still"),
    "two weeks in 32 bits": (in_32_bits(1.2e6), "times go on in large steps"),
    "backwards": (lambda moments: 900 - moments, "times go back"),
    "days": (lambda moments: moments / 86_400, "times are neither"),
}


def arrivals_of(moments: NDArray[np.float64], way: str) -> NDArray[np.float64]:
    """Give the moments at which frames arrive, in their order, seconds on another clock."""
    generator = np.random.default_rng(5)
    delays = {
        "evenly": np.full(len(moments), 0.001),
        "with jitter": generator.uniform(0.0, 0.03, len(moments)),
        # As radio delivers: the frames of a tenth of a second come at once.
        "in bursts": np.ceil(moments / 0.1) * 0.1 - moments,
    }[way]
    return np.maximum.accumulate(moments + delays) + 700.0


def read(times: NDArray[np.float64], arrivals: NDArray[np.float64]) -> tuple[NDArray[np.float64], SenderClock]:
    """Read times; 0 is replaced by the arrival, as the decoders do."""
    clock, told = SenderClock(), np.where(times == 0, arrivals, times)
    return np.array(list(map(clock.read, told.tolist(), arrivals.tolist()))), clock


@pytest.mark.slow
@pytest.mark.parametrize("way", ["evenly", "with jitter", "in bursts"])
@pytest.mark.parametrize("rate", [8, 30, 60, 120, 240])
@pytest.mark.parametrize("kind", CLOCKS)
def test_each_clock_is_known_within_a_second(kind: str, rate: int, way: str) -> None:
    """From then on times advance with the frames or, when times mean nothing, with the arrivals."""
    sent, told = CLOCKS[kind]
    moments = np.arange(4 * rate) / rate
    arrivals = arrivals_of(moments, way)
    # A clock of 1/8 s is fine enough for eight frames a second.
    told = "" if kind == "two weeks in 32 bits" and rate == 8 else told
    seconds, clock = read(sent(moments), arrivals)
    first = seconds[rate + 2 :] - seconds[rate + 2]
    assert clock.verdict.note.startswith(told)
    assert bool(clock.verdict.note) == bool(told)
    if clock.verdict.note.endswith("arrivals are used"):
        assert np.array_equal(seconds[rate + 2 :], arrivals[rate + 2 :])
    else:
        tolerance = 0.15 if "frame number" in kind else 0.07
        assert np.abs(first - moments[rate + 2 :] + moments[rate + 2]).max() < tolerance
        assert (np.diff(first) > 0).all()


def test_a_verdict_changes_when_it_is_given_twice() -> None:
    """A clock that stands still for half a second is believed again; one that is another from then on is followed."""
    moments = np.arange(1200) / 120
    stuck = moments + BOOT
    stuck[120:180] = stuck[120]
    assert read(stuck, moments)[1].verdict.note == ""
    seconds, clock = read(np.where(moments < 5, moments + BOOT, 1e3 * moments), moments)
    assert clock.verdict.note.startswith("times are milliseconds")
    assert np.allclose(seconds[-200:], moments[-200:])
