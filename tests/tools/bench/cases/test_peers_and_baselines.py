"""`kinespace bench peers`: the alternatives compute the right numbers, and all are judged alike."""

from __future__ import annotations

import numpy as np
import pytest

from kinespace.library import MotionLibrary, distance_rows
from kinespace.library.naming import hdm05
from kinespace.stream.frame import Frame
from kinespace.stream.recognizer import LiveSignature
from kinespace.tools.bench.cases import baselines, peers
from kinespace.tools.bench.cases.baselines import Hopping, LeadingAxis, TimeWarping, poses_in_body_frame
from kinespace.tools.feeding.feed import Cue, resampled

pytestmark = pytest.mark.slow

NAMES = ["SVD of the window", "np.cov + eigh", "DTW"]


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


@pytest.mark.parametrize("name", NAMES)
def test_every_peer_finds_a_motion_of_the_library(name: str, few: MotionLibrary) -> None:
    """Shown a motion that is in the library, everybody's best score is its class's; after a gap another one's."""
    alternative = baselines.makers(few, 120.0)[name]()
    for motion in few.motions[::7]:
        alternative.clear()
        for positions in resampled(motion, 120.0).positions:
            alternative.push(positions)
        scores = alternative.read()
        assert scores.shape == (3,)
        assert few.classes[int(np.argmax(scores))] == motion.class_name


@pytest.mark.parametrize("axis", [baselines.by_svd, baselines.by_eigh])
def test_the_axis_is_the_leading_eigenvector(axis: object, few: MotionLibrary) -> None:
    """Either way gives a vector of unit length that the covariance stretches most."""
    assert callable(axis)
    rows = distance_rows(few.motions[0].positions, few.skeleton)
    covariance = np.cov(rows, rowvar=False)
    vector = axis(rows)
    assert np.linalg.norm(vector) == pytest.approx(1.0)
    np.testing.assert_allclose(covariance @ vector, np.linalg.norm(covariance, 2) * vector, atol=1e-9)


def test_the_axis_is_compared_with_windows_as_long(few: MotionLibrary) -> None:
    """The half second that ends a window of the library scores one for its class, up to rounding."""
    alternative = LeadingAxis(few, baselines.by_svd, 60.0)
    motion = few.motions[0]
    for positions in motion.positions[:30]:
        alternative.push(positions)
    assert alternative.read()[0] == pytest.approx(1.0, abs=1e-4)


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
    for each in np.repeat(positions, 2, axis=0):
        warping.push(each)
    last = poses_in_body_frame(positions[::2], few.skeleton)[-30:]
    np.testing.assert_allclose(warping.read(), _warped(few, last), rtol=1e-3)


def test_a_pose_in_the_bodys_frame_forgets_place_and_heading() -> None:
    """Turned about the vertical and shifted, a pose is the same; bent, it is another."""
    positions = MotionLibrary.builtin().motions[0].positions
    plain = poses_in_body_frame(positions, hdm05.SKELETON)
    cosine, sine = np.cos(1.1), np.sin(1.1)
    turn = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
    moved = positions @ turn.T + np.array([1.0, 0.5, -2.0])
    np.testing.assert_allclose(poses_in_body_frame(moved, hdm05.SKELETON), plain, atol=1e-9)
    assert np.abs(plain[0] - plain[len(plain) // 2]).max() > 0.05


def test_answers_come_at_every_hop_and_anew_after_a_gap() -> None:
    """The first answer comes when enough frames have come, then one at every hop; a gap starts the count again."""

    class Counter:
        pushed = cleared = 0

        def push(self, _: object) -> None:
            self.pushed += 1

        def read(self) -> np.ndarray[tuple[int, ...], np.dtype[np.floating]]:
            return np.array([0.2, 0.7])

        def clear(self) -> None:
            self.cleared += 1

    counter = Counter()
    hopping = Hopping(counter, ("a", "b"), first=10, hop=4)
    times = [*(1 + k / 120 for k in range(30)), *(3 + k / 120 for k in range(12))]
    answers = [hopping.push(Frame("me", time, np.zeros((2, 3)))) for time in times]
    assert [index for index, answer in enumerate(answers) if answer] == [9, 13, 17, 21, 25, 29, 39]
    assert set(answers) == {None, "b"}
    assert (counter.pushed, counter.cleared) == (42, 1)


def test_answers_count_after_half_a_second_of_a_motion() -> None:
    """Earlier answers, and missing ones, do not count; later ones are right if they name the motion performed."""
    frame = Frame("me", 1.0, np.zeros((2, 3)))
    dues = [*(k / 120 for k in range(120)), *(2 + k / 120 for k in range(90))]
    piece = [Cue(due, frame, seq, "a" if due < 2 else "b") for seq, due in enumerate(dues)]
    answers = [("a" if seq % 2 else None) for seq in range(len(piece))]
    judged = peers._judged(piece, answers)  # noqa: SLF001 - decides a published figure
    assert judged == [True] * 31 + [False] * 16


def test_everybody_is_timed_and_judged(few: MotionLibrary, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ours come first with a ratio of one to themselves; all have speed and ratios, and are often right.

    Nobody compares with a motion of the person whose motions are played.
    """
    compared: list[MotionLibrary] = []
    makers, ours = baselines.makers, peers._ours  # noqa: SLF001 - watched
    monkeypatch.setattr(baselines, "makers", lambda *of: (compared.append(of[0]), makers(*of))[1])
    monkeypatch.setattr(peers, "_ours", lambda *of: (compared.append(of[0]), ours(*of))[1])
    found = peers.measure(few, person="bd", rounds=1)
    assert len(compared) == 3
    assert {library.actors for library in compared} == {("mm",)}
    assert [peer.name for peer in found.peers] == [*LiveSignature, *NAMES]
    assert (found.person, found.motions) == ("bd", 6)
    assert found.answers > 60
    for peer in found.peers:
        assert peer.frames_per_second == pytest.approx(1e6 / peer.us_per_frame)
        assert set(peer.ratios) == set(LiveSignature)
        assert all(ratio > 0 for ratio in peer.ratios.values())
        # Three classes, and people who perform the same: by chance a third would be right.
        assert 0.5 < peer.accuracy <= 1
    for signature in LiveSignature:
        own = found.peer(signature)
        assert own is not None
        assert own.ratios[signature] == 1.0
    assert found.peer("somebody") is None
