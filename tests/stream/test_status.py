"""A service's status: sums, rates and percentiles."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kinespace.stream.recognizer import RecognizerCounts
from kinespace.stream.recognizer.performers import PerformerCounts
from kinespace.stream.status import HopTimes, InputCounts, Rates, Status


def test_inputs_add_up() -> None:
    """The counts of several sources are added field by field, and neither is changed."""
    first, second = InputCounts(1, 2, 3, 4, 5), InputCounts(10, 20, 30, 40, 50)
    assert first + second == InputCounts(11, 22, 33, 44, 55)
    assert (first, second) == (InputCounts(1, 2, 3, 4, 5), InputCounts(10, 20, 30, 40, 50))
    assert sum([first, second], start=InputCounts()) == first + second


def test_lost_counts_each_kind_of_loss_once() -> None:
    """Each kind of loss counts once; frames that were used, foreign messages and new beginnings are no losses."""
    inputs = InputCounts(received=10**9, malformed=1, foreign=10**8, overrun=10, missing=100)
    recognizers = RecognizerCounts(frames=10**9, out_of_order=100_000, restarts=10**8, hops=10**9)
    outcomes = PerformerCounts(no_room=1_000, other_joints=10_000, dropped=10**8, recognizers=recognizers)
    assert Status(inputs, outcomes, 10**8, {}, 0.0, 0.0).lost == 111_111


def test_rates_are_counted_from_reading_to_reading() -> None:
    """A rate is the frames since the last reading by the seconds since then, for each performer, and finite."""
    rates = Rates(100.0)
    for performer in "aababa":
        rates[performer] += 1
    assert rates.read(102.0, "abc") == {"a": 2.0, "b": 1.0}
    rates["b"] += 1
    assert rates.read(102.5, "b") == {"b": 2.0}
    assert rates.read(103.0, "b") == {}
    rates["a"] += 1
    assert np.isfinite(rates.read(103.0, "a")["a"])


@given(seconds=st.lists(st.floats(0.0, 1.0), max_size=50), percent=st.sampled_from([0, 50, 99, 100]))
def test_percentiles_are_numpys(seconds: list[float], percent: float) -> None:
    """While few hops are remembered, percentiles equal numpy's over all hops, as plain numbers; 0 before the first."""
    times = HopTimes()
    for each in seconds:
        times.append(each)
    assert times.percentile(percent) == pytest.approx(float(np.percentile(seconds or [0.0], percent)))
    assert type(times.percentile(percent)) is float


def test_old_hops_are_forgotten() -> None:
    """A slow beginning does not stay in the percentiles for ever, and a minute of hops does."""
    times = HopTimes()
    times.append(9.0)
    for _ in range(30 * 60):
        times.append(0.001)
    assert times.percentile(100) == 9.0
    for _ in range(30 * 60):
        times.append(0.001)
    assert times.percentile(100) == 0.001
