"""The error that every reader raises for a file that cannot be used, and numbers read from a file's words."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence


class RecordingError(ValueError):
    """A recording cannot be found or used; the message names it and, where there is one, the line or byte."""


def finite_numbers(words: Sequence[str], count: int, where: str = "") -> list[float]:
    """Read words as finite numbers.

    Parameters
    ----------
    words
        As they stand in the file.
    count
        How many there must be.
    where
        Follows `numbers` in messages, like ` after 'length'`.

    Raises
    ------
    ValueError
        There are more or fewer, or one is no finite number.
    """
    if len(words) != count:
        raise ValueError(f"expected {count} numbers{where}, got {len(words)}")
    got = repr(" ".join(words)[:60])
    try:
        values = [float(word) for word in words]
    except ValueError as error:
        raise ValueError(f"expected numbers{where}, got {got}") from error
    if not all(map(math.isfinite, values)):
        raise ValueError(f"expected finite numbers{where}, got {got}")
    return values
