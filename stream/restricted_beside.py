"""The library restricted to the joints that a sender has, prepared in a thread beside the loop that recognises."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from kinespace.stream.recognizer import Recognizer
from kinespace.stream.recognizer.fewer_joints import require_room

if TYPE_CHECKING:
    from kinespace.library.motion_library import MotionLibrary
    from kinespace.stream.recognizer import Settings


class RestrictedBeside:
    """Restricts a library, and opens its windows, while the caller goes on: that takes seconds.

    Parameters
    ----------
    library, settings
        Of the recognisers that will compare with it.
    """

    def __init__(self, library: MotionLibrary, settings: Settings) -> None:
        self._library = library
        self._settings = settings
        self._threads: dict[frozenset[str], threading.Thread] = {}
        self._ready: dict[frozenset[str], MotionLibrary] = {}
        self._failed: dict[frozenset[str], str] = {}

    def __call__(self, joints: frozenset[str]) -> MotionLibrary | None:
        """Give the library restricted to these joints, None as long as it is being prepared.

        Raises
        ------
        ValueError
            There are too few of the library's joints, too many sets of them already, or nothing can be compared.
        """
        if joints not in self._threads:
            require_room(self._library, joints, len(self._threads))
            # A daemon, so that Ctrl-C need not wait for it.
            thread = threading.Thread(target=self._prepare, args=(self._library, joints), daemon=True)
            self._threads[joints] = thread
            thread.start()
        if joints in self._failed:
            raise ValueError(self._failed[joints])
        return self._ready.get(joints)

    def exchange(self, library: MotionLibrary) -> None:
        """Restrict another library of the same joints from now on."""
        self._library = library
        self._threads, self._ready, self._failed = {}, {}, {}

    def wait(self) -> None:
        """Wait until everything that was asked for is prepared."""
        for thread in self._threads.values():
            thread.join()

    def _prepare(self, library: MotionLibrary, joints: frozenset[str]) -> None:
        # An exchange puts others in their place: what is prepared of the library before it is for nobody then.
        ready, failed = self._ready, self._failed
        try:
            restricted = library.restricted_to(joints)
            # The windows that a recogniser opens are remembered: the next one has them at once.
            Recognizer(restricted, self._settings)
        except (ValueError, MemoryError) as error:
            failed[joints] = f"{len(joints)} of them cannot be compared: {error}"
        else:
            ready[joints] = restricted
