"""Work done ahead in a thread: while one recording is played, the next one is read, and no more."""

from __future__ import annotations

import queue
import sys
import threading
import time
from contextlib import suppress
from typing import TYPE_CHECKING, Generic, Self, TypeVar

if TYPE_CHECKING:
    from collections.abc import Iterator

#: Seconds the reading thread may keep Python's lock while a frame that is due waits for it.
_SWITCH_INTERVAL = 0.0005
#: Seconds between two looks of a thread with nothing to do at whether it is still wanted.
_LOOK_EVERY = 0.1
#: Seconds a thread in the middle of its work is waited for at the end.
_PATIENCE = 5.0

_Item = TypeVar("_Item")


class ReadAhead(Generic[_Item]):
    """Passes on an iterator's items, which a thread fetches beforehand; a context manager and an iterator.

    Parameters
    ----------
    source
        The iterator. An error that it raises is raised here, after the items before it.
    most
        How many items are kept ready.

    Attributes
    ----------
    waited
        Seconds that the consumer has had to wait so far.
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
        """Hand something to the consumer; False when the consumer has left."""
        while not self._unwanted.is_set():
            try:
                self._ready.put(ready, timeout=_LOOK_EVERY)
            except queue.Full:
                continue
            return True
        return False
