"""Windows of fewer joints opened in a thread, so that no performer waits while another's are opened."""

from __future__ import annotations

import sys
import threading

from kinespace.library.windows.index import MAX_VIEWS, WindowIndex

#: Seconds for which a thread may keep Python's lock while a frame waits for it.
_SWITCH_INTERVAL = 0.0005


class BackgroundViews:
    """Opens one view at a time; called as `WindowIndex.by_joints` is. Threads take turns quickly from now on."""

    def __init__(self) -> None:
        sys.setswitchinterval(min(sys.getswitchinterval(), _SWITCH_INTERVAL))
        #: Why views cannot be opened.
        self._refused: dict[tuple[WindowIndex, tuple[str, ...]], str] = {}
        self._thread: threading.Thread | None = None

    def __call__(self, index: WindowIndex, joints: tuple[str, ...]) -> WindowIndex | None:
        """Give the windows as a body of these joints shows them; None while they are not open.

        Raises
        ------
        ValueError
            Nothing can be compared by these joints.
        """
        if reason := self._refused.get((index, joints)):
            raise ValueError(reason)
        if index.has_view(joints):
            return index.by_joints(joints)
        if self._thread is None or not self._thread.is_alive():
            # A daemon, so that Ctrl-C need not wait for the thread.
            asked = index, joints
            self._thread = threading.Thread(target=self._open, args=asked, name="kinespace opening", daemon=True)
            self._thread.start()
        return None

    def _open(self, index: WindowIndex, joints: tuple[str, ...]) -> None:
        try:
            index.by_joints(joints)
        except (ValueError, MemoryError) as error:
            while len(self._refused) >= MAX_VIEWS:
                del self._refused[next(iter(self._refused))]
            self._refused[index, joints] = str(error) or type(error).__name__
