"""Texts of recordings, read line by line in the encoding in which they seem to be."""

import codecs
import io
from collections.abc import Iterator
from pathlib import Path

from kinespace.library import memory

#: Characters of a line, at most: twenty times a frame of 512 joints.
MAX_LINE = 1_000_000


def encoding_of(begin: bytes) -> str:
    """Say by its first bytes in which encoding a text is: UTF-8, UTF-16, else Shift-JIS or Windows' Latin letters."""
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


def lines_of(path: Path, most: int | None = None, *, encoding: str = "", errors: str = "strict") -> Iterator[str]:
    """Read a text line by line, each with its end; in the encoding that `encoding_of` finds when none is given.

    Raises
    ------
    ValueError
        The text is longer than `most` characters, or than a file may be, or a line is; or it is of another encoding.
    OSError
        The file cannot be opened.
    """
    left = memory.limit() if most is None else most
    with memory.opened(path) as file:
        encoding = encoding or encoding_of(file.read(memory.MAX_WITHOUT_MOTION))
    with io.TextIOWrapper(memory.opened(path), encoding=encoding, errors=errors, newline="") as file:
        while line := file.readline(MAX_LINE + 1):
            left -= len(line)
            if left < 0 or len(line) > MAX_LINE:
                raise ValueError(f"{path}: expected a shorter {'line' if left >= 0 else 'text'}, got more characters")
            # .NET writes a real minus in some countries.
            yield line.replace("\N{MINUS SIGN}", "-")
