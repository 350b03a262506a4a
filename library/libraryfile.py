"""The container of a motion library: a header and arrays in one `.npz` without pickle, atomic, checked when read."""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
import zipfile
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

FORMAT = "kinespace motion library"
#: 2: shapes are Cholesky factors; before, they were matrix roots.
VERSION = 2


class LibraryFileError(ValueError):
    """A file is not a usable motion library; the message names the file and says why."""


def write(path: Path, header: Mapping[str, object], arrays: Mapping[str, NDArray[np.floating]]) -> None:
    """Write a library file so that a reader sees the old one or the new one, never a half.

    Parameters
    ----------
    path
        The file; replaced when it exists.
    header
        What JSON can hold; format and version are added.
    arrays
        Any number of them, stored as little-endian float32, or float16 where they are that.

    Raises
    ------
    OSError
        The folder cannot be written; nothing is left behind.
    """
    encoded = json.dumps({"format": FORMAT, "version": VERSION, **header}, separators=(",", ":")).encode()
    stored = {
        name: np.ascontiguousarray(array, dtype="<f2" if array.dtype == np.float16 else "<f4")
        for name, array in arrays.items()
    }
    digest = _digest(encoded, stored)
    handle, temporary = tempfile.mkstemp(dir=path.absolute().parent, prefix=f".{path.name}.", suffix=".part")
    try:
        with os.fdopen(handle, "wb") as file:
            np.savez_compressed(file, allow_pickle=False, header=_as_array(encoded), digest=_as_array(digest), **stored)
            file.flush()
            os.fsync(file.fileno())
        # mkstemp makes a private file; a library is as readable as any other file its maker writes.
        mask = os.umask(0)
        os.umask(mask)
        Path(temporary).chmod(0o666 & ~mask)
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def read(path: Path) -> tuple[dict[str, Any], dict[str, NDArray[np.floating]]]:
    """Read a library file.

    Returns
    -------
    The header and the arrays by name, as they were given to `write`.

    Raises
    ------
    LibraryFileError
        The file is cut short, not a motion library, of another format version, or not what was written.
    OSError
        The file cannot be opened.
    """
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            encoded = bytes(stored["header"])
            header = _checked_header(path, encoded)
            arrays = {name: stored[name] for name in stored if name not in ("header", "digest")}
            digest = bytes(stored["digest"])
    except LibraryFileError:
        raise
    except OSError as error:
        if error.filename is not None:  # the file cannot be opened
            raise
        raise LibraryFileError(f"{path}: not a motion library, or cut short ({error})") from error
    # What numpy and zipfile raise for a file that is cut short, overwritten in the middle, or of another kind.
    except (
        zipfile.BadZipFile,
        zlib.error,
        EOFError,
        KeyError,
        RuntimeError,
        TypeError,
        ValueError,
    ) as error:
        raise LibraryFileError(f"{path}: not a motion library, or cut short") from error
    if _digest(encoded, arrays) != digest:
        raise LibraryFileError(f"{path}: changed since it was written (its digest does not fit)")
    return header, arrays


def _checked_header(path: Path, encoded: bytes) -> dict[str, Any]:
    header = json.loads(encoded)
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise LibraryFileError(f"{path}: not a motion library")
    if header.get("version") != VERSION:
        raise LibraryFileError(f"{path}: format version {header.get('version')}, this kinespace reads {VERSION}")
    return header


def _digest(encoded: bytes, arrays: Mapping[str, NDArray[np.floating]]) -> bytes:
    digest = hashlib.sha256(encoded)
    for name in sorted(arrays):
        digest.update(f"{name} {arrays[name].dtype.str} {arrays[name].shape}".encode())
        digest.update(np.ascontiguousarray(arrays[name]).tobytes())
    return digest.digest()


def _as_array(content: bytes) -> NDArray[np.uint8]:
    return np.frombuffer(content, dtype=np.uint8)
