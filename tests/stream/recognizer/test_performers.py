"""Several performers: each recognised as if alone, followed from first frame to silence, bounded in number."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from fakes import assert_same, pushed, shown
from synthetic import STICK, STICK_CLASSES, stick_clip

from kinespace.library import MotionLibrary, SkeletonMismatchError, WindowIndex, by_joints, opened
from kinespace.stream import Announcement, Event, Frame, Performers, Recognition, Recognizer, Settings
from kinespace.stream.frame import NewSender
from kinespace.stream.recognizer import SentJoints

POSE = stick_clip("bow").positions[0]
FIVE = STICK.joints[:5]


def _frames(performer: str, class_name: str, *, frames: int = 200, start: float = 0.0) -> list[Frame]:
    return shown(stick_clip(class_name, seed=70, frames=frames).positions, begin=start, performer=performer)


def _with_joints(frames: Sequence[Frame], order: Sequence[int]) -> list[Frame]:
    return [replace(frame, positions=frame.positions[list(order)]) for frame in frames]


def _pushed(performers: Performers, frames: Iterable[Frame], arrival: float = 0.0) -> list[Recognition]:
    return [answer for frame in frames if (answer := performers.push(frame, arrival)) is not None]


def _alone(library: MotionLibrary | WindowIndex, frames: Sequence[Frame]) -> list[Recognition]:
    return pushed(Recognizer(library), frames)


def _named(order: Sequence[int]) -> tuple[str, ...]:
    return tuple(STICK.joints[place] for place in order)


def _told(events: Iterable[Event]) -> list[tuple[str, str, str]]:
    return [(event.performer, str(event.kind), event.label) for event in events]


@pytest.mark.parametrize(
    ("settings", "promised"), [(Settings(), 6.0), (Settings(false_alarms=0.0), 0.0), (Settings(signature="paper"), 0.0)]
)
def test_what_is_promised_and_missed(sticks: MotionLibrary, settings: Settings, promised: float) -> None:
    """The promise of the settings, and the library's own motions that it misses; nothing where none is said."""
    missed = opened(sticks).courses.missed_at(6.0) if promised else None
    assert Performers(sticks, settings).promise == (promised, missed)


# --- overload ----------------------------------------------------------------------------------------------------


def test_in_overload_everybody_is_answered_as_alone(sticks: MotionLibrary) -> None:
    """Compared together, some of them by fewer joints, each performer gets the answers that it gets alone."""
    names = [f"p{number}" for number in range(11)]
    feeds = {name: _frames(name, STICK_CLASSES[place % 3])[place:] for place, name in enumerate(names)}
    feeds |= {name: _with_joints(feeds[name], range(5)) for name in names[::4]}
    joined = [Announcement(name, FIVE) for name in names[::4]]

    def answered(some: Sequence[str]) -> list[Recognition]:
        performers, answers = Performers(sticks), list[Recognition]()
        performers.push_all([each for each in joined if each.performer in some], 0.0, newest_only=True)
        for begin in range(0, 180, 12):
            events = [frame for name in some for frame in feeds[name][begin : begin + 12]]
            told = performers.push_all(events, 0.0, newest_only=True)
            assert all(answer is None or answer.time == event.time for event, answer in zip(events, told, strict=True))
            answers += filter(None, told)
        return answers

    together = answered(names)
    assert {each.performer for each in together} == {*names}
    for name in names:
        own, alone = [each for each in together if each.performer == name], answered([name])
        for one, other in zip(own, alone, strict=True):
            assert (one.time, one.outcome, one.label) == (other.time, other.outcome, other.label)
            assert (one.guess_index, _told(one.events)) == (other.guess_index, _told(other.events))
            assert (one.done and one.done.label) == (other.done and other.done.label)
            # Beside others numbers are rounded otherwise.
            np.testing.assert_allclose(one.scores, other.scores, atol=1e-4)


