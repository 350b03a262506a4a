"""The camera in a process of its own, for `kinespace live --camera`: no picture ever makes a recogniser wait."""

from __future__ import annotations

import multiprocessing
import os
import threading
from contextlib import suppress
from typing import TYPE_CHECKING, Self

from kinespace.stream.workers.child_process import leave_signals_to_parent, signals_held
from kinespace.tools.camera.joints import require_extra
from kinespace.tools.programs.camera.session import CameraPlan, watch

if TYPE_CHECKING:
    from collections.abc import Callable
    from multiprocessing.connection import Connection

#: Seconds after which a new process is given up, and after which one that is to end is.
_MAX_START, _MAX_END = 30.0, 0.5


class CameraProcess:
    """A camera's process; a context manager. It ends with its parent, however that ends.

    Parameters
    ----------
    plan
        What is watched, and where frames go.
    say
        Is given a line for a person when the camera has stopped, from another thread.

    Attributes
    ----------
    opened
        A line that says what is watched.

    Raises
    ------
    ImportError, OSError, ValueError
        As `session.watch`, before the first picture.
    """

    def __init__(self, plan: CameraPlan, say: Callable[[str], object]) -> None:
        require_extra()
        context = multiprocessing.get_context("spawn")
        self._connection, theirs = context.Pipe()
        self._process = context.Process(target=_watch, args=(theirs, plan), daemon=True)
        with signals_held():
            self._process.start()
        theirs.close()
        reply = self._received(_MAX_START)
        if not isinstance(reply, str):
            self._end()
            raise reply or ChildProcessError("camera: its process ended before it began, or is silent")
        self.opened, self._say, self._ending = reply, say, False
        threading.Thread(target=self._listen, name="kinespace camera", daemon=True).start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._ending = True
        self._end()

    def _received(self, seconds: float | None) -> str | Exception | None:
        with suppress(EOFError, OSError):
            if self._connection.poll(seconds):
                reply: str | Exception = self._connection.recv()
                return reply
        return None

    def _listen(self) -> None:
        last = self._received(None)
        if not self._ending:
            self._say(f"camera: {last or 'its process died'}")

    def _end(self) -> None:
        with suppress(OSError):
            self._connection.send(None)
        self._process.join(_MAX_END)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
        self._connection.close()


def _watch(connection: Connection, plan: CameraPlan) -> None:
    """Run in the child: say what is watched, go on until the film ends, or the parent says so or is gone."""
    leave_signals_to_parent()
    with suppress(OSError):
        try:
            connection.send(str(watch(plan, connection.send, connection.poll)))
        except (OSError, ValueError, ImportError) as error:
            connection.send(error)
    # A camera's driver may hang, and would keep the process.
    os._exit(0)
