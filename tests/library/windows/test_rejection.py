from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from naive_windows import evidence, logit

from kinespace.library.motion_library.learned import Learned
from kinespace.library.windows.index import WindowIndex
from kinespace.library.windows.rejection import (
    MAX_LEAD,
    RATES,
    Evidence,
    Rejection,
    learned_rejection,
    stand_in,
    typical_evidence,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.library import MotionLibrary

REJECTION = Rejection(
    weights=np.array([-2.0, -1.0, 1.5, 0.25, 0.5]),
    offset=0.75,
    biases={"walk": 0.5, "jump": -0.25},
    slopes={"walk": 0.25, "jump": 0.0},
    thresholds=np.array([3.0, 2.5, 2.0, 1.0, 0.5, -1.0]),
    typical=np.array([0.5, -0.25, 1.0, 0.5]),
    joints=31,
)
EVIDENCE = Evidence(distances=(0.5, -1.0), leads=(1.0, -0.5), noise=0.01)


@pytest.fixture(scope="module")
def learning(builtin: MotionLibrary) -> WindowIndex:
    """Give an index that has to learn from its own motions: six classes by three people."""
    fewer = builtin.without(classes=builtin.classes[1::2], actors=("bk", "tr"))
    return WindowIndex.of(replace(fewer, learned=None))


def _evidence(index: WindowIndex, window: int, left_out: np.ndarray) -> tuple[Evidence, str]:
    """Let a window of the library ask the other windows, and give the guess and its evidence."""
    logs = index.own_distances(window, left_out)
    weighing = index.comparison.weighing
    guess = int(weighing.named(logs).argmin())
    return Evidence.of(weighing.alone(logs), guess), index.classes[guess]


def _share_known(index: WindowIndex, rate: float, *, with_class: bool) -> float:
    """Give the share of windows that are known, their person left out, and with them perhaps their class."""
    motions = [index.library.motions[each] for each in index.motions]
    rejection, known = learned_rejection(index), []
    for window, motion in enumerate(motions):
        left_out: Sequence[bool] = [
            other.actor == motion.actor or (not with_class and other.class_name == motion.class_name)
            for other in motions
        ]
        evidence, guess = _evidence(index, window, np.array(left_out))
        known.append(rejection.logit(evidence, guess) >= rejection.threshold_at(rate))
    return float(np.mean(known))


def test_evidence_is_read_off_each_group_alone() -> None:
    """A guess may be behind in one group, and lead another by more than counts."""
    groups = np.array([[0.5, 1.0, 4.0], [0.25, 0.0, -1.0]])
    for guess in range(3):
        distances, leads = evidence(groups, guess)
        read = Evidence.of(groups, guess, noise=0.01)
        assert read.distances == pytest.approx(distances)
        assert read.leads == pytest.approx(leads)
        assert read.compared == read.distances + read.leads
        assert read.lead == pytest.approx(np.mean(leads))
        assert read.noise == 0.01
    assert Evidence.of(groups, 2).leads[0] == -MAX_LEAD


def test_the_lead_of_the_only_class_says_nothing() -> None:
    """With one class, or none with windows beside the guess, the lead is 0: the distance decides."""
    assert Evidence.of(np.array([[0.5], [1.0]]), 0).leads == (0.0, 0.0)
    assert Evidence.of(np.array([[0.5, np.inf], [1.0, 2.0]]), 0).leads == (0.0, 1.0)


@pytest.mark.parametrize(("class_name", "bias", "slope"), [("walk", 0.5, 0.25), ("jump", -0.25, 0), ("sit", 0, 0)])
def test_evidence_is_weighed(class_name: str, bias: float, slope: float) -> None:
    """A class that was not learned has no bias and no slope."""
    weighed = logit(
        REJECTION.weights.tolist(),
        EVIDENCE.compared,
        REJECTION.typical.tolist(),
        EVIDENCE.noise,
        offset=REJECTION.offset,
        bias=bias,
        slope=slope,
    )
    assert REJECTION.logit(EVIDENCE, class_name) == pytest.approx(weighed)


def test_numbers_come_back_from_a_librarys_file() -> None:
    """They are kept as named arrays of single precision."""
    again = Rejection.of_kept(Learned.of_arrays(REJECTION.kept().arrays()), 2)
    for name in ("weights", "thresholds", "typical"):
        assert np.array_equal(getattr(again, name), getattr(REJECTION, name))
    assert (again.offset, again.biases, again.slopes) == (0.75, REJECTION.biases, REJECTION.slopes)
    assert again.joints == 31
    assert again.logit(EVIDENCE, "walk") == pytest.approx(REJECTION.logit(EVIDENCE, "walk"))


@pytest.mark.parametrize("name", ["weights", "offset", "thresholds", "typical", "joints"])
@pytest.mark.parametrize("wrong", [None, np.zeros(7), np.array([np.nan])], ids=["missing", "more", "no number"])
def test_numbers_that_do_not_fit_are_refused(name: str, wrong: np.ndarray | None) -> None:
    """The message names them."""
    arrays: dict[str, np.ndarray] = dict(REJECTION.kept().arrays())
    arrays.pop(name)
    if wrong is not None:
        arrays[name] = wrong
    with pytest.raises(ValueError, match=f"^{name}: expected"):
        Rejection.of_kept(Learned.of_arrays(arrays), 2)


def test_the_more_may_be_named_the_lower_the_threshold() -> None:
    """Thresholds are as kept at kept rates, between them in between, and constant beyond them."""
    assert [REJECTION.threshold_at(rate) for rate in RATES] == pytest.approx(REJECTION.thresholds.tolist())
    assert 1.0 < REJECTION.threshold_at(0.07) < 2.0
    assert REJECTION.threshold_at(0.0) == REJECTION.threshold_at(RATES[0])
    assert REJECTION.threshold_at(1.0) == REJECTION.threshold_at(RATES[-1])


def test_moved_to_other_joints_typical_evidence_is_judged_alike() -> None:
    """Typical evidence with one set of joints gets the logit of typical evidence with another set."""
    typical = np.array([1.5, 0.5, 0.25, 0.75])
    moved = REJECTION.moved_to(typical)
    before = REJECTION.logit(Evidence((0.5, -0.25), (1.0, 0.5)), "walk")
    assert moved.logit(Evidence((1.5, 0.5), (0.25, 0.75)), "walk") == pytest.approx(before)
    assert np.array_equal(moved.thresholds, REJECTION.thresholds)


@pytest.mark.slow
def test_a_library_learns_from_its_own_motions(learning: WindowIndex) -> None:
    """Motions of a person left out are mostly known, motions whose class is left out mostly not."""
    assert _share_known(learning, 0.1, with_class=True) > 0.75
    assert _share_known(learning, 0.1, with_class=False) < 0.25


@pytest.mark.slow
def test_the_rate_is_kept_on_the_librarys_own_motions(learning: WindowIndex) -> None:
    """At each rate about that share of windows without their class is named."""
    named = [_share_known(learning, rate, with_class=False) for rate in (0.05, 0.2, 0.4)]
    assert named == pytest.approx([0.05, 0.2, 0.4], abs=0.08)


def test_thresholds_fall_with_the_rate(learning: WindowIndex) -> None:
    """No lead speaks against a guess, and thresholds fall with the rate."""
    rejection = learned_rejection(learning)
    groups = len(learning.comparison.weighing.groups)
    assert rejection.weights.shape == (2 * groups + 1,)
    assert (rejection.weights[groups:] >= 0).all()
    assert rejection.weights[groups:-1].any()
    assert rejection.weights[-1] == 0.0
    assert (np.diff(rejection.thresholds) <= 0).all()
    assert rejection.typical == pytest.approx(typical_evidence(learning))
    assert (np.abs(rejection.typical[groups:]) <= MAX_LEAD).all()


def test_too_few_motions_to_learn_from(sticks: MotionLibrary) -> None:
    """A library of one motion, or of one class, is judged by numbers that stand in."""
    [one] = sticks.motions[:1]
    alone = WindowIndex.of(replace(sticks, motions=(one,)))
    one_class = WindowIndex.of(sticks.without(classes=sticks.classes[1:]))
    for index in (alone, one_class):
        assert np.array_equal(learned_rejection(index).weights, stand_in(2).weights)
    assert np.array_equal(typical_evidence(alone), np.zeros(4))
    rejection = learned_rejection(alone)
    near, far = (rejection.logit(EVIDENCE._replace(distances=(whole, whole)), one.class_name) for whole in (-1.0, 2.0))
    assert near > rejection.threshold_at(0.05) > far


def test_a_library_with_learned_numbers_uses_them(builtin_index: WindowIndex) -> None:
    """The built-in library's file holds the numbers of its rejection."""
    learned = builtin_index.library.learned
    assert learned is not None
    rejection = builtin_index.rejection
    kept = Rejection.of_kept(learned, len(builtin_index.comparison.weighing.groups))
    assert np.array_equal(rejection.weights, kept.weights)
    assert rejection.offset == kept.offset
    assert rejection is builtin_index.rejection
