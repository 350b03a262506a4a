"""`kinespace` as a person starts it, in a process of its own: what it prints can be read while it runs."""

from __future__ import annotations

import ctypes
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple, Self

#: Seconds that a program may take to print what is expected.
_PATIENCE = 60.0
_POLL = 0.01
#: Linux's PR_SET_PDEATHSIG.
_SIGNAL_OF_PARENTS_END = 1


def _end_with_parent() -> None:
    """Let the new process end with its parent, also with one that is killed."""
    ctypes.CDLL(None).prctl(_SIGNAL_OF_PARENTS_END, signal.SIGTERM)


class Place(NamedTuple):
    """Where a recogniser listens for frames by OSC and by ZeroMQ (empty: not), and where it answers by ZeroMQ."""

    osc: tuple[str, int]
    frames: str
    answers: str


class Program:
    """A running `kinespace`; a context manager that kills it at the end, also when it is stopped.

    Parameters
    ----------
    arguments
        Its arguments.
    module
        What Python runs, in place of `kinespace`.
    """

    def __init__(self, *arguments: str, module: str = "kinespace") -> None:
        self._name = arguments[0]
        self._folder = tempfile.TemporaryDirectory()
        self._output = Path(self._folder.name) / "output"
        with self._output.open("wb") as printed:
            self.process = subprocess.Popen(  # noqa: S603 - our own command
                [sys.executable, "-m", module, *arguments],
                env={**os.environ, "COLUMNS": "200", "PYTHONUTF8": "1"},
                stdin=subprocess.DEVNULL,
                stdout=printed,
                stderr=subprocess.STDOUT,
                preexec_fn=_end_with_parent if sys.platform == "linux" else None,  # noqa: PLW1509 - no thread of ours holds a lock
            )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.wait()
        self._folder.cleanup()

    @property
    def printed(self) -> str:
        """Everything printed so far."""
        return self._output.read_text(encoding="utf-8", errors="replace")

    def expect(self, pattern: str) -> re.Match[str]:
        """Wait until the output matches.

        Raises
        ------
        ChildProcessError
            The program has ended, or a minute has passed.
        """
        until = time.monotonic() + _PATIENCE
        while True:
            ended = self.process.poll() is not None or time.monotonic() > until
            if found := re.search(pattern, self.printed):
                return found
            if ended:
                said = self.printed.strip().removeprefix("kinespace: ")
                raise ChildProcessError(f"kinespace {self._name}: {said or 'silent'}")
            time.sleep(_POLL)

    def place(self) -> Place:
        """Wait until `live` or `gateway` listens; give its addresses."""
        # A second ZeroMQ address is the one for commands.
        pattern = r"listening on OSC (\S+):(\d+)(?:, ZeroMQ ([^\s;,]+))?[^;]*; answering to .*?ZeroMQ ([^\s;,]+)"
        host, port, frames, answers = self.expect(pattern).groups()
        return Place((host, int(port)), frames or "", answers)
