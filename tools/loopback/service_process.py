"""A recogniser as a person starts it, or a bare echo, over loopback: demo, latency, bench and tests use both."""

from __future__ import annotations

import gc
import json
import multiprocessing
import tempfile
import time
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Self

import zmq

from kinespace.stream import osc, zeromq
from kinespace.stream.workers.child_process import leave_signals_to_parent, signals_held
from kinespace.stream.zeromq import Endpoint
from kinespace.tools.cli.address import host_and_port
from kinespace.tools.cli.arguments import arguments_of
from kinespace.tools.feeding.feed import OscFrameSender, ZmqFrameSender
from kinespace.tools.loopback.program import Program

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

    from kinespace.library import MotionLibrary
    from kinespace.stream.recognizer import Settings
    from kinespace.tools.feeding.feed import FrameSender
    from kinespace.tools.loopback.answer_listener import Receiver

Transport = Literal["osc", "zmq"]
LOOPBACK = "127.0.0.1"
_ANY = f"tcp://{LOOPBACK}:*"
#: Seconds after which a new process, or a connection to it, is given up.
_MAX_START = 60.0
#: Milliseconds between two looks of an echo whether it is to end, and between two greetings.
_CHECK_EVERY, _GREET_EVERY = 100, 50


class BackgroundService:
    """`kinespace live`, or an echo, in its own process on this machine; a context manager that ends it.

    Parameters
    ----------
    transport
        "osc" or "zmq".
    library
        The library to recognise with; the built-in library when not given.
    settings
        Of the recognisers.
    echo
        Send every packet back unread instead, to measure the cost of everything around a recogniser.
    performers
        The number of performers at once, at most.

    Attributes
    ----------
    process_id
        The number of the process, once it runs.

    Raises
    ------
    ChildProcessError
        The process ended before it began; the message says why.
    """

    def __init__(
        self,
        transport: Transport,
        *,
        library: MotionLibrary | None = None,
        settings: Settings | None = None,
        echo: bool = False,
        performers: int = 32,
    ) -> None:
        self._opened = ExitStack()
        self._transport, self._library, self._echo = transport, library, echo
        self._command = ["--plain", "--performers", f"{performers}", *(arguments_of(settings) if settings else ())]
        self.process_id = 0

    def __enter__(self) -> Self:
        with ExitStack() as opened:
            self._receiver = osc.OscReceiver(LOOPBACK, 0) if self._transport == "osc" else None
            port = self._receiver.address[1] if self._receiver else 0
            if self._receiver:
                opened.callback(self._receiver.close)
            begin = self._begin_echo if self._echo else self._begin
            self._frames_to, self._answers_at = begin(opened, port)
            self._opened = opened.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._opened.close()

    def _begin(self, opened: ExitStack, port: int) -> tuple[str, str]:
        """Start `kinespace live`; give the addresses for frames and of answers."""
        ends = [f"--osc-in={LOOPBACK}:0", f"--osc-out={LOOPBACK}:{port}"]
        command = [*self._command, *(ends if self._transport == "osc" else [f"--zmq-in={_ANY}", f"--zmq-out={_ANY}"])]
        if self._library:
            file = Path(opened.enter_context(tempfile.TemporaryDirectory())) / "library.npz"
            self._library.save(file, compressed=False)
            command += ["--library", f"{file}"]
        program = opened.enter_context(Program("live", *command))
        self.process_id = program.process.pid
        frames_to, answers_at = program.expect(r"listening on \S+ (\S+); answering to \S+ (\S+);").groups()
        return frames_to, answers_at

    def _begin_echo(self, opened: ExitStack, port: int) -> tuple[str, str]:
        # A fresh interpreter, so that the child has none of the parent's sockets and threads.
        context = multiprocessing.get_context("spawn")
        connection, theirs = context.Pipe()
        process = context.Process(target=_echo, args=(theirs, port), daemon=True)
        with signals_held():
            process.start()
        opened.callback(process.join)
        opened.callback(process.kill)
        # Only the child keeps its end, so that its death is noticed at once.
        theirs.close()
        opened.callback(connection.close)
        if not connection.poll(_MAX_START):
            raise ChildProcessError("the echo's process did not start")
        self.process_id = process.pid or 0
        frames_to, answers_at = connection.recv()
        return frames_to, answers_at

    def connect(self) -> tuple[FrameSender, Receiver]:
        """Open a sender of frames to the service and a receiver of its answers, and check that both reach it.

        UDP reaches it at once. ZeroMQ peers take a moment to connect, and messages before that are lost.

        Raises
        ------
        TimeoutError
            They did not connect within a minute.
        """
        if self._receiver:
            return OscFrameSender(*host_and_port(self._frames_to)), self._receiver
        sender = ZmqFrameSender(Endpoint(self._frames_to, bind=False))
        receiver = zeromq.ZmqReceiver(Endpoint(self._answers_at, bind=False))
        until = time.monotonic() + _MAX_START
        while time.monotonic() < until:
            sender.greet()
            receiver.socket.poll(_GREET_EVERY)
            while (parts := receiver.receive()) is not None:
                # A greeting came back, or a status counts it.
                if self._echo or (parts[0] == b"status/" and json.loads(parts[1])["inputs"]["received"]):
                    return sender, receiver
        raise TimeoutError("ZeroMQ: the recogniser's process was not reached")


def _echo(connection: Connection, port: int) -> None:
    """Run in the child until the parent has gone: send every packet back, by OSC to a port."""
    leave_signals_to_parent()
    receiver: Receiver
    sender: osc.OscSender | zeromq.ZmqSender
    if port:
        receiver, sender = osc.OscReceiver(LOOPBACK, 0), osc.OscSender(LOOPBACK, port)
        addresses = f"{LOOPBACK}:{receiver.address[1]}", ""
    else:
        endpoint = Endpoint(_ANY, bind=True)
        receiver, sender = zeromq.ZmqReceiver(endpoint), zeromq.ZmqSender(endpoint)
        addresses = receiver.address, sender.address
    poller = zmq.Poller()
    poller.register(receiver.socket, zmq.POLLIN)
    gc.freeze()
    # A parent that is gone closes its end.
    with suppress(OSError, EOFError):
        connection.send(addresses)
        while not connection.poll():
            if not poller.poll(_CHECK_EVERY):
                continue
            while (packet := receiver.receive()) is not None:
                sender.send(packet)  # type: ignore[arg-type]  # both ends are of one transport
