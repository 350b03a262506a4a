"""The few functions of a hop that are compiled where a compiler was found; each stands in for the numpy one beside it.

`loops.c` has them. Nothing else knows which one computes: both take the same arguments, and give the same but for
rounding.
"""

import importlib
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from types import ModuleType
from typing import TYPE_CHECKING, ParamSpec, TypeVar

_Arguments = ParamSpec("_Arguments")
_Result = TypeVar("_Result")


def _built() -> ModuleType | None:
    try:
        return importlib.import_module("kinespace.library.compiled._loops")
    except ImportError:
        return None


_module = _built()
#: Whether the compiled functions are in use.
in_use = _module is not None and os.environ.get("KINESPACE_COMPILED") != "0"


def compiled(by_numpy: Callable[_Arguments, _Result]) -> Callable[_Arguments, _Result]:
    """Take the compiled function of the same name in place of a function in numpy, where there is one.

    A compiled function that gives None leaves the call to numpy: of arrays that are too large for it, say.
    """
    own: Callable[_Arguments, _Result | None] | None = getattr(_module, by_numpy.__name__, None)
    if own is None:
        return by_numpy

    @wraps(by_numpy)
    def either(*arguments: _Arguments.args, **named: _Arguments.kwargs) -> _Result:
        found = own(*arguments, **named) if in_use else None
        return by_numpy(*arguments, **named) if found is None else found

    return either


@contextmanager
def left_aside() -> Iterator[None]:
    """Compute by numpy inside this block."""
    global in_use  # noqa: PLW0603 - one for the process, as modules are
    before, in_use = in_use, False
    try:
        yield
    finally:
        in_use = before


def kind() -> str:
    """Name the arithmetic in use, in a few words."""
    return "compiled loops" if in_use else "numpy"
