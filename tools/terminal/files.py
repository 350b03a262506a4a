"""What programs say of the files that they read, and output files, checked before the work."""

from __future__ import annotations

import argparse
import errno
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path

from kinespace.library import Clip, Reading, read_recordings
from kinespace.library.motion_library.library_file import locked
from kinespace.library.naming import summary
from kinespace.library.recordings.formats.labels import labels_beside
from kinespace.library.windows.segments import remarks
from kinespace.tools.terminal.console import note, progress, shortened


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


#: Remarks of each kind on what was read otherwise than it stands in a file, at most.
_MAX_SAID = 10
#: Characters of one, at most.
_LONGEST = 280


class NameNotes:
    """Says, once for each, which convention clips' joint names had, how many of our joints they have, and oddities."""

    def __init__(self) -> None:
        self._noted, self._said = set[str](), Counter[str]()

    def __call__(self, clip: Clip) -> Clip:
        """Print a note on a clip if it is new; give the clip."""
        line = summary(clip.naming, clip.skeleton.joints) if clip.naming else ""
        if line and line not in self._noted:
            self._noted.add(line)
            note(line)
        for remark in (*clip.notes, *remarks(clip)):
            # A folder's recordings mostly have the same oddities: of what a body is like one line of each kind is
            # enough, of what was read otherwise than it stands in a file some.
            kind, most = remark.partition(":")[0], _MAX_SAID if remark in clip.notes else 1
            self._said[kind] += 1
            if self._said[kind] <= most:
                note(shortened(f"{clip.name}: {remark}", _LONGEST))
            elif self._said[kind] == _MAX_SAID + 1:
                note(f"{clip.name}: {remark}; no more of this kind ({kind}) is said")
        return clip


def read_with_notes(paths: Sequence[Path], reading: Reading) -> Iterator[Clip]:
    """Read recordings one after the other, with a progress bar and notes on their joint names."""
    return progress(map(NameNotes(), read_recordings(paths, reading)), "Reading", len(paths))


def require_place_for_report(output: Path, options: argparse.Namespace) -> None:
    """As `require_place_for`; and refuse (FileExistsError) a file that is read by way of another option."""
    require_place_for(output)
    real, given = output.resolve(), [*vars(options).values()]
    for each in chain(given, *(option for option in given if isinstance(option, list))):
        if isinstance(each, Path) and each is not output and real.exists():
            place = each.resolve()
            if real.is_relative_to(place) or real in labels_beside(place):
                raise FileExistsError(f"{output}: expected another place for what is written: it is read with {each}")
