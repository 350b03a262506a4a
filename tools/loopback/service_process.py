"""A service, or a stand-in for it, in a process of its own: demo, latency and tests use it over loopback."""

from __future__ import annotations

import gc
import json
import multiprocessing
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Protocol, Self

import zmq

from kinespace.library import MotionLibrary
from kinespace.stream import osc, zeromq
from kinespace.stream.inputs import OscDecoder, Source, ZmqDecoder
from kinespace.stream.outputs import LayoutSink, NativeLayout, ZmqSink
from kinespace.stream.outputs.body_sink import BodySink
from kinespace.stream.recognizer import Performers, Recognizer, Settings
from kinespace.stream.service.child_process import leave_signals_to_parent, signals_held
from kinespace.stream.service.loop import Service
from kinespace.stream.zeromq import Endpoint, Keyring
from kinespace.tools.feeding.feed import OscFrameSender, ZmqFrameSender

if TYPE_CHECKING:
    from collections.abc import Callable
    from multiprocessing.connection import Connection
    from pathlib import Path

    from kinespace.stream.outputs import Sink
    from kinespace.stream.service.status import Status
    from kinespace.tools.feeding.feed import FrameSender, Packet
    from kinespace.tools.loopback.answer_listener import Receiver

Transport = Literal["osc", "zmq"]
LOOPBACK = "127.0.0.1"
ANY_ENDPOINT = Endpoint(f"tcp://{LOOPBACK}:*", bind=True)
#: Seconds after which a new process is given up.
_MAX_START = 60.0
#: Seconds after which a stand-in checks whether the parent wants it to stop.
_CHECK_EVERY = 0.1
_GREET_EVERY_MS = 50


class StandIn(Protocol):
    """Answers in a recogniser's place, to measure the cost of everything around it; it is sent to the process."""

    def answer(self, packet: Packet) -> Packet | None:
        """Give the answer to a packet; None for no answer."""


class Echo:
    """Sends every packet back unread."""

    def answer(self, packet: Packet) -> Packet:
        """Give the packet itself."""
        return packet


@dataclass(frozen=True, slots=True)
class _Request:
    transport: Transport
    library: MotionLibrary | None
    settings: Settings
    answer_port: int
    stand_in: StandIn | None
    performers: int
    keys: Path | None
    watched: bool


class BackgroundService:
    """A recogniser, or a stand-in for it, in its own process on this machine.

    Use as a context manager; on leaving, the process is stopped and `status` holds its last counts.

    Parameters
    ----------
    transport
        "osc" or "zmq".
    library
        The library to recognise with; the built-in library when not given.
    settings
        Of the recognisers.
    stand_in
        Answers instead of a recogniser. Over ZeroMQ it must answer a greeting, whose topic is `hello/`.
    performers
        The number of performers at once, at most.
    keys
        Folder of the keys that both ends of ZeroMQ use; None for none.
    watched
        Whether answers and bodies are also published on an endpoint of their own, `watched_at`, for a page.

    Attributes
    ----------
    status
        The service's counters when it was stopped; None before, and for a stand-in.
    watched_at
        The ZeroMQ endpoint for a page, once it runs; empty unless `watched`.
    """

    def __init__(
        self,
        transport: Transport,
        *,
        library: MotionLibrary | None = None,
        settings: Settings | None = None,
        stand_in: StandIn | None = None,
        performers: int = 32,
        keys: Path | None = None,
        watched: bool = False,
    ) -> None:
        self._keyring = Keyring(keys) if keys else None
        self.status: Status | None = None
        self.watched_at = ""
        self._stand_in = stand_in
        self._receiver: osc.OscReceiver | None = osc.OscReceiver(LOOPBACK, 0) if transport == "osc" else None
        port = self._receiver.address[1] if self._receiver else 0
        # A fresh interpreter, so that the child has none of the parent's sockets and threads.
        context = multiprocessing.get_context("spawn")
        self._connection, self._theirs = context.Pipe()
        request = _Request(transport, library, settings or Settings(), port, stand_in, performers, keys, watched)
        self._process = context.Process(target=_serve, args=(self._theirs, request), daemon=True)

    def __enter__(self) -> Self:
        try:
            with signals_held():
                self._process.start()
            # Only the child keeps its end, so that its death is noticed at once.
            self._theirs.close()
            self._frames_to, self._answers_at, self.watched_at = self._started()
        except BaseException:
            if self._process.pid is not None:
                self._process.kill()
            self._release()
            raise
        return self

    def _started(self) -> tuple[Any, Any, str]:
        if not self._connection.poll(_MAX_START):
            raise TimeoutError("the recogniser's process did not start")
        try:
            answer = self._connection.recv()
        except EOFError:
            raise ChildProcessError("the recogniser's process ended before it began") from None
        if isinstance(answer, Exception):
            raise answer
        frames_to, answers_at, watched_at = answer
        return frames_to, answers_at, watched_at

    def __exit__(self, *_: object) -> None:
        # A child that died tells nothing; its answers have stopped already.
        with suppress(EOFError, OSError):
            self._connection.send(None)
            if self._connection.poll(_MAX_START):
                self.status = self._connection.recv()
        self._release()

    def _release(self) -> None:
        if self._process.pid is not None:
            self._process.join(_MAX_START)
        self._connection.close()
        if self._receiver:
            self._receiver.close()
        if self._keyring:
            self._keyring.close()

    @property
    def frames_to(self) -> str | tuple[str, int]:
        """The address to send frames to, once it runs: (host, port) of UDP, or a ZeroMQ endpoint to connect to."""
        address: str | tuple[str, int] = self._frames_to
        return address

    @property
    def process_id(self) -> int | None:
        """The number of the process, once it runs."""
        return self._process.pid

    def connect(self) -> tuple[FrameSender, Receiver]:
        """Open a sender of frames to the service and a receiver of its answers, and check that both reach it.

        UDP reaches it at once. ZeroMQ peers take a moment to connect, and messages before that are lost.

        Raises
        ------
        TimeoutError
            They did not connect within a minute.
        """
        if self._receiver:
            return OscFrameSender(*self._frames_to), self._receiver
        sender = ZmqFrameSender(Endpoint(self._frames_to, bind=False), self._keyring)
        receiver = zeromq.ZmqReceiver(Endpoint(self._answers_at, bind=False), keyring=self._keyring)
        until = time.monotonic() + _MAX_START
        while time.monotonic() < until:
            sender.greet()
            receiver.socket.poll(_GREET_EVERY_MS)
            while (parts := receiver.receive()) is not None:
                if self._has_heard_us(parts):
                    return sender, receiver
        raise TimeoutError("ZeroMQ: the recogniser's process was not reached")

    def _has_heard_us(self, parts: list[bytes]) -> bool:
        """Whether a message shows that greetings arrive: a stand-in's answer, or a status that counts them."""
        if self._stand_in:
            return True
        return parts[0] == b"status/" and json.loads(parts[1])["inputs"]["received"] > 0


