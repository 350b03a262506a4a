"""Workers in the test's own process, in the place of processes: they are killed, hang and start when a test says so."""

from __future__ import annotations

import queue
from collections import deque
from multiprocessing.reduction import ForkingPickler
from typing import TYPE_CHECKING, Any

from kinespace.stream.workers.process import Loop

if TYPE_CHECKING:
    from kinespace.stream.workers.process import Start


class FakeChannel:
    """Both directions of a worker's channel; messages are worked on when `work` is called."""

    dropped = 0
    is_behind = False

    def __init__(self) -> None:
        self.to_worker: deque[bytes] = deque()
        self.back: list[bytes] = []
        self.closed = False

    def fileno(self) -> int:
        """Give no number: nobody polls."""
        return -1

    def send(self, message: bytes, frames: int = 0) -> None:  # noqa: ARG002 - as a channel has it
        """Keep a message until the worker works."""
        self.to_worker.append(message)

    def flush(self) -> None:
        """Do nothing: nothing waits for room."""

    def receive(self) -> list[bytes] | None:
        """Give what came back; None once the worker is dead and all is read."""
        back, self.back = self.back, []
        return None if self.closed and not back else back

    def close(self) -> None:
        """Close."""
        self.closed = True


class _Back:
    """The worker's end, of which its loop uses only `send`."""

    is_behind = False

    def __init__(self, channel: FakeChannel) -> None:
        self._channel = channel

    def send(self, message: bytes) -> None:
        """Write back, unless the process is dead."""
        if not self._channel.closed:
            self._channel.back.append(message)


class FakeProcess:
    """Takes the place of `crew._Process`."""

    #: Of the newest processes, in their order.
    all: list[FakeProcess] = []  # noqa: RUF012 - emptied by the fixture

    def __init__(self, name: str, library: bytes, start: Start, now: float) -> None:
        self.name, self.begun, self.heard, self.ready = name, now, now, False
        self.process_id = len(FakeProcess.all) + 1
        self.channel: Any = FakeChannel()
        self.hangs = False
        self._opened: queue.SimpleQueue[Any] = queue.SimpleQueue()
        motions, order, book = ForkingPickler.loads(library)
        self._loop = Loop(_Back(self.channel), start.worker(motions, order), self._opened)  # type: ignore[arg-type]
        self._loop.worker.book = book
        FakeProcess.all.append(self)

    @property
    def sensitivity(self) -> float:
        """The recognisers' sensitivity."""
        return self._loop.worker.performers.sensitivity

    def exchange(self, library: bytes) -> None:
        """Take another library at the next turn."""
        self._opened.put(ForkingPickler.loads(library))

    def work(self, most: int = 1_000_000) -> None:
        """Work on what has come, and report."""
        if self.hangs or self.channel.closed:
            return
        self._loop.exchange()
        while self.channel.to_worker and most:
            most -= 1
            self._loop.obey(self.channel.to_worker.popleft())
        self._loop.report()

    def kill(self) -> None:
        """Die: what waits is never worked on, what was written can still be read."""
        self.channel.closed = True

    def end(self, *, kill: bool) -> None:  # noqa: ARG002 - both ways are the same
        """End."""
        self.channel.close()
