"""Computing answers beforehand, and pairing answers with their frames."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from programs import builtin_library, motion_cues

from kinespace.stream import Frame, Recognizer, Settings, osc
from kinespace.stream.recognition import Answer
from kinespace.tools.loopback.expected_answers import AnswerMatcher, Expected, expected_answers

if TYPE_CHECKING:
    from kinespace.tools.feeding.feed import Cue


def over_osc(cue: Cue) -> Frame:
    """Give the frame as decoded from a datagram."""
    (frame,) = osc.decode(osc.encode_frame(cue.frame), 0.0).events
    assert isinstance(frame, Frame)
    return frame


def answer(label: str, score: float) -> Answer:
    """Make a received answer."""
    return Answer("me", 0, score, 0.1, label)


def test_positions_are_rounded_as_the_wire_rounds_them() -> None:
    """Far from the origin, where float32 holds only centimetres, rounded positions are expected."""
    library = builtin_library()
    meant = [
        replace(cue, frame=replace(cue.frame, positions=cue.frame.positions + np.float64(9e4)))
        for cue in motion_cues("kickLFront1Reps", 1.2)
    ]
    exact, received = Recognizer(library), Recognizer(library)
    exact_scores = [each.score for cue in meant if (each := exact.push(cue.frame))]
    scores = [each.score for cue in meant if (each := received.push(over_osc(cue)))]
    expected = [each.score for each in expected_answers(meant, library, Settings())]
    assert expected == pytest.approx(scores, abs=1e-9)
    assert expected != pytest.approx(exact_scores, abs=1e-5)


@given(st.lists(st.booleans(), max_size=40))
def test_answers_find_their_frames_and_the_missing_are_counted(arrived: list[bool]) -> None:
    """Whichever answers get lost, each that arrives is paired with its own frame, and the rest is lost or waiting."""
    expected = [Expected(3 * index, "wave", 0.5 + index / 1000) for index in range(len(arrived))]
    matcher = AnswerMatcher(expected)
    for each, has_arrived in zip(expected, arrived, strict=True):
        if has_arrived:
            assert matcher.match(answer(each.label, each.score + 4e-6)) == each
    assert matcher.lost + matcher.waiting == arrived.count(False)


def test_an_unexpected_answer_changes_nothing() -> None:
    """An answer with another label or score matches none, and the next one still finds its own."""
    matcher = AnswerMatcher([Expected(0, "wave", 0.9), Expected(4, "wave", 0.8)])
    assert matcher.match(answer("bow", 0.9)) is None
    assert matcher.match(answer("wave", 0.85)) is None
    assert matcher.match(answer("wave", 0.9)) == Expected(0, "wave", 0.9)
    assert (matcher.lost, matcher.waiting) == (0, 1)


def test_two_answers_alike_are_taken_in_their_order() -> None:
    """Of two expected answers that say the same, the earlier is taken first and none is lost."""
    alike = [Expected(0, "still", 0.5), Expected(4, "still", 0.5)]
    matcher = AnswerMatcher(alike)
    assert [matcher.match(answer("still", 0.5)) for _ in range(3)] == [*alike, None]
    assert (matcher.lost, matcher.waiting) == (0, 0)
