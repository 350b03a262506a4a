"""A worker's process: it reads frames from its channel, and writes answers back, until the other end is closed."""

from __future__ import annotations

import gc
import queue
import select
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.reduction import ForkingPickler
from typing import TYPE_CHECKING, Any

from kinespace.stream.recognizer import Performers, Recognizer, SentJoints, Settings
from kinespace.stream.service.background_opener import background_restricter, background_windows
from kinespace.stream.service.child_process import leave_signals_to_parent
from kinespace.stream.workers.channel import Channel
from kinespace.stream.workers.wire import (
    ASK,
    FRAMES,
    REPORT,
    SENSE,
    TAKE_OVER,
    Answers,
    decode_entries,
    decode_frames,
    decode_number,
    decode_share,
    encode_answers,
)
from kinespace.stream.workers.worker import Worker

if TYPE_CHECKING:
    import socket
    from multiprocessing.connection import Connection

    from kinespace.library.naming import Naming

#: Seconds between two reports.
REPORT_EVERY = 0.25


@dataclass(frozen=True, slots=True)
class Start:
    """The values that a worker needs beside the library.

    Attributes
    ----------
    settings
        The settings of the recognisers.
    assumed, naming
        The same as for `SentJoints`.
    most, silence
        The same as for `Performers`.
    """

    settings: Settings
    assumed: tuple[str, ...]
    naming: Naming
    most: int
    silence: float

    def worker(self, library: Any, order: tuple[str, ...]) -> Worker:  # noqa: ANN401 - as for `Performers`
        """Make the worker."""
        joints = SentJoints(self.assumed, self.naming, background_restricter(self.settings))
        opener = background_windows()
        performers = Performers(
            library,
            self.settings,
            most=self.most,
            silence=self.silence,
            joints=joints,
            opener=opener,
            classes=order,
        )
        return Worker(performers)


def packed(library: object, order: tuple[str, ...], book: int) -> bytes:
    """Pack a library, opened or not, with the order and the number of its classes, for another process of ours."""
    return bytes(ForkingPickler.dumps((library, order, book)))


def run(end: socket.socket, libraries: Connection, start: Start) -> None:
    """Work until the other end of the channel is closed.

    Parameters
    ----------
    end
        The socket on which frames come.
    libraries
        Gives `packed` libraries; the first library comes before any frame.
    start
        The other values that the worker needs.
    """
    # The parent closes the channel when it is done.
    leave_signals_to_parent(termination=True)
    opened: queue.SimpleQueue[Any] = queue.SimpleQueue()
    given = libraries, opened, start.settings
    threading.Thread(target=_read, args=given, name="kinespace libraries", daemon=True).start()
    if (first := opened.get()) is None:
        return
    library, order, book = first
    worker = start.worker(library, order)
    worker.book = book
    gc.freeze()
    Loop(Channel(end), worker, opened).run()


def _read(libraries: Connection, opened: queue.SimpleQueue[Any], settings: Settings) -> None:
    with suppress(EOFError, OSError):
        while True:
            library, order, book = ForkingPickler.loads(libraries.recv_bytes())
            # A recogniser prepares what all recognisers share, some of which takes a second: no frame waits for it.
            Recognizer(library, settings)
            opened.put((library, order, book))
    opened.put(None)


class Loop:
    """Reads messages, works, and reports, until the other end is closed."""

    def __init__(self, channel: Channel, worker: Worker, opened: queue.SimpleQueue[Any]) -> None:
        self.worker = worker
        self._channel, self._opened = channel, opened
        self._next_report = 0.0

    def run(self) -> None:
        """Go on until the channel is closed."""
        while True:
            self.report_when_due()
            writing = [self._channel] if self._channel.is_behind else []
            select.select([self._channel], writing, [], max(self._next_report - time.monotonic(), 0.0))
            self._channel.flush()
            messages = self._channel.receive()
            if messages is None:
                return
            self.exchange()
            for message in messages:
                self.obey(message)
                self.report_when_due()

    def exchange(self) -> None:
        """Compare with the library that came last, if one came."""
        while not self._opened.empty():
            if (received := self._opened.get()) is not None:
                library, order, book = received
                self.worker.exchange(library, order, book)

    def obey(self, message: bytes) -> None:
        """Take in one message."""
        kind, content = message[:1], message[1:]
        if kind == FRAMES:
            if answers := self.worker.push(decode_frames(content), time.monotonic()):
                self._channel.send(encode_answers(Answers(answers)))
        elif kind == TAKE_OVER:
            self.worker.take_over(decode_entries(content), time.monotonic())
        elif kind == SENSE:
            self.worker.performers.set_sensitivity(decode_share(content))
        elif kind == REPORT:
            self.report()
        elif kind == ASK:
            self._channel.send(encode_answers(Answers([], last=decode_number(content))))

    def report_when_due(self) -> None:
        """Report a few times a second, which also shows that the worker is alive."""
        if time.monotonic() >= self._next_report:
            self.report()

    def report(self) -> None:
        """Report now."""
        now = time.monotonic()
        self._next_report = now + REPORT_EVERY
        self._channel.send(encode_answers(Answers([], self.worker.report(now))))
