"""A thread that opens, saves, checks and tries taught motions, one change after the other, while frames go on."""

from __future__ import annotations

import queue
import threading
import time
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

from kinespace.library.motion_library import NOTHING
from kinespace.library.teaching.examples import checked
from kinespace.stream.frame import Frame
from kinespace.stream.recognition import EventKind
from kinespace.stream.recognizer import Recognizer
from kinespace.stream.teaching import State, Step

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from kinespace.library.teaching.examples import Roster, TaughtWindows
    from kinespace.library.windows.index import WindowIndex
    from kinespace.stream.recognizer import Settings
    from kinespace.stream.teaching import Changed, Notice, Teacher
    from kinespace.stream.teaching.memory import Remembered

#: Seconds between two answers when an example is tried on the last minutes: enough to count starts.
_TRIED_EVERY = 0.1
#: Seconds after the first change within which it is saved, also while further changes wait; and between two attempts.
_SAVED_WITHIN = 1.0
#: Frames after which the thread pauses for other threads.
_FRAMES_AT_ONCE = 6
#: Seconds of the pause.
_PAUSE = 0.002


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


class RosterOpener:
    """Deals with changes in the order in which they came; ends when it is closed.

    Parameters
    ----------
    windows
        Opens rosters.
    file
        Where the roster is saved after every change.
    teacher
        Takes the checks of examples.
    exchange
        Takes an opened roster; without an index while nothing is taught and nothing else is compared.
    """

    def __init__(
        self,
        windows: TaughtWindows,
        file: Path,
        teacher: Teacher,
        exchange: Callable[[Roster, WindowIndex | None], Sequence[Notice | Changed]],
    ) -> None:
        #: The newest roster, as long as it is not saved, since when, and whether an attempt failed.
        self._unsaved: Roster | None = None
        self._since, self._failed = 0.0, False
        self._windows, self._file, self._teacher, self._exchange = windows, file, teacher, exchange
        self._changes: queue.SimpleQueue[Change | None] = queue.SimpleQueue()
        #: What is to be done in the caller's thread; each call gives notices.
        self._results: queue.SimpleQueue[Callable[[], Sequence[Notice | Changed]]] = queue.SimpleQueue()
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._work, name="kinespace teaching", daemon=True)
        self._thread.start()

    def open(self, change: Change) -> None:
        """Open, save, check and try a change soon."""
        self._changes.put(change)

    def results(self) -> Iterator[Notice | Changed]:
        """Hand over the results since the last call, in order; give the notices on them."""
        while not self._results.empty():
            yield from self._results.get()()

    def close(self) -> None:
        """Save the last changes, and end."""
        self._ending.set()
        self._changes.put(None)
        self._thread.join()

    def _work(self) -> None:
        while True:
            try:
                change = self._changes.get(timeout=_SAVED_WITHIN if self._unsaved else None)
            except queue.Empty:
                self._save()
                continue
            if change is None:
                break
            index = self._opened(change)
            if change.number and index is not None:
                check = checked(index, change.number)
                starts = self._starts(change, index)
                self._results.put(partial(self._teacher.checked, change.number, check, starts))
        self._save()

    @property
    def has_unsaved(self) -> bool:
        """Whether there are changes that are not in the file."""
        return self._unsaved is not None

    def _opened(self, change: Change) -> WindowIndex | None:
        """Open a roster and save it, unless another one waits and the oldest change is young; give its index."""
        try:
            index = self._windows.index_of(change.roster)
            if index is not None:
                # A first recogniser prepares the windows here; between two frames there is no time for this.
                Recognizer(index, change.settings)
        except (ValueError, MemoryError) as error:
            reason = " ".join(str(error).split())
            if change.number:
                self._results.put(partial(self._teacher.failed, change.number, reason))
            else:
                self._say(Step.REFUSED, reason)
            return None
        self._results.put(partial(self._exchange, change.roster, index))
        if self._unsaved is None:
            self._since = time.monotonic()
        self._unsaved = change.roster
        if change.asked or self._changes.empty() or time.monotonic() - self._since > _SAVED_WITHIN:
            self._save(asked=change.asked)
        return index

    def _save(self, *, asked: bool = False) -> None:
        """Save the newest roster; a failure is said once, and tried again later."""
        roster = self._unsaved
        if roster is None:
            return
        try:
            library = roster.library()
            # A symbolic link stays one.
            if library is None:
                self._file.resolve().unlink(missing_ok=True)
            else:
                library.save(self._file.resolve())
        except (OSError, ValueError) as error:
            why = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
            if asked or not self._failed:
                self._say(
                    Step.REFUSED, f"{self._file.name} was not saved: {why}; the taught motions are still in memory"
                )
            self._failed = True
            return
        asked, self._failed, self._unsaved = asked or self._failed, False, None
        if asked:
            count = len(roster.examples)
            self._say(Step.DONE, f"{self._file.name} saved, examples: {count}" if count else "nothing to save")

    def _say(self, step: Step, reason: str) -> None:
        self._results.put(lambda: [State("", step, 0.0, reason)])

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
