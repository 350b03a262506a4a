"""Motions that were really done: once each, at their end, none that was broken off."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from kinespace.library import NOTHING, MotionLibrary
from kinespace.library.progress.phase_table import points_of
from kinespace.library.windows.index import WindowIndex, opened
from kinespace.library.windows.whole_motions import STEP
from kinespace.stream import Frame, Recognizer, Settings
from kinespace.stream.recognizer.done import DoneFollower

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.library.clip import Clip
    from kinespace.stream.recognition import Done
    from kinespace.stream.recognizer.done import Found

SQUAT, ARMS, DOWN = "squat1Reps", "rotateArmsBothBackward1Reps", "lieDownFloor"


@pytest.fixture(scope="module")
def index() -> WindowIndex:
    """Open three classes of HDM05, without one actor."""
    builtin = MotionLibrary.builtin()
    some = [each for each in builtin.motions if each.class_name in {SQUAT, ARMS, DOWN} and each.actor != "bd"]
    return opened(replace(builtin, motions=tuple(some), guests=()))


def clips_of(class_name: str, actor: str = "bd") -> list[Clip]:
    """Choose motions."""
    return [each for each in MotionLibrary.builtin().motions if (each.class_name, each.actor) == (class_name, actor)]


def joined(clips: Sequence[Clip]) -> list[np.ndarray]:
    """Put motions one behind the other on one spot, with half a second between two in which the body changes over."""
    pieces = [clips[0].positions]
    for clip in clips[1:]:
        last = pieces[-1][-1]
        here = clip.positions - clip.positions[0, 0] + last[0]
        pieces += [last + (here[0] - last) * share for share in np.linspace(0, 1, 30)[None, :, None, None]]
        pieces.append(here)
    return pieces


def said(index: WindowIndex, clips: Sequence[np.ndarray], rate: float = 60.0, **settings: float) -> list[Done]:
    """Push pieces of positions, one behind the other and a second of stillness behind them; give what was done."""
    positions = np.concatenate([*clips, np.repeat(clips[-1][-1:], round(rate), axis=0)])
    recognizer = Recognizer(index, Settings(**settings))
    answers = (recognizer.push(Frame("p", place / rate, each)) for place, each in enumerate(positions))
    return [answer.done for answer in answers if answer and answer.done]


def test_each_squat_is_done_once_when_it_ends(index: WindowIndex) -> None:
    """Four squats one behind the other are four motions, each about where it was and as long as it was."""
    clips = clips_of(SQUAT)[:4]
    ends = np.cumsum([clip.frames for clip in clips]) / 60 + 0.5 * np.arange(4)
    done = said(index, joined(clips), false_alarms=60.0)
    assert [each.label for each in done] == [SQUAT] * 4
    assert [each.index for each in done] == [index.classes.index(SQUAT)] * 4
    for each, end, clip in zip(done, ends, clips, strict=True):
        assert end - 0.7 < each.end < end + 0.3
        assert 0.5 < each.duration / clip.duration < 1.5
        assert 0.5 < each.speed < 2
        assert 0.5 < each.amplitude < 2
        assert 0.8 < each.score < 1


def test_speed_and_size_are_those_of_the_performer(index: WindowIndex) -> None:
    """A squat that is played faster is faster than before."""
    clip = clips_of(SQUAT)[1]
    (usual,), (faster,) = (said(index, [clip.positions], rate, false_alarms=60.0) for rate in (60.0, 72.0))
    assert faster.speed > 1.05 * usual.speed


@pytest.mark.parametrize("name", [SQUAT, ARMS])
def test_a_motion_that_is_broken_off_is_not_done(index: WindowIndex, name: str) -> None:
    """Of the first halves of motions none is done, of whole ones most are."""
    clips = clips_of(name)
    whole = [bool(said(index, [clip.positions], false_alarms=60.0)) for clip in clips]
    half = [bool(said(index, [clip.positions[: clip.frames // 2]])) for clip in clips]
    assert sum(whole) > len(clips) / 2
    assert sum(half) <= 0.05 * len(clips)


def test_an_example_of_nothing_is_not_done(index: WindowIndex) -> None:
    """A squat that is nearer to an example of nothing than to other squats is not said."""
    clip, *_ = clips_of(SQUAT)
    assert [each.label for each in said(index, [clip.positions])] == [SQUAT]
    taught = index.with_motions([replace(clip, class_name=NOTHING)])
    assert not said(taught, [clip.positions])


def test_fewer_false_alarms_are_promised_with_fewer_motions(index: WindowIndex) -> None:
    """What is said with a strict promise is also said with a lax one; with none nothing is said."""
    clips = [clip.positions for name in (ARMS, SQUAT, DOWN) for clip in clips_of(name)[:2]]
    counts = [len(said(index, clips, false_alarms=each)) for each in (0.0, 1.0, 60.0)]
    assert counts == sorted(counts)
    assert counts[0] == 0 < counts[2]


#: Guesses, and whether they are known, one a look.
Guesses = list[tuple[str, bool]]


def support_of(class_name: str, window: int, guesses: Guesses) -> float:
    """Give what a class gains by the guesses in the last seven tenths of a window of so many points."""
    counting = guesses[-math.ceil((window - 1) * 0.7 / 3) :]
    return sum((1.5 + 1.5 * known) * (guess == class_name) for guess, known in counting) / len(counting)


def by_definition(
    index: WindowIndex, points: np.ndarray, limits: np.ndarray, guesses: Guesses
) -> list[tuple[str, float, float]]:
    """Judge every class by every window at every second step; the most evident gains support, and waits a moment."""
    whole, found, waiting, over = index.whole, [], None, -math.inf
    judge, judgements = whole.judging(points, np.ones(len(points)))
    for step in range(2, len(points) + 1, 2):
        now = (step - 1) * STEP
        judge(step)
        free = []
        for (length, count), place in itertools.product(enumerate(whole.lengths), range(len(whole.classes))):
            begin = now - (count - 1) * STEP
            if begin >= over - 0.15 * (now - begin) and judgements[0, length, place] > -math.inf:
                above = whole.judged(judgements, length, place).evidence - limits[place]
                free.append((above, whole.classes[place], begin, count))
        if free:
            above, name, begin, count = max(free)
            above += support_of(name, count, guesses[: step // 2])
            if above > (waiting[3] if waiting else 0.0):
                waiting = name, begin, now, above
        if waiting and now - waiting[2] > 0.19:
            found.append(waiting[:3])
            over, waiting = waiting[2], None
    return found


def test_the_follower_finds_what_its_definition_does(index: WindowIndex) -> None:
    """The same motions, at the same times, on real motions one behind the other."""
    clips = [clip for name in (SQUAT, ARMS, DOWN) for clip in clips_of(name)[:5]]
    points = np.concatenate([points_of(clip, index.body, index.basis) for clip in clips])
    follower, looked, guesses = DoneFollower(index.whole, 60.0), [], Guesses()
    rng, names = np.random.default_rng(5), (SQUAT, ARMS, DOWN, "a class without a course")
    for step in range(0, len(points) - 1, 2):
        guesses.append((names[step // 40 % 4] if rng.random() < 0.8 else SQUAT, bool(rng.random() < 0.5)))
        follower.guessed(guesses[-1][0], is_named=guesses[-1][1])
        looked.append(follower.push_all(np.arange(step, step + 2) * STEP, points[step : step + 2], np.ones_like))
    found: list[Found] = [each for each in looked if each]
    expected = by_definition(index, points, index.whole.limit_at(60.0), guesses)
    assert len(expected) >= 8
    assert [each.class_name for each in found] == [name for name, _, _ in expected]
    for each, (_, begin, end) in zip(found, expected, strict=True):
        assert (each.start, each.end) == pytest.approx((begin, end), abs=1e-6)


def test_what_is_guessed_and_named_gains_evidence(index: WindowIndex) -> None:
    """A squat that stands a little below its limit is done where it was named, not where another class was guessed.

    `nothing`, which is never guessed, gains as much as any class.
    """
    points = points_of(clips_of(SQUAT)[0], index.body, index.basis)
    points = np.concatenate([points, np.repeat(points[-1:], 12, axis=0)])
    with_nothing = index.with_motions([replace(clips_of(SQUAT)[0], class_name=NOTHING)])

    def found(index: WindowIndex, name: str, *, is_named: bool) -> list[str]:
        # The promise at which support decides.
        follower = DoneFollower(index.whole, 10.0)
        looks = []
        for step in range(0, len(points) - 2, 3):
            follower.guessed(name, is_named=is_named)
            looks.append(follower.push_all(np.arange(step, step + 3) * STEP, points[step : step + 3], np.ones_like))
        return [each.class_name for each in looks if each]

    assert found(index, SQUAT, is_named=True) == [SQUAT]
    assert found(index, DOWN, is_named=True) == []
    assert found(with_nothing, SQUAT, is_named=True) == []


@pytest.mark.slow
def test_a_gap_and_another_library(index: WindowIndex) -> None:
    """After a gap of seconds, and with another library, a motion is found again from its beginning on.

    A motion at whose end the feed pauses is said when it goes on; after a reset another performer may follow.
    """
    clip = clips_of(SQUAT)[0]
    recognizer = Recognizer(index, Settings(false_alarms=60.0))

    def pushed(since: float, stands: int = 60) -> list[str]:
        still = np.repeat(clip.positions[-1:], stands, axis=0)
        answers = [
            recognizer.push(Frame("p", since + place / 60, each))
            for place, each in enumerate(np.concatenate([clip.positions, still]))
        ]
        return [answer.done.label for answer in answers if answer and answer.done]

    assert pushed(0.0) == [SQUAT]
    assert pushed(100.0) == [SQUAT]
    assert pushed(110.0, 0) == []
    assert pushed(120.0) == [SQUAT, SQUAT]
    assert pushed(130.0, 0) == []
    assert pushed(20.0) == [SQUAT, SQUAT]
    assert pushed(140.0, 0) == []
    recognizer.reset()
    assert pushed(150.0) == [SQUAT]
    recognizer.exchange(index.library.without(classes=[ARMS]))
    assert pushed(200.0) == [SQUAT]
    recognizer.exchange(index.library.without(classes=[SQUAT]))
    assert pushed(300.0) == []
