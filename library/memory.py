"""What a file may take: opened only if it is a regular one, read up to a limit; and memory given back to the system."""

import codecs
import ctypes
import errno
import io
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
#: Characters of a line, at most: twenty times a frame of 512 joints.
MAX_LINE = 1_000_000
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


def size_of(text: str) -> int:
    """Read a number of bytes as a person types it: a number, perhaps followed by kB, MB or GB.

    Raises
    ------
    ValueError
        The text is no positive number.
    """
    units = {"kb": 1e3, "mb": 1e6, "gb": 1e9}
    unit = text[-2:].lower()
    size = float(text[:-2] if unit in units else text) * units.get(unit, 1.0)
    if not 1 <= size < float("inf"):
        raise ValueError(f"size: expected a positive number, got {text}")
    return round(size)


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


def encoding_of(path: Path) -> str:
    """Say by its first bytes in which encoding a text is: UTF-8, UTF-16, else Shift-JIS or Windows' Latin letters."""
    with opened(path) as file:
        begin = file.read(MAX_WITHOUT_MOTION)
    if begin[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16"
    if begin[1:40:2].count(0) > 9:
        return "utf-16-le"
    for encoding in ("utf-8-sig", "cp932"):
        try:
            # The last character may be cut.
            codecs.getincrementaldecoder(encoding)().decode(begin)
        except UnicodeDecodeError:
            continue
        # Latin letters above ASCII begin at 0xa0; of Japanese text some bytes are lower.
        if encoding == "utf-8-sig" or any(0x81 <= byte <= 0x9F for byte in begin):
            return encoding
    return "cp1252"


def lines(path: Path, most: int | None = None, *, encoding: str = "", errors: str = "strict") -> Iterator[str]:
    """Read a text line by line, each with its end; in the encoding that `encoding_of` finds when none is given.

    Raises
    ------
    ValueError
        The text is longer than `most` characters, or than a file may be, or a line is; or it is of another encoding.
    OSError
        The file cannot be opened.
    """
    left = limit() if most is None else most
    with io.TextIOWrapper(opened(path), encoding=encoding or encoding_of(path), errors=errors, newline="") as file:
        while line := file.readline(MAX_LINE + 1):
            left -= len(line)
            if left < 0 or len(line) > MAX_LINE:
                raise ValueError(f"{path}: expected a shorter {'line' if left >= 0 else 'text'}, got more characters")
            yield line


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
