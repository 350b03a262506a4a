"""Kept answers to whole feeds; and a feed that is changed as must not matter gets the same answers."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from answers import FEEDS, RECORDED, differing, frames_of, kept, summed_up
from fakes import assert_same, pushed
from scipy.spatial.transform import Rotation

from kinespace.library import Clip, MotionLibrary
from kinespace.stream import Announcement, Frame, LiveSignature, Performers, Recognition, Recognizer, Settings

pytestmark = pytest.mark.slow

Feed = list[Frame]
Answers = Sequence[Recognition]

CLASSES = ("kickLFront1Reps", "squat1Reps", "throwBasketball")


@pytest.fixture(scope="module")
def clips(some_clips: tuple[Clip, ...]) -> list[Clip]:
    """Give motions of two known classes and of an unknown one."""
    return [clip for clip in some_clips if clip.class_name in CLASSES]


@pytest.fixture(scope="module")
def feed(clips: list[Clip]) -> Feed:
    """Show them one after another at 64 frames a second, whose times have no rounding, with pauses between."""
    return [*frames_of(clips, 64.0, pause=0.390625)]


def _settings(signature: LiveSignature) -> Settings:
    return Settings(signature=signature, progress=signature is LiveSignature.WINDOWS)


def _assert_alike(first: Sequence[Recognition], second: Sequence[Recognition], within: float) -> None:
    """Demand the same words, and numbers that differ by rounding."""
    assert len(first) == len(second) > 0
    for one, other in zip(first, second, strict=True):
        np.testing.assert_allclose(one.scores, other.scores, atol=within)
        assert (one.label, one.guess, one.doubted) == (other.label, other.guess, other.doubted)
        assert [(each.kind, each.label) for each in one.events] == [(each.kind, each.label) for each in other.events]
        assert (one.movement, one.share) == pytest.approx((other.movement, other.share), abs=within)
        if one.progress and other.progress:
            for name in ("phase", "speed", "amplitude", "sure"):
                assert getattr(one.progress, name) == pytest.approx(getattr(other.progress, name), abs=20 * within)


def _moved(change: Callable[[np.ndarray], np.ndarray]) -> Callable[[Feed], Feed]:
    return lambda feed: [replace(frame, positions=change(frame.positions)) for frame in feed]


TURN = Rotation.from_rotvec([0.3, -1.1, 0.4]).as_matrix()
#: Changes of all frames that change no answer, and how far numbers may differ.
CHANGES: dict[str, tuple[Callable[[Feed], Feed], float]] = {
    "turned": (_moved(lambda positions: positions @ TURN.T), 1e-3),
    "shifted": (_moved(lambda positions: positions + np.array([3.0, -1.0, 20.0])), 1e-3),
    "a tall body": (_moved(lambda positions: 1.3 * positions), 1e-3),
    "an hour later": (lambda feed: [replace(frame, time=frame.time + 4096.0) for frame in feed], 1e-3),
    "in single precision": (_moved(lambda positions: positions.astype(np.float32).astype(np.float64)), 5e-3),
}


@pytest.fixture(scope="module", params=LiveSignature)
def asked(request: pytest.FixtureRequest, small_library: MotionLibrary, feed: Feed) -> tuple[Settings, Answers]:
    """Give each signature's settings, and the answers to the feed as it is."""
    settings = _settings(request.param)
    return settings, pushed(Recognizer(small_library, settings), feed)


@pytest.mark.parametrize("change", CHANGES)
def test_what_may_vary(small_library: MotionLibrary, feed: Feed, asked: tuple[Settings, Answers], change: str) -> None:
    """A body's place, heading and size, the clock's zero and rounding change no word."""
    (changed, within), (settings, first) = CHANGES[change], asked
    _assert_alike(first, pushed(Recognizer(small_library, settings), changed(feed)), within)


@pytest.mark.parametrize("signature", LiveSignature)
def test_a_mirror_image_is_answered_alike(small_library: MotionLibrary, feed: Feed, signature: LiveSignature) -> None:
    """To the last bit: distances know no left and right. Courses do: what starts and is done may differ."""
    mirrored = _moved(lambda positions: positions * [-1.0, 1.0, 1.0])(feed)
    settings = replace(_settings(signature), progress=False)
    answers = [pushed(Recognizer(small_library, settings), each) for each in (feed, mirrored)]
    assert_same(*answers, "events", "done", "seen")


