"""Courses: whole motions at equal way, in the body's own frame, and the limits of what is said."""

import math
from dataclasses import replace
from itertools import pairwise

import naive_courses as naive
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kinespace.library import NOTHING, Clip, MotionLibrary, Skeleton
from kinespace.library.signature.own_frame import STEP, at_steps, corners_of, own_path
from kinespace.library.windows import courses as motions
from kinespace.library.windows.courses import POINTS, Courses, Pieces, at_equal_way, path_of, ways_of
from kinespace.library.windows.segments import mirrored

SQUAT, JOG, GRAB, DOWN = "squat1Reps", "jogLeftCircle4StepsRstart", "grabHighR", "lieDownFloor"


def clips_of(builtin: MotionLibrary, *classes: str, actor: str = "") -> list[Clip]:
    """Choose motions of HDM05."""
    return [each for each in builtin.motions if each.class_name in classes and actor in ("", each.actor)]


def equal_way(path: np.ndarray) -> np.ndarray:
    """Read a whole path at equal way, (1, POINTS, numbers)."""
    ways = ways_of(path)
    return at_equal_way(path, ways, np.zeros(1), ways[-1:])


def test_points_are_those_of_the_definition(builtin: MotionLibrary) -> None:
    """On real motions, of all joints and of a few."""
    for clip in clips_of(builtin, JOG, GRAB, actor="tr")[:3]:
        for joints in (None, ("root", "lclavicle", "rclavicle", "lhipjoint", "rhipjoint", "lhand", "rhand")):
            some = clip.restricted_to(joints) if joints else clip
            corners, body = corners_of(some.skeleton), some.positions[::4]
            expected = naive.own_points_of(body.astype(np.float64), tuple(corners))  # type: ignore[arg-type]
            np.testing.assert_allclose(own_path(body, some.skeleton)[0], expected, atol=1e-9)


def test_costs_are_those_of_the_definition(builtin: MotionLibrary) -> None:
    """Of real windows by real motions, to single precision."""
    paths = [path_of(clip) for clip in clips_of(builtin, SQUAT, GRAB, JOG, DOWN, actor="bk")[::5]]
    read = np.concatenate([equal_way(path) for path in paths])
    for place, path in enumerate(paths):
        np.testing.assert_allclose(read[place], naive.at_equal_way_of(path), atol=1e-6)
    pieces = Pieces.of(read)
    expected = [[naive.cost_of(one, other) for other in read] for one in read]
    np.testing.assert_allclose(pieces.costs(pieces), expected, rtol=1e-3, atol=1e-4)
    np.testing.assert_allclose(pieces.lengths, [naive.way_of(each) for each in read], rtol=1e-4)
    shares = pieces.lengths[:, None] / pieces.lengths
    assert (pieces.as_far(pieces) == ((shares < naive.LONGER) & (shares > 1 / naive.LONGER))).all()


def test_place_heading_speed_and_rests_do_not_matter(builtin: MotionLibrary) -> None:
    """A motion costs itself next to nothing wherever it is done, at half the speed, and between rests."""
    clip = clips_of(builtin, GRAB, actor="tr")[0]
    turned = clip.positions @ Rotation.from_euler("y", 2.0).as_matrix().T + (3.0, 0.0, -2.0)
    slower = replace(clip, frame_rate=clip.frame_rate / 2)
    rests = np.concatenate([np.repeat(clip.positions[:1], 60, axis=0), clip.positions])
    one = Pieces.of(equal_way(path_of(clip)))
    for other in (replace(clip, positions=turned), slower, replace(clip, positions=rests)):
        assert float(one.costs(Pieces.of(equal_way(path_of(other))))[0, 0]) < 0.02, other
    assert float(one.costs(Pieces.of(equal_way(path_of(replace(clip, positions=turned)))))[0, 0]) < 1e-5


def test_the_other_side_is_another_motion(builtin: MotionLibrary) -> None:
    """Distances between joints cannot tell a motion from its mirror image; the own frame can."""
    clip = clips_of(builtin, GRAB, actor="tr")[0]
    one, other = (Pieces.of(equal_way(path_of(each))) for each in (clip, mirrored(clip)))
    again = Pieces.of(equal_way(path_of(clips_of(builtin, GRAB, actor="tr")[1])))
    assert float(one.costs(other)[0, 0]) > 0.9 > 3 * float(one.costs(again)[0, 0])


