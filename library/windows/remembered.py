"""The opened windows of the built-in library, kept in the user's cache folder: the next start need not cut them."""

import hashlib
import os
import platform
import stat
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, Literal, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from kinespace.library import compiled, memory
from kinespace.library.clip import Clip
from kinespace.library.motion_library import MotionLibrary
from kinespace.library.signature.basis import Basis
from kinespace.library.signature.body import Body
from kinespace.library.windows.comparer import Head
from kinespace.library.windows.comparison import Comparison, Weighing
from kinespace.library.windows.courses import Courses
from kinespace.library.windows.rejection import Rejection
from kinespace.library.windows.segments import Segments

_ENDING = ".windows"
#: Files that are kept: one for each set of joints that was used lately.
_KEPT = 12
#: Bytes of a file, at most; the built-in library's windows take some 5 MB.
_MAX_BYTES = 40_000_000
#: The numbers of an opened index.
Numbers: TypeAlias = tuple[
    Body,
    Basis,
    Comparison,
    tuple[NDArray[np.float16], ...],
    NDArray[np.float32],
    NDArray[np.intp],
    Head | None,
    Rejection,
    Segments,
    Courses,
]


def cache_folder() -> Path:
    """Give this user's folder for files that can be made again; it need not exist."""
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / "kinespace"


def remembered(
    library: MotionLibrary, weighing: Weighing, joints: tuple[str, ...], compute: Callable[[], Numbers]
) -> Numbers:
    """Give the numbers of opened windows: from the user's cache, or computed and put there.

    Motions of other libraries than the built-in one are nobody's business but their owner's: their numbers are computed
    every time. A file is believed if it lies in a folder that this user alone can write to, and its digest is right;
    its name is the digest of all that the numbers depend on. Where no file can be read or written, nothing is said.

    Parameters
    ----------
    library, weighing, joints
        The numbers depend on these, on the program's own text, and on the arithmetic.
    compute
        Gives the numbers.
    """
    try:
        path = _path(library, weighing, joints) if _is_builtin(library) else None
    except (OSError, RuntimeError):
        # There is no home, or the program's text cannot be read.
        path = None
    if path is None:
        return compute()
    with suppress(*memory.DAMAGE, OSError, ValueError, IndexError):
        return _read(path)
    numbers = compute()
    with suppress(OSError, ValueError):
        _write(path, numbers)
    return numbers


def _path(library: MotionLibrary, weighing: Weighing, joints: tuple[str, ...]) -> Path:
    # Sums may be rounded by these.
    arithmetic = compiled.in_use, np.__version__, platform.machine(), sys.version_info[:2]
    described = (weighing, joints, arithmetic, _text(), _motions(library))
    name = hashlib.sha256(repr(described).encode()).hexdigest()
    return cache_folder() / "windows" / f"{name}{_ENDING}"


def _is_builtin(library: MotionLibrary) -> bool:
    """Say whether the motions are the built-in library's, perhaps by fewer joints."""
    builtin = MotionLibrary.builtin()
    return library is builtin or [*map(_named, library.motions)] == [*map(_named, builtin.motions)]


def _named(motion: Clip) -> tuple[str, str, str, int]:
    return motion.name, motion.class_name, motion.actor, motion.frames


def _motions(library: MotionLibrary) -> str:
    """Identify a library's motions and learned numbers; the built-in library's file is part of the program."""
    if library is MotionLibrary.builtin():
        # Not by this alone: a test's own library in its place must not be kept as it.
        return f"builtin {hashlib.sha256(repr([*map(_named, library.motions)]).encode()).hexdigest()}"
    found = hashlib.sha256(repr((library.skeleton, [*map(_named, library.motions)])).encode())
    for motion in library.motions:
        found.update(motion.positions.tobytes())
    for name, numbers in sorted(library.learned.items()):
        found.update(name.encode() + numbers.tobytes())
    return found.hexdigest()


@cache
def _text() -> str:
    """Identify the program's own text, compiled loops and motions: other numbers may come from others."""
    found, folder = hashlib.sha256(), Path(__file__).parents[1]
    for path in sorted([*folder.rglob("*.py"), *folder.rglob("_loops.*"), *folder.glob("*.npz")]):
        found.update(path.read_bytes())
    return found.hexdigest()


# --- files ------------------------------------------------------------------------------------------------------------


def encoded_numbers(value: object) -> object:
    """Encode arrays, also how they lie in memory, and numbers of numpy's."""
    if isinstance(value, np.ndarray):
        order: Literal["C", "F"] = "F" if value.flags.fnc else "C"
        return value.dtype.str, value.shape, order, value.tobytes(order)
    return value.item()  # type: ignore[attr-defined]


def decoded_numbers(_: object, value: Any) -> NDArray[np.generic]:  # noqa: ANN401 - of any message
    """Decode an array; no other field is of a kind that msgspec does not know."""
    kind, shape, order, numbers = value
    return np.frombuffer(numbers, kind).reshape(shape, order=order).copy(order)


def _require_own(path: Path) -> None:
    """Refuse what is a link, or not this user's alone (ValueError), and what is not there (OSError)."""
    found = path.lstat()
    if stat.S_ISLNK(found.st_mode) or (hasattr(os, "getuid") and found.st_uid != os.getuid()) or found.st_mode & 0o022:
        raise ValueError(f"{path}: a link, or others can write to it")


def _read(path: Path) -> Numbers:
    """Read a file; OSError or ValueError for one that is not there, is not this user's alone, or is damaged."""
    for each in (path.parent, path):
        _require_own(each)
    content = memory.content(path, _MAX_BYTES)
    digest, numbers = content[:32], content[32:]
    if hashlib.sha256(numbers).digest() != digest:
        raise ValueError(f"{path}: damaged")
    read: Numbers = msgspec.msgpack.decode(numbers, type=Numbers, dec_hook=decoded_numbers)
    # The oldest file goes first.
    os.utime(path)
    return read


def _write(path: Path, numbers: Numbers) -> None:
    """Write a file, and remove our own that were not used for longest; errors as of `_read`."""
    folder = path.parent
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    _require_own(folder)
    content = msgspec.msgpack.encode(numbers, enc_hook=encoded_numbers)
    with tempfile.NamedTemporaryFile(dir=folder, prefix="new-", delete=False) as new:
        try:
            new.write(hashlib.sha256(content).digest() + content)
        except OSError:
            Path(new.name).unlink(missing_ok=True)
            raise
    Path(new.name).replace(path)
    # Whatever else lies there is somebody's.
    ours = [*folder.glob(f"*{_ENDING}"), *folder.glob("new-*")]
    newest_first = sorted(ours, key=lambda each: -each.lstat().st_mtime)
    for each in newest_first[_KEPT:]:
        each.unlink(missing_ok=True)
