"""Senders' clocks: each kind is found within the first second, for any pattern of arrivals."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from synthetic import stick_clip

from kinespace.library import MotionLibrary
from kinespace.stream import Frame, Performers
from kinespace.stream.inputs import Admission
from kinespace.stream.inputs.clock import SenderClock

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
    clock = SenderClock()
    told = np.where(times == 0, arrivals, times)
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


def test_a_feed_without_times_has_the_arrivals() -> None:
    """Time 0 means "on arrival", and there is no note on it."""
    arrivals = np.arange(100) / 50 + 3.0
    seconds, clock = read(np.zeros(100), arrivals)
    assert np.array_equal(seconds, arrivals)
    assert clock.verdict.note == ""


def test_a_verdict_changes_when_it_is_given_twice() -> None:
    """A clock that stands still for half a second is believed again; one that is another from then on is followed."""
    moments = np.arange(1200) / 120
    stuck = moments + BOOT
    stuck[120:180] = stuck[120]
    assert read(stuck, moments)[1].verdict.note == ""
    other = np.where(moments < 5, moments + BOOT, 1e3 * moments)
    seconds, clock = read(other, moments)
    assert clock.verdict.note.startswith("times are milliseconds")
    assert np.allclose(seconds[-200:], moments[-200:])


@pytest.mark.parametrize("kind", CLOCKS)
def test_answers_come_with_any_clock(kind: str, sticks: MotionLibrary) -> None:
    """Two seconds of a performer with any clock are answered some twenty times a second after the first second."""
    admission, performers = Admission(), Performers(sticks)
    positions = stick_clip("wave", seed=3, frames=240).positions
    moments = np.arange(240) / 120
    answers = [
        performers.push_all(admission.admit([Frame("ann", time or arrival, joints)], arrival, ("10.0.0.5", 1)), arrival)
        for time, arrival, joints in zip(CLOCKS[kind][0](moments).tolist(), moments + BOOT, positions, strict=True)
    ]
    assert sum(answer is not None for each in answers[120:] for answer in each) > 20
    assert admission.clocks == ({"ann": admission.clocks["ann"]} if CLOCKS[kind][1] else {})
