"""Work done ahead in a thread: while one recording is played, the next one is read."""

from __future__ import annotations

import queue
import sys
import threading
import time
from contextlib import suppress
from typing import TYPE_CHECKING, Generic, Self, TypeVar

if TYPE_CHECKING:
    from collections.abc import Iterator

#: Seconds for which the reading thread may keep Python's lock while a frame that is due waits for it.
_SWITCH_INTERVAL = 0.0005
#: Seconds after which an idle thread checks whether it is still needed.
_LOOK_EVERY = 0.1
#: Seconds to wait for a busy thread at the end.
_PATIENCE = 5.0

_Item = TypeVar("_Item")


class ReadAhead(Generic[_Item]):
    """Fetches an iterator's items in a thread, ahead of the consumer; a context manager and an iterator.

    Parameters
    ----------
    The iterator. An error that it raises is raised here, after the items before it.
        The iterator. An error that it raises is raised here, after the items before it.
    most
        How many items are kept ready.

    Attributes
    ----------
    waited
        Seconds for which the consumer has waited so far.
    """

    def __init__(self, source: Iterator[_Item], *, most: int = 1) -> None:
        self.waited = 0.0
        self._source = source
        # Items, each in a tuple, or the error that ended the iterator, which may be StopIteration.
        self._ready: queue.Queue[tuple[_Item] | BaseException] = queue.Queue(most)
        self._unwanted = threading.Event()
        self._thread = threading.Thread(target=self._read, name="kinespace reading", daemon=True)

    def __enter__(self) -> Self:
        self._interval = sys.getswitchinterval()
        sys.setswitchinterval(min(self._interval, _SWITCH_INTERVAL))
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._unwanted.set()
        self._thread.join(_PATIENCE)
        sys.setswitchinterval(self._interval)

    def __iter__(self) -> Iterator[_Item]:
        while True:
            began = time.perf_counter()
            ready = self._get()
            self.waited += time.perf_counter() - began
            if isinstance(ready, StopIteration):
                return
            if isinstance(ready, BaseException):
                raise ready
            yield ready[0]

    def _get(self) -> tuple[_Item] | BaseException:
        while True:
            # With a timeout, because on Windows not even Ctrl-C ends a wait without one.
            with suppress(queue.Empty):
                return self._ready.get(timeout=_LOOK_EVERY)

    def _read(self) -> None:
        try:
            for item in self._source:
                if not self._put((item,)):
                    return
        except BaseException as error:  # noqa: BLE001 - raised where it is waited for
            self._put(error)
        else:
            self._put(StopIteration())

    def _put(self, ready: tuple[_Item] | BaseException) -> bool:
        """Hand an object to the consumer; False when the consumer has left."""
        while not self._unwanted.is_set():
            try:
                self._ready.put(ready, timeout=_LOOK_EVERY)
            except queue.Full:
                continue
            return True
        return False
