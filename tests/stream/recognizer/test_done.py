"""Motions that begin, that were really done, once each, at their end, and that go on: how far they are."""

import math
import tracemalloc
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from operator import itemgetter

import naive_courses as naive
import numpy as np
import pytest
from fakes import pushed, shown
from naive_courses import Pace, beginning_of, gone_on, median_of, weighed
from numpy.typing import NDArray
from programs import motions_of, two_of_each

from kinespace.library import NOTHING, Clip, MotionLibrary, WindowIndex, distance_rows, opened
from kinespace.library.phases import VELOCITY, PhaseTable
from kinespace.library.signature.own_frame import STEP, own_path
from kinespace.library.windows.courses import Courses, path_of
from kinespace.stream import Done, Recognizer, Settings
from kinespace.stream.recognizer import decision
from kinespace.stream.recognizer.decision import Judged
from kinespace.stream.recognizer.done import DoneFollower, costs_of
from kinespace.stream.recognizer.progress import ProgressFollower

SQUAT, ARMS, DOWN = "squat1Reps", "rotateArmsBothBackward1Reps", "lieDownFloor"


@pytest.fixture(scope="module")
def index() -> WindowIndex:
    """Open three classes of HDM05, without one actor."""
    builtin = MotionLibrary.builtin()
    some = [each for each in builtin.motions if each.class_name in {SQUAT, ARMS, DOWN} and each.actor != "bd"]
    return opened(replace(builtin, motions=tuple(some)))


def joined(clips: Sequence[Clip]) -> list[np.ndarray]:
    """Put motions one behind the other on one spot, with half a second between two in which the body changes over."""
    pieces = [clips[0].positions]
    for clip in clips[1:]:
        last = pieces[-1][-1]
        here = clip.positions - clip.positions[0, 0] + last[0]
        pieces += [last + (here[0] - last) * share for share in np.linspace(0, 1, 30)[None, :, None, None]]
        pieces.append(here)
    return pieces


def done_by(recognizer: Recognizer, clips: Sequence[np.ndarray], begin: float = 0.0) -> list[Done]:
    """Push pieces of positions, one behind the other and a second of stillness behind them; give what was done."""
    positions = np.concatenate([*clips, np.repeat(clips[-1][-1:], 60, axis=0)])
    return [answer.done for answer in pushed(recognizer, shown(positions, 60.0, begin=begin)) if answer.done]


def said(index: WindowIndex, clips: Sequence[np.ndarray], **settings: float) -> list[Done]:
    """Give what was done of pieces of positions."""
    return done_by(Recognizer(index, Settings(**settings)), clips)


@pytest.mark.slow
def test_each_squat_is_done_once_when_it_ends(index: WindowIndex) -> None:
    """Four squats one behind the other are four motions, each about where it was and as long as it was."""
    clips = motions_of(SQUAT)[2:6]
    ends = np.cumsum([clip.frames for clip in clips]) / 60 + 0.5 * np.arange(4)
    done = said(index, joined(clips), false_alarms=60.0)
    assert [each.label for each in done] == [SQUAT] * 4
    assert [each.index for each in done] == [index.classes.index(SQUAT)] * 4
    for each, end, clip in zip(done, ends, clips, strict=True):
        assert end - 0.7 < each.end < end + 0.3
        assert 0.5 < each.duration / clip.duration < 1.5
        assert 0.5 < each.speed < 2
        assert 0.5 < each.amplitude < 2
        assert 0.5 < each.score < 1


