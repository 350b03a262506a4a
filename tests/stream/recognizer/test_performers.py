"""Several performers: each recognised as if alone, followed from first frame to silence, bounded in number."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic import STICK, STICK_CLASSES, stick_clip

from kinespace.stream.frame import Announcement, Frame
from kinespace.stream.recognizer import Performers, Recognizer, SentJoints, Settings

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.library.motion_library import MotionLibrary
    from kinespace.stream.recognition import Recognition

POSE = stick_clip("bow").positions[0]


@pytest.fixture(scope="module")
def library(sticks: MotionLibrary) -> MotionLibrary:
    """Give the library of these tests."""
    return sticks


def _frames(performer: str, class_name: str, *, frames: int = 200, start: float = 0.0) -> list[Frame]:
    positions = stick_clip(class_name, seed=70, frames=frames).positions
    return [Frame(performer, start + index / 120, each) for index, each in enumerate(positions)]


def _reordered(frames: Sequence[Frame], order: Sequence[int]) -> list[Frame]:
    return [dataclasses.replace(frame, positions=frame.positions[list(order)]) for frame in frames]


def _pushed(performers: Performers, frames: Sequence[Frame], arrival: float = 0.0) -> list[Recognition]:
    return [answer for frame in frames if (answer := performers.push(frame, arrival)) is not None]


def _alone(library: MotionLibrary, frames: Sequence[Frame]) -> list[Recognition]:
    recognizer = Recognizer(library)
    return [answer for frame in frames if (answer := recognizer.push(frame)) is not None]


def _assert_same(first: Sequence[Recognition], second: Sequence[Recognition]) -> None:
    """Demand the same answers, number for number."""
    assert len(first) == len(second) > 0
    for one, other in zip(first, second, strict=True):
        assert np.array_equal(one.scores, other.scores)
        assert (one.performer, one.time, one.label) == (other.performer, other.time, other.label)


# --- each as if alone --------------------------------------------------------------------------------------------


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=10)
def test_interleaved_feeds_are_recognised_as_if_alone(library: MotionLibrary, seed: int) -> None:
    """The frames of several performers are mixed in any way; each performer gets the answers of a feed alone."""
    generator = np.random.default_rng(seed)
    feeds = {name: _frames(name, name, start=100.0 * place) for place, name in enumerate(STICK_CLASSES)}
    turns = generator.permutation(np.repeat(STICK_CLASSES, 200)).tolist()
    waiting = {name: iter(feed) for name, feed in feeds.items()}
    performers = Performers(library)
    answers = _pushed(performers, [next(waiting[name]) for name in turns])
    assert set(performers.names) == set(STICK_CLASSES)
    for name, feed in feeds.items():
        _assert_same([answer for answer in answers if answer.performer == name], _alone(library, feed))
    assert performers.counts.recognizers.frames == 600
    assert performers.counts.recognizers.hops == len(answers)


@pytest.mark.slow
@given(seed=st.integers(0, 2**32 - 1), most=st.sampled_from([1, 4, 40]))
@settings(max_examples=15)
def test_batches_are_recognised_like_single_frames(library: MotionLibrary, seed: int, most: int) -> None:
    """Frames and announcements in batches of any sizes get the answers of frames one by one."""
    generator = np.random.default_rng(seed)
    order = [5, 4, 3, 2, 1, 0]
    reordered = Announcement("bow", tuple(STICK.joints[index] for index in order))
    feeds: dict[str, list[Frame | Announcement]] = {
        name: list(_frames(name, name, frames=260, start=100.0 * place)) for place, name in enumerate(STICK_CLASSES)
    }
    feeds["bow"] = [*feeds["bow"][:90], reordered, *_reordered(_frames("bow", "bow", frames=260)[90:], order)]
    turns = [name for name, feed in feeds.items() for _ in feed]
    generator.shuffle(turns)
    waiting = {name: iter(feed) for name, feed in feeds.items()}
    events = [next(waiting[name]) for name in turns]
    together, single = Performers(library), Performers(library)
    found: list[Recognition | None] = []
    while len(found) < len(events):
        size = int(generator.integers(0, most + 1))
        answers = together.push_all(events[len(found) : len(found) + size], 0.0)
        assert len(answers) == min(size, len(events) - len(found))
        found += answers
    for event, answer in zip(events, found, strict=True):
        if isinstance(event, Announcement):
            single.announce(event, 0.0)
            assert answer is None
            continue
        expected = single.push(event, 0.0)
        assert (answer is None) == (expected is None)
        if answer is not None and expected is not None:
            assert answer.scores == pytest.approx(expected.scores, abs=1e-6)
            assert (answer.performer, answer.time, answer.label) == (event.performer, event.time, expected.label)
    assert together.counts == single.counts
    assert together.counts.recognizers.hops > 50


def test_the_settings_are_every_recognisers(library: MotionLibrary) -> None:
    """Settings hold for every performer: with a hop of 0 every frame after the first window is answered."""
    performers = Performers(library, Settings(hop=0))
    for name in ("a", "b"):
        assert len(_pushed(performers, _frames(name, "jump"))) == 200 - 18


# --- joints ------------------------------------------------------------------------------------------------------


def test_joints_may_come_in_any_order(library: MotionLibrary) -> None:
    """A feed that announces its joints in another order, with some more among them, gets the same answers."""
    frames = _frames("p", "wave")
    order = [5, 2, 0, 4, 1, 3]
    names = ["tail", *(STICK.joints[index] for index in order), "hat"]
    mixed = [
        dataclasses.replace(frame, positions=np.vstack([[[9.0, 9.0, 9.0]], frame.positions[order], POSE[:1]]))
        for frame in frames
    ]
    performers = Performers(library)
    performers.announce(Announcement("p", tuple(names)), 0.0)
    _assert_same(_pushed(performers, mixed), _alone(library, frames))


def test_an_announced_order_outlives_a_silence(library: MotionLibrary) -> None:
    """Joints said once, before a silence in which the performer was dropped, still hold for the frames after it."""
    order = list(range(len(STICK.joints)))[::-1]
    performers = Performers(library, silence=1.0)
    performers.announce(Announcement("a", tuple(STICK.joints[index] for index in order)), 0.0)
    performers.drop_silent(10.0)
    assert performers.names == ()
    answers = _pushed(performers, _reordered(_frames("a", "bow"), order), 10.0)
    _assert_same(answers, _alone(library, _frames("a", "bow")))


def test_announcements_of_strangers_do_not_pile_up(library: MotionLibrary) -> None:
    """Announcements under ever new names are remembered up to a limit."""
    performers = Performers(library, most=2, silence=1.0)
    order = list(range(len(STICK.joints)))[::-1]
    backwards = tuple(STICK.joints[index] for index in order)
    for stranger in range(100):
        performers.announce(Announcement(f"s{stranger}", backwards), 2.0 * stranger)
    performers.drop_silent(1000.0)
    answers = _pushed(performers, _frames("s0", "bow"), 1000.0)
    _assert_same(answers, _alone(library, _frames("s0", "bow")))


def test_without_an_announcement_the_skeletons_own_order_is_assumed(library: MotionLibrary) -> None:
    """Frames of the right number of joints are taken as the library's skeleton, announced so or not."""
    frames = _frames("p", "wave")
    _assert_same(_pushed(Performers(library), frames), _alone(library, frames))
    announced = Performers(library)
    announced.announce(Announcement("p", STICK.joints), 0.0)
    _assert_same(_pushed(announced, frames), _alone(library, frames))


