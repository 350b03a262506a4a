from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from naive_windows import logit

from kinespace.library.learned import Learned
from kinespace.library.windows.index import WindowIndex
from kinespace.library.windows.rejection import (
    MAX_LEAD,
    RATES,
    Evidence,
    Rejection,
    learned_rejection,
    typical_evidence,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.library import MotionLibrary

REJECTION = Rejection(
    weights=np.array([-2.0, 1.5, -0.5, 0.25, 0.125]),
    offset=0.75,
    biases={"walk": 0.5, "jump": -0.25},
    thresholds=np.array([3.0, 2.5, 2.0, 1.0, 0.5, -1.0]),
    typical=np.array([0.5, 1.0, -0.5]),
    joints=31,
)
EVIDENCE = Evidence(whole=0.5, lead=1.0, eigen=-1.0, swing=-2.0, sway=-1.0)


@pytest.fixture(scope="module")
def learning(builtin: MotionLibrary) -> WindowIndex:
    """Give an index that has to learn from its own motions: six classes by three people."""
    fewer = builtin.without(classes=builtin.classes[1::2], actors=("bk", "tr"))
    return WindowIndex.of(replace(fewer, learned=None))


def _evidence(index: WindowIndex, window: int, left_out: np.ndarray) -> tuple[Evidence, str]:
    """Let a window of the library ask the rest, and give the guess and what speaks for it."""
    views = index.own_distances(window, left_out)
    distances = views[: index.comparison.weighing.naming].min(axis=0)
    guess = int(distances.argmin())
    first, second = sorted(distances)[:2]
    lead = min(float(second - first), MAX_LEAD)
    return Evidence(float(views[0, guess]), lead, float(views[-1, guess]), 0.0, 0.0), index.classes[guess]


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


@pytest.mark.parametrize(("class_name", "bias"), [("walk", 0.5), ("jump", -0.25), ("sit", 0.0)])
def test_evidence_is_weighed(class_name: str, bias: float) -> None:
    """A class that was not learned has no bias."""
    assert REJECTION.logit(EVIDENCE, class_name) == pytest.approx(
        logit(REJECTION.weights.tolist(), EVIDENCE, REJECTION.offset, bias)
    )


def test_numbers_come_back_from_a_librarys_file() -> None:
    """They are kept as named arrays of single precision."""
    again = Rejection.of_kept(Learned.of_arrays(REJECTION.kept().arrays()))
    for name in ("weights", "thresholds", "typical"):
        assert np.array_equal(getattr(again, name), getattr(REJECTION, name))
    assert (again.offset, again.biases, again.joints) == (0.75, REJECTION.biases, 31)
    assert again.logit(EVIDENCE, "walk") == REJECTION.logit(EVIDENCE, "walk")


@pytest.mark.parametrize("name", ["weights", "offset", "thresholds", "typical", "joints"])
@pytest.mark.parametrize("wrong", [None, np.zeros(7), np.array([np.nan])], ids=["missing", "more", "no number"])
def test_numbers_that_do_not_fit_are_refused(name: str, wrong: np.ndarray | None) -> None:
    """The message names them."""
    arrays: dict[str, np.ndarray] = dict(REJECTION.kept().arrays())
    arrays.pop(name)
    if wrong is not None:
        arrays[name] = wrong
    with pytest.raises(ValueError, match=f"^{name}: expected"):
        Rejection.of_kept(Learned.of_arrays(arrays))


def test_the_more_may_be_named_the_lower_the_threshold() -> None:
    """At kept rates it is what was kept, between them in between, and beyond them it stays."""
    assert [REJECTION.threshold_at(rate) for rate in RATES] == pytest.approx(REJECTION.thresholds.tolist())
    assert 1.0 < REJECTION.threshold_at(0.07) < 2.0
    assert REJECTION.threshold_at(0.0) == REJECTION.threshold_at(RATES[0])
    assert REJECTION.threshold_at(1.0) == REJECTION.threshold_at(RATES[-1])


def test_moved_to_other_joints_typical_evidence_is_judged_alike() -> None:
    """What is typical of the one set of joints gets the logit that was typical of the other."""
    typical = np.array([1.5, 0.5, 0.25])
    moved = REJECTION.moved_to(typical)
    before = REJECTION.logit(Evidence(*REJECTION.typical, -2.0, -1.0), "walk")
    assert moved.logit(Evidence(*typical, -2.0, -1.0), "walk") == pytest.approx(before)
    assert np.array_equal(moved.typical, typical)
    assert np.array_equal(moved.thresholds, REJECTION.thresholds)


def test_a_library_learns_from_its_own_motions(learning: WindowIndex) -> None:
    """Motions of a person left out are mostly known, those whose class is left out mostly not."""
    assert _share_known(learning, 0.1, with_class=True) > 0.75
    assert _share_known(learning, 0.1, with_class=False) < 0.25


def test_the_rate_is_kept_on_the_librarys_own_motions(learning: WindowIndex) -> None:
    """At each rate about that share of windows without their class is named."""
    named = [_share_known(learning, rate, with_class=False) for rate in (0.05, 0.2, 0.4)]
    assert named == pytest.approx([0.05, 0.2, 0.4], abs=0.08)


def test_what_a_library_learns(learning: WindowIndex) -> None:
    """Distance speaks against a guess and lead for it, and thresholds fall with the rate."""
    rejection = learned_rejection(learning)
    assert rejection.weights[0] < 0 < rejection.weights[1]
    assert not rejection.weights[2:].any()
    assert (np.diff(rejection.thresholds) <= 0).all()
    assert rejection.typical == pytest.approx(typical_evidence(learning))
    assert 0 < rejection.typical[1] <= MAX_LEAD


def test_too_few_motions_to_learn_from(sticks: MotionLibrary) -> None:
    """A library of one motion, or of one class, is judged by numbers that stand in."""
    [one] = sticks.motions[:1]
    alone = WindowIndex.of(replace(sticks, motions=(one,)))
    one_class = WindowIndex.of(sticks.without(classes=sticks.classes[1:]))
    assert learned_rejection(alone) is learned_rejection(one_class)
    assert np.array_equal(typical_evidence(alone), np.zeros(3))
    rejection = learned_rejection(alone)
    near, far = (rejection.logit(EVIDENCE._replace(whole=whole), one.class_name) for whole in (-1.0, 2.0))
    assert near > rejection.threshold_at(0.05) > far


def test_a_library_with_learned_numbers_uses_them(builtin_index: WindowIndex) -> None:
    """The built-in library's file says how its motions are told from others."""
    learned = builtin_index.library.learned
    assert learned is not None
    rejection = builtin_index.rejection
    assert np.array_equal(rejection.weights, Rejection.of_kept(learned).weights)
    assert rejection.offset == Rejection.of_kept(learned).offset
    assert rejection is builtin_index.rejection
