"""How much memory a process has, and for how long it has used a core."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

_MEGABYTE = 1 << 20


def resident_mb(process_id: int | None = None) -> float | None:
    """Give the resident memory of a process in MB, of this one by default; None where the system does not tell.

    Linux tells in `/proc`; elsewhere `ps` is asked.
    """
    number = os.getpid() if process_id is None else process_id
    try:
        pages = int(Path(f"/proc/{number}/statm").read_text(encoding="ascii").split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE") / _MEGABYTE
    except (OSError, ValueError, IndexError, AttributeError):
        return _told_by_ps(number)


def _told_by_ps(process_id: int) -> float | None:
    program = shutil.which("ps")
    if program is None:
        return None
    command = [program, "-o", "rss=", "-p", str(process_id)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 - a fixed command
    told = done.stdout.strip()
    return int(told) / 1024 if told.isdigit() else None


def core_seconds(process_id: int | None = None) -> float | None:
    """Give for how many seconds a process, this one by default, has used a core; None where the system does not tell.

    All its threads count. Only Linux tells, in `/proc`.
    """
    number = os.getpid() if process_id is None else process_id
    try:
        # After the command's name, which may hold any character; user and system time are the 14th and 15th field.
        told = Path(f"/proc/{number}/stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()
    except OSError:
        return None
    return (int(told[11]) + int(told[12])) / os.sysconf("SC_CLK_TCK")