@pytest.mark.parametrize("before", [0, 150])
def test_announcing_the_assumed_joints_changes_nothing(library: MotionLibrary, before: int) -> None:
    """Announcing the assumed joints, at any moment and repeatedly, does not change the window."""
    frames = _frames("p", "jump")
    performers, answers = Performers(library), []
    for index, frame in enumerate(frames):
        if index >= before:
            performers.announce(Announcement("p", STICK.joints), 0.0)
        answers += _pushed(performers, [frame])
    _assert_same(answers, _alone(library, frames))


def test_a_repeated_announcement_changes_nothing(library: MotionLibrary) -> None:
    """Another order, announced every second as senders do, begins no new window."""
    order = [3, 1, 0, 2, 5, 4]
    frames = _frames("p", "wave")
    performers, answers = Performers(library), []
    for frame in _reordered(frames, order):
        performers.announce(Announcement("p", tuple(STICK.joints[index] for index in order)), 0.0)
        answers += _pushed(performers, [frame])
    _assert_same(answers, _alone(library, frames))


def test_other_joints_begin_a_new_window(library: MotionLibrary) -> None:
    """Once other joints are announced the window holds only frames that came after, in the new order."""
    performers = Performers(library)
    first = _pushed(performers, _frames("p", "bow"))
    order = [1, 0, 3, 2, 5, 4]
    performers.announce(Announcement("p", tuple(STICK.joints[index] for index in order)), 0.0)
    after = _frames("p", "wave", start=200 / 120)
    answers = _pushed(performers, _reordered(after, order))
    assert {answer.label for answer in first} == {"bow"}
    _assert_same(answers, _alone(library, after))


