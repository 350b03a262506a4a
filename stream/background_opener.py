"""Libraries of fewer joints opened in a thread, so that no performer waits for another's joints to be done without."""

from __future__ import annotations

import threading
from collections import OrderedDict
from typing import TYPE_CHECKING

from kinespace.stream.recognizer.doubts import MAX_RESTRICTED, opened_anew

if TYPE_CHECKING:
    from kinespace.library.motion_library import MotionLibrary
    from kinespace.library.windows.index import WindowIndex

    _Key = tuple[MotionLibrary, tuple[str, ...]]


class BackgroundOpener:
    """Opens one library at a time; the last ones stay open.

    Parameters
    ----------
    most
        How many stay open.
    """

    def __init__(self, most: int = MAX_RESTRICTED) -> None:
        self._most = most
        #: None for one that cannot be opened: no motion is left of it.
        self._opened: OrderedDict[_Key, WindowIndex | None] = OrderedDict()
        self._thread: threading.Thread | None = None

    def __call__(self, library: MotionLibrary, joints: tuple[str, ...]) -> WindowIndex | None:
        """Give a library's windows as a body of some of its joints shows it; None while they are not ready."""
        key = library, joints
        if key in self._opened:
            self._opened.move_to_end(key)
            return self._opened[key]
        if self._thread is None or not self._thread.is_alive():
            # What is opened when the program ends is of no use to anybody.
            self._thread = threading.Thread(target=self._open, args=(key,), name="kinespace opening", daemon=True)
            self._thread.start()
        return None

    def _open(self, key: _Key) -> None:
        try:
            self._opened[key] = opened_anew(*key)
        except ValueError:
            self._opened[key] = None
        while len(self._opened) > self._most:
            self._opened.popitem(last=False)
