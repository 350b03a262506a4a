"""Loops that keep the cores of a virtual machine awake: to wake a core that sleeps may take its host milliseconds."""

from __future__ import annotations

import os
import subprocess
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

#: Runs only where no other process wants to run, and ends with its parent.
_LOOP = """
import os, sys
os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
while os.getppid() == int(sys.argv[1]):
    for _ in range(100_000):
        pass
"""


@contextmanager
def awake_cores() -> Iterator[None]:
    """Keep every core awake inside this block, with a process of Linux's idle class each.

    Raises
    ------
    OSError
        The system has no idle class.
    """
    if not hasattr(os, "SCHED_IDLE"):
        raise OSError("awake: expected Linux, which has processes that run only where nothing else does")
    command = [sys.executable, "-I", "-S", "-c", _LOOP, str(os.getpid())]
    loops = [subprocess.Popen(command) for _ in range(os.cpu_count() or 1)]  # noqa: S603 - our own command
    try:
        yield
    finally:
        for each in loops:
            each.kill()
            each.wait()