def test_one_performers_joints_are_not_anothers(library: MotionLibrary) -> None:
    """An announcement holds for its own performer's frames only."""
    performers = Performers(library)
    performers.announce(Announcement("a", STICK.joints[::-1]), 0.0)
    frames = _frames("b", "jump")
    _assert_same(_pushed(performers, frames), _alone(library, frames))


@pytest.mark.parametrize("joints", [STICK.joints[:4], ("nobody", "noone", *STICK.joints[2:]), ("x",)])
def test_frames_of_too_few_of_the_joints_are_counted(library: MotionLibrary, joints: tuple[str, ...]) -> None:
    """Frames with fewer than five of the library's joints are counted, not used, until enough joints are announced."""
    performers = Performers(library)
    performers.announce(Announcement("p", joints), 0.0)
    assert performers.push(Frame("p", 0.0, np.zeros((len(joints), 3))), 0.0) is None
    assert performers.push(Frame("p", 0.1, np.zeros((6, 3))), 0.0) is None
    assert (performers.counts.other_joints, performers.counts.recognizers.frames) == (2, 0)
    assert "of them among the 6 compared, expected 5 at least" in performers.refused["p"]
    performers.announce(Announcement("p", STICK.joints), 0.0)
    frames = _frames("p", "bow")
    _assert_same(_pushed(performers, frames), _alone(library, frames))
    assert performers.counts.other_joints == 2


@pytest.mark.parametrize("joints", [STICK.joints[:5], ("nobody", *STICK.joints[1:])])
def test_frames_of_some_of_the_joints_are_compared_by_them(library: MotionLibrary, joints: tuple[str, ...]) -> None:
    """A performer with a joint less is answered as by the library restricted to the others."""
    performers = Performers(library)
    performers.announce(Announcement("p", joints), 0.0)
    there = [place for place, name in enumerate(STICK.joints) if name in joints]
    frames = _frames("p", "bow")
    kept = [dataclasses.replace(each, positions=each.positions[there]) for each in frames]
    foreign = [np.full((len(joints) - len(there), 3), 9.0)] * len(frames)
    sent = [
        dataclasses.replace(each, positions=np.vstack([nobody, each.positions]))
        for each, nobody in zip(kept, foreign, strict=True)
    ]
    _assert_same(_pushed(performers, sent), _alone(library.restricted_to(joints), kept))
    assert performers.compared == {"p": "5 of 6 joints"}
    _assert_same(_pushed(performers, _frames("q", "wave")), _alone(library, _frames("q", "wave")))
    assert (performers.refused, performers.counts.recognizers.frames) == ({}, 2 * len(frames))


def test_other_joints_end_the_motion(library: MotionLibrary) -> None:
    """When a sender names other joints during a motion, the motion ends."""
    performers = Performers(library)
    answers = _pushed(performers, _frames("p", "bow"))
    started = [event for answer in answers for event in answer.events]
    performers.announce(Announcement("p", STICK.joints[:5]), 0.0)
    ended = performers.drop_silent(0.0)
    assert [(event.kind, event.label) for event in (*started, *ended)] == [("start", "bow"), ("end", "bow")]


def test_only_so_many_sets_of_joints(library: MotionLibrary) -> None:
    """Each set of joints costs room and time: a fourth is refused with the reason, until the others have left."""
    performers = Performers(library)
    for place in range(5):
        performers.announce(Announcement(f"p{place}", tuple(np.delete(STICK.joints, place).tolist())), 0.0)
        performers.push(Frame(f"p{place}", 0.0, POSE[:5]), 0.0)
    assert [*performers.refused] == ["p3", "p4"]
    assert performers.refused["p3"] == "5 joints, 3 performers send other sets of joints already"
    performers.drop_silent(10.0)
    performers.announce(Announcement("p3", tuple(np.delete(STICK.joints, 3).tolist())), 10.0)
    assert _pushed(performers, _reordered(_frames("p3", "bow"), [0, 1, 2, 4, 5]), 10.0)
    assert "p3" not in performers.refused