@pytest.mark.parametrize("name", [SQUAT, ARMS])
def test_a_motion_that_is_broken_off_is_not_done(index: WindowIndex, name: str) -> None:
    """Of the first halves of motions none is done, of whole ones most are."""
    clips = motions_of(name)[::2]
    whole = [bool(said(index, [clip.positions], false_alarms=60.0)) for clip in clips]
    half = [bool(said(index, [clip.positions[: clip.frames // 2]])) for clip in clips]
    assert sum(whole) > len(clips) / 2
    assert sum(half) <= 0.05 * len(clips)


@pytest.mark.parametrize("taught_by", ["one", "several"])
def test_limits_of_one_persons_motions_fall_with_time(index: WindowIndex, taught_by: str) -> None:
    """A window that lasts longer or shorter than a motion must cost less, unless several persons taught the limit."""
    one = Courses.of([clip for name in (SQUAT, ARMS) for clip in motions_of(name)[:2]])
    courses, clip = index.courses if taught_by == "several" else one, motions_of(SQUAT)[3]
    follower, looks = DoneFollower(courses, clip.skeleton, 6.0), 0
    for time, frame in zip(clip.times, clip.positions, strict=True):
        if (ending := follower.push([float(time)], frame[None])) is None:
            continue
        for count, limits in zip(ending.counts.tolist(), ending.limits, strict=True):
            for motion, seconds in enumerate(courses.seconds.tolist()):
                falls = math.exp(-0.2 * math.log(count / 30 / seconds) ** 2) if taught_by == "one" else 1.0
                assert limits[motion] == pytest.approx(courses.limits[0, motion] * falls, rel=1e-5)
            looks += 1
        assert np.allclose(ending.limits[:, len(courses.seconds) :], courses.limits[1], rtol=1e-7)
    assert looks > 10


def test_an_example_of_nothing_is_not_done(index: WindowIndex) -> None:
    """A squat that is nearer to an example of nothing than to other squats is not said."""
    clip = motions_of(SQUAT)[3]
    assert [each.label for each in said(index, [clip.positions])] == [SQUAT]
    assert not said(index.with_motions([replace(clip, class_name=NOTHING)]), [clip.positions])


def growth_of(known: Sequence[tuple[float, str, float]], time: float, class_name: str, *, several: bool) -> float:
    """Say how much wider the limits of a class of several persons are by its best evidence of the last 1.5 seconds."""
    recent = [(name, evidence) for at, name, evidence in known if at >= time - 1.5]
    if not recent:
        return 1.0
    own = [math.exp(0.2 * evidence) for name, evidence in recent if name == class_name]
    return min(max([0.7, *own]), 1.1 if several else 1.8)


def seen_by_definition(  # noqa: PLR0913 - what a look depends on
    index: WindowIndex, points: np.ndarray, step: int, over: int, *, size: float, whole: bool, known: Sequence[tuple]
) -> tuple[str, float, float]:
    """Give the class that the windows which end with a step show most surely, its cost, and that without evidence."""
    courses, best = index.courses, (1.0, "", 1.0)
    shown = zip(courses.classes, courses.persons, strict=True)
    grown = {name: growth_of(known, step * STEP, name, several=count > 1) for name, count in shown}
    pieces, limits = (courses.whole, courses.limits[0]) if whole else (courses.begun, courses.limits[1])
    for count in courses.counts:
        begin = step - count
        if begin < max(over, 0) or (whole and count < 15):
            continue
        window = points[begin : step + 1]
        # Where a window goes farther or less far than any motion, none is compared.
        every = np.concatenate([courses.whole.lengths, courses.begun.lengths])
        if not every.min() / naive.LONGER < naive.way_of(window) / size < every.max() * naive.LONGER:
            continue
        read = naive.at_equal_way_of(window)
        way = naive.way_of(read) / size
        course, ways = naive.course_of(read, courses.whitening), np.abs(np.diff(read[:, :-9], axis=0)).sum(axis=0)
        widths, tilt = np.ptp(read[:, :-9], axis=0), naive.tilt_of(read)
        for motion, limit in enumerate(limits):
            longer = way / pieces.lengths[motion]
            if not 1 / naive.LONGER < longer < naive.LONGER:
                continue
            shared = [
                max(float(mine @ theirs[motion] / np.linalg.norm(mine)), naive.LEAST)
                for mine, theirs in ((ways, pieces.ways), (widths, pieces.widths))
            ]
            shared.append(naive.alike_of(float(tilt @ pieces.tilts[motion])))
            cost = (1 - float(course @ pieces.courses[motion])) / math.prod(shared) / float(limit)
            if whole and courses.whitening is None:
                cost *= math.exp(0.2 * math.log(count * STEP / courses.seconds[motion]) ** 2)
            name = courses.classes[int(np.searchsorted(courses.starts, motion, side="right")) - 1]
            best = min(best, (cost / grown[name], name, cost))
    return best[1], best[0], best[2]


@pytest.mark.slow
def test_the_follower_finds_what_its_definition_does(index: WindowIndex) -> None:
    """The same motions at the same looks, on real motions one behind the other."""
    few = index.of_some(range(0, len(index.library.motions), 4))
    clips = [clip for name in (SQUAT, DOWN, ARMS) for clip in motions_of(name)[1:3]]
    positions = np.concatenate([each[::2] for each in joined(clips)])
    clip = replace(clips[0], positions=positions, frame_rate=30.0)
    points, follower = path_of(clip), DoneFollower(few.courses, clip.skeleton, 6.0)
    done, begun, streaks, over, expected, looks = [], [], {True: ("", 0), False: ("", 0)}, -1, [], 0
    # Evidence comes and goes: now for one class, now for another, now against all.
    rng, known, waiting = np.random.default_rng(5), list[tuple[float, str, float]](), list[tuple[str, float]]()
    for step, frame in enumerate(positions):
        if rng.random() < 0.3:
            known.append((step * STEP, str(rng.choice(few.courses.classes)), float(rng.normal(0, 3))))
            follower.know(*known[-1])
        ending = follower.push([step * STEP], frame[None])
        if ending is None:
            continue
        look = follower.look(ending, *costs_of([ending]))
        looks += 1
        done += [(step, look.done.class_name)] if look.done else []
        begun += [(step, look.seen.class_name)] if look.seen and look.seen.begins else []
        seen = {}
        for whole in (True, False):
            some = positions[max(step - 20, 0) : step + 1]
            size = own_path(some, clip.skeleton)[1] / own_path(positions, clip.skeleton)[1]
            seen[whole] = seen_by_definition(few, points, step, over, size=size, whole=whole, known=known)
            name, (before, count) = seen[whole][0], streaks[whole]
            streaks[whole] = name, count + 1 if name and name == before else 1
        (name, cost, without), (_, count) = seen[True], streaks[True]
        if name and count >= 2:
            nearer = not waiting or cost < waiting[-1][1]
            waiting.append((name, cost))
            if without > 1 and len(waiting) <= 3 and nearer:
                continue
        if waiting:
            expected.append((step, min(waiting, key=itemgetter(1))[0]))
            over, streaks, waiting = step, {True: ("", 0), False: ("", 0)}, []
    assert looks == pytest.approx(len(positions) / 3, abs=1)
    assert len(expected) >= 3
    assert done == expected
    # Each motion begins before it is done.
    assert {name for _, name in done} <= {name for _, name in begun}


def test_evidence_is_forgotten_where_nobody_looks(index: WindowIndex) -> None:
    """A library of postures has no course and no looks: evidence does not grow with the hours."""
    follower = DoneFollower(Courses.of([]), index.library.skeleton, 6.0)
    tracemalloc.start()
    for step in range(20_000):
        follower.know(step * STEP, SQUAT, 1.0)
    grown, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert grown < 200_000


@pytest.mark.parametrize("hop", [1 / 30, 1.0])
def test_a_gap_and_another_library(index: WindowIndex, hop: float) -> None:
    """After a gap of seconds, and with another library, a motion is found again from its beginning on.

    After a reset another performer may follow. Nothing is said of a class that was taken away.
    """
    clip = motions_of(SQUAT)[3]
    recognizer = Recognizer(index, Settings(false_alarms=60.0, hop=hop))

    def found(begin: float) -> list[str]:
        return [each.label for each in done_by(recognizer, [clip.positions], begin)]

    assert [found(begin) for begin in (0.0, 100.0, 20.0)] == [[SQUAT]] * 3
    recognizer.reset()
    assert found(150.0) == [SQUAT]
    recognizer.exchange(index.library.without(classes=[ARMS]))
    assert found(200.0) == [SQUAT]
    recognizer.exchange(index.library.without(classes=[SQUAT]))
    assert found(300.0) == []


@pytest.mark.parametrize("ends", ["exchange", "reset"])
def test_what_no_answer_has_said_goes_with_its_library_and_its_performer(index: WindowIndex, ends: str) -> None:
    """A motion that was seen between two slow hops is not said of a class that is gone, or of the next performer."""
    recognizer, positions = Recognizer(index, Settings(false_alarms=60.0, hop=8.0)), motions_of(SQUAT)[3].positions
    body = np.concatenate([positions, np.repeat(positions[-1:], 600, axis=0)])
    frames = shown(body, 60.0)
    before = pushed(recognizer, frames[: len(positions) + 60])
    assert not any(answer.done for answer in before)
    if ends == "exchange":
        recognizer.exchange(index.library.without(classes=[SQUAT]))
    else:
        recognizer.reset()
    after = pushed(recognizer, frames[len(positions) + 60 :])
    assert after
    assert not any(answer.done for answer in after)


def test_evidence_for_few_peoples_classes_beside_others_counts_sooner(
    builtin: MotionLibrary, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Above what 5 % of unknown movement has; for classes that several persons show above what 1 % has."""
    found, averages, average = dict[str, set[float]](), list[float](), decision.averaged

    def averaging(*arguments: object) -> Judged:
        judged = average(*arguments)  # type: ignore[arg-type]
        averages.append(judged[0])
        return judged

    def know(_: DoneFollower, __: float, name: str, evidence: float) -> None:
        found.setdefault(name, set()).add(round(averages[-1] - evidence, 3))

    monkeypatch.setattr(decision, "averaged", averaging)
    monkeypatch.setattr(DoneFollower, "know", know)
    squat, grab = (motions_of(name)[0] for name in (SQUAT, "grabHighR"))
    index = opened(builtin).with_motions([replace(squat, class_name="mine", actor="")])
    recognizer = Recognizer(index)
    pushed(recognizer, shown([*squat.positions[::4], *grab.positions[::4]], 30.0))
    one, _, five, *_ = index.rejection.thresholds.round(3).tolist()
    assert found.pop("mine") == {five}
    assert set().union(*found.values()) == {one}


# --- progress: how far, how fast, how large ---------------------------------------------------------------------------


@cache
def opened_few() -> WindowIndex:
    """Open two motions of each of three classes by each actor, compared as the whole library's are."""
    builtin = MotionLibrary.builtin()
    some = two_of_each((SQUAT, ARMS, DOWN), builtin.actors)
    return WindowIndex.of(replace(builtin, motions=some))


@cache
def table_without(actor: str) -> PhaseTable:
    """Make the phase table of the other actors' motions."""
    index = opened_few()
    return PhaseTable.of(index.library.without(actors=[actor]).motions, index.body, index.basis)


def points_of(positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Place a body in the library's basis, relative to its size."""
    index = opened_few()
    rows = distance_rows(positions, index.library.skeleton)
    return rows @ index.basis.directions / index.body.size(rows)[:, None]


@pytest.mark.usefixtures("arithmetic")
@pytest.mark.parametrize("class_name", [SQUAT, ARMS])
def test_every_step_equals_the_textbooks(class_name: str) -> None:
    """On a real clip the filter equals, at every step, a filter written one moment at a time."""
    table = table_without("bk")
    moments = table.classes[class_name]
    few = replace(moments, vectors=moments.vectors[:4], speeds=moments.speeds[:4])
    follower = ProgressFollower(PhaseTable({class_name: few}, table.whitening, table.basis))
    past, pace, count = list["NDArray[np.float64]"](), Pace(float(few.speeds.mean())), few.speeds.shape[1]
    beginning = beginning_of(count)
    belief = [[each / 4 for each in beginning]] * 4
    for index, point in enumerate(points_of(motions_of(class_name, "bk")[0].positions[::2])[:60]):
        past.append(point)
        belief = gone_on(belief, beginning, cyclic=few.cyclic)
        live = np.concatenate([point, VELOCITY * (point - past[max(0, len(past) - 5)])])
        belief = weighed(belief, few.vectors, live @ table.whitening, 1 / 16)
        told = follower.push(index * STEP, point, class_name)
        assert told.phase == pytest.approx(median_of(belief), abs=1e-3)
        at = np.sum(belief, axis=0)
        near = sum(each for moment, each in enumerate(at) if abs(moment / (count - 1) - told.phase) <= 0.1)
        assert told.sure == pytest.approx(near, abs=1e-3)
        expected = float(np.sum(belief * few.speeds)), float(np.dot(at, few.usual_speeds))
        pace.push(past, live[len(live) // 2 :], expected, float(np.dot(at, few.usual_swings)))
        assert (told.speed, told.amplitude) == pytest.approx((pace.speed, pace.amplitude), rel=1e-3)


def test_between_two_hops_a_body_moves_in_a_straight_line() -> None:
    """Seen at every second or third step, the progress is as if the points between had been seen, too."""
    points = points_of(motions_of(ARMS, "bk")[0].positions[:160:5])
    for apart in (2, 3):
        seldom, often = (ProgressFollower(table_without("bk")) for _ in range(2))
        for place, point in enumerate(points):
            told, before = seldom.push(apart * place * STEP, point, ARMS), points[max(place - 1, 0)]
            for part in range(1, apart + 1) if place else [apart]:
                moment = (apart * max(place - 1, 0) + part * (place > 0)) * STEP
                seen = often.push(moment, before + part / apart * (point - before), ARMS)
            assert (told.phase, told.speed) == pytest.approx((seen.phase, seen.speed), abs=1e-6)
