"""The sensitivity and the lead that a library asks for."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from synthetic import stick_clip

from kinespace.library import MotionLibrary
from kinespace.stream.recognizer import LiveSignature, Settings
from kinespace.stream.recognizer.decision import needed_lead, usual_sensitivity

if TYPE_CHECKING:
    from collections.abc import Sequence


def _library(actors: Sequence[str]) -> MotionLibrary:
    return MotionLibrary.of_clips([stick_clip("wave", actor=actor) for actor in actors])


@pytest.mark.parametrize(
    ("actors", "sensitivity", "lead"), [(["a", "a"], 0.28, 3.6), ([""], 0.28, 3.6), (["a", "b"], 0.2, 3.0)]
)
def test_one_persons_library_names_more_and_starts_later(
    actors: Sequence[str], sensitivity: float, lead: float
) -> None:
    """One person's few motions say little of what is unknown; a longer lead makes up for it."""
    library = _library(actors)
    assert usual_sensitivity(library) == sensitivity
    assert needed_lead(library, Settings()) == lead
    assert needed_lead(library, Settings(lead=2.0)) == 2.0
    assert needed_lead(library, Settings(LiveSignature.PAPER)) == 3.0


def test_a_library_judged_by_strangers_is_stricter(builtin: MotionLibrary) -> None:
    """Where strangers taught what is unknown, the number of persons does not matter."""
    alone = builtin.without(actors=builtin.actors[1:])
    for library in (builtin, alone):
        assert usual_sensitivity(library) == 0.05
        assert needed_lead(library, Settings()) == 3.0
