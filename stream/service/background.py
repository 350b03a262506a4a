"""Processes and threads beside the loop: they neither get the user's signals nor make a frame wait."""

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection

from kinespace.library.windows.index import WindowIndex
from kinespace.library.windows.opening import MAX_VIEWS, by_joints, has_view
from kinespace.stream.packet import remember
from kinespace.stream.recognizer.fitting import kinds_of

#: Seconds after which a new process is given up.
_MAX_START = 60.0
#: Ctrl-C and a closed terminal reach every process of the terminal. Some systems have SIGHUP, Windows has SIGBREAK.
_TERMINAL = ("SIGINT", "SIGHUP", "SIGBREAK")


@contextmanager
def signals_held() -> Iterator[None]:
    """Hold this thread's signals back while a process is started that calls `leave_signals_to_parent` first.

    A signal that cut the start short would leave the child with half of its orders, or with a parent that does not know
    of it. A signal that reached the child while it imports would end it with a traceback.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    # It would let signals through when it starts its own process.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _numbers((*_TERMINAL, "SIGTERM")))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


#: Goes on until its second argument says that the end is wanted. Its first argument gets a line that says that it has
#: begun, perhaps more later.
Serve = Callable[[Callable[[str], None], Callable[[], bool]], None]


class Child:
    """A new process that says when it has begun, or why it has not, and ends when our end of its pipe is closed.

    Parameters
    ----------
    name
        What it is called in messages.
    serve
        Runs in the process. OSError, ValueError and ImportError that it raises come back as what it sends.
    max_end
        Seconds after which it is killed when it is to end.

    Attributes
    ----------
    process, connection
        The process, and our end of the pipe.
    said
        The line with which it has begun.

    Raises
    ------
    ChildProcessError
        It ended before it began.
    TimeoutError
        It is silent.
    Exception
        It sent this exception.
    """

    def __init__(self, name: str, serve: Serve, *, max_end: float) -> None:
        context, self._max_end = multiprocessing.get_context("spawn"), max_end
        self.connection, theirs = context.Pipe()
        self.process = context.Process(target=_serve, args=(theirs, serve), daemon=True)
        with signals_held():
            self.process.start()
        theirs.close()
        try:
            started = self.connection.poll(_MAX_START)
            reply: str | Exception = self.connection.recv() if started else TimeoutError(f"the {name} is silent")
        except EOFError:
            reply = ChildProcessError(f"the process of the {name} ended before it began")
        if isinstance(reply, Exception):
            self.close()
            raise reply
        self.said = reply

    def close(self) -> None:
        """End the process."""
        self.connection.close()
        self.process.join(self._max_end)
        if self.process.is_alive():
            self.process.kill()
            self.process.join()


def _serve(connection: Connection, serve: Serve) -> None:
    """Run in the child, until the parent closes its end or is gone."""
    leave_signals_to_parent()
    with suppress(OSError):
        try:
            serve(connection.send, connection.poll)
        except (OSError, ValueError, ImportError) as error:
            connection.send(error)
    # A camera's driver may hang, and would keep the process.
    os._exit(0)


def leave_signals_to_parent(*, termination: bool = False) -> None:
    """Ignore a terminal's signals in this process, and SIGTERM if `termination`."""
    for number in _numbers((*_TERMINAL, "SIGTERM") if termination else _TERMINAL):
        signal.signal(number, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _numbers((*_TERMINAL, "SIGTERM")))


def _numbers(names: tuple[str, ...]) -> list[signal.Signals]:
    return [getattr(signal, name) for name in names if hasattr(signal, name)]


#: Seconds for which a thread may keep Python's lock while a frame waits for it.
_SWITCH_INTERVAL = 0.0005


class BackgroundViews:
    """Opens one view at a time; called as `by_joints` is. Threads take turns quickly from now on."""

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
        if has_view(index, joints):
            return by_joints(index, joints)
        if self._thread is None or not self._thread.is_alive():
            # A daemon, so that Ctrl-C need not wait for the thread.
            asked = index, joints
            self._thread = threading.Thread(target=self._open, args=asked, name="kinespace opening", daemon=True)
            self._thread.start()
        return None

    def _open(self, index: WindowIndex, joints: tuple[str, ...]) -> None:
        try:
            # Else the recogniser looks for the kinds, which takes some thousandths of a second, while a feed runs.
            kinds_of(by_joints(index, joints).library)
        except (ValueError, MemoryError) as error:
            remember(self._refused, (index, joints), str(error) or type(error).__name__, MAX_VIEWS)