def test_asked_twice_answered_alike(small_library: MotionLibrary, feed: Feed, asked: tuple[Settings, Answers]) -> None:
    """After a reset, to the last bit; without one after a restart; and frames that come late change nothing."""
    settings, first = asked
    recognizer = Recognizer(small_library, settings)
    assert_same(pushed(recognizer, feed), first)
    recognizer.end()
    recognizer.reset()
    assert_same(pushed(recognizer, feed), first)
    assert (recognizer.counts.restarts, recognizer.counts.hops) == (0, 2 * len(first))
    recognizer.end()
    assert_same(pushed(recognizer, feed), first)
    assert recognizer.counts.restarts == 1
    generator, again, answers = np.random.default_rng(2), Recognizer(small_library, settings), []
    for frame in feed:
        answers += pushed(again, [frame])
        for _ in range(int(generator.integers(0, 4))):
            late = frame.time - generator.uniform(0.0, 0.4)
            assert again.push(Frame("ann", late, generator.normal(size=(31, 3)))) is None
    assert_same(answers, first)
    assert again.counts.out_of_order > len(feed)


def test_frames_are_neither_changed_nor_kept(small_library: MotionLibrary, feed: Feed) -> None:
    """Positions may be overwritten once they are pushed, as in a receiver's one buffer; answers stay."""
    expected = pushed(Recognizer(small_library), feed)
    recognizer, buffer, answers, scores = Recognizer(small_library), np.empty((31, 3)), [], []
    for frame in feed:
        buffer[:] = frame.positions
        newest = pushed(recognizer, [replace(frame, positions=buffer)])
        assert np.array_equal(buffer, frame.positions)
        answers += newest
        scores += [answer.scores.copy() for answer in newest]
        buffer[:] = 1e6
    assert_same(answers, expected)
    assert all(np.array_equal(answer.scores, before) for answer, before in zip(answers, scores, strict=True))


def test_interleaved_performers_get_the_answers_they_get_alone(small_library: MotionLibrary, clips: list[Clip]) -> None:
    """Frames mixed by chance, joints in other orders, other names, one by one, bit for bit, or several at once."""
    feeds = {f"person {place}": [*frames_of([clip], 60.0)] for place, clip in enumerate(clips)}
    alone = {name: pushed(Recognizer(small_library), feed) for name, feed in feeds.items()}
    joints, generator = small_library.skeleton.joints, np.random.default_rng(14)
    orders = {name: generator.permutation(len(joints)) for name in feeds}
    turns = generator.permutation(np.repeat(list(feeds), [len(feed) for feed in feeds.values()])).tolist()
    sent = list[Frame | Announcement]()
    for name, order in orders.items():
        sent.append(Announcement(name, tuple(joints[place] for place in order)))
    places = dict.fromkeys(feeds, 0)
    for name in turns:
        frame = feeds[name][places[name]]
        sent.append(replace(frame, performer=name, positions=frame.positions[orders[name]]))
        places[name] += 1
    for together in (1, 7):
        performers, mixed = Performers(small_library), {name: list[Recognition]() for name in feeds}
        for begin in range(0, len(sent), together):
            for answer in performers.push_all(sent[begin : begin + together], 0.0):
                if answer is not None:
                    mixed[answer.performer].append(answer)
        for name, answers in mixed.items():
            anns = [
                replace(
                    answer,
                    performer="ann",
                    done=answer.done and replace(answer.done, performer="ann"),
                    events=tuple(replace(event, performer="ann") for event in answer.events),
                )
                for answer in answers
            ]
            assert_same(anns, alone[name], within=1e-4 if together > 1 else 0.0)


@pytest.mark.parametrize("feed", FEEDS | RECORDED)
def test_feeds_are_answered_as_ever(feed: str, request: pytest.FixtureRequest) -> None:
    """Words, events and the means of the numbers are the kept ones."""
    found = FEEDS[feed]() if feed in FEEDS else RECORDED[feed](request.getfixturevalue("data_folder"))
    assert not differing(kept()[feed], summed_up(found))
