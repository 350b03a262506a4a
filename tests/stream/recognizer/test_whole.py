"""A whole clip recognised at once, and answers as rows of a table."""

from dataclasses import replace

import numpy as np
import pytest
from performed import assert_same, pushed, shown
from synthetic import STICK, stick_clip

from kinespace.library import MotionLibrary, SkeletonMismatchError
from kinespace.stream import Recognizer, Settings, recognise


def test_a_clip_is_answered_as_live(sticks: MotionLibrary) -> None:
    """The answers are those of a recogniser to which the frames are pushed; fewer joints restrict the library."""
    clip = replace(stick_clip("bow", seed=50, frames=240, rate=120.0), actor="ann")
    expected = pushed(Recognizer(sticks), shown(clip.positions, 120.0, performer="ann"))
    assert_same(recognise(sticks, clip), [each for each in expected if each])
    assert recognise(sticks, clip, Settings(hop=0.5))[1].time == pytest.approx(0.65, abs=0.02)
    fewer = clip.restricted_to(STICK.joints[:5])
    assert recognise(sticks, replace(fewer, actor=""))
    with pytest.raises(SkeletonMismatchError, match="expected at least 5"):
        recognise(sticks, clip.restricted_to(STICK.joints[:4]))
    with pytest.raises(ValueError, match="clip: expected a Clip, got ndarray"):
        recognise(sticks, clip.positions)  # type: ignore[arg-type] # a mistake
    with pytest.raises(ValueError, match=r"frame: expected a Frame.* got ndarray"):
        Recognizer(sticks).push(clip.positions)  # type: ignore[arg-type] # a mistake


def test_an_answer_is_a_flat_row(sticks: MotionLibrary) -> None:
    """Every value is a number or a text; label, guess, scores and events are the answer's."""
    answers = recognise(sticks, stick_clip("bow", seed=50, frames=360, rate=120.0))
    rows = [answer.as_dict() for answer in answers]
    assert {type(value) for row in rows for value in row.values()} <= {str, float, int}
    assert len({tuple(row) for row in rows}) == 1
    for row, answer in zip(rows, answers, strict=True):
        assert (row["label"], row["score"], row["margin"]) == (answer.label, answer.score, answer.margin)
        assert row["class"] == (answer.class_name or "")
        assert [row[f"score {name}"] for name in answer.classes] == answer.scores.tolist()
        assert bool(row["event"]) == bool(answer.events)
    assert any(row["event"].startswith("start bow") for row in rows)
    assert np.all(np.diff([row["time"] for row in rows]) > 0)
