"""The program that reads C3D files by ezc3d in a process of its own.

ezc3d is C++ and trusts the file: a broken file can end its process, keep the process busy for ever, or ask for all
memory there is. So ezc3d runs in this process, and `c3d_process` is the other side. The program is started by its path
and imports nothing of ours, so that it is ready as soon as numpy and ezc3d are loaded.

Asked:    a line of JSON for each file: `path`, and `memory`, how many bytes more than now it may take. The program ends
          with its input.
Answered: `u64 bytes of JSON, u64 bytes of numbers`, then both. The JSON has `error`, or `point` (the group POINT's
          parameters by name) and `shape` (points, frames); the numbers are x, y, z and residual of all points, f8.
"""

from __future__ import annotations

import json
import os
import signal
import struct
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

SIZES = struct.Struct("<QQ")
#: The errors that ezc3d and its Python wrapping raise for a file they do not understand.
ERRORS = (OSError, RuntimeError, ValueError, IndexError, KeyError, TypeError, MemoryError)


def read_points(path: str) -> tuple[dict[str, list[Any]], NDArray[np.float64]]:
    """Read the group POINT's parameters and all points of a C3D.

    Returns
    -------
    The parameters by name; x, y, z and residual (below 0 where the point is out of sight), shape (4, points, frames),
    in the file's unit.

    Raises
    ------
    OSError, RuntimeError, ValueError, IndexError, KeyError, TypeError, MemoryError
        The file cannot be read.
    """
    import ezc3d  # noqa: PLC0415 - an extra

    read = ezc3d.c3d(path)
    point = {
        name: np.asarray(each["value"]).ravel().tolist()
        for name, each in read["parameters"]["POINT"].items()
        if name != "__METADATA__"
    }
    points = np.array(read["data"]["points"], dtype="<f8")
    points[3] = read["data"]["meta_points"]["residuals"][0]
    return point, points


def serve(asked: BinaryIO, answered: BinaryIO) -> None:
    """Read one file after the other, as each is asked for, until the input ends."""
    for line in asked:
        request = json.loads(line)
        numbers = b""
        try:
            _allow_memory(request["memory"])
            point, points = read_points(request["path"])
            told = {"point": point, "shape": points.shape[1:]}
            numbers = points.tobytes()
        except ERRORS as error:
            told = {"error": str(error) or type(error).__name__}
        text = json.dumps(told).encode()
        answered.write(SIZES.pack(len(text), len(numbers)) + text)
        answered.write(numbers)
        answered.flush()


def _allow_memory(more: int) -> None:
    """Limit how many bytes more than now this process may take; only Linux can."""
    if sys.platform != "linux":
        return
    import resource  # noqa: PLC0415 - not on every system

    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    _, most = resource.getrlimit(resource.RLIMIT_AS)
    wanted = pages * resource.getpagesize() + more
    resource.setrlimit(resource.RLIMIT_AS, (wanted if most == resource.RLIM_INFINITY else min(wanted, most), most))


def main() -> None:
    """Serve standard input and output."""
    # Ctrl-C reaches every process of a terminal; this process ends with its input.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # ezc3d's own prints are not part of the answer.
    answered = os.fdopen(os.dup(1), "wb")
    with Path(os.devnull).open("wb") as nowhere:
        os.dup2(nowhere.fileno(), 1)
    serve(sys.stdin.buffer, answered)


if __name__ == "__main__":
    main()
