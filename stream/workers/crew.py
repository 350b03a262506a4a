"""Worker processes of one machine: frames go to them by their partitions; a killed or hung worker is replaced.

The performers of a worker that ended go to the other workers at once, with the frames of the last seconds, and come
back when the new process is ready.
"""

from __future__ import annotations

import multiprocessing
import queue
import socket
import threading
import time
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

from kinespace.stream.recognizer.matcher import library_of
from kinespace.stream.service.child_process import signals_held
from kinespace.stream.workers import process as child
from kinespace.stream.workers.answer_source import AnswerSource
from kinespace.stream.workers.channel import Channel
from kinespace.stream.workers.ledger import Ledger
from kinespace.stream.workers.spread import Spread, questions
from kinespace.stream.workers.wire import ASK, FRAMES, REPORT, decode_answers, encode_frames, encode_number
from kinespace.stream.zeromq.frames import FormatError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from kinespace.library.motion_library import MotionLibrary
    from kinespace.library.windows.index import WindowIndex
    from kinespace.stream.frame import Admitted
    from kinespace.stream.recognition import Event, Recognition
    from kinespace.stream.recognizer import SentJoints, Settings
    from kinespace.stream.workers.wire import SentFrame

#: Seconds without a report after which a worker counts as hung, and in which a new one must be ready.
MAX_SILENT, MAX_START = 1.0, 60.0
#: Seconds between two starts of a worker that ends soon after it was started.
_PAUSE = 1.0
#: Seconds between two looks at the workers, above which this process itself was stopped for a while.
_STOPPED = 0.5
#: Seconds in which the last frames are answered at the end.
_MAX_ENDING = 0.5


class _Process:
    """One process, from its start to its end."""

    def __init__(self, name: str, library: bytes, start: child.Start, now: float) -> None:
        self.name, self.begun, self.heard, self.ready = name, now, now, False
        context = multiprocessing.get_context("spawn")
        ours, theirs = socket.socketpair()
        reading, self._writing = context.Pipe(duplex=False)
        self.channel = Channel(ours)
        self._process = context.Process(target=child.run, args=(theirs, reading, start), name=name, daemon=True)
        self._process.start()
        # Only the child keeps these ends, so that its death is noticed at once.
        theirs.close()
        reading.close()
        self._libraries: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        threading.Thread(target=self._hand_over, name=f"kinespace library of {name}", daemon=True).start()
        self.exchange(library)

    @property
    def process_id(self) -> int | None:
        return self._process.pid

    def exchange(self, library: bytes) -> None:
        self._libraries.put(library)

    def _hand_over(self) -> None:
        """Write libraries in a thread, because a pipe takes them only as fast as the child reads."""
        with suppress(OSError), self._writing:
            while (library := self._libraries.get()) is not None:
                self._writing.send_bytes(library)

    def end(self, *, kill: bool) -> None:
        self.channel.close()
        self._libraries.put(None)
        if kill:
            self._process.kill()
        self._process.join(None if kill else child.REPORT_EVERY * 8)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()


class WorkerSource(AnswerSource):
    """The answers of one worker, whose process may be replaced."""

    def __init__(self, crew: Crew, place: int) -> None:
        super().__init__()
        self._crew, self._place = crew, place
        self.name = f"worker {place + 1}"
        self.process: _Process | None = None
        self.starts = 0
        self.start_at = 0.0
        #: The service polls these sockets while there is no process. No message ever comes by them.
        self._idle = socket.socketpair()

    def fileno(self) -> int:
        """Give the number of the socket on which answers come now."""
        return self.process.channel.fileno() if self.process else self._idle[0].fileno()

    @property
    def pollable(self) -> object:
        """The source itself, because the socket changes with the process."""
        return self

    @property
    def notes(self) -> list[str]:
        """Notes for a person, a line each."""
        return self._crew.notes if self._place == 0 else []

    def read(self, now: float) -> None:
        """Read the answers that have come."""
        if self.process:
            messages = self.process.channel.receive()
            if messages is None:
                self._crew.replace(self, now, "ended")
                return
            for message in messages:
                self.bring(self._crew.read(self, message, now))

    def drain(self) -> list[Recognition]:
        """Give all answers that were read."""
        drained = [recognition for recognition, _ in self._answers]
        self._answers.clear()
        return drained

    def tend(self, now: float) -> Sequence[Admitted]:
        """Look after the worker."""
        self._crew.tend(self, now)
        return ()

    def close(self) -> None:
        """End the process."""
        process, self.process = self.process, None
        if process:
            process.end(kill=False)
        for end in self._idle:
            end.close()


