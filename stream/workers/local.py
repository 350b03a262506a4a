"""Workers on this machine: processes that a gateway starts, replaces when they end or hang, and ends.

They meet the gateway at a socket in a folder that only this user can open. So libraries may travel as Python's own
objects, opened already. Windows has no such socket here: libraries travel as files there, and are opened again.
"""

from __future__ import annotations

import gc
import multiprocessing
import os
import shutil
import socket
import sys
import tempfile
import threading
import time
from contextlib import closing, suppress
from dataclasses import dataclass
from multiprocessing.reduction import ForkingPickler
from typing import TYPE_CHECKING, Any

from kinespace.stream.workers.bus import open_session
from kinespace.stream.workers.child_process import leave_signals_to_parent, signals_held
from kinespace.stream.workers.gateway import Gateway
from kinespace.stream.workers.node import Node
from kinespace.stream.workers.terms import file_of, library_in

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

    from kinespace.library.motion_library import MotionLibrary
    from kinespace.library.windows.index import WindowIndex
    from kinespace.stream.workers.terms import Terms

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
#: Seconds between two looks at the processes.
_LOOK_EVERY = 0.1


@dataclass(slots=True)
class _Worker:
    """One worker's process, which may be replaced.

    Attributes
    ----------
    process, alive
        The process, and our end of the pipe at whose closing it ends.
    begun
        When it was started.
    absent_from
        The process is killed when it is not ready for some seconds from then on.
    """

    process: Any
    alive: Connection
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
        self._workers: dict[str, _Worker] = {}
        self._next_look = 0.0
        self._place = f"unixsock-stream/{self._folder.name}/gateway" if _IS_PRIVATE else _free_place()
        try:
            session = open_session([self._place], [], None)
        except BaseException:
            self._folder.cleanup()
            raise
        super().__init__(session, library, terms, pack=_packed if _IS_PRIVATE else file_of)
        try:
            for number in range(count):
                self._start(f"{number + 1}", time.monotonic())
            self._wait_until_ready()
        except BaseException:
            self.close()
            raise

    def _start(self, name: str, now: float) -> None:
        context = multiprocessing.get_context("spawn")
        theirs, ours = context.Pipe(duplex=False)
        given = name, self._place, self._folder.name, theirs
        process = context.Process(target=_work, args=given, name=f"worker {name}", daemon=True)
        # An interrupt after the start and before the assignment would leave a process that nobody ends.
        with signals_held():
            process.start()
            self._workers[name] = _Worker(process, ours, now, now + MAX_START)
        # Only the child keeps this end.
        theirs.close()

    def _wait_until_ready(self) -> None:
        until = time.monotonic() + MAX_START
        while len(self.ready) < len(self._workers):
            ended = [name for name, each in self._workers.items() if not each.process.is_alive()]
            if ended:
                raise ChildProcessError(f"worker {ended[0]} ended before it was ready")
            if time.monotonic() > until:
                raise TimeoutError(f"the workers were not ready within {MAX_START:g} s")
            time.sleep(0.005)
            self.inbox.deal()

    def tend(self, now: float) -> None:
        """Look after the workers; kill a worker that hangs, and start a worker again that has ended."""
        super().tend(now)
        if now < self._next_look:
            return
        self._next_look, ready = now + _LOOK_EVERY, self.ready
        for name, each in [*self._workers.items()]:
            if name in ready:
                each.absent_from = now
            elif now - each.absent_from > _MAX_ABSENT:
                each.process.kill()
            # A worker that ends at its start is not started without pause.
            if now - each.begun > _PAUSE and not each.process.is_alive():
                each.alive.close()
                self._start(name, now)

    def close(self) -> None:
        """End the workers; without effect a second time."""
        super().close()
        for each in self._workers.values():
            each.alive.close()
        for each in self._workers.values():
            each.process.join(_MAX_ENDING)
            each.process.kill()
            each.process.join()
        self._workers.clear()
        self._folder.cleanup()


def _packed(library: MotionLibrary | WindowIndex) -> bytes:
    return bytes(ForkingPickler.dumps(library))


def _free_place() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


def _work(name: str, place: str, folder: str, alive: Connection) -> None:
    """Work until the gateway's process closes its end of a pipe, or ends."""
    leave_signals_to_parent(termination=True)
    threading.Thread(target=_end_with, args=(alive, folder), name="kinespace parent", daemon=True).start()
    read = ForkingPickler.loads if _IS_PRIVATE else library_in
    with closing(Node(open_session([], [place], None), lambda _: None, name=name, read=read)) as node:
        gc.freeze()
        node.run()


def _end_with(parent: Connection, folder: str) -> None:
    with suppress(EOFError, OSError):
        parent.recv_bytes()
    # A parent that was killed has left its folder. The loop may hang, and has nothing to save.
    shutil.rmtree(folder, ignore_errors=True)
    os._exit(0)
