"""Progress: how far, how fast, how large."""

from dataclasses import replace
from functools import cache
from itertools import groupby, islice

import numpy as np
import pytest
from naive_progress import Pace, beginning_of, gone_on, median, weighed
from numpy.typing import NDArray

from kinespace.library import Clip, MotionLibrary, WindowIndex, distance_rows
from kinespace.library.phases import VELOCITY, PhaseTable
from kinespace.stream.recognizer.progress import STEP, ProgressFollower

SQUAT, ARMS, DOWN = "squat1Reps", "rotateArmsBothBackward1Reps", "lieDownFloor"


@cache
def opened_few() -> WindowIndex:
    """Open two motions of each of three classes by each actor, compared as the whole library's are."""
    builtin = MotionLibrary.builtin()
    by_both = groupby(builtin.motions, key=lambda clip: (clip.class_name, clip.actor))
    some = tuple(each for (name, _), own in by_both for each in islice(own, 2) if name in {SQUAT, ARMS, DOWN})
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


def clip_of(class_name: str, actor: str, nth: int = 0) -> Clip:
    """Choose a motion of the library."""
    return [clip for clip in opened_few().library.motions if (clip.class_name, clip.actor) == (class_name, actor)][nth]


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
    for index, point in enumerate(points_of(clip_of(class_name, "bk").positions[::2])[:60]):
        past.append(point)
        belief = gone_on(belief, beginning, cyclic=few.cyclic)
        live = np.concatenate([point, VELOCITY * (point - past[max(0, len(past) - 5)])])
        belief = weighed(belief, few.vectors, live @ table.whitening, 1 / 16)
        told = follower.push(index * STEP, point, class_name)
        assert told.phase == pytest.approx(median(belief), abs=1e-3)
        at = np.sum(belief, axis=0)
        near = sum(each for moment, each in enumerate(at) if abs(moment / (count - 1) - told.phase) <= 0.1)
        assert told.sure == pytest.approx(near, abs=1e-3)
        expected = float(np.sum(belief * few.speeds)), float(np.dot(at, few.usual_speeds))
        pace.push(past, live[len(live) // 2 :], expected, float(np.dot(at, few.usual_swings)))
        assert (told.speed, told.amplitude) == pytest.approx((pace.speed, pace.amplitude), rel=1e-3)


def test_between_two_hops_a_body_moves_in_a_straight_line() -> None:
    """Seen at every second or third step, the progress is as if the points between had been seen, too."""
    points = points_of(clip_of(ARMS, "bk").positions[:160:5])
    for apart in (2, 3):
        seldom, often = (ProgressFollower(table_without("bk")) for _ in range(2))
        for place, point in enumerate(points):
            told, before = seldom.push(apart * place * STEP, point, ARMS), points[max(place - 1, 0)]
            for part in range(1, apart + 1) if place else [apart]:
                moment = (apart * max(place - 1, 0) + part * (place > 0)) * STEP
                seen = often.push(moment, before + part / apart * (point - before), ARMS)
            assert (told.phase, told.speed) == pytest.approx((seen.phase, seen.speed), abs=1e-6)