class Crew(Spread):
    """Worker processes in the place of `Performers`.

    Parameters
    ----------
    count
        How many.
    library, settings, most, silence, joints, classes
        The same as for `Performers`; the workers do not open a library again that is opened already.
    clock
        Seconds, the service's own.

    Attributes
    ----------
    sources
        Where answers come back: sources for the service, which closes them.

    Raises
    ------
    ChildProcessError
        A worker ended before it was ready.
    TimeoutError
        A worker was not ready within a minute.
    """

    def __init__(  # noqa: PLR0913 - all by keyword
        self,
        count: int,
        library: MotionLibrary | WindowIndex,
        settings: Settings,
        *,
        most: int,
        joints: SentJoints,
        silence: float = 5.0,
        classes: Sequence[str] = (),
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        if count < 1:
            raise ValueError(f"count: expected at least 1 worker, got {count}")
        motions = library_of(library)
        ledger = Ledger(most=most, silence=silence)
        super().__init__(motions, classes or motions.classes, settings, joints, ledger)
        self._start = child.Start(settings, joints.assumed, joints.naming, most, silence)
        self._library = child.packed(library, tuple(classes), 0)
        self._clock = clock
        self._replaced, self._last_replaced = 0, ""
        self._looked = clock()
        self.sources = [WorkerSource(self, place) for place in range(count)]
        self._by_name = {source.name: source for source in self.sources}
        try:
            for source in self.sources:
                self._begin(source, clock())
            self._wait_until_ready()
        except BaseException:
            for source in self.sources:
                source.close()
            raise

    def _begin(self, source: WorkerSource, now: float) -> None:
        source.starts += 1
        start = replace(self._start, settings=self.settings)
        # An interrupt after the start and before the assignment would leave a process that nobody ends.
        with signals_held():
            source.process = _Process(source.name, self._library, start, now)

    def _wait_until_ready(self) -> None:
        until = self._clock() + MAX_START
        while not all(source.process and source.process.ready for source in self.sources):
            if self._replaced:
                raise ChildProcessError(f"{self._last_replaced} before it was ready")
            if self._clock() > until:
                raise TimeoutError(f"the workers were not ready within {MAX_START:g} s")
            time.sleep(0.01)
            for source in self.sources:
                source.read(self._clock())

    @property
    def process_ids(self) -> list[int | None]:
        """The number of each worker's process; None while it has none."""
        return [source.process.process_id if source.process else None for source in self.sources]

    @property
    def notes(self) -> list[str]:
        """Notes for a person, a line each: workers that were replaced, frames that were dropped."""
        replaced = f"workers replaced so far: {self._replaced}; last: {self._last_replaced}"
        return [*super().notes, *([replaced] if self._replaced else [])]

    def _dropped(self) -> int:
        return sum(source.process.channel.dropped for source in self.sources if source.process)

    @property
    def _hearing(self) -> list[str]:
        # A process that starts hears of it, too.
        return [each.name for each in self.sources if each.process]

    @property
    def _ready(self) -> dict[str, WorkerSource]:
        return {each.name: each for each in self.sources if each.process and each.process.ready}

    def _give(self, worker: str, frames: list[SentFrame]) -> None:
        self._tell(worker, FRAMES + encode_frames(frames), len(frames))

    def _tell(self, worker: str, message: bytes, frames: int = 0) -> None:
        if process := self._by_name[worker].process:
            process.channel.send(message, frames)

    def read(self, source: WorkerSource, message: bytes, now: float) -> list[tuple[Recognition, float]]:
        """Read a worker's message; give its answers that are news."""
        process = source.process
        if process is None:
            return []
        try:
            answers = decode_answers(message)
        except FormatError:
            self.unread += 1
            return []
        process.heard = now
        news = self.take_back(process.name, answers)
        if not process.ready:
            process.ready = True
            self._assign(self._ready)
        return news

    def tend(self, source: WorkerSource, now: float) -> None:
        """Send the messages that wait; replace a worker that does not report; start a worker whose time has come."""
        if now - self._looked > _STOPPED:
            # This process was stopped and could not read the workers' reports.
            for each in self.sources:
                if each.process:
                    each.process.heard = max(each.process.heard, now - MAX_SILENT / 2)
        self._looked = now
        process = source.process
        if process is None:
            if now >= source.start_at:
                self._begin(source, now)
            return
        process.channel.flush()
        if now - process.heard > (MAX_SILENT if process.ready else MAX_START):
            # The worker may have written answers before it hung.
            source.read(now)
            if source.process is process and now - process.heard > MAX_SILENT:
                self.replace(source, now, "hung and was killed")

    def replace(self, source: WorkerSource, now: float, what: str) -> None:
        """Give the performers of a worker that has ended to the others, and start it again."""
        process, source.process = source.process, None
        if process is None:
            return
        process.end(kill=True)
        self._past_dropped += process.channel.dropped
        self._replaced, self._last_replaced = self._replaced + 1, f"{process.name} {what}"
        # A worker that ends at its start is not started without pause.
        source.start_at = now if process.ready and now - process.begun > _PAUSE else now + _PAUSE
        self._lose(process.name, self._ready)

    def exchange(self, library: MotionLibrary | WindowIndex, order: Sequence[str] = ()) -> list[Event]:
        """Compare all performers with another library from now on; end the motions whose class it lacks."""
        self._books.append(tuple(order) or library_of(library).classes)
        self._library = child.packed(library, tuple(order), len(self._books) - 1)
        for source in self.sources:
            if source.process:
                source.process.exchange(self._library)
        return self._ledger.end_others(self.classes)

    def end(self) -> list[Event]:
        """Give the last events, and the ends of all motions going on, because no more frames will come."""
        question = next(questions)
        for worker in self._ready:
            self._tell(worker, REPORT)
            self._tell(worker, ASK + encode_number(question))
        until = self._clock() + _MAX_ENDING
        while self._clock() < until and not self._are_done(question):
            time.sleep(0.001)
            for source in self.sources:
                if source.process:
                    source.process.channel.flush()
                    source.read(self._clock())
        last = [event for source in self.sources for each in source.drain() for event in each.events]
        return [*last, *super().end()]

    def _are_done(self, question: int) -> bool:
        return all(self._last.get(name, 0) >= question for name in self._ready)
