"""Libraries of fewer joints opened in a thread."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinespace.stream.background_opener import BackgroundOpener

if TYPE_CHECKING:
    from kinespace.library.motion_library import MotionLibrary


def _waited(opener: BackgroundOpener) -> None:
    thread = opener._thread  # noqa: SLF001 - waited for, instead of asked again and again
    assert thread is not None
    thread.join()


def test_windows_are_there_once_they_are_open(sticks: MotionLibrary) -> None:
    """What is asked for is not ready at first, and the same object ever after."""
    opener, joints = BackgroundOpener(), sticks.skeleton.joints[:5]
    assert opener(sticks, joints) is None
    _waited(opener)
    index = opener(sticks, joints)
    assert index is not None
    assert index.library.skeleton.joints == joints
    assert opener(sticks, joints) is index


def test_only_so_many_stay_open(sticks: MotionLibrary) -> None:
    """The one that was asked for longest ago is forgotten."""
    opener, joints = BackgroundOpener(most=1), sticks.skeleton.joints
    for chosen in (joints[:5], joints[1:]):
        assert opener(sticks, chosen) is None
        _waited(opener)
    assert opener(sticks, joints[1:]) is not None
    assert opener(sticks, joints[:5]) is None


def test_a_library_that_cannot_be_opened_is_not_tried_again(sticks: MotionLibrary) -> None:
    """With too few joints nothing is opened, and no thread is started for it a second time."""
    opener, joints = BackgroundOpener(), sticks.skeleton.joints[:3]
    assert opener(sticks, joints) is None
    _waited(opener)
    tried = opener._thread  # noqa: SLF001 - the same one as before
    assert opener(sticks, joints) is None
    assert opener._thread is tried  # noqa: SLF001 - as above