def test_a_clock_that_jumps_leaves_no_answers_out(sticks: MotionLibrary) -> None:
    """In overload a sender of odd times must not let the counts say that nearly all answers are missing."""
    performers = Performers(sticks)
    for begin in (0.0, 1e9, -1e9, 2e9):
        performers.push_all(_frames("p", STICK_CLASSES[0], start=begin), 0.0, newest_only=True)
    assert 0 < performers.counts.recognizers.skipped < 1000


# --- joints ------------------------------------------------------------------------------------------------------


def test_joints_that_are_assumed(sticks: MotionLibrary) -> None:
    """Senders who name none have the assumed ones; announcing these later changes nothing; one may not be missing."""
    order, frames = [1, 0, 3, 2, 5, 4], _frames("p", "bow")
    performers, answers = Performers(sticks, joints=SentJoints(_named(order))), []
    for index, frame in enumerate(_with_joints(frames, order)):
        if index == 100:
            performers.announce(Announcement("p", _named(order)), 0.0)
        answers += _pushed(performers, [frame])
    assert_same(answers, _alone(sticks, frames))
    with pytest.raises(SkeletonMismatchError):
        Performers(sticks, joints=SentJoints(FIVE))


@pytest.mark.parametrize("joints", [STICK.joints[:4], ("nobody", "noone", *STICK.joints[2:]), ("x",)])
def test_frames_of_too_few_of_the_joints_are_counted(sticks: MotionLibrary, joints: tuple[str, ...]) -> None:
    """Frames with fewer than five of the library's joints are counted, not used, until enough joints are announced."""
    performers = Performers(sticks)
    performers.announce(Announcement("p", joints), 0.0)
    for size in (6, len(joints)):
        assert performers.push(Frame("p", 0.0, np.zeros((size, 3))), 0.0) is None
        assert size == len(joints) or performers.refused["p"] == f"6 joints, but {len(joints)} names were sent"
    assert performers.ordered(Frame("p", 0.0, np.zeros((7, 3)))) is None
    assert (performers.counts.other_joints, performers.counts.recognizers.frames) == (2, 0)
    assert "of them among the 6 compared, expected 5 at least" in performers.refused["p"]
    unknown = [name for name in joints if name not in STICK.joints]
    assert (f"names not known: {', '.join(unknown)}; " in performers.refused["p"]) == bool(unknown)
    performers.announce(Announcement("p", STICK.joints), 0.0)
    assert_same(_pushed(performers, _frames("p", "bow")), _alone(sticks, _frames("p", "bow")))
    assert (performers.refused, performers.counts.other_joints) == ({}, 2)


@pytest.mark.parametrize("joints", [FIVE, ("nobody", *STICK.joints[1:])])
def test_frames_of_some_of_the_joints_are_compared_by_them(sticks: MotionLibrary, joints: tuple[str, ...]) -> None:
    """A performer with a joint less is answered as by the library restricted to the others; others as before."""
    performers, sent = Performers(sticks), [STICK.joints.index(name) if name in STICK.joints else 0 for name in joints]
    performers.announce(Announcement("p", joints), 0.0)
    kept = [place for name, place in zip(joints, sent, strict=True) if name in STICK.joints]
    frames = _frames("p", "bow")
    view = by_joints(opened(sticks), [STICK.joints[place] for place in kept])
    assert_same(_pushed(performers, _with_joints(frames, sent)), _alone(view, _with_joints(frames, kept)))
    assert performers.compared == {"p": "5 of 6 joints"}
    whole = performers.ordered(_with_joints(frames, sent)[0])
    assert whole.positions[kept].tolist() == frames[0].positions[kept].tolist()
    assert_same(_pushed(performers, _frames("q", "wave")), _alone(sticks, _frames("q", "wave")))
    assert performers.refused == {}


