"""The recogniser's two signatures and their settings: settings that do not apply are refused."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from synthetic import stick_clip

from kinespace.stream.frame import Frame
from kinespace.stream.recognition import EventKind, Outcome
from kinespace.stream.recognizer import LiveSignature, Recognizer, Settings

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.library.clip import Clip
    from kinespace.library.motion_library import MotionLibrary
    from kinespace.library.windows.index import WindowIndex
    from kinespace.stream.recognition import Recognition

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def frames(some_clips: tuple[Clip, ...]) -> list[Frame]:
    """Perform two clips of the small library's classes, three times each."""
    clips = [clip for clip in some_clips if clip.class_name in ("kickLFront1Reps", "squat1Reps")]
    positions = np.concatenate([clip.positions for clip in clips for _ in range(3)])
    return [Frame("p", index / 120, each) for index, each in enumerate(positions)]


def _stick_frames(class_name: str, *, seconds: float = 2.0, start: float = 5.0) -> list[Frame]:
    clip = stick_clip(class_name, seed=60, frames=round(seconds * 120))
    return [Frame("p", start + index / 120, positions) for index, positions in enumerate(clip.positions)]


def _answers(recognizer: Recognizer, frames: Sequence[Frame]) -> list[Recognition]:
    return [answer for frame in frames if (answer := recognizer.push(frame)) is not None]


# --- which signature ---------------------------------------------------------------------------------------------


def test_all_parts_are_compared_unless_told_otherwise(small_library: MotionLibrary, frames: list[Frame]) -> None:
    """Asked for or not, all parts are compared: the paper's signature gives other scores."""
    unasked = _answers(Recognizer(small_library), frames)
    asked = _answers(Recognizer(small_library, Settings(signature=LiveSignature.WINDOWS)), frames)
    by_paper = _answers(Recognizer(small_library, Settings(signature=LiveSignature.PAPER)), frames)
    assert [each.scores.tolist() for each in unasked] == [each.scores.tolist() for each in asked]
    assert [each.label for each in unasked] == [each.label for each in asked]
    assert len(by_paper) == len(unasked)
    assert not np.allclose(by_paper[-1].scores, unasked[-1].scores, atol=0.01)


@pytest.mark.parametrize("signature", LiveSignature)
def test_every_answer_holds_the_eigenvectors_view(
    small_library: MotionLibrary, frames: list[Frame], signature: LiveSignature
) -> None:
    """With either signature an answer has the leading eigenvector's own class, score, share and gap, each 0 to 1."""
    answers = _answers(Recognizer(small_library, Settings(signature=signature)), frames)
    assert {each.eigenvector_class for each in answers} <= set(small_library.classes)
    for answer in answers:
        numbers = [answer.eigenvector_score, answer.share, answer.gap, *answer.scores]
        assert 0.0 <= min(numbers) <= max(numbers) <= 1.0
        assert answer.share > 0.1
    right = [each.eigenvector_class == each.class_name for each in answers if each.class_name]
    assert np.mean(right) > 0.5


def test_only_the_default_signature_has_evidence(small_library: MotionLibrary, frames: list[Frame]) -> None:
    """Answers by all parts carry the evidence; the paper's signature has none."""
    for signature in LiveSignature:
        answers = _answers(Recognizer(small_library, Settings(signature=signature)), frames[:200])
        assert {each.evidence is None for each in answers} == {signature is LiveSignature.PAPER}


# --- settings ----------------------------------------------------------------------------------------------------


#: Settings that are refused, by name, with the expectation.
_BY_PAPER = {"window"}
WRONG: list[tuple[str, object, str]] = [
    *(("window", value, "a positive number of seconds") for value in (0.0, -1.0, np.inf, np.nan)),
    *(("longest_gap", value, "a positive number of seconds") for value in (0.0, -1.0, np.inf, np.nan)),
    *(
        (name, value, "a number not below 0")
        for name in ("sensitivity", "lead", "hop", "stillness")
        for value in (-1, -1e-9, np.inf, np.nan)
    ),
    ("sensitivity", 2, "a share from 0 to 1"),
    ("signature", "papier", "windows or paper"),
    ("progress", "no", "True or False"),
    ("plausibility", 0, "True or False"),
    ("hop", 1e9, "at most 60 seconds"),
    ("hop", "1", "a number"),
    ("lead", True, "a number"),
    ("longest_gap", None, "a number"),
    ("window", "1", "a number"),
]


