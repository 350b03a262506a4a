"""Fewer joints: a restricted library equals a library of clips without the other joints."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from kinespace.library.motion_library import MotionLibrary
from kinespace.library.skeleton import Skeleton, SkeletonMismatchError
from kinespace.library.windows.index import opened
from kinespace.stream.frame import Frame
from kinespace.stream.recognizer import LiveSignature, Recognizer, Settings
from kinespace.tools.cli.main import main
from kinespace.tools.feeding.joint_sets import joints_of

if TYPE_CHECKING:
    from pathlib import Path

    from kinespace.library.clip import Clip
    from kinespace.stream.recognition import Recognition

pytestmark = pytest.mark.slow

#: Sets of 20, 15 and 9 joints.
SETS = ("kinect20", "osceleton", "vrchat")


@pytest.fixture(scope="module", params=SETS)
def restricted(request: pytest.FixtureRequest, small_library: MotionLibrary) -> MotionLibrary:
    """Give the small library as a body of fewer joints shows it."""
    return small_library.restricted_to(joints_of(request.param))


@pytest.fixture(scope="module")
def stranger(builtin: MotionLibrary) -> tuple[Clip, ...]:
    """Give a motion of each class of the small library by a person that the library lacks."""
    names = ("kickLFront1Reps", "lieDownFloor", "squat1Reps")
    return tuple(next(m for m in builtin.motions if (m.class_name, m.actor) == (name, "bk")) for name in names)


def _answers(recognizer: Recognizer, clip: Clip) -> list[Recognition]:
    order = [clip.skeleton.joints.index(name) for name in recognizer.library.skeleton.joints]
    frames = zip(clip.times.tolist(), clip.positions[:, order], strict=True)
    return [answer for time, positions in frames if (answer := recognizer.push(Frame("p", time, positions)))]


def _assert_same(first: list[Recognition], second: list[Recognition]) -> None:
    assert len(first) == len(second) > 20
    for one, other in zip(first, second, strict=True):
        assert one.scores == pytest.approx(other.scores, abs=1e-3)
        assert (one.label, one.best) == (other.label, other.best)
        assert one.eigenvector_class == other.eigenvector_class


@pytest.mark.parametrize("signature", LiveSignature)
def test_fewer_joints_are_as_if_there_had_never_been_more(
    restricted: MotionLibrary, small_library: MotionLibrary, stranger: tuple[Clip, ...], signature: LiveSignature
) -> None:
    """A library restricted to some joints answers as one built from clips of those joints."""
    kept = restricted.skeleton.joints
    built = MotionLibrary.of_clips(clip.restricted_to(kept) for clip in small_library.motions)
    assert built.skeleton.joints == kept
    for clip in stranger:
        expected = _answers(Recognizer(built, Settings(signature=signature)), clip)
        _assert_same(_answers(Recognizer(restricted, Settings(signature=signature)), clip), expected)


def test_fewer_joints_still_name_motions(restricted: MotionLibrary, stranger: tuple[Clip, ...]) -> None:
    """With 20, 15 or 9 joints a stranger's motions are guessed right for most of their time."""
    right = [
        answer.classes[answer.best] == clip.class_name
        for clip in stranger
        for answer in _answers(Recognizer(restricted), clip)
    ]
    assert np.mean(right) > 0.7


@pytest.mark.parametrize("signature", LiveSignature)
def test_the_order_of_joints_says_nothing(
    small_library: MotionLibrary, stranger: tuple[Clip, ...], signature: LiveSignature
) -> None:
    """A library whose joints are in alphabetical order gives the same answers, with parents or without."""
    joints = tuple(sorted(small_library.skeleton.joints))[:20]
    fewer = [clip.restricted_to(joints) for clip in small_library.motions]
    theirs = fewer[0].skeleton.joints
    assert theirs != joints
    places = [theirs.index(name) for name in joints]
    parents = tuple(-1 if (p := fewer[0].skeleton.parents[k]) < 0 else joints.index(theirs[p]) for k in places)
    sorted_clips = [clip.as_of(Skeleton(joints, parents)) for clip in fewer]
    libraries = MotionLibrary.of_clips(fewer), MotionLibrary.of_clips(sorted_clips)
    assert libraries[1].skeleton.joints == joints
    for clip in stranger:
        answers = [_answers(Recognizer(library, Settings(signature=signature)), clip) for library in libraries]
        _assert_same(*answers)


def test_all_of_hdm05s_joints_get_hdm05s_order(small_library: MotionLibrary) -> None:
    """Clips whose joints are in alphabetical order build the same library as clips in the usual order."""
    joints = tuple(sorted(small_library.skeleton.joints))
    shuffled = MotionLibrary.of_clips(clip.as_of(Skeleton(joints)) for clip in small_library.motions)
    assert shuffled.skeleton.joints == small_library.skeleton.joints
    for one, other in zip(shuffled.motions, small_library.motions, strict=True):
        np.testing.assert_array_equal(one.positions, other.positions)


def test_a_restricted_library_keeps_the_learned_numbers(builtin: MotionLibrary) -> None:
    """The built-in library with fewer joints still judges by numbers learned from strangers."""
    fewer = builtin.restricted_to(joints_of("kinect20"))
    assert fewer.learned is not None
    assert builtin.learned is not None
    assert {"weights", "thresholds", "typical"} <= set(fewer.learned.arrays()) < set(builtin.learned.arrays())


def test_no_shared_joints_are_one_line(
    sticks: MotionLibrary, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A feed that shares fewer than five joints with the library is refused in one line, by both counts."""
    with pytest.raises(SkeletonMismatchError, match=r"expected at least 5 of the library's 6 \(root ... foot\), got 2"):
        sticks.restricted_to(joints_of("kinectv2"))
    sticks.save(tmp_path / "sticks.npz")
    feed = ("--feed", "kinectv2", "--osc-in", "127.0.0.1:0")
    assert main(["live", "--library", str(tmp_path / "sticks.npz"), *feed]) == 2
    errors = capsys.readouterr().err
    assert errors.startswith("kinespace: joints: expected at least 5 of the library's 6")
    assert errors.count("\n") == 1


def test_a_restricted_library_is_opened_for_its_own_joints(restricted: MotionLibrary) -> None:
    """Windows are measured over the pairs of the joints there are."""
    index = opened(restricted)
    assert index.basis.directions.shape[0] == len(restricted.skeleton.pairs)
    assert index.basis.share > 0.98
