"""Libraries of fewer joints prepared in a thread, so that no performer waits while another's joints are restricted."""

from __future__ import annotations

import threading
from collections import OrderedDict
from typing import TYPE_CHECKING, Generic, TypeVar

from kinespace.library.motion_library import MotionLibrary
from kinespace.stream.recognizer import Recognizer
from kinespace.stream.recognizer.joints.fewer_joints import MAX_RESTRICTED, opened_anew
from kinespace.stream.service.yielding import yielding

if TYPE_CHECKING:
    from collections.abc import Callable

    from kinespace.library.windows.index import WindowIndex
    from kinespace.stream.recognizer import Settings
    from kinespace.stream.recognizer.joints.fewer_joints import Restricter

_Prepared = TypeVar("_Prepared")


class BackgroundOpener(Generic[_Prepared]):
    """Prepares one library at a time, and keeps the last ones.

    Parameters
    ----------
    prepare
        Prepares a library restricted to some of its joints; raises ValueError if these joints are too few.
    most
        How many prepared libraries are kept.
    """

    def __init__(
        self, prepare: Callable[[MotionLibrary, tuple[str, ...]], _Prepared], most: int = MAX_RESTRICTED
    ) -> None:
        self._prepare, self._most = prepare, most
        #: In place of a library that cannot be prepared: the reason.
        self._prepared: OrderedDict[tuple[MotionLibrary, tuple[str, ...]], _Prepared | str] = OrderedDict()
        self._thread: threading.Thread | None = None

    def __call__(self, library: MotionLibrary, joints: tuple[str, ...]) -> _Prepared | None:
        """Give the library prepared for these joints; None while it is not ready.

        Raises
        ------
        ValueError
            Nothing can be compared by these joints.
        """
        key = library, joints
        prepared = self._prepared.get(key)
        if prepared is None:
            self._start(library, joints)
            return None
        self._prepared.move_to_end(key)
        if isinstance(prepared, str):
            raise ValueError(prepared)  # noqa: TRY004 - a reason is kept as text
        return prepared

    def _start(self, library: MotionLibrary, joints: tuple[str, ...]) -> None:
        if self._thread is None or not self._thread.is_alive():
            # A daemon, so that Ctrl-C need not wait for the thread.
            self._thread = threading.Thread(
                target=self._run, args=(library, joints), name="kinespace opening", daemon=True
            )
            self._thread.start()

    def _run(self, library: MotionLibrary, joints: tuple[str, ...]) -> None:
        try:
            with yielding():
                prepared = self._prepare(library, joints)
            self._prepared[library, joints] = prepared
        except (ValueError, MemoryError) as error:
            self._prepared[library, joints] = str(error) or type(error).__name__
        while len(self._prepared) > self._most:
            self._prepared.popitem(last=False)


def background_restricter(
    settings: Settings, restrict: Restricter = MotionLibrary.restricted_to
) -> BackgroundOpener[MotionLibrary | WindowIndex | None]:
    """Restrict libraries in a thread, and open their windows for recognisers with these settings."""

    def prepare(library: MotionLibrary, joints: tuple[str, ...]) -> MotionLibrary | WindowIndex | None:
        restricted = restrict(library, joints)
        assert restricted is not None  # noqa: S101 - for mypy: this `restrict` waits
        # The library remembers the windows that a recogniser opens: its next recogniser has them at once.
        Recognizer(restricted, settings)
        return restricted

    return BackgroundOpener(prepare)


def background_windows() -> BackgroundOpener[WindowIndex]:
    """Open the windows of restricted libraries in a thread."""
    return BackgroundOpener(opened_anew)
