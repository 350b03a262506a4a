"""A thread that opens, saves, checks and tries taught motions, one change after the other, while frames go on."""

from __future__ import annotations

import queue
import threading
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from kinespace.library.motion_library import NOTHING
from kinespace.library.teaching.examples import checked
from kinespace.stream.frame import Frame
from kinespace.stream.recognition import EventKind
from kinespace.stream.recognizer import Recognizer
from kinespace.stream.teaching import State, Step

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from kinespace.library.teaching.examples import Check, Roster, TaughtWindows
    from kinespace.library.windows.index import WindowIndex
    from kinespace.stream.recognizer import Settings
    from kinespace.stream.teaching.memory import Remembered

#: Seconds between two answers when an example is tried on the last minutes: enough to count starts.
_TRIED_EVERY = 0.1
#: Frames after which the thread pauses for other threads, and the pause in seconds.
_FRAMES_AT_ONCE, _PAUSE = 6, 0.002


@dataclass(frozen=True, slots=True, eq=False)
class Change:
    """A roster to open and save.

    Attributes
    ----------
    roster
        All examples now.
    settings
        The settings of the recognisers.
    number
        The number of an example to check and to try; 0 for none.
    before
        The performer's last minutes before that example, on which it is tried; None where they are not known.
    asked
        Whether a command asked for the file, and waits until it is written.
    """

    roster: Roster
    settings: Settings
    number: int = 0
    before: Remembered | None = None
    asked: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Opened:
    """The opened roster; no index while nothing is taught and nothing else is compared."""

    roster: Roster
    index: WindowIndex | None


@dataclass(frozen=True, slots=True, eq=False)
class Checked:
    """An example's check, and how often its class would have started in the last minutes."""

    number: int
    check: Check | None
    starts: int


@dataclass(frozen=True, slots=True)
class Failed:
    """An example cannot be compared, and why."""

    number: int
    reason: str


#: A state is for listeners: the file was written, or what went wrong.
Result = Opened | Checked | Failed | State


class RosterOpener:
    """Deals with changes in the order in which they came; ends when it is closed.

    Parameters
    ----------
    windows
        Opens rosters.
    file
        Where the roster is saved after every change.
    """

    def __init__(self, windows: TaughtWindows, file: Path) -> None:
        self._windows, self._file = windows, file
        self._changes: queue.SimpleQueue[Change | None] = queue.SimpleQueue()
        self._results: queue.SimpleQueue[Result] = queue.SimpleQueue()
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._work, name="kinespace teaching", daemon=True)
        self._thread.start()

    def open(self, change: Change) -> None:
        """Open, save, check and try a change soon."""
        self._changes.put(change)

    def results(self) -> Iterator[Result]:
        """Give the results since the last call, in order."""
        while not self._results.empty():
            yield self._results.get()

    def close(self) -> None:
        """Save the last changes, and end."""
        self._ending.set()
        self._changes.put(None)
        self._thread.join()

    def _work(self) -> None:
        unsaved: Roster | None = None
        while (change := self._changes.get()) is not None:
            index, unsaved = self._opened(change, unsaved)
            if change.number and index is not None:
                check = checked(index, change.number)
                self._results.put(Checked(change.number, check, self._starts(change, index)))
        if unsaved is not None:
            self._save(unsaved)

    def _opened(self, change: Change, unsaved: Roster | None) -> tuple[WindowIndex | None, Roster | None]:
        """Open a roster and save it, unless another one waits; give its index, and the roster not saved yet."""
        try:
            index = self._windows.index_of(change.roster)
            if index is not None:
                # A first recogniser prepares the windows here; between two frames there is no time for this.
                Recognizer(index, change.settings)
        except (ValueError, MemoryError) as error:
            reason = " ".join(str(error).split())
            self._results.put(Failed(change.number, reason) if change.number else _refused(reason))
            return None, unsaved
        self._results.put(Opened(change.roster, index))
        if not (change.asked or self._changes.empty()):
            return index, change.roster
        self._save(change.roster, asked=change.asked)
        return index, None

    def _save(self, roster: Roster, *, asked: bool = False) -> None:
        try:
            library = roster.library()
            if library is None:
                self._file.unlink(missing_ok=True)
            else:
                library.save(self._file)
        except (OSError, ValueError) as error:
            why = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
            told = f"{self._file.name} was not saved: {why}; the taught motions are still in memory"
            self._results.put(_refused(told))
            return
        if asked:
            count = len(roster.examples)
            told = f"{self._file.name} saved, examples: {count}" if count else "nothing to save"
            self._results.put(State("", Step.DONE, 0.0, told))

    def _starts(self, change: Change, index: WindowIndex) -> int:
        """Count how often the new class would have started in the performer's last minutes."""
        if change.before is None:
            return 0
        name = next((each.class_name for each in change.roster.examples if each.number == change.number), NOTHING)
        recognizer = Recognizer(index, replace(change.settings, hop=_TRIED_EVERY))
        starts = 0
        before = change.before.clip()
        for place, (moment, positions) in enumerate(zip(before.times.tolist(), before.positions, strict=True)):
            # The end of the program does not wait for a count.
            if place % _FRAMES_AT_ONCE == 0 and self._ending.wait(_PAUSE):
                break
            recognition = recognizer.push(Frame("before", moment, positions))
            for event in recognition.events if recognition else ():
                starts += event.kind is EventKind.START and event.label == name
        return starts


def _refused(reason: str) -> State:
    return State("", Step.REFUSED, 0.0, reason)
