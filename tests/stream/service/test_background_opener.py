"""Libraries of fewer joints prepared in a thread."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from kinespace.stream.recognizer import Settings
from kinespace.stream.service.background_opener import BackgroundOpener, background_restricter, background_windows

if TYPE_CHECKING:
    from kinespace.library.motion_library import MotionLibrary


def _wait(opener: BackgroundOpener[Any]) -> None:
    thread = opener._thread  # noqa: SLF001 - the test waits for the thread instead of asking again and again
    assert thread is not None
    thread.join()


def test_windows_are_given_once_they_are_open(sticks: MotionLibrary) -> None:
    """Windows that were asked for are not ready at first; later the opener gives the same object every time."""
    opener, joints = background_windows(), sticks.skeleton.joints[:5]
    assert opener(sticks, joints) is None
    _wait(opener)
    index = opener(sticks, joints)
    assert index is not None
    assert index.library.skeleton.joints == joints
    assert opener(sticks, joints) is index


def test_a_library_is_restricted_for_a_recogniser(sticks: MotionLibrary) -> None:
    """The restricted library holds the joints asked for."""
    restricter, joints = background_restricter(Settings()), sticks.skeleton.joints[:5]
    assert restricter(sticks, joints) is None
    _wait(restricter)
    restricted = restricter(sticks, joints)
    assert restricted is not None
    assert restricted.skeleton.joints == joints


def test_only_so_many_are_kept(sticks: MotionLibrary) -> None:
    """The opener forgets the library that was asked for longest ago."""
    opener, joints = BackgroundOpener(lambda _, joints: len(joints), most=1), sticks.skeleton.joints
    for chosen in (joints[:5], joints):
        assert opener(sticks, chosen) is None
        _wait(opener)
    assert opener(sticks, joints) == len(joints)
    assert opener(sticks, joints[:5]) is None


def test_a_library_that_cannot_be_prepared_is_not_tried_again(sticks: MotionLibrary) -> None:
    """The reason is raised each time, and no second thread is started."""
    opener, joints = background_windows(), sticks.skeleton.joints[:3]
    assert opener(sticks, joints) is None
    _wait(opener)
    tried = opener._thread  # noqa: SLF001 - the test compares threads
    for _ in range(2):
        with pytest.raises(ValueError, match="expected at least 5"):
            opener(sticks, joints)
    assert opener._thread is tried  # noqa: SLF001 - as above
