"""The few functions of a hop that are compiled where a compiler was found; each stands in for the numpy one beside it.

`loops.c` has them. Nothing else knows which one computes: both take the same arguments, and give the same but for
rounding.
"""

import importlib
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any, TypeVar

_Function = TypeVar("_Function", bound=Callable[..., Any])


def _built() -> ModuleType | None:
    try:
        return importlib.import_module("kinespace.library.compiled._loops")
    except ImportError:
        return None


_module = _built() if os.environ.get("KINESPACE_COMPILED") != "0" else None
#: Whether the compiled functions are in use.
in_use = _module is not None
#: The functions in numpy, by their names.
by_numpy: dict[str, Callable[..., Any]] = {}


def compiled(function: _Function) -> _Function:
    """Take the compiled function of the same name in place of a function in numpy, where there is one.

    A compiled function that gives None leaves the call to `by_numpy`: of arrays that are too large for it, say.
    """
    by_numpy[function.__name__] = function
    taken: _Function = getattr(_module, function.__name__, function)
    return taken


@contextmanager
def left_aside() -> Iterator[None]:
    """Compute by numpy inside this block, with the modules that are imported before it."""
    global in_use  # noqa: PLW0603 - one for the process, as modules are
    before, in_use = in_use, False
    own = {name: getattr(sys.modules[each.__module__], name) for name, each in by_numpy.items()}
    _take(by_numpy)
    try:
        yield
    finally:
        in_use = before
        _take(own)


def _take(functions: dict[str, Callable[..., Any]]) -> None:
    """Let the modules that call these functions find them by their names."""
    for name, each in functions.items():
        setattr(sys.modules[by_numpy[name].__module__], name, each)


def kind() -> str:
    """Name the arithmetic in use, in a few words."""
    return "compiled loops" if in_use else "numpy"
