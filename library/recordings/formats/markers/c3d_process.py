"""C3D files read in a process of their own: a file that crashes ezc3d crashes nothing else."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Self

import numpy as np

from kinespace.library.recordings import memory
from kinespace.library.recordings.formats.markers import c3d_child

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: A file may take so many seconds, and a second more for each so many bytes.
_PATIENCE, _MIN_RATE = 20.0, 400_000
#: Bytes of memory that a file may take: so many, and so many times its size.
_MEMORY, _MEMORY_TIMES = 512 << 20, 64


class C3dProcess:
    """Reads C3D files in another process, which starts with the first file; a context manager.

    Where Python cannot start itself again, because it is built into another program, files are read in this process.
    """

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def process_id(self) -> int | None:
        """The system's number of the process; None when no process runs."""
        return self._process.pid if self._process else None

    def close(self) -> None:
        """End the process, if it runs; the next file starts another one."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            # The process's end of the pipe may be gone, and the bytes not yet written with it.
            with suppress(OSError):
                process.communicate()

    def read(self, path: Path) -> tuple[dict[str, list[Any]], NDArray[np.float64]]:
        """Read a file, as `library.formats.markers.c3d_child.read_points` does.

        Raises
        ------
        ValueError
            The file cannot be read; or ezc3d ended, or took far more time or memory than such a file needs.
        ImportError
            ezc3d is not installed.
        """
        if find_spec("ezc3d") is None:
            raise ImportError("reading C3D needs ezc3d: pip install 'kinespace[c3d]'")
        if not Path(sys.executable or "").stem.lower().startswith(("python", "pypy")):
            try:
                return c3d_child.read_points(str(path))
            except c3d_child.ERRORS as error:
                raise ValueError(str(error)) from error
        size = path.stat().st_size
        told, numbers = self._answer(path, size)
        if "error" in told:
            raise ValueError(told["error"])
        return told["point"], np.frombuffer(numbers, dtype="<f8").reshape(4, *told["shape"])

    def _answer(self, path: Path, size: int) -> tuple[dict[str, Any], bytes]:
        """Ask for a file and wait for the answer; kill the process when it takes too long."""
        process = self._process = self._process or _started()
        asked, answered = process.stdin, process.stdout
        if asked is None or answered is None:
            raise AssertionError("a process started with pipes has them")
        request = {"path": str(path.absolute()), "memory": min(_MEMORY + _MEMORY_TIMES * size, memory.limit())}
        patience = _PATIENCE + size / _MIN_RATE
        given_up = threading.Event()

        def give_up() -> None:
            given_up.set()
            process.kill()

        timer = threading.Timer(patience, give_up)
        timer.start()
        try:
            asked.write(json.dumps(request).encode() + b"\n")
            asked.flush()
            text_size, numbers_size = c3d_child.SIZES.unpack(_exactly(answered, c3d_child.SIZES.size))
            return json.loads(_exactly(answered, text_size)), _exactly(answered, numbers_size)
        except (OSError, EOFError) as error:
            self.close()
            ended = f"did not end within {patience:.0f} s" if given_up.is_set() else "broke down"
            raise ValueError(f"the reader {ended} on it") from error
        except BaseException:
            # Interrupted in the middle of an answer: the rest of that answer must not be taken for the next one.
            self.close()
            raise
        finally:
            timer.cancel()
            timer.join()
            if given_up.is_set():
                self.close()


def _started() -> subprocess.Popen[bytes]:
    """Start the program, with the same module path as here."""
    paths = os.pathsep.join(path for path in sys.path if path)
    return subprocess.Popen(  # noqa: S603 - our own program
        [sys.executable, "-P", c3d_child.__file__],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": paths, "OPENBLAS_NUM_THREADS": "1"},
        # On Windows a program without a console would open a console.
        creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
    )


def _exactly(file: IO[bytes], size: int) -> bytes:
    """Read so many bytes; EOFError when the process ends before."""
    read = file.read(size)
    if len(read) < size:
        raise EOFError
    return read