def test_only_so_many_sets_of_joints(sticks: MotionLibrary) -> None:
    """Each set of joints costs room and time: a fourth is refused with the reason, until the others have left."""
    performers = Performers(sticks)
    fewer = [tuple(np.delete(STICK.joints, place).tolist()) for place in range(5)]
    for place, joints in enumerate(fewer):
        performers.announce(Announcement(f"p{place}", joints), 0.0)
        performers.push(Frame(f"p{place}", 0.0, POSE[:5]), 0.0)
    assert [*performers.refused] == ["p3", "p4"]
    assert performers.refused["p3"] == "5 joints, 3 performers send other sets of joints already"
    performers.drop_silent(10.0)
    performers.announce(Announcement("p3", fewer[3]), 10.0)
    assert _pushed(performers, _with_joints(_frames("p3", "bow"), [0, 1, 2, 4, 5]), 10.0)
    assert "p3" not in performers.refused


def test_a_performer_is_answered_once_the_windows_are_open(sticks: MotionLibrary) -> None:
    """Frames before are counted, with the reason; after an exchange the old windows serve unless a class is gone."""
    ready, frames = [False], _with_joints(_frames("p", "bow"), range(5))

    def views(index: WindowIndex, joints: tuple[str, ...]) -> WindowIndex | None:
        return by_joints(index, joints) if ready[0] else None

    performers = Performers(sticks, views=views)
    performers.announce(Announcement("p", FIVE), 0.0)
    performers.push(Frame("p", 0.0, POSE[:5]), 0.0)
    told = "the library is being restricted to 5 of its joints, which takes some seconds"
    assert (performers.compared, performers.refused, performers.opening) == ({"p": told}, {}, ("p",))
    assert (performers.counts.other_joints, performers.counts.opening) == (0, 1)
    ready[0] = True
    assert_same(_pushed(performers, frames), _alone(by_joints(opened(sticks), FIVE), frames))
    assert (performers.refused, performers.opening) == ({}, ())
    ready[0] = False
    performers.exchange(sticks.renamed({}))
    assert any(_pushed(performers, [replace(each, time=each.time + 10) for each in frames]))
    performers.exchange(sticks.without(classes=["bow"]))
    assert not any(_pushed(performers, [replace(each, time=each.time + 20) for each in frames]))


def test_joints_that_cannot_be_compared_are_refused_with_the_reason(sticks: MotionLibrary) -> None:
    """The error of opening is the reason why the performer's frames are refused."""

    def views(_: WindowIndex, joints: tuple[str, ...]) -> WindowIndex | None:
        raise ValueError(f"no motion has {len(joints)}")

    performers = Performers(sticks, views=views)
    performers.announce(Announcement("p", FIVE), 0.0)
    performers.push(Frame("p", 0.0, POSE[:5]), 0.0)
    assert performers.refused == {"p": "5 joints, 5 of them cannot be compared: no motion has 5"}


@pytest.mark.parametrize("named", [(), STICK.joints, (*STICK.joints, "hat")])
def test_frames_of_another_size_are_counted_and_passed_over(sticks: MotionLibrary, named: tuple[str, ...]) -> None:
    """Frames with another number of joints than were named, between valid frames, change nothing else."""
    performers, frames, answers = Performers(sticks), _frames("p", "bow"), []
    if named:
        performers.announce(Announcement("p", named), 0.0)
    size = len(named) or 6
    for index, frame in enumerate(frames):
        positions = np.vstack([frame.positions, POSE])[:size]
        wrong = Frame("p", frame.time + 0.001, np.zeros(((0, 5, 31, 13 - size)[index % 4], 3)))
        answers += _pushed(performers, [replace(frame, positions=positions), wrong])
    assert_same(answers, _alone(sticks, frames))
    assert performers.counts.other_joints == len(frames)
    why = f"but {size} names were sent" if named else "whose names were never sent, expected 6"
    assert why in performers.refused["p"]


# --- coming and going --------------------------------------------------------------------------------------------


