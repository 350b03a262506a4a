"""Joints that cannot be believed: mended or left out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from kinespace.stream.frame import Frame
from kinespace.stream.recognition import Outcome
from kinespace.stream.recognizer import Recognizer
from kinespace.stream.recognizer.joints.plausibility import mirrored_places
from kinespace.tools.feeding.feed import resampled

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from kinespace.library.clip import Clip
    from kinespace.library.motion_library import MotionLibrary
    from kinespace.stream.recognition import Recognition

RATE = 30.0
ARM = ("lhumerus", "lradius", "lwrist", "lhand", "lthumb", "lfingers")


@pytest.fixture(scope="module")
def squat(small_library: MotionLibrary) -> Clip:
    """Give a squat at 30 frames a second."""
    return resampled(next(m for m in small_library.motions if m.class_name.startswith("squat")), RATE)


def _played(recognizer: Recognizer, positions: NDArray[np.float64]) -> list[Recognition]:
    frames = (Frame("p", 1 + index / RATE, each) for index, each in enumerate(positions))
    return [answer for frame in frames if (answer := recognizer.push(frame))]


def _places(library: MotionLibrary, *names: str) -> list[int]:
    return [library.skeleton.joints.index(name) for name in names]


def test_a_frozen_arm_is_done_without(small_library: MotionLibrary, squat: Clip) -> None:
    """From the first second on the squat is named without the arm, and no answer is lost."""
    positions = squat.positions.copy()
    arm = _places(small_library, *ARM)
    positions[:, arm] = positions[0, arm]
    recognizer = Recognizer(small_library)
    answers = _played(recognizer, positions)
    assert len(answers) == len(_played(Recognizer(small_library), squat.positions))
    assert all(answer.doubted == ARM for answer in answers if answer.time > 2)
    assert recognizer.doubt == f"joints: done without {', '.join(ARM)}"
    assert answers[-1].class_name == squat.class_name


def test_answers_are_implausible_until_fewer_joints_windows_are_ready(
    small_library: MotionLibrary, squat: Clip
) -> None:
    """While the windows of fewer joints are not open every hop is answered; then they hold the last seconds at once."""
    positions = squat.positions.copy()
    positions[:, _places(small_library, "lthumb")] = np.nan
    fewer = small_library.restricted_to(set(small_library.skeleton.joints) - {"lthumb"})
    whole = _played(Recognizer(fewer), np.delete(squat.positions, _places(small_library, "lthumb"), axis=1))
    index = Recognizer(fewer)._matcher._index  # noqa: SLF001 - the opener's index
    late: list[int] = []

    def opener(_: MotionLibrary, joints: tuple[str, ...]) -> object:
        assert joints == fewer.skeleton.joints
        late.append(1)
        return index if len(late) > 10 else None

    answers = _played(Recognizer(small_library, opener=opener), positions)  # type: ignore[arg-type]
    assert len(answers) == len(whole)
    assert any(answer.outcome is Outcome.IMPLAUSIBLE for answer in answers)
    assert answers[-1].scores == pytest.approx(whole[-1].scores, abs=1e-6)


def test_windows_that_cannot_be_opened_leave_the_body_implausible(small_library: MotionLibrary, squat: Clip) -> None:
    """When no library of the joints that are left can be opened, every hop is answered and none is named."""
    positions = squat.positions.copy()
    positions[:, _places(small_library, "lthumb")] = np.nan

    def opener(_: MotionLibrary, joints: tuple[str, ...]) -> None:
        raise ValueError(f"no motion shows these {len(joints)} joints")

    answers = _played(Recognizer(small_library, opener=opener), positions)
    assert answers[-1].outcome is Outcome.IMPLAUSIBLE


def test_a_joint_lost_for_a_moment_is_held(small_library: MotionLibrary, squat: Clip) -> None:
    """A hand that is lost for less than a fifth of a second changes no label."""
    positions = squat.positions.copy()
    positions[40:44, _places(small_library, "lhand", "lfingers")] = np.nan
    recognizer = Recognizer(small_library)
    answers = _played(recognizer, positions)
    expected = _played(Recognizer(small_library), squat.positions)
    assert [answer.label for answer in answers] == [answer.label for answer in expected]
    assert not recognizer.doubt


@pytest.mark.parametrize("fault", ["sides", "unit"])
def test_changes_in_mid_stream_are_corrected(small_library: MotionLibrary, squat: Clip, fault: str) -> None:
    """Sides exchanged and a unit changed from one frame on give the answers of a sound feed."""
    positions, half = squat.positions.copy(), squat.frames // 2
    mirrored = mirrored_places(small_library.skeleton.joints)
    positions[half:] = positions[half:][:, mirrored] if fault == "sides" else 1000 * positions[half:]
    answers = _played(Recognizer(small_library), positions)
    for answer, expected in zip(answers, _played(Recognizer(small_library), squat.positions), strict=True):
        assert answer.label == expected.label
        assert answer.scores == pytest.approx(expected.scores, abs=0.02)


@pytest.mark.parametrize("frames", [1, 8])
def test_of_a_body_that_jumps_nothing_is_named(small_library: MotionLibrary, squat: Clip, frames: int) -> None:
    """A body that shows two postures by turns is answered, and never with a class."""
    low = int(squat.positions[:, 0, 1].argmin())
    shown = np.where(np.arange(150) // frames % 2, low, 0)
    answers = _played(Recognizer(small_library), squat.positions[shown])
    assert {answer.outcome for answer in answers if answer.time > 2} == {Outcome.IMPLAUSIBLE}
    assert not any(answer.class_name for answer in answers)
