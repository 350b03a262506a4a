"""A thread that opens, checks and tries taught motions while frames go on."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

from kinespace.library.motion_library import NOTHING
from kinespace.library.teaching.examples import Roster, TaughtWindows, checked
from kinespace.library.windows.index import WindowIndex
from kinespace.stream.frame import Frame
from kinespace.stream.recognition import EventKind
from kinespace.stream.recognizer import Recognizer, Settings
from kinespace.stream.teaching import Changed, Notice, State, Step, Teacher
from kinespace.stream.teaching.commands import Tried
from kinespace.stream.teaching.memory import Remembered

#: Seconds between two answers when an example is tried on the last minutes: enough to count what is said.
_TRIED_EVERY = 0.1
#: Frames after which the thread pauses for other threads.
_FRAMES_AT_ONCE = 6
#: Seconds of the pause.
_PAUSE = 0.002


@dataclass(frozen=True, slots=True, eq=False)
class Change:
    """A roster to open.

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
    """

    roster: Roster
    settings: Settings
    number: int = 0
    before: Remembered | None = None


class RosterOpener:
    """Opens the newest roster, and checks all examples that have come since the last one; ends when it is closed.

    Parameters
    ----------
    windows
        Opens rosters.
    teacher
        Takes the checks of examples.
    exchange
        Takes an opened roster; without an index while nothing is taught and nothing else is compared.
    """

    def __init__(
        self,
        windows: TaughtWindows,
        teacher: Teacher,
        exchange: Callable[[Roster, WindowIndex | None], Sequence[Notice | Changed]],
    ) -> None:
        self._windows, self._teacher, self._exchange = windows, teacher, exchange
        self._changes: queue.SimpleQueue[Change | None] = queue.SimpleQueue()
        #: What is to be done in the caller's thread; each call gives notices.
        self._results: queue.SimpleQueue[Callable[[], Sequence[Notice | Changed]]] = queue.SimpleQueue()
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._work, name="kinespace teaching", daemon=True)
        self._thread.start()

    def open(self, change: Change) -> None:
        """Open, check and try a change soon."""
        self._changes.put(change)

    def results(self) -> Iterator[Notice | Changed]:
        """Hand over the results since the last call, in order; give the notices on them."""
        while not self._results.empty():
            yield from self._results.get()()

    def close(self) -> None:
        """End; changes that wait are not opened any more."""
        self._ending.set()
        self._changes.put(None)
        self._thread.join()

    def _work(self) -> None:
        while change := self._changes.get():
            waiting: list[Change | None] = [change]
            while not self._changes.empty():
                waiting.append(self._changes.get())
            changes = [each for each in waiting if each]
            if self._ending.is_set():
                return
            if not self._opened(changes, changes[-1].roster) and len(changes) > 1:
                # One of them cannot be compared: which one?
                failed = set[int]()
                for each in changes:
                    kept = tuple(example for example in each.roster.examples if example.number not in failed)
                    if not self._opened([each], replace(each.roster, examples=kept)):
                        failed.add(each.number)
            if len(changes) < len(waiting):
                return

    def _opened(self, changes: Sequence[Change], roster: Roster) -> bool:
        """Open a roster and check the examples that came with it; say whether it could be opened."""
        last = changes[-1]
        try:
            index = self._windows.index_of(roster)
            if index is not None:
                # A first recogniser prepares the windows here; between two frames there is no time for this.
                Recognizer(index, last.settings)
        except (ValueError, MemoryError) as error:
            reason = " ".join(str(error).split())
            if last.number and len(changes) == 1:
                self._results.put(partial(self._teacher.failed, last.number, reason))
            elif len(changes) == 1:
                self._results.put(lambda: [State("", Step.REFUSED, 0.0, reason)])
            return False
        self._results.put(partial(self._exchange, roster, index))
        numbers = {each.number for each in roster.examples}
        for each in changes:
            if each.number and not self._ending.is_set():
                known = index if each.number in numbers else None
                check = checked(known, each.number) if known else None
                tried = self._tried(each, known) if known else Tried()
                self._results.put(partial(self._teacher.checked, each.number, check, tried))
        return True

    def _tried(self, change: Change, index: WindowIndex) -> Tried:
        """Count how often the new class would have been said in the performer's last minutes.

        Neither the end of the program nor another change, which somebody wants to see at once, waits for a count.
        """
        name = next((each.class_name for each in change.roster.examples if each.number == change.number), NOTHING)
        if change.before is None or name == NOTHING:
            return Tried()
        recognizer = Recognizer(index, replace(change.settings, hop=_TRIED_EVERY))
        before, begin = change.before.clip(), change.before.frames[0][0]
        started, done = list[float](), list[float]()
        for place, (moment, positions) in enumerate(zip(before.times.tolist(), before.positions, strict=True)):
            if place % _FRAMES_AT_ONCE == 0 and (self._ending.wait(_PAUSE) or not self._changes.empty()):
                return Tried()
            recognition = recognizer.push(Frame("before", moment, positions))
            for event in recognition.events if recognition else ():
                started += [event.time] * (event.kind is EventKind.START and event.label == name)
            if recognition and recognition.done and recognition.done.label == name:
                done.append(recognition.done.start + recognition.done.duration / 2)
        own = [(each.start - begin, each.end - begin) for each in change.before.shown]
        starts, ends = (sum(not any(a <= at <= b for a, b in own) for at in times) for times in (started, done))
        return Tried(starts, ends, before.duration)
