"""The recogniser's two ways of comparing, which of them is taken, and how its motions end."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from synthetic import stick_clip, stick_clips

from library.eigen import RESIDUAL_TOLERANCE
from library.motionlibrary import MotionLibrary
from stream.frame import Frame
from stream.recognition import EventKind, Outcome
from stream.recognizer import LiveSignature, Recognizer, Settings

if TYPE_CHECKING:
    from collections.abc import Sequence

    from library.clip import Clip
    from stream.recognition import Recognition


@pytest.fixture(scope="module")
def sticks() -> MotionLibrary:
    """Build a library of whole motions only."""
    return MotionLibrary.of_clips(stick_clips())


@pytest.fixture(scope="module")
def builtin() -> MotionLibrary:
    return MotionLibrary.builtin()


@pytest.fixture(scope="module")
def frames(some_clips: tuple[Clip, ...]) -> list[Frame]:
    """Perform two clips of the built-in library's classes, three times each."""
    positions = np.concatenate([clip.positions for clip in some_clips[3:5] for _ in range(3)])
    return [Frame("p", index / 120, each) for index, each in enumerate(positions)]


def _stick_frames(class_name: str, *, seconds: float = 2.0, start: float = 5.0) -> list[Frame]:
    clip = stick_clip(class_name, seed=60, frames=round(seconds * 120))
    return [Frame("p", start + index / 120, positions) for index, positions in enumerate(clip.positions)]


def _answers(recognizer: Recognizer, frames: Sequence[Frame]) -> list[Recognition]:
    return [answer for frame in frames if (answer := recognizer.push(frame)) is not None]


# --- which way ---------------------------------------------------------------------------------------------------


def test_windows_are_the_default_where_there_are_some(builtin: MotionLibrary, frames: list[Frame]) -> None:
    """Asked for or not, the built-in library's windows are compared: answers after half a second, no share, no gap."""
    unasked = _answers(Recognizer(builtin), frames)
    asked = _answers(Recognizer(builtin, Settings(signature=LiveSignature.WINDOWS)), frames)
    assert unasked[0].time == pytest.approx(0.5)
    assert {(each.share, each.gap, each.residual) for each in unasked} == {(None, None, None)}
    assert [each.scores.tolist() for each in unasked] == [each.scores.tolist() for each in asked]
    assert [each.label for each in unasked] == [each.label for each in asked]


def test_the_eigenvector_is_compared_where_that_is_asked(builtin: MotionLibrary, frames: list[Frame]) -> None:
    """Asked for, the eigenvector is compared though there are windows: share and gap, residuals certified."""
    recognizer = Recognizer(builtin, Settings(signature=LiveSignature.EIGENVECTOR))
    answers = _answers(recognizer, frames)
    assert answers[0].time == pytest.approx(1.0)
    for answer in answers:
        assert answer.share is not None
        assert answer.gap is not None
        assert answer.residual is not None
        assert 0 < answer.share <= 1
        assert 0 <= answer.gap <= 1
        assert answer.residual <= RESIDUAL_TOLERANCE
    by_windows = _answers(Recognizer(builtin), frames)
    assert not np.allclose(answers[-1].scores, by_windows[-1].scores, atol=0.01)


def test_whole_motions_are_compared_by_the_eigenvector(sticks: MotionLibrary) -> None:
    """A library without windows is compared by the eigenvector, asked for or not."""
    unasked = _answers(Recognizer(sticks), _stick_frames("jump"))
    asked = _answers(Recognizer(sticks, Settings(signature=LiveSignature.EIGENVECTOR)), _stick_frames("jump"))
    assert [answer.share for answer in unasked] == [answer.share for answer in asked]
    assert None not in {answer.share for answer in unasked}


def test_windows_that_are_not_there_are_refused(sticks: MotionLibrary) -> None:
    """Asking for windows of a library that keeps none is an error that says so."""
    with pytest.raises(ValueError, match="signature: expected a library with windows"):
        Recognizer(sticks, Settings(signature=LiveSignature.WINDOWS))


@pytest.mark.parametrize("name", ["sensitivity", "lead"])
@pytest.mark.parametrize("value", [-1e-9, np.inf, np.nan])
def test_settings_of_windows_and_events_are_not_negative(name: str, value: float) -> None:
    """A negative or endless sensitivity or lead is refused, by its name; 0 is not."""
    with pytest.raises(ValueError, match=f"{name}: expected a number not below 0"):
        Settings(**{name: value})
    Settings(**{name: 0.0})


def test_sensitivity_is_a_setting(builtin: MotionLibrary, frames: list[Frame]) -> None:
    """Motions with a centimetre of noise on every joint are named less often the lower the sensitivity."""
    generator = np.random.default_rng(2)
    noisy = [Frame("p", f.time, f.positions + generator.normal(scale=0.01, size=(31, 3))) for f in frames]
    named = [
        sum(answer.outcome is Outcome.NAMED for answer in _answers(Recognizer(builtin, settings), noisy))
        for settings in (Settings(signature=LiveSignature.WINDOWS, sensitivity=rate) for rate in (0.005, 0.4))
    ]
    assert named[0] < named[1]


# --- events of a recogniser --------------------------------------------------------------------------------------


def test_recognitions_carry_what_they_made_happen(sticks: MotionLibrary) -> None:
    """Two motions in a row: a start, then an end and a start at once, each in the recognition of its time."""
    recognizer = Recognizer(sticks)
    answers = _answers(recognizer, [*_stick_frames("bow"), *_stick_frames("wave", start=7.0)])
    told = [answer.events for answer in answers if answer.events]
    assert [[(event.kind, event.label) for event in events] for events in told] == [
        [(EventKind.START, "bow")],
        [(EventKind.END, "bow"), (EventKind.START, "wave")],
    ]
    for answer in answers:
        assert {(event.time, event.performer) for event in answer.events} <= {(answer.time, "p")}


def test_a_larger_lead_starts_later(sticks: MotionLibrary) -> None:
    """How clear a lead a start needs is a setting."""
    starts = [
        next(
            answer.time
            for answer in _answers(Recognizer(sticks, Settings(lead=lead)), _stick_frames("bow"))
            if answer.events
        )
        for lead in (0.0, 3.0, 20.0)
    ]
    assert starts[0] == pytest.approx(6.0)
    assert starts[0] < starts[1] < starts[2]


@pytest.mark.parametrize("reset", [False, True])
def test_the_end_is_at_the_last_frame(sticks: MotionLibrary, *, reset: bool) -> None:
    """What goes on ends once, at the time of the last frame taken in, also when the window was forgotten since."""
    recognizer = Recognizer(sticks)
    assert recognizer.end() is None
    frames = _stick_frames("jump")
    _answers(recognizer, frames)
    if reset:
        recognizer.reset()
    ended = recognizer.end()
    assert ended is not None
    assert (ended.kind, ended.label, ended.time) == (EventKind.END, "jump", frames[-1].time)
    assert recognizer.end() is None


def test_a_gap_does_not_end_what_goes_on(sticks: MotionLibrary) -> None:
    """A motion that goes on after the feed was away for a second is the same motion: no end, no second start."""
    recognizer = Recognizer(sticks)
    answers = _answers(recognizer, [*_stick_frames("bow"), *_stick_frames("bow", start=8.0)])
    assert recognizer.counts.restarts == 1
    assert [event.kind for answer in answers for event in answer.events] == [EventKind.START]
