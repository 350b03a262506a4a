"""The inner loops of a hop: compiled where a compiler was found, else in numpy. Who binds one need not know which."""

from __future__ import annotations

import importlib
import os
from contextlib import contextmanager
from typing import TYPE_CHECKING, cast

from kinespace.library.kernels import plain
from kinespace.library.kernels.table import KERNELS

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import ModuleType

    import numpy as np
    from numpy.typing import NDArray

    from kinespace.library.kernels.plain import Call

#: Raised when a kernel's arguments change.
VERSION = 9


def _built() -> ModuleType | None:
    if os.environ.get("KINESPACE_COMPILED") == "0":
        return None
    try:
        built = importlib.import_module("kinespace.library.kernels._compiled")
    except ImportError:
        return None
    # A module built from older sources is left aside until it is built again.
    return built if getattr(built, "VERSION", 0) == VERSION else None


#: The compiled module; None where there is none.
compiled = _built()


def bind(name: str, *arguments: NDArray[np.generic] | float) -> Call:
    """Bind a kernel to its arrays, which are checked once, and to its constants; a call takes its other numbers.

    Parameters
    ----------
    name
        A kernel of `kernels.table.KERNELS`.
    arguments
        Its arrays, then its constants.

    Raises
    ------
    ValueError
        An array does not fit, or an argument is missing.
    """
    kernel = KERNELS[name]
    arrays, constants = arguments[: len(kernel.arrays)], cast("tuple[float, ...]", arguments[len(kernel.arrays) :])
    if len(constants) != len(kernel.constants):
        raise ValueError(f"{name}: expected {', '.join(kernel.constants) or 'no constants'}, got {constants}")
    lengths = kernel.lengths(cast("tuple[NDArray[np.generic], ...]", arrays))
    if compiled is None or not _has_room(compiled, lengths):
        return cast("Call", getattr(plain, name)(*arguments))
    return cast("Call", compiled.bind(name, arrays, tuple(lengths.values()), constants, kernel.most(lengths)))


def _has_room(module: ModuleType, lengths: dict[str, int]) -> bool:
    """Say whether the compiled kernels, whose stack is bounded, take arrays of these lengths."""
    limits = {"j": module.MAX_JOINTS, "d": module.MAX_DIRECTIONS, "g": module.MAX_PARTS, "v": module.MAX_VIEWS}
    return all(lengths[letter] <= most for letter, most in limits.items() if letter in lengths)


@contextmanager
def left_aside() -> Iterator[None]:
    """Bind numpy's kernels inside this block; a recogniser is created and used inside it, or outside."""
    global compiled  # noqa: PLW0603 - one for the process, as modules are
    before, compiled = compiled, None
    try:
        yield
    finally:
        compiled = before


def kind() -> str:
    """Name the arithmetic in use, in a few words."""
    return f"compiled loops ({compiled.kind()})" if compiled else "numpy"
