"""The camera in a process of its own, for `kinespace live --camera`: no picture ever makes a recogniser wait."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from typing import Self

from kinespace.stream.service.child_process import Child, leave_signals_to_parent
from kinespace.tools.camera.joints import require_extra
from kinespace.tools.programs.camera.session import CameraPlan, watch

#: Seconds after which a process that is to end is killed.
_MAX_END = 0.5


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
        self._child, self._say, self._ending = Child("camera", _watch, plan, max_end=_MAX_END), say, False
        self.opened = self._child.said
        threading.Thread(target=self._listen, name="kinespace camera", daemon=True).start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._ending = True
        self._child.close()

    def _listen(self) -> None:
        wait([self._child.process.sentinel])
        last = "its process died"
        with suppress(EOFError, OSError):
            last = self._child.connection.recv()
        if not self._ending:
            self._say(f"camera: {last}")


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
