"""Settings: checked once; and what they mean for a library."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from synthetic import stick_clip

from kinespace.library import MotionLibrary, opened
from kinespace.stream import LiveSignature, Settings
from kinespace.stream.recognizer.settings import index_for, needed_lead, threshold_for, usual_sensitivity

PAPER = LiveSignature.PAPER


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"signature": "best"}, "signature: expected windows or paper, got 'best'"),
        ({"window": 1.0}, "window: expected none with the signature windows"),
        ({"signature": "paper", "sensitivity": 0.1}, "sensitivity: expected none with the signature paper"),
        ({"signature": "paper", "progress": True}, "progress: expected False with the signature paper, got True"),
        *(({"signature": "paper", "window": each}, "window: expected a positive") for each in (0, -1.0, math.inf)),
        *(({"longest_gap": each}, "longest_gap: expected a positive number of seconds") for each in (0, math.nan)),
        *(
            ({name: each}, f"{name}: expected a number not below 0, got {each}")
            for name in ("sensitivity", "lead", "hop", "stillness")
            for each in (-1e-9, math.inf, math.nan)
        ),
        ({"sensitivity": 1.1}, "sensitivity: expected a share from 0 to 1, got 1.1"),
        *(({"hop": each}, f"hop: expected 0, or 0.001 to 60 seconds, got {each}") for each in (61.0, 0.0009)),
        *(({"hop": each}, "hop: expected a number, got") for each in ("1", None, True)),
        *(({"progress": each}, "progress: expected True or False, got") for each in (1, None)),
        ({"lead": "3"}, "lead: expected a number, got '3'"),
    ],
)
def test_settings_that_make_no_sense_are_refused(given: dict[str, Any], said: str) -> None:
    """The message says which, what was expected, and what came."""
    with pytest.raises(ValueError, match=said):
        Settings(**given)


def test_settings_at_their_bounds() -> None:
    """Numbers of any kind do, and None where a library decides; a signature may be its text."""
    Settings(sensitivity=1, lead=0, hop=60, stillness=np.float32(0.0))
    assert [Settings(hop=hop).hop for hop in (0, 0.001)] == [0, 0.001]
    assert Settings(signature="paper", window=0.1).signature is PAPER  # type: ignore[arg-type]
    assert Settings(sensitivity=None, lead=None) == Settings()


@pytest.mark.parametrize(
    ("actors", "sensitivity", "lead"), [(["a", "a"], 0.2, 3.6), ([""], 0.1, 3.6), (["a", "b"], 0.2, 3.0)]
)
def test_a_small_library_names_less_and_starts_later(
    actors: Sequence[str], sensitivity: float, lead: float, builtin: MotionLibrary
) -> None:
    """One motion of each class says little of what is unknown, as does one person; strangers say most."""
    library = MotionLibrary.of_clips([stick_clip("wave", actor=actor) for actor in actors])
    assert usual_sensitivity(library) == sensitivity
    assert needed_lead(library, Settings()) == lead
    assert needed_lead(library, Settings(lead=2.0)) == 2.0
    assert needed_lead(library, Settings(PAPER)) == 3.0
    judged = builtin.without(actors=builtin.actors[len(actors) :])
    assert (usual_sensitivity(judged), needed_lead(judged, Settings())) == (0.05, 3.0)


def test_a_library_is_opened_as_the_settings_compare_it(sticks: MotionLibrary) -> None:
    """By the paper with its own window, once; windows that are open already are used."""
    index = opened(sticks)
    assert index_for(sticks, Settings()) is index_for(index, Settings()) is index
    paper = index_for(index, Settings(PAPER, window=0.3))
    assert paper.comparison.weighing.parts[0].seconds == 0.3
    assert index_for(paper, Settings(PAPER, window=0.3)) is index_for(sticks, Settings(PAPER, window=0.3)) is paper
    assert index_for(paper, Settings(PAPER)).comparison.weighing.parts[0].seconds == 0.5


def test_what_a_movement_needs_to_be_named(sticks: MotionLibrary) -> None:
    """The threshold of the sensitivity, of three fifths of it by fewer joints, none by the paper."""
    index = opened(sticks)
    for given in (None, 0.1):
        share = given or usual_sensitivity(sticks)
        settings = Settings(sensitivity=given)
        assert threshold_for(index, settings) == index.rejection.threshold_at(share)
        assert threshold_for(index, settings, of_fewer=True) == index.rejection.threshold_at(0.6 * share)
    paper = Settings(PAPER)
    assert threshold_for(index_for(index, paper), paper) == -math.inf