def test_the_silent_are_dropped_and_their_counts_kept(sticks: MotionLibrary) -> None:
    """A performer that sends nothing for longer than `silence`, by arrivals, is dropped, and told once."""
    performers = Performers(sticks, silence=2.0)
    assert performers.names == ()
    performers.push(Frame("a", 900.0, POSE), 10.0)
    performers.push(Frame("b", 5.0, POSE[:2]), 10.5)
    performers.announce(Announcement("c", STICK.joints), 11.0)
    performers.drop_silent(12.0)
    assert performers.names == ("a", "b", "c")
    performers.drop_silent(12.6)
    assert performers.names == ("c",)
    assert (performers.take_gone(), performers.take_gone()) == (["a", "b"], [])
    before = performers.counts
    assert (before.dropped, before.recognizers.frames, before.other_joints) == (2, 1, 1)
    performers.push(Frame("a", 901.0, POSE), 12.7)
    assert (before.recognizers.frames, performers.counts.recognizers.frames) == (1, 2)
    performers.drop_silent(30.0)
    performers.push(Frame("c", 901.0, POSE), 30.0)
    assert performers.take_gone() == ["a"]


def test_a_performer_who_comes_back_starts_anew(sticks: MotionLibrary) -> None:
    """With an empty window, even if the frames' clock shows no gap, and with the joints announced before."""
    performers, order = Performers(sticks, silence=2.0), [3, 1, 0, 2, 5, 4]
    performers.announce(Announcement("p", _named(order)), 0.0)
    _pushed(performers, _with_joints(_frames("p", "bow"), order))
    performers.drop_silent(3.0)
    back = _frames("p", "wave", start=200 / 120)
    assert_same(_pushed(performers, _with_joints(back, order), 4.0), _alone(sticks, back))
    # A new sender by that name has other joints.
    performers.push_all([NewSender("p")], 5.0)
    assert performers.names == ()
    assert_same(_pushed(performers, back, 6.0), _alone(sticks, back))


def test_at_the_end_all_that_goes_on_is_ended_once(sticks: MotionLibrary) -> None:
    """Motions that go on end at the last frame's time, at the end or after a pause; who does nothing has no end."""
    for ending in ("end", "end_paused", "drop_silent"):
        performers = Performers(sticks)
        for name, class_name in (("a", "bow"), ("b", "wave")):
            _pushed(performers, _frames(name, class_name, frames=240, start=1.0), 1.0)
        performers.push(Frame("c", 1.0, POSE), 1.0)
        assert performers.end_paused(1.7) == performers.drop_silent(5.9) == []
        ended = getattr(performers, ending)(*(() if ending == "end" else (6.1,)))
        assert _told(ended) == [("a", "end", "bow"), ("b", "end", "wave")]
        assert [event.time for event in ended] == pytest.approx([1.0 + 239 / 120] * 2)
        assert performers.end() == []
    performers = Performers(sticks, most=1)
    _pushed(performers, _frames("a", "bow", frames=240, start=1.0), 1.0)
    performers.push(Frame("b", 1.0, POSE), 6.1)
    assert (_told(performers.drop_silent(6.2)), performers.take_gone()) == ([("a", "end", "bow")], ["a"])


def test_there_is_room_for_only_so_many(sticks: MotionLibrary) -> None:
    """Frames of one performer too many are counted and refused; the others are answered as before."""
    performers, frames, answers = Performers(sticks, most=2), _frames("a", "jump"), []
    performers.push(Frame("b", 0.0, POSE), 0.0)
    for index, frame in enumerate(frames):
        answers += _pushed(performers, [frame])
        assert performers.push(Frame(f"stranger {index}", frame.time, POSE), 0.0) is None
        performers.announce(Announcement(f"stranger {index}", STICK.joints), 0.0)
    assert_same(answers, _alone(sticks, frames))
    assert performers.names == ("b", "a")
    assert performers.counts.no_room == len(frames)


