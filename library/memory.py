"""What a file may take: opened only if it is a regular one, read up to a limit; and memory given back to the system."""

import ctypes
import errno
import os
import stat
import struct
import sys
import tokenize
import warnings
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import BinaryIO

#: Bytes that one file may take unless another limit is set.
MAX_MEMORY = 1_000_000_000
#: Bytes of a file that holds no motion, at most: labels, a skeleton, a preset.
MAX_WITHOUT_MOTION = 1_000_000
#: Bytes of a zip file's directory, at most.
_MAX_DIRECTORY_BYTES = 64_000
#: Bytes of memory for a number of a recording, at most: while it is read, it stands in several arrays.
_BYTES_READ = 48
#: The errors of zipfile, zlib and numpy for a file that is cut short, overwritten in the middle, or of another kind.
DAMAGE = (
    *(zipfile.BadZipFile, zlib.error, struct.error, tokenize.TokenError, MemoryError),
    *(EOFError, KeyError, OverflowError, RuntimeError, SyntaxError, SystemError, TypeError),
)
_limit = ContextVar("max_memory", default=MAX_MEMORY)


def give_back_memory() -> None:
    """Give free memory back to the system; glibc's allocator keeps it otherwise."""
    if sys.platform == "linux":
        # Other C libraries than glibc have no such function.
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(0)


# --- the limit --------------------------------------------------------------------------------------------------------


def limit() -> int:
    """Say how many bytes one file may take."""
    return _limit.get()


@contextmanager
def limited_to(most: int) -> Iterator[None]:
    """Let one file take at most so many bytes."""
    token = _limit.set(most)
    try:
        yield
    finally:
        _limit.reset(token)


def require(needed: int, what: str) -> None:
    """Refuse to take more bytes than one file may.

    Raises
    ------
    ValueError
        The file needs more bytes; the message names the file and the option that allows it.
    """
    if needed > limit():
        raise ValueError(
            f"{what}: expected at most {limit() / 1e6:.0f} MB once it is read, got {needed / 1e6:.0f} MB; "
            f"kinespace --max-memory {needed / 1e9 + 0.05:.1f}GB allows it"
        )


def require_numbers(count: int) -> None:
    """Refuse a recording of more numbers than fit into the memory that one file may take (ValueError)."""
    require(count * _BYTES_READ, "memory")


# --- files ------------------------------------------------------------------------------------------------------------


def opened(path: Path) -> BinaryIO:
    """Open a file for reading; OSError for a pipe or a device too, which might never end, or never begin."""
    return open(path, "rb", opener=_regular)


def _regular(path: str, flags: int) -> int:
    # Without waiting: a pipe into which nobody writes would not open. Windows has neither.
    file = os.open(path, flags | getattr(os, "O_NONBLOCK", 0))
    mode = os.fstat(file).st_mode
    # A folder is refused by Python itself.
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        os.close(file)
        raise OSError(errno.EINVAL, "expected a file, got a pipe or a device", path)
    return file


def content(path: Path, most: int = MAX_WITHOUT_MOTION) -> bytes:
    """Read a whole file; ValueError for one of more bytes than `most`, whatever size the system gives."""
    with opened(path) as file:
        found = file.read(most + 1)
    if len(found) > most:
        raise ValueError(f"{path}: expected at most {most} bytes, got more")
    return found


@contextmanager
def archive(path: Path) -> Iterator[zipfile.ZipFile]:
    """Open a zip file of a few arrays; one of `DAMAGE`, OSError or ValueError for anything else."""
    with opened(path) as file:
        # zipfile holds the directory in memory, however large it is.
        file.seek(-42, os.SEEK_END)
        end = file.read(42)
        signature, size = struct.unpack("<20x4s8xL6x", end)
        if end.startswith(b"PK\x06\x07") or signature != b"PK\x05\x06" or size > _MAX_DIRECTORY_BYTES:
            raise zipfile.BadZipFile("not an archive of arrays")
        with zipfile.ZipFile(file) as found, warnings.catch_warnings():
            # numpy's, on headers as Python 2 wrote them.
            warnings.simplefilter("ignore", UserWarning)
            yield found


def unpacked(found: zipfile.ZipFile, name: str, most: int) -> bytes:
    """Unpack one array's file, of at most so many bytes (ValueError); zipfile compares its checksum."""
    info = found.getinfo(f"{name}.npy")
    if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise zipfile.BadZipFile("packed in an unknown way")
    if info.file_size > most:
        raise ValueError(f"{name}: expected at most {most} bytes, got {info.file_size}")
    with found.open(info) as member:
        # Never read more bytes than the directory says.
        return member.read(info.file_size)
