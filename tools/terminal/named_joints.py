"""Recordings read with a progress bar, and notes on the convention of their joint names."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from kinespace.library import Clip, Reading, read_recordings
from kinespace.library.naming import summary
from kinespace.library.windows.oddities import remarks
from kinespace.tools.terminal.console import note, progress
from kinespace.tools.terminal.tables import shortened

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
