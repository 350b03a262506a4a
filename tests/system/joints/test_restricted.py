"""Fewer joints: a restricted library equals a library of clips without the other joints."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from performed import pushed, shown

from kinespace.library.motion_library import MotionLibrary
from kinespace.stream.recognizer import LiveSignature, Recognizer, Settings
from kinespace.tools.cli.main import main
from kinespace.tools.feeding.joint_sets import joints_of

if TYPE_CHECKING:
    from pathlib import Path

    from kinespace.library.clip import Clip
    from kinespace.stream.recognition import Recognition

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def stranger(builtin: MotionLibrary) -> tuple[Clip, ...]:
    """Give a motion of each class of the small library by a person that the library lacks."""
    names = ("kickLFront1Reps", "lieDownFloor", "squat1Reps")
    return tuple(next(m for m in builtin.motions if (m.class_name, m.actor) == (name, "bk")) for name in names)


def _answers(recognizer: Recognizer, clip: Clip) -> list[Recognition]:
    order = [clip.skeleton.joints.index(name) for name in recognizer.library.skeleton.joints]
    return pushed(recognizer, shown(clip.positions[:, order], clip.frame_rate))


def _assert_same(first: list[Recognition], second: list[Recognition]) -> None:
    assert len(first) == len(second) > 20
    for one, other in zip(first, second, strict=True):
        assert one.scores == pytest.approx(other.scores, abs=1e-3)
        assert (one.label, one.best) == (other.label, other.best)
        assert one.eigenvector_class == other.eigenvector_class


@pytest.mark.parametrize("joints", ["kinect20", "vrchat"])
@pytest.mark.parametrize("signature", LiveSignature)
def test_fewer_joints_are_as_if_there_had_never_been_more(
    small_library: MotionLibrary, stranger: tuple[Clip, ...], signature: LiveSignature, joints: str
) -> None:
    """A library restricted to 20 or 9 joints answers as one built from clips of those joints."""
    restricted = small_library.restricted_to(joints_of(joints))
    kept = restricted.skeleton.joints
    built = MotionLibrary.of_clips(clip.restricted_to(kept) for clip in small_library.motions)
    assert built.skeleton.joints == kept
    for clip in stranger:
        expected = _answers(Recognizer(built, Settings(signature=signature)), clip)
        _assert_same(_answers(Recognizer(restricted, Settings(signature=signature)), clip), expected)


def test_no_shared_joints_are_one_line(
    sticks: MotionLibrary, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A feed that shares fewer than five joints with the library is refused in one line, by both counts."""
    sticks.save(tmp_path / "sticks.npz")
    feed = ("--feed", "kinectv2", "--osc-in", "127.0.0.1:0")
    assert main(["live", "--library", str(tmp_path / "sticks.npz"), *feed]) == 2
    errors = capsys.readouterr().err
    assert errors.startswith("kinespace: joints: expected at least 5 of the library's 6")
    assert errors.count("\n") == 1
