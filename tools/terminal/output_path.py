"""Output files, checked before the work."""

from __future__ import annotations

import argparse
import errno
import os
from itertools import chain
from pathlib import Path

from kinespace.library.motion_library.library_file import locked
from kinespace.library.recordings.formats.labels import labels_beside


def require_place_for(output: Path, *, overwrite: bool = True) -> None:
    """Refuse a place that cannot be written to, with its name.

    Parameters
    ----------
    output
        The file to be written.
    overwrite
        Whether a file may be replaced; if not, the message names the option that allows it.

    Raises
    ------
    IsADirectoryError, FileNotFoundError, PermissionError
        It is a folder, or its folder does not exist or is not writable.
    FileExistsError
        It exists, and may not be replaced.
    ValueError
        Another program teaches there.
    """
    folder = output.absolute().parent
    if output.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(output))
    if not folder.is_dir():
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(output.parent))
    if not os.access(folder, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(output.parent))
    if output.exists() and not overwrite:
        raise FileExistsError(f"{output}: exists already; --overwrite writes over it")
    with locked(output):
        pass


def require_place_for_report(output: Path, options: argparse.Namespace) -> None:
    """As `require_place_for`; and refuse (FileExistsError) a file that is read by way of another option."""
    require_place_for(output)
    real, given = output.resolve(), [*vars(options).values()]
    for each in chain(given, *(option for option in given if isinstance(option, list))):
        if isinstance(each, Path) and each is not output and real.exists():
            place = each.resolve()
            if real.is_relative_to(place) or real in labels_beside(place):
                raise FileExistsError(f"{output}: expected another place for what is written: it is read with {each}")
