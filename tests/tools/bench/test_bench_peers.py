"""`kinespace bench peers`: the other methods compute the right numbers, and all are judged alike."""

import numpy as np
import pytest

from kinespace.library import MotionLibrary
from kinespace.library.naming import hdm05
from kinespace.stream.frame import Frame
from kinespace.stream.recognizer import LiveSignature
from kinespace.tools.bench import peers
from kinespace.tools.bench.baselines import Alternative, TimeWarping, poses_in_body_frame
from kinespace.tools.feeding.feed import clip_cues, resampled

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def few() -> MotionLibrary:
    """Give the two shortest motions of each of two people in each of three classes."""
    whole = MotionLibrary.builtin()
    by_length = sorted(whole.motions, key=lambda motion: motion.duration)
    chosen = [
        motion
        for class_name in ("elbowToKnee1RepsLelbowStart", "kickLFront1Reps", "squat1Reps")
        for actor in ("bd", "mm")
        for motion in [each for each in by_length if (each.class_name, each.actor) == (class_name, actor)][:2]
    ]
    return MotionLibrary(whole.skeleton, tuple(chosen))


def test_every_method_finds_a_motion_of_the_library(few: MotionLibrary) -> None:
    """Shown motions that are in the library, one after the other, every method names the class at last."""
    for name, contender in peers.contenders_of(few).items():
        for motion in few.motions[::7]:
            contender.begin()
            answers = [contender.push(cue.frame) for cue in clip_cues([resampled(motion, 120.0)], "me")]
            assert next(filter(None, reversed(answers))) == motion.class_name, name


def _warped(library: MotionLibrary, poses: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> list[float]:
    """Find the cheapest paths by trying all steps, one pose after the other: textbook, slow."""
    scores = dict.fromkeys(library.classes, np.inf)
    for motion in library.motions:
        template = poses_in_body_frame(motion.positions[::2], motion.skeleton)
        costs = [np.linalg.norm(template - pose, axis=1) for pose in poses]
        paths = list(costs[0])
        for cost in costs[1:]:
            paths = [cost[place] + min(paths[max(place - 2, 0) : place + 1]) for place in range(len(template))]
        scores[motion.class_name] = min(scores[motion.class_name], min(paths) / len(poses))
    return [1 / (1 + each) for each in scores.values()]


def test_warping_finds_the_cheapest_path(few: MotionLibrary) -> None:
    """Scores equal the best of all allowed paths through each single motion, tried one by one."""
    warping = TimeWarping(few, 120.0)
    positions = MotionLibrary.builtin().motions[100].positions[:90]
    for number, each in enumerate(np.repeat(positions, 2, axis=0)):
        warping.push(Frame("me", 1.0 + number / 120, each))
    last = poses_in_body_frame(positions[::2], few.skeleton)[-30:]
    np.testing.assert_allclose(warping.scores(), _warped(few, last), rtol=1e-3)


def test_a_pose_in_the_bodys_frame_forgets_place_and_heading() -> None:
    """Turned about the vertical and shifted, a pose is the same; bent, it is another."""
    positions = MotionLibrary.builtin().motions[0].positions
    plain = poses_in_body_frame(positions, hdm05.SKELETON)
    cosine, sine = np.cos(1.1), np.sin(1.1)
    turn = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
    moved = positions @ turn.T + np.array([1.0, 0.5, -2.0])
    np.testing.assert_allclose(poses_in_body_frame(moved, hdm05.SKELETON), plain, atol=1e-9)
    assert np.abs(plain[0] - plain[len(plain) // 2]).max() > 0.05


def test_answers_come_at_every_hop_of_a_motion(few: MotionLibrary) -> None:
    """The first answer comes after half a second, then one at every hop; another motion starts the count again."""

    class Counter(Alternative):
        def entry(self, _: object, number: int) -> np.ndarray[tuple[int, ...], np.dtype[np.floating]] | None:
            return np.zeros(1) if number % 2 else None

        def scores(self) -> np.ndarray[tuple[int, ...], np.dtype[np.floating]]:
            return np.array([0.2, 0.7, 0.1])

    counter, answers = Counter(few, 120.0, 50), list[str | None]()
    for frames in (70, 62):
        counter.begin()
        answers += [counter.push(Frame("me", 1.0, np.zeros((2, 3)))) for _ in range(frames)]
    assert [index for index, answer in enumerate(answers) if answer] == [59, 63, 67, 129]
    assert set(answers) == {None, few.classes[1]}
    assert len(counter._entries) == 31  # noqa: SLF001 - every other frame of the second motion


def test_all_are_timed_and_judged(few: MotionLibrary, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ours come first with a ratio of one to themselves; none compares with a motion of the person who is played."""
    compared: list[MotionLibrary] = []
    made = peers.contenders_of
    monkeypatch.setattr(peers, "contenders_of", lambda library: (compared.append(library), made(library))[1])
    found = peers.raced(few, "bd")
    assert [library.actors for library in compared] == [("mm",)]
    assert list(found)[:2] == list(LiveSignature)
    for name, peer in found.items():
        assert peer.us_per_frame > 0
        assert (peer.ratio == 1.0) == (name == LiveSignature.WINDOWS)
        assert peer.answers > 60
        # Three classes, and people who perform the same: by chance a third would be right.
        assert 0.5 < peer.accuracy <= 1
