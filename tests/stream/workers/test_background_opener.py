"""Windows of fewer joints opened in a thread."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from kinespace.library.windows.index import MAX_VIEWS, WindowIndex
from kinespace.stream.workers.background_opener import BackgroundViews

if TYPE_CHECKING:
    from kinespace.library.motion_library import MotionLibrary


def _wait(views: BackgroundViews) -> None:
    thread = views._thread  # noqa: SLF001 - the test waits for the thread instead of asking again and again
    assert thread is not None
    thread.join()


def test_windows_are_given_once_they_are_open(sticks: MotionLibrary) -> None:
    """Windows that were asked for are not ready at first; then they are the index's."""
    views, index, joints = BackgroundViews(), WindowIndex.of(sticks), sticks.skeleton.joints[:5]
    assert views(index, joints) is None
    _wait(views)
    assert views(index, joints) is index.by_joints(joints)
    assert index.by_joints(joints).library.skeleton.joints == joints


def test_joints_that_cannot_be_compared_are_not_tried_again(sticks: MotionLibrary) -> None:
    """The reason is raised each time, and no second thread is started, until so many others were refused."""
    views, index, joints = BackgroundViews(), WindowIndex.of(sticks), sticks.skeleton.joints
    assert views(index, joints[:3]) is None
    _wait(views)
    tried = views._thread  # noqa: SLF001 - the test compares threads
    for _ in range(2):
        with pytest.raises(ValueError, match="expected at least 5"):
            views(index, joints[:3])
    assert views._thread is tried  # noqa: SLF001 - as above
    for place in range(MAX_VIEWS):
        assert views(index, (f"joint {place}",)) is None
        _wait(views)
    assert views(index, joints[:3]) is None
    _wait(views)
