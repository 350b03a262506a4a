"""The answer: its properties follow from its scores and its outcome."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from performed import NAMED

from kinespace.stream.recognition import Outcome

NAMELESS = [outcome for outcome in Outcome if outcome is not Outcome.NAMED]


def test_a_named_class_is_the_one_that_scores_highest() -> None:
    """Index, name and label are the best class's, followed by the second's index and the distance between the two."""
    assert (NAMED.best, NAMED.class_index, NAMED.class_name, NAMED.label) == (1, 1, "jump", "jump")
    assert (NAMED.score, NAMED.second_index, NAMED.margin) == (0.75, 2, 0.25)


@pytest.mark.parametrize("outcome", NAMELESS)
def test_without_a_name_the_label_says_why(outcome: Outcome) -> None:
    """Still and ambiguous windows name no class, index -1, and say their outcome; the scores are there all the same."""
    nameless = dataclasses.replace(NAMED, outcome=outcome)
    assert (nameless.class_index, nameless.class_name) == (-1, None)
    assert nameless.label == outcome.value
    assert type(nameless.label) is str
    assert (nameless.best, nameless.score, nameless.second_index, nameless.margin) == (1, 0.75, 2, 0.25)


@given(scores=st.lists(st.floats(0.0, 1.0, width=32), min_size=2, max_size=20))
def test_the_margin_is_that_of_the_two_best(scores: list[float]) -> None:
    """For any scores the best is a highest one, the second another class, and the margin their difference."""
    classes = tuple(f"class{index}" for index in range(len(scores)))
    answer = dataclasses.replace(NAMED, classes=classes, scores=np.array(scores))
    second, best = sorted(scores)[-2:]
    assert answer.score == best
    assert answer.margin == best - second
    assert scores[answer.second_index] == second
