from __future__ import annotations

import math

import pytest

from kinespace.stream.recognizer.hysteresis import PER_SECOND, Hysteresis, Judgement

#: Seconds of one hop, of which thirty make a second.
HOP = 1 / PER_SECOND


def test_a_lead_is_gathered() -> None:
    """Three hops of a lead of 0.4 are the 1.2 that a takeover needs, and it happens once."""
    hysteresis = Hysteresis(1.2 - 1e-9)
    assert [hysteresis.push(2, 0.4, HOP) for _ in range(5)] == [False, False, True, False, False]
    assert hysteresis.current == 2


def test_a_clear_lead_takes_over_at_once() -> None:
    """One hop of a large lead is enough."""
    hysteresis = Hysteresis(0.6)
    assert hysteresis.push(1, 3.0, HOP)


def test_hops_count_for_as_long_as_they_last() -> None:
    """Twice as many hops of half the time gather the same lead."""
    hysteresis = Hysteresis(1.2 - 1e-9)
    assert [hysteresis.push(0, 0.4, HOP / 2) for _ in range(6)] == [False] * 5 + [True]


def test_when_the_leader_changes_the_count_begins_anew() -> None:
    """An index that leads for two hops of three never takes over."""
    hysteresis = Hysteresis(1.2 - 1e-9)
    taken = [hysteresis.push(leader, 0.4, HOP) for leader in (0, 0, 1, 0, 0, 1, 0, 0)]
    assert not any(taken)
    assert hysteresis.current is None
    assert hysteresis.push(0, 0.4, HOP)


def test_the_current_index_stays_until_another_has_gathered_enough() -> None:
    """It holds while another leads a little, and it comes back without an event."""
    hysteresis = Hysteresis(1.0)
    hysteresis.push(0, 2.0, HOP)
    assert not hysteresis.push(1, 0.6, HOP)
    assert hysteresis.current == 0
    assert not hysteresis.push(0, 2.0, HOP)
    assert not hysteresis.push(1, 0.6, HOP)
    assert hysteresis.push(1, 0.6, HOP)
    assert hysteresis.current == 1


def test_after_clearing_everything_begins_anew() -> None:
    """All gathered lead is forgotten, and no index is current."""
    hysteresis = Hysteresis(1.0)
    hysteresis.push(0, 0.9, HOP)
    hysteresis.clear()
    assert hysteresis.current is None
    assert not hysteresis.push(0, 0.9, HOP)
    assert hysteresis.push(0, 0.9, HOP)


def test_the_first_average_is_the_first_evidence() -> None:
    """The average of one piece of evidence is that piece itself."""
    judgement = Judgement(1.0)
    assert math.isnan(judgement.average)
    assert judgement.push(1.0, HOP)
    assert judgement.average == 1.0
    assert not Judgement(1.0).push(0.99, HOP)


def test_a_named_motion_holds_a_little_below_the_threshold() -> None:
    """The same evidence that does not make a motion known keeps it known."""
    named, unnamed = Judgement(1.0), Judgement(1.0)
    named.push(1.1, HOP)
    assert all(named.push(0.0, HOP) for _ in range(60))
    assert not any(unnamed.push(0.0, HOP) for _ in range(60))


def test_a_named_motion_lets_go() -> None:
    """Well below the threshold it is unknown, and must reach the threshold again."""
    judgement = Judgement(1.0)
    judgement.push(2.0, HOP)
    answers = [judgement.push(-5.0, HOP) for _ in range(30)]
    assert answers[0]
    assert not answers[-1]
    assert answers == sorted(answers, reverse=True)
    assert not any(judgement.push(0.9, HOP) for _ in range(90))
    assert judgement.push(1.5, 1.0)


def test_the_average_does_not_depend_on_the_hop() -> None:
    """A tenth of a second of new evidence counts alike in one hop and in ten."""
    once, often = Judgement(0.0), Judgement(0.0)
    for judgement in (once, often):
        judgement.push(2.0, HOP)
    once.push(-1.0, 0.1)
    for _ in range(10):
        often.push(-1.0, 0.01)
    assert often.average == pytest.approx(once.average)
    assert once.average == pytest.approx(-1.0 + 3.0 * math.exp(-0.1 / 0.3))


def test_one_odd_window_does_not_make_a_motion_unknown() -> None:
    """A single hop of bad evidence is averaged away."""
    judgement = Judgement(1.0)
    for _ in range(30):
        judgement.push(2.0, HOP)
    assert judgement.push(-10.0, HOP)


def test_a_cleared_judgement_knows_nothing() -> None:
    """A motion that was known is no longer known."""
    judgement = Judgement(1.0)
    judgement.push(3.0, HOP)
    judgement.clear()
    assert math.isnan(judgement.average)
    assert not judgement.push(0.5, HOP)
