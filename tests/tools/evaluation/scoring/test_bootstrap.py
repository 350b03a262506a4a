"""Figures and their intervals: compared with drawing by hand, and for few units."""

import naive_score
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kinespace.tools.evaluation.bootstrap import Figure, Percentile, Ratio, RocArea

FIRST, SECOND = 2012, 2013


def _repeated(values: list[list[float]], counts: list[int]) -> list[float]:
    return [value for each, count in zip(values, counts, strict=True) for value in each * count]


# --- shares and rates --------------------------------------------------------------------------------------------


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.integers(1, 12))
def test_a_ratio_is_drawn_by_units(seed: int, units: int) -> None:
    """A share of drawn units is the quotient of the two sums over them."""
    generator = np.random.default_rng(seed)
    among = generator.integers(0, 20, units).tolist()
    counted = [int(generator.integers(0, each + 1)) for each in among]
    figure = Ratio(counted, among, 60.0)
    shares = [
        60 * sum(np.multiply(counts, counted)) / below if (below := sum(np.multiply(counts, among))) else None
        for counts in naive_score.drawn_again(units, FIRST)
    ]
    assert figure.value() == (pytest.approx(60 * sum(counted) / sum(among)) if sum(among) else None)
    expected = naive_score.middle(shares)
    assert figure.interval() == (expected and pytest.approx(expected))


# --- percentiles -------------------------------------------------------------------------------------------------


@settings(max_examples=8)
@given(st.integers(0, 2**32 - 1), st.sampled_from([50.0, 90.0]))
def test_a_percentile_is_drawn_by_units(seed: int, percent: float) -> None:
    """A percentile of drawn units is the percentile of all their values; a unit without values adds none."""
    generator = np.random.default_rng(seed)
    values = [generator.random(generator.integers(0, 3)).tolist() for _ in range(6)]
    figure = Percentile(values, percent)
    assert figure.value() == _approx(naive_score.percentile([each for unit in values for each in unit], percent))
    drawn = [naive_score.percentile(_repeated(values, counts), percent) for counts in naive_score.drawn_again(6, FIRST)]
    expected = naive_score.middle(drawn)
    assert figure.interval() == (expected and pytest.approx(expected))


def _approx(value: float | None) -> object:
    return None if value is None else pytest.approx(value)


# --- ROC area ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
def test_a_roc_area_is_drawn_by_units(seed: int) -> None:
    """Both kinds are drawn again, each by itself, and every pair of values is compared; ties count half."""
    generator = np.random.default_rng(seed)
    kinds = [
        [(generator.integers(0, 6, generator.integers(0, 4)) + shift).astype(float) for _ in range(4)]
        for shift in (1, 0)
    ]
    figure = RocArea(*kinds)
    higher, lower = ([each.tolist() for each in kind] for kind in kinds)
    flat = [[value for each in kind for value in each] for kind in (higher, lower)]
    assert figure.value() == pytest.approx(naive_score.roc_area(*flat))
    areas = [
        naive_score.roc_area(_repeated(higher, first), _repeated(lower, second))
        for first, second in zip(naive_score.drawn_again(4, FIRST), naive_score.drawn_again(4, SECOND), strict=True)
    ]
    assert figure.interval() == pytest.approx(naive_score.middle(areas))


# --- persons -----------------------------------------------------------------------------------------------------


@settings(max_examples=25)
@given(st.lists(st.tuples(st.sampled_from("abcd"), st.integers(0, 9), st.integers(0, 9)), min_size=1, max_size=12))
def test_a_ratio_is_drawn_by_persons(units: list[tuple[str, int, int]]) -> None:
    """A person is drawn with all units, as often as persons alone would be drawn."""
    persons, counted, among = zip(*units, strict=True)
    everyone = sorted(set(persons))
    shares = []
    for times in naive_score.drawn_again(len(everyone), FIRST):
        drawn = [everyone[place] for place, count in enumerate(times) for _ in range(count)]
        above, below = (sum(sum(each[at] for each in units if each[0] == person) for person in drawn) for at in (1, 2))
        shares.append(above / below if below else None)
    expected = naive_score.middle(shares)
    assert Ratio(counted, among, persons=(persons,)).interval(by_person=True) == (expected and pytest.approx(expected))


# --- nothing to take a figure of ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "figure",
    [
        Ratio([], []),
        Ratio([0.0, 0.0], [0.0, 0.0]),
        Percentile([], 50),
        Percentile([[], []], 50),
        RocArea([], []),
        RocArea([np.ones(3)], []),
        RocArea([np.zeros(0)], [np.ones(2)]),
        Ratio([], [], persons=([],)),
        RocArea([np.ones(3)], [], persons=(["ann"], [])),
    ],
    ids=lambda figure: f"{figure}"[:30],
)
def test_of_nothing_there_is_no_figure(figure: Figure) -> None:
    """Without units, or with empty ones, there is neither a figure nor an interval: None, not zero."""
    assert figure.value() is None
    assert figure.interval(by_person=bool(figure.persons)) is None
