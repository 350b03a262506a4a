"""How much memory a file may take when it is read; checked before the memory is taken."""

from __future__ import annotations

from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

#: Bytes that one file may take unless another limit is set.
MAX_MEMORY = 1_000_000_000
_limit = ContextVar("max_memory", default=MAX_MEMORY)


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
            f"kinespace --max-memory {needed / 1e9:.1f}GB allows it"
        )


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