def test_who_lies_down_does_not_squat(builtin: MotionLibrary) -> None:
    """In the own frame both crouch and stretch; where above is tells them apart, however the feed's axes stand."""
    turn, dearer = Rotation.from_euler("xyz", (1.0, 2.0, 0.5)).as_matrix(), []
    squats = [Pieces.of(equal_way(path_of(squat))) for squat in clips_of(builtin, SQUAT)]
    for down in clips_of(builtin, DOWN):
        lying = Pieces.of(equal_way(path_of(down)))
        turned = Pieces.of(equal_way(path_of(replace(down, positions=down.positions @ turn))))
        np.testing.assert_allclose(turned.tilts, lying.tilts, atol=1e-4)
        pairs = zip(squats, [lying._replace(tilts=squat.tilts) for squat in squats], strict=True)
        dearer += [float(one.costs(lying)[0, 0] / one.costs(other)[0, 0]) for one, other in pairs]
    assert min(dearer) > 1.0
    assert np.median(dearer) > 2.0


def test_a_body_without_shoulders_is_followed_by_its_distances(sticks: MotionLibrary) -> None:
    """Joints with names of their own have courses, too; everyday movement says nothing of them."""
    assert corners_of(sticks.skeleton) is None
    assert motions.everyday(sticks.skeleton) is None
    courses = Courses.of(sticks.motions)
    assert courses.whole.ways.shape[1] == len(sticks.skeleton.pairs)
    assert set(courses.classes) == {each.class_name for each in sticks.motions if motions.has_course(each)}


def test_a_motion_that_repeats_itself_is_cut_into_rounds(builtin: MotionLibrary) -> None:
    """Four steps of jogging are rounds of two; a squat is one piece."""
    jog, squat = Courses.of(clips_of(builtin, JOG, actor="mm")[:1]), Courses.of(clips_of(builtin, SQUAT)[:1])
    assert len(jog.seconds) > 2
    assert len(squat.seconds) == 1
    assert jog.seconds.max() < 1.2


def test_limits_come_from_movement_that_must_not_be_said(builtin: MotionLibrary) -> None:
    """A gesture like a walk has a low limit, one like no everyday movement a high one; `nothing` lowers a limit."""
    squat, jog = clips_of(builtin, SQUAT, actor="tr")[0], clips_of(builtin, JOG, actor="tr")[0]
    courses = Courses.of([jog, squat])
    jogs, squats = courses.limits[0, :-1], courses.limits[0, -1]
    assert courses.classes == (JOG, SQUAT)
    assert jogs.max() < 0.3 < squats
    nothing = replace(clips_of(builtin, SQUAT, actor="tr")[1], class_name=NOTHING)
    lower = Courses.of([jog, squat, nothing])
    assert lower.classes == (JOG, SQUAT)
    windows = Pieces.of(motions.windows_of(path_of(nothing), lower.counts))
    for limit, pieces in zip(lower.limits, (lower.whole, lower.begun), strict=True):
        costs = pieces.costs(windows)[-1][pieces.as_far(windows, 2.5)[-1]]
        assert limit[-1] <= 0.85 * costs.min() + 1e-6
    assert lower.limits[0, -1] < squats


def test_directions_in_which_people_differ_count_less(builtin: MotionLibrary) -> None:
    """Three persons of every class teach it; other people's motions of a class are then nearer, relative to others."""

    def nearer(courses: Courses) -> float:
        squats = slice(courses.starts[1], None)
        between = courses.whole.costs(Pieces(*(each[squats] for each in courses.whole)))[: courses.starts[1]]
        return float(np.nanmedian(courses.crossed * courses.limits[0]) / np.median(between))

    clips = clips_of(builtin, SQUAT, GRAB)
    several = Courses.of(clips)
    two = Courses.of([replace(each, actor="ab"[each.actor in ("bd", "bk")]) for each in clips])
    own = [Courses.of([each]).whole.courses[0].reshape(POINTS - 1, -1) for each in clips]
    read = [(each.class_name, each.actor, course) for each, course in zip(clips, own, strict=True)]
    alike = several.whitening.T @ (0.6 * naive.scatter_of(read) + 0.4 * np.eye(93)) @ several.whitening
    np.testing.assert_allclose(alike, np.eye(93), atol=1e-3)
    assert two.whitening is None
    assert nearer(several) < nearer(two)