def test_a_performer_is_answered_once_the_library_is_ready(library: MotionLibrary) -> None:
    """Frames before the restricted library is ready are counted, with the reason; later frames are answered."""
    ready = [False]

    def restricter(whole: MotionLibrary, joints: tuple[str, ...]) -> MotionLibrary | None:
        return whole.restricted_to(joints) if ready[0] else None

    performers = Performers(library, joints=SentJoints(restricter=restricter))
    performers.announce(Announcement("p", STICK.joints[:5]), 0.0)
    performers.push(Frame("p", 0.0, POSE[:5]), 0.0)
    told = "the library is being restricted to 5 of its joints, which takes some seconds"
    assert (performers.compared, performers.refused) == ({"p": told}, {})
    assert performers.counts.other_joints == 1
    ready[0] = True
    frames = [dataclasses.replace(each, positions=each.positions[:5]) for each in _frames("p", "bow")]
    _assert_same(_pushed(performers, frames), _alone(library.restricted_to(STICK.joints[:5]), frames))
    assert performers.refused == {}
    # Meanwhile the library before serves, unless it has a class that is gone.
    ready[0] = False
    performers.exchange(library.renamed({}))
    assert any(_pushed(performers, [dataclasses.replace(each, time=each.time + 10) for each in frames]))
    performers.exchange(library.without(classes=["bow"]))
    assert not any(_pushed(performers, [dataclasses.replace(each, time=each.time + 20) for each in frames]))


def test_joints_that_cannot_be_compared_are_refused_with_the_reason(library: MotionLibrary) -> None:
    """The restricter's error is the reason why the performer's frames are refused."""

    def restricter(_: MotionLibrary, joints: tuple[str, ...]) -> MotionLibrary | None:
        raise ValueError(f"no motion has {len(joints)}")

    performers = Performers(library, joints=SentJoints(restricter=restricter))
    performers.announce(Announcement("p", STICK.joints[:5]), 0.0)
    performers.push(Frame("p", 0.0, POSE[:5]), 0.0)
    assert performers.refused == {"p": "5 joints, 5 of them cannot be compared: no motion has 5"}


@pytest.mark.parametrize("announced", [False, True])
@pytest.mark.parametrize("joints", [0, 5, 7, 31])
def test_frames_of_another_size_are_counted_and_passed_over(
    library: MotionLibrary, joints: int, *, announced: bool
) -> None:
    """Frames with another number of joints, between valid frames, are counted and change nothing else."""
    performers = Performers(library)
    if announced:
        performers.announce(Announcement("p", STICK.joints), 0.0)
    frames = _frames("p", "bow")
    answers = []
    for frame in frames:
        answers += _pushed(performers, [frame, Frame("p", frame.time + 0.001, np.zeros((joints, 3)))])
    _assert_same(answers, _alone(library, frames))
    assert performers.counts.other_joints == len(frames)


def test_a_larger_announced_body_does_not_pass_as_the_assumed_one(library: MotionLibrary) -> None:
    """A sender that announced eight joints and sends six has its frames refused: which six is not known."""
    performers = Performers(library)
    performers.announce(Announcement("p", (*STICK.joints, "hat", "tail")), 0.0)
    assert performers.push(Frame("p", 0.0, POSE), 0.0) is None
    assert performers.push(Frame("p", 0.1, np.vstack([POSE, POSE[:2]])), 0.0) is None
    assert (performers.counts.other_joints, performers.counts.recognizers.frames) == (1, 1)


# --- coming and going --------------------------------------------------------------------------------------------


def test_performers_come_with_their_first_frame_or_announcement(library: MotionLibrary) -> None:
    """Performers are followed, in the order in which they were first heard of."""
    performers = Performers(library)
    assert (len(performers), performers.names) == (0, ())
    performers.push(Frame("b", 0.0, POSE), 0.0)
    performers.announce(Announcement("a", STICK.joints), 0.0)
    performers.push(Frame("b", 0.1, POSE), 0.0)
    assert (len(performers), performers.names) == (2, ("b", "a"))


def test_the_silent_are_dropped_and_their_counts_kept(library: MotionLibrary) -> None:
    """A performer that is silent for longer than `silence`, by arrivals, is dropped; the counts stay."""
    performers = Performers(library, silence=2.0)
    performers.push(Frame("a", 900.0, POSE), 10.0)
    performers.push(Frame("b", 5.0, POSE), 10.5)
    performers.announce(Announcement("c", STICK.joints), 11.0)
    performers.drop_silent(12.0)
    assert performers.names == ("a", "b", "c")
    performers.drop_silent(12.6)
    assert performers.names == ("c",)
    assert performers.counts.dropped == 2
    assert performers.counts.recognizers.frames == 2
    performers.push(Frame("a", 901.0, POSE), 12.7)
    assert performers.counts.recognizers.frames == 3