def _serve(connection: Connection, request: _Request) -> None:
    """Run in the child: open sockets, report the address, go on until told to stop, report the counts."""
    leave_signals_to_parent()
    # A parent that is gone needs no report.
    with suppress(BrokenPipeError, ConnectionError):
        _serve_parent(connection, request)


def _serve_parent(connection: Connection, request: _Request) -> None:
    try:
        source, sink, addresses = _osc_ends(request) if request.transport == "osc" else _zmq_ends(request)
        performers = None if request.stand_in else _performers(request)
        sinks, watched_at = _watched(request, performers)
    except (OSError, ValueError) as error:
        connection.send(error)
        return
    connection.send((*addresses, watched_at))
    if performers is None:
        _stand_in(connection, source, sink, request.stand_in or Echo())
        connection.send(None)
        return
    gc.freeze()
    with Service(performers, [source], [sink, *sinks]) as service:
        _when_told(connection, service.stop)
        service.run()
        connection.send(service.status())


def _performers(request: _Request) -> Performers:
    library = request.library or MotionLibrary.builtin()
    # The first recogniser computes the library's windows; the first performer's first frame must not wait for them.
    Recognizer(library, request.settings)
    return Performers(library, request.settings, most=request.performers)


def _watched(request: _Request, performers: Performers | None) -> tuple[list[Sink], str]:
    """Open the endpoint for a page; give its sinks and its address."""
    if not request.watched or performers is None:
        return [], ""
    sender = zeromq.ZmqSender(ANY_ENDPOINT)
    return [ZmqSink(sender), BodySink(sender, performers)], sender.address


def _when_told(connection: Connection, stop: Callable[[], None]) -> None:
    """Stop when the parent says so, or is gone; a thread waits, because checking every time is slow."""

    def wait() -> None:
        connection.poll(None)
        stop()

    threading.Thread(target=wait, name="kinespace until told to stop", daemon=True).start()


def _osc_ends(request: _Request) -> tuple[Source, LayoutSink | ZmqSink, tuple[object, object]]:
    receiver, sender = osc.OscReceiver(LOOPBACK, 0), osc.OscSender(LOOPBACK, request.answer_port)
    return Source(receiver, OscDecoder()), LayoutSink(NativeLayout(), sender), (receiver.address, None)


def _zmq_ends(request: _Request) -> tuple[Source, LayoutSink | ZmqSink, tuple[object, object]]:
    # The end of the process closes it.
    keyring = Keyring(request.keys) if request.keys else None
    receiver, sender = zeromq.ZmqReceiver(ANY_ENDPOINT, keyring=keyring), zeromq.ZmqSender(ANY_ENDPOINT, keyring)
    return Source(receiver, ZmqDecoder()), ZmqSink(sender), (receiver.address, sender.address)


def _stand_in(connection: Connection, source: Source, sink: LayoutSink | ZmqSink, stand_in: StandIn) -> None:
    """Receive and send, nothing else: the cost of the transport and the machine."""
    stopped = threading.Event()
    _when_told(connection, stopped.set)
    poller = zmq.Poller()
    poller.register(source.receiver.socket, zmq.POLLIN)
    gc.freeze()
    while not stopped.is_set():
        if not poller.poll(int(_CHECK_EVERY * 1000)):
            continue
        while (packet := source.receiver.receive()) is not None:
            answer = stand_in.answer(packet)
            if answer is not None:
                sink.sender.send(answer)  # type: ignore[arg-type]  # both ends are of one transport
    source.close()
    sink.close()
