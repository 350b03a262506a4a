"""A worker's process: libraries are prepared before frames are compared with them."""

from __future__ import annotations

import queue
from typing import TYPE_CHECKING, Any

from kinespace.library.progress import phase_table
from kinespace.library.windows.index import opened
from kinespace.stream.recognizer import Recognizer, Settings
from kinespace.stream.workers import process

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pytest

    from kinespace.library.motion_library import MotionLibrary


class FakePipe:
    """A pipe whose other end is closed after some messages."""

    def __init__(self, sent: Iterator[bytes]) -> None:
        self._sent = sent

    def recv_bytes(self) -> bytes:
        """Give the next message."""
        for each in self._sent:
            return each
        raise EOFError


def test_a_library_is_prepared_before_a_frame_waits_for_it(
    sticks: MotionLibrary, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The tables of progress, which take a second, are there when the loop gets a library; the end is told, too."""
    made = []
    table_of = phase_table.PhaseTable.of
    monkeypatch.setattr(phase_table.PhaseTable, "of", lambda *given: made.append(1) or table_of(*given))
    sent = iter([process.packed(opened(sticks), (), 3)])
    libraries: queue.SimpleQueue[Any] = queue.SimpleQueue()
    settings = Settings(progress=True)
    process._read(FakePipe(sent), libraries, settings)  # noqa: SLF001 - the process's thread runs it
    library, _, book = libraries.get()
    assert (book, len(made) > 0) == (3, True)
    made.clear()
    Recognizer(library, settings)
    assert not made
    assert libraries.get() is None