def test_at_the_end_all_that_goes_on_is_ended_once(library: MotionLibrary) -> None:
    """Motions that go on end at the last frame's time; a performer without a motion has no end."""
    performers = Performers(library)
    for name, class_name in (("a", "bow"), ("b", "wave")):
        positions = stick_clip(class_name, seed=81, frames=240).positions
        for index, each in enumerate(positions):
            performers.push(Frame(name, 1.0 + index / 120, each), index / 120)
    performers.push(Frame("c", 1.0, POSE), 2.0)
    ended = performers.end()
    assert [(event.performer, str(event.kind), event.label) for event in ended] == [
        ("a", "end", "bow"),
        ("b", "end", "wave"),
    ]
    assert [event.time for event in ended] == pytest.approx([1.0 + 239 / 120] * 2)
    assert performers.end() == []


@pytest.mark.parametrize("heard", ["frames", "announcements", "bad frames"])
def test_an_active_performer_is_not_dropped(library: MotionLibrary, heard: str) -> None:
    """Any packet of a performer, used or not, breaks the silence."""
    performers = Performers(library, silence=2.0)
    for second in range(10):
        if heard == "announcements":
            performers.announce(Announcement("p", STICK.joints), float(second))
        else:
            performers.push(Frame("p", 1.0, POSE if heard == "frames" else POSE[:2]), float(second))
        performers.drop_silent(second + 1.5)
        assert performers.names == ("p",)
    performers.drop_silent(12.0)
    assert performers.names == ()


def test_a_performer_who_comes_back_starts_anew(library: MotionLibrary) -> None:
    """A performer who was dropped starts with an empty window, even if the frames' own clock shows no gap."""
    performers = Performers(library, silence=2.0)
    first = _frames("p", "bow")
    _pushed(performers, first, arrival=0.0)
    performers.drop_silent(3.0)
    back = _frames("p", "wave", start=200 / 120)
    _assert_same(_pushed(performers, back, arrival=4.0), _alone(library, back))


def test_there_is_room_for_only_so_many(library: MotionLibrary) -> None:
    """Frames of one performer too many are counted and refused; the others are answered as before."""
    performers = Performers(library, most=2)
    frames = _frames("a", "jump")
    performers.push(Frame("b", 0.0, POSE), 0.0)
    answers = []
    for index, frame in enumerate(frames):
        answers += _pushed(performers, [frame])
        assert performers.push(Frame(f"stranger {index}", frame.time, POSE), 0.0) is None
        performers.announce(Announcement(f"stranger {index}", STICK.joints), 0.0)
    _assert_same(answers, _alone(library, frames))
    assert performers.names == ("b", "a")
    assert performers.counts.no_room == len(frames)


def test_the_silent_make_room(library: MotionLibrary) -> None:
    """When there is no room, a performer that fell silent makes room for a newcomer."""
    performers = Performers(library, most=1, silence=2.0)
    performers.push(Frame("a", 0.0, POSE), 0.0)
    performers.push(Frame("b", 0.0, POSE), 2.0)
    assert performers.names == ("a",)
    performers.push(Frame("b", 0.0, POSE), 2.1)
    assert performers.names == ("b",)
    assert (performers.counts.no_room, performers.counts.dropped) == (1, 1)


def test_the_counts_are_a_copy(library: MotionLibrary) -> None:
    """Counts that were read do not change later, and reading them changes nothing."""
    performers = Performers(library)
    performers.push(Frame("a", 0.0, POSE), 0.0)
    before = performers.counts
    performers.push(Frame("a", 1.0, np.zeros((2, 3))), 0.0)
    performers.push(Frame("a", 1.0, POSE), 0.0)
    assert (before.recognizers.frames, before.other_joints) == (1, 0)
    assert performers.counts == performers.counts
    assert (performers.counts.recognizers.frames, performers.counts.other_joints) == (2, 1)


@pytest.mark.parametrize(
    ("most", "silence", "named"),
    [(0, 5.0, "most"), (-1, 5.0, "most"), (1, 0.0, "silence"), (1, np.inf, "silence"), (1, np.nan, "silence")],
)
def test_bounds_that_make_no_sense_are_refused(library: MotionLibrary, most: int, silence: float, named: str) -> None:
    """There is room for at least one, and silence is a positive number of seconds."""
    with pytest.raises(ValueError, match=f"{named}: expected"):
        Performers(library, most=most, silence=silence)