def test_few_peoples_classes_keep_their_limits_beside_others(builtin: MotionLibrary) -> None:
    """One example beside five classes of several persons: these teach the whitening, and are judged by it alone."""
    names = builtin.classes[:5]
    several = [each for name in names for each in clips_of(builtin, name)[::3]]
    one = clips_of(builtin, builtin.classes[-1])[:1]
    alone, beside = Courses.of(several), Courses.of([*several, *one])
    np.testing.assert_allclose(beside.whitening, alone.whitening, atol=1e-6)
    assert beside.beside_others == {builtin.classes[-1]}
    assert (beside.limits[0, : len(alone.seconds)] <= alone.limits[0] + 1e-6).all()
    assert (beside.limits[0, len(alone.seconds) :] <= 0.55).all()
    taught = [Courses.of([*clips_of(builtin, *names[:count]), *one]).whitening is not None for count in (1, 2)]
    assert taught == [False, True]


def test_classes_that_share_their_beginning_lower_limits() -> None:
    """Where two classes share their beginning it starts neither of them."""
    joints = Skeleton(("lclavicle", "rclavicle", "lhipjoint", "rhipjoint", "lhand"), (-1, 0, 0, 1, 0))
    rest = np.array([[0.2, 1.4, 0.0], [-0.2, 1.4, 0.0], [0.1, 0.9, 0.0], [-0.1, 0.9, 0.0], [0.3, 0.9, 0.0]])

    def gesture(name: str, *corners: tuple[float, float, float]) -> Clip:
        hand = np.concatenate([np.linspace(a, b, 30) for a, b in pairwise(corners)])
        positions = np.repeat(rest[None], len(hand), axis=0)
        positions[:, 4] = hand
        return Clip(joints, positions, 60.0, name=name, class_name=name, actor="a")

    low, high, left, front = (0.3, 0.9, 0.0), (0.3, 1.6, 0.0), (1.0, 1.6, 0.0), (0.3, 1.6, 0.7)
    alone = Courses.of([gesture("a", low, high, left)])
    both = Courses.of([gesture("a", low, high, left), gesture("b", low, high, front)])
    assert both.limits[1, 0] < 0.05 < alone.limits[1, 0]


def test_classes_without_a_course(builtin: MotionLibrary) -> None:
    """Postures and jerks have no course; a library of them has none at all, and is never done."""
    clip = clips_of(builtin, SQUAT)[0]
    held = replace(clip, positions=np.repeat(clip.positions[:1], 200, axis=0), class_name="held")
    short = replace(clip, positions=clip.positions[:20], class_name="short")
    assert motions.without_course([clip, held, short, replace(short, class_name=NOTHING)]) == ["held", "short"]
    none = Courses.of([held, short])
    assert none.classes == none.counts == ()
    assert math.isnan(none.missed_at(6.0))


def test_what_is_promised_and_missed(builtin: MotionLibrary) -> None:
    """More false alarms that are accepted miss fewer motions; one person's motions ask each other."""
    courses = Courses.of(clips_of(builtin, SQUAT, GRAB))
    missed = [courses.missed_at(each) for each in (1.0, 6.0, 60.0, 600.0)]
    assert missed == sorted(missed, reverse=True)
    assert missed[0] < 0.2
    shares = [motions.share_at(each) for each in (0.1, 1.0, 6.0, 600.0, 1e4)]
    assert shares == sorted(shares)
    by_hand = np.mean(courses.crossed[np.isfinite(courses.crossed)] > motions.share_at(6.0))
    assert courses.missed_at(6.0) == pytest.approx(by_hand)


def test_positions_between_frames_lie_on_straight_lines() -> None:
    """Whatever the frame rate."""
    times, positions = np.array([0.0, 0.1, 0.4]), np.array([[[0.0] * 3], [[1.0] * 3], [[4.0] * 3]])
    np.testing.assert_allclose(at_steps(times, positions, np.array([0.05, 0.1, 0.3]))[:, 0, 0], [0.5, 1.0, 3.0])
    assert pytest.approx(1 / 30) == STEP


def test_the_same_recordings_under_several_names_say_nothing_of_people(builtin: MotionLibrary) -> None:
    """Three names of one person's motions weigh all directions alike; the limits are numbers."""
    clips = [clips_of(builtin, name, actor="bk")[0] for name in (SQUAT, GRAB)]
    courses = Courses.of([replace(clip, actor=actor) for clip in clips for actor in "abc"])
    np.testing.assert_allclose(courses.whitening @ courses.whitening.T, np.eye(93) / 0.4, atol=1e-5)
    assert np.isfinite(courses.limits).all()
    assert (courses.limits > 0).all()
