"""Examples out of recordings: a thread reads the files of one folder, and of no other place."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from typing import TYPE_CHECKING

from kinespace.library.recordings import Reading, RecordingError, RecordingReader
from kinespace.library.recordings.formats.labels import Segment, cut
from kinespace.stream.inputs.recording.takes import read_raw

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from kinespace.library.clip import Clip
    from kinespace.library.skeleton import Skeleton
    from kinespace.stream.teaching.commands import From

#: Requests that wait for their file, at most.
MAX_WAITING = 8
#: Characters that say why a part could not be read, at most.
_MAX_SAID = 280


class RecordingsFolder:
    """Reads parts of recordings, one after the other.

    Parameters
    ----------
    folder
        Recordings outside of it are refused, also by way of links; None: all are.
    skeleton
        The joints that examples need.

    Attributes
    ----------
    refused
        Requests that named no recording in the folder.
    """

    def __init__(self, folder: Path | None, skeleton: Skeleton) -> None:
        self.refused = 0
        self._folder, self._skeleton = folder and folder.resolve(), skeleton
        self._reader = RecordingReader(Reading(raw=read_raw))
        self._thread = ThreadPoolExecutor(1, "kinespace recordings")
        #: The requests whose parts are being read, in order, and their files.
        self._asked: list[tuple[From, Path, Future[Clip]]] = []

    def ask(self, asked: From) -> str:
        """Read a part of a recording soon; give the reason why not, empty when it is read."""
        path = self._path(asked.name)
        if path is None:
            self.refused += 1
            return "no such recording in the folder of --recordings" if self._folder else "expected --recordings"
        if len(self._asked) >= MAX_WAITING:
            self.refused += 1
            return f"{MAX_WAITING} recordings are being read already"
        self._asked.append((asked, path, self._thread.submit(self._part, path, asked)))
        return ""

    def parts(self) -> Iterator[tuple[From, Clip | str]]:
        """Give the parts read since the last call, over the skeleton's joints, or why there is none."""
        while self._asked and self._asked[0][2].done():
            asked, path, read = self._asked.pop(0)
            if error := read.exception():
                why = " ".join(str(error).split()).removeprefix(f"{path}: ") or type(error).__name__
                yield asked, f"{path.name}: {why}"[:_MAX_SAID]
            else:
                yield asked, read.result()

    def close(self) -> None:
        """End; what is being read is read."""
        self._thread.shutdown(cancel_futures=True)
        self._asked = [each for each in self._asked if not each[2].cancelled()]

    def _path(self, name: str) -> Path | None:
        """Find a file in the folder; None for a file elsewhere, for none, and for a name that no file can have."""
        if self._folder is None:
            return None
        try:
            path = (self._folder / name).resolve()
            return path if path.is_relative_to(self._folder) and path.is_file() else None
        except (OSError, ValueError, RuntimeError):
            return None

    def _part(self, path: Path, asked: From) -> Clip:
        whole = self._reader.clip(path)
        part = next(cut(whole, [Segment(asked.start, min(asked.end, whole.duration), asked.class_name)]), None)
        if part is None:
            raise RecordingError("expected frames between start and end")
        return part.restricted_to(self._skeleton.joints).as_of(self._skeleton)
