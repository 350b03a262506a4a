"""Output files, checked before the work."""

from __future__ import annotations

import errno
import os
from pathlib import Path

from kinespace.library.motion_library.library_file import locked


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