@pytest.mark.parametrize(("name", "value", "expected"), WRONG)
def test_a_wrong_setting_is_refused_by_name(name: str, value: object, expected: str) -> None:
    """Numbers beyond their bounds and values of another type are refused; the message says expectation and value."""
    signature = LiveSignature.PAPER if name in _BY_PAPER else LiveSignature.WINDOWS
    with pytest.raises(ValueError, match=f"{name}: expected {expected}, got {value!r}"):
        Settings(**{"signature": signature} | {name: value})  # type: ignore[arg-type]


@pytest.mark.parametrize(("name", "value"), [("window", 1.0), ("sensitivity", 0.0), ("hop", 0)])
def test_a_setting_has_its_signature(name: str, value: float) -> None:
    """A setting of the other signature is refused by name, with any value; its own takes it, 0 too."""
    own, other = (LiveSignature.PAPER, "windows") if name in _BY_PAPER else (LiveSignature.WINDOWS, "paper")
    assert getattr(Settings(signature=own, **{name: value}), name) == value
    if name != "hop":
        with pytest.raises(ValueError, match=f"{name}: expected none with the signature {other}, got {value}"):
            Settings(signature=other, **{name: value})  # type: ignore[arg-type]


def test_more_sensitive_names_more(builtin_index: WindowIndex, some_clips: tuple[Clip, ...]) -> None:
    """Unknown motions are named at more hops the larger the share of unknown time that may be named."""
    unknown = some_clips[::3]
    names = {clip.class_name for clip in unknown}
    motions = builtin_index.library.motions
    others = builtin_index.of_some([k for k, motion in enumerate(motions) if motion.class_name not in names])
    positions = np.concatenate([clip.positions for clip in unknown])
    frames = [Frame("p", index / 120, each) for index, each in enumerate(positions)]
    named = [
        sum(
            answer.outcome is Outcome.NAMED
            for answer in _answers(Recognizer(others, Settings(sensitivity=rate)), frames)
        )
        for rate in (0.0, 0.01, 0.4, 1.0)
    ]
    assert named[0] == named[1] < named[2] == named[3]


@pytest.mark.parametrize("signature", LiveSignature)
@pytest.mark.parametrize(("stillness", "still"), [(0.001, False), (0.9, True)])
def test_stillness_is_a_setting(
    sticks: MotionLibrary, signature: LiveSignature, stillness: float, *, still: bool
) -> None:
    """With either signature, movement below the given stillness is still, and movement above it is not."""
    answers = _answers(Recognizer(sticks, Settings(signature=signature, stillness=stillness)), _stick_frames("bow"))
    assert len(answers) > 40
    assert {answer.outcome is Outcome.STILL for answer in answers} == {still}
    assert {answer.movement < stillness for answer in answers} == {still}


def test_the_papers_window_is_a_setting(sticks: MotionLibrary) -> None:
    """A second after a stop a window of half a second is still, and one of two seconds is not."""
    frames = _stick_frames("wave")
    held = [Frame("p", frames[-1].time + k / 120, frames[-1].positions) for k in range(1, 121)]
    outcomes = [
        _answers(Recognizer(sticks, Settings(signature=LiveSignature.PAPER, window=window)), [*frames, *held])[-1]
        for window in (0.5, 2.0)
    ]
    assert [each.outcome is Outcome.STILL for each in outcomes] == [True, False]


# --- events of a recogniser --------------------------------------------------------------------------------------


def test_recognitions_carry_their_events(sticks: MotionLibrary) -> None:
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
    assert starts[0] < starts[1] < starts[2]


@pytest.mark.parametrize("reset", [False, True])
def test_the_end_is_at_the_last_frame(sticks: MotionLibrary, *, reset: bool) -> None:
    """A motion ends once, at the time of the last frame, also when the window was forgotten since."""
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


def test_a_short_gap_does_not_end_a_motion(sticks: MotionLibrary) -> None:
    """A motion that goes on after the feed was away for 0.6 s is the same motion: no end, no second start."""
    recognizer = Recognizer(sticks)
    answers = _answers(recognizer, [*_stick_frames("bow"), *_stick_frames("bow", start=7.6)])
    assert recognizer.counts.restarts == 1
    assert [event.kind for answer in answers for event in answer.events] == [EventKind.START]
