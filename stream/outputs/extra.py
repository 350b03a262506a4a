"""Packages that an output needs and a plain installation lacks."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType


def extra(package: str, name: str) -> ModuleType:
    """Load a package of an extra; ImportError says how to get it."""
    try:
        return import_module(package)
    except (ImportError, RuntimeError) as error:
        # RuntimeError: pylsl is there without the library that it calls.
        raise ImportError(f"{name.upper()} needs {package}: pip install 'kinespace[{name}]'") from error