def test_the_silent_and_the_idle_make_room(sticks: MotionLibrary) -> None:
    """Who fell silent, or was not answered for a second, makes room for a newcomer that sends steadily."""
    performers = Performers(sticks, most=1, silence=2.0)
    performers.push(Frame("a", 0.0, POSE), 0.0)
    performers.push(Frame("b", 0.0, POSE), 2.0)
    assert performers.names == ("a",)
    performers.push(Frame("b", 0.0, POSE), 2.1)
    assert performers.names == ("b",)
    assert (performers.counts.no_room, performers.counts.dropped) == (1, 1)
    performers.push(Frame("b", 0.0, POSE), 3.15)
    for index in range(12):
        assert performers.names == ("b",)
        performers.push(Frame("c", index / 30, POSE), 3.2 + index / 30)
    assert (performers.names, performers.take_gone()) == (("c",), ["a", "b"])
    # Who is answered stays; a newcomer that sends now and then gets no room.
    for index, frame in enumerate(_frames("c", "bow", frames=480, start=9.0)):
        performers.push(frame, 4.0 + index / 120)
        performers.push(Frame("d", frame.time, POSE), 4.0 + index / 120)
    assert performers.names == ("c",)


# --- another library ---------------------------------------------------------------------------------------------


def test_another_library_is_everybodys(sticks: MotionLibrary, small_library: MotionLibrary) -> None:
    """Also of newcomers and of bodies with fewer joints; motions whose class is gone end; other joints are refused."""
    performers = Performers(sticks)
    performers.announce(Announcement("b", FIVE), 0.0)
    _pushed(performers, _frames("a", "bow"))
    _pushed(performers, _with_joints(_frames("b", "bow"), range(5)))
    with pytest.raises(SkeletonMismatchError):
        performers.exchange(small_library)
    assert performers.library is sticks
    fewer, order = sticks.without(classes=["bow"]), ("wave", "nope", "jump")
    assert sorted(_told(performers.exchange(fewer, order))) == [("a", "end", "bow"), ("b", "end", "bow")]
    assert (performers.classes, performers.library) == (order, fewer)
    fewer_joints = _with_joints(_frames("b", "bow", start=5.0), range(5))
    for frames in (_frames("a", "bow", start=5.0), fewer_joints, _frames("c", "bow")):
        for answer in _pushed(performers, frames):
            assert answer.classes == order
            assert answer.class_name != "bow"
    assert performers.exchange(sticks) == []
    assert performers.classes == STICK_CLASSES


def test_the_sensitivity_is_everybodys(sticks: MotionLibrary) -> None:
    """The library's usual one until another is set, also for newcomers."""
    performers = Performers(sticks)
    assert performers.sensitivity == 0.2
    performers.push(Frame("a", 0.0, POSE), 0.0)
    performers.set_sensitivity(0.35)
    performers.push(Frame("b", 0.0, POSE), 0.0)
    assert performers.sensitivity == 0.35
    assert Performers(sticks, Settings(sensitivity=0.1)).sensitivity == 0.1
    assert {each.recognizer.settings.sensitivity for each in performers._here.values()} == {0.35}  # noqa: SLF001


@pytest.mark.parametrize(("named", "n"), [("most", 0), ("most", -1), *(("silence", n) for n in (0, np.inf, np.nan))])
def test_bounds_that_make_no_sense_are_refused(sticks: MotionLibrary, named: str, n: float) -> None:
    """There is room for at least one, and silence is a positive number of seconds."""
    with pytest.raises(ValueError, match=f"{named}: expected"):
        Performers(sticks, **{named: n})  # type: ignore[arg-type]


def test_times_in_milliseconds_are_said_at_once(sticks: MotionLibrary) -> None:
    """A tenth of a second of such frames is enough; a feed that falls silent now and then is no such feed."""
    frames, performers = _frames("p", "wave"), Performers(sticks)
    _pushed(performers, [replace(frame, time=1000 * frame.time) for frame in frames[:12]])
    said = "times: expected seconds, got a gap before nearly each of 12 frames (milliseconds?)"
    assert performers.refused == performers.doubted == {"p": said}
    rare = Performers(sticks)
    _pushed(rare, [replace(frame, time=frame.time + 9 * (place // 15)) for place, frame in enumerate(frames)])
    assert rare.refused == {}
    assert rare.counts.recognizers.restarts > 10
