"""Workers on this machine: processes that a gateway starts, replaces when they end or hang, and ends.

They meet the gateway at a socket in a folder that only this user can open. So libraries may travel as Python's own
objects, opened already. Windows has no such socket here: libraries travel as files there, and are opened again.
"""

from __future__ import annotations

import gc
import itertools
import multiprocessing
import shutil
import socket
import sys
import tempfile
import time
from contextlib import closing
from dataclasses import dataclass
from multiprocessing.reduction import ForkingPickler
from typing import Any

from kinespace.library.motion_library import MotionLibrary
from kinespace.library.windows.index import WindowIndex
from kinespace.stream.service.child_process import leave_signals_to_parent, signals_held
from kinespace.stream.workers.bus import open_session
from kinespace.stream.workers.gateway import Gateway
from kinespace.stream.workers.terms import Terms, file_of, library_in
from kinespace.stream.workers.worker import Worker

#: Whether the socket is this user's own.
_IS_PRIVATE = sys.platform != "win32"
#: Seconds in which a new worker must be ready.
MAX_START = 60.0
#: Seconds in which a worker that was left out must come back before it is killed.
_MAX_ABSENT = 2.0
#: Seconds between two starts of a worker that ends soon after it was started.
_PAUSE = 1.0
#: Seconds in which a worker ends.
_MAX_ENDING = 2.0


@dataclass(slots=True)
class _Process:
    """A worker's process; when it was started, and since when it is not ready: it is killed some seconds later."""

    process: Any
    begun: float
    absent_from: float


class LocalGateway(Gateway):
    """A gateway with workers of its own.

    Parameters
    ----------
    count
        How many workers.
    library, terms
        The same as for `Gateway`.

    Raises
    ------
    ImportError
        Zenoh is not installed.
    ChildProcessError
        A worker ended before it was ready.
    TimeoutError
        A worker was not ready within a minute.
    """

    def __init__(self, count: int, library: MotionLibrary | WindowIndex, terms: Terms) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="kinespace-")
        #: By the worker's name, which no other one ever has.
        self._processes: dict[str, _Process] = {}
        self._numbers = itertools.count(1)
        self._place = f"unixsock-stream/{self._folder.name}/gateway" if _IS_PRIVATE else _free_place()
        try:
            session = open_session([self._place], [], None)
        except BaseException:
            self._folder.cleanup()
            raise
        super().__init__(session, library, terms, pack=_packed if _IS_PRIVATE else file_of)
        try:
            for _ in range(count):
                self._start(time.monotonic())
            self._wait_until_ready()
        except BaseException:
            self.close()
            raise

    def _start(self, now: float) -> None:
        name = f"{next(self._numbers)}"
        given = name, self._place, self._folder.name
        process = multiprocessing.get_context("spawn").Process(target=_work, args=given, daemon=True)
        # An interrupt after the start and before the assignment would leave a process that nobody ends.
        with signals_held():
            process.start()
            self._processes[name] = _Process(process, now, now + MAX_START)

    def _wait_until_ready(self) -> None:
        until = time.monotonic() + MAX_START
        while len(self.ready) < len(self._processes):
            ended = [name for name, each in self._processes.items() if not each.process.is_alive()]
            if ended:
                raise ChildProcessError(f"worker {ended[0]} ended before it was ready")
            if time.monotonic() > until:
                raise TimeoutError(f"the workers were not ready within {MAX_START:g} s")
            time.sleep(0.005)
            self.inbox.deal()

    def tend(self, now: float) -> None:
        """Look after the workers; kill a worker that hangs, and start another for one that has ended."""
        super().tend(now)
        ready = self.ready
        for name, each in [*self._processes.items()]:
            if name in ready:
                each.absent_from = now
            elif now - each.absent_from > _MAX_ABSENT:
                each.process.kill()
            # A worker that ends at its start is not started without pause.
            if now - each.begun > _PAUSE and not each.process.is_alive():
                del self._processes[name]
                self._start(now)

    def close(self) -> None:
        """End the workers; without effect a second time."""
        super().close()
        for each in self._processes.values():
            each.process.join(_MAX_ENDING)
            each.process.kill()
            each.process.join()
        self._processes.clear()
        self._folder.cleanup()


def _packed(library: MotionLibrary | WindowIndex) -> bytes:
    return bytes(ForkingPickler.dumps(library))


def _free_place() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


def _work(name: str, place: str, folder: str) -> None:
    """Work until the gateway is gone, also by the death of its process, which leaves its folder."""
    leave_signals_to_parent(termination=True)
    read = ForkingPickler.loads if _IS_PRIVATE else library_in
    with closing(Worker(open_session([], [place], None), lambda _: None, name=name, read=read)) as worker:
        gc.freeze()
        worker.run(once=True)
    shutil.rmtree(folder, ignore_errors=True)
