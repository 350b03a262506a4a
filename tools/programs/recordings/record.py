"""`kinespace record`: writes every packet of a feed to a file, as it came."""

from __future__ import annotations

import time
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import zmq
from rich.status import Status

from kinespace.stream import osc, zeromq
from kinespace.stream.inputs.recording import RawWriter, Recorder, source_name
from kinespace.stream.zeromq import Endpoint, Keyring
from kinespace.tools.cli.address import host_and_port, opening
from kinespace.tools.cli.arguments import OSC_IN, add_inputs, add_keys, add_overwrite, positive
from kinespace.tools.cli.interruption import stop_on_signals
from kinespace.tools.terminal.console import console, progress_console
from kinespace.tools.terminal.output_path import require_place_for

if TYPE_CHECKING:
    import argparse

#: Milliseconds of the longest sleep: Ctrl-C takes effect within this time.
_MAX_SLEEP = 100

_Receivers = list[osc.OscReceiver | zeromq.ZmqReceiver]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.description = (
        "Keeps every packet with its arrival time and sender until Ctrl-C. A crash costs the last second at most. "
        "kinespace replay sends the file again bit for bit; kinespace live --record records while it recognises."
    )
    parser.add_argument("output", type=Path, metavar="FILE", help="the recording to make, like tonight.kinerec")
    add_inputs(parser)
    add_keys(parser)
    parser.add_argument("--seconds", type=positive, help="seconds to record (default: until Ctrl-C)")
    add_overwrite(parser)


def run(options: argparse.Namespace) -> int:
    """Run the program with these options; return the exit status."""
    return record(
        options.output,
        osc_in=options.osc_in or (None if options.zmq_in else OSC_IN),
        zmq_in=options.zmq_in,
        keys=options.keys,
        seconds=options.seconds,
        overwrite=options.overwrite,
    )


def record(
    output: Path, *, osc_in: str | None, zmq_in: str | None, keys: Path | None, seconds: float | None, overwrite: bool
) -> int:
    """Record until interrupted, or for so many seconds; print the counts.

    Parameters
    ----------
    output
        The file to write.
    osc_in, zmq_in
        Where packets come in; at least one of the two.
    keys
        Folder of the keys of ZeroMQ senders; None for none.
    seconds
        How long; by default until interrupted.
    overwrite
        Whether a file that is there may be written over.
    """
    require_place_for(output, overwrite=overwrite)
    with ExitStack() as opened:
        receivers = _open(opened, osc_in, zmq_in, keys)
        output.unlink(missing_ok=True)
        names = list(map(source_name, receivers))
        writer = opened.enter_context(RawWriter(output, names))
        recording = _Recording(receivers, writer)
        stop_on_signals(recording.stop)
        console.print(f"recording {', '.join(names)} to {output}; Ctrl-C ends", soft_wrap=True)
        with Status("no packets yet", console=progress_console) as shown:
            recording.run(seconds, shown)
    lost = sum(receiver.kernel_drops for receiver in receivers)
    console.print(
        f"{output}: {writer.written} packets, {output.stat().st_size / 1e6:.2f} MB; "
        f"{writer.failed} could not be written, {lost} were lost by the system before they came here"
        + (f", {recording.broken} connections broke (messages too large or too many?)" if recording.broken else ""),
        soft_wrap=True,
    )
    return 0


def _open(opened: ExitStack, osc_in: str | None, zmq_in: str | None, keys: Path | None) -> _Receivers:
    if not (osc_in or zmq_in):
        raise ValueError("record: expected --osc-in or --zmq-in, got neither")
    receivers: _Receivers = []
    keyring = opened.enter_context(Keyring(keys)) if keys else None
    if osc_in:
        with opening("--osc-in"):
            receivers.append(osc.OscReceiver(*host_and_port(osc_in)))
        opened.callback(receivers[-1].close)
    if zmq_in:
        with opening("--zmq-in"):
            receivers.append(zeromq.ZmqReceiver(Endpoint.parse(zmq_in, bind=True), keyring=keyring))
        opened.callback(receivers[-1].close)
    return receivers


class _Recording:
    """Writes packets from sockets to a file, until stopped.

    Attributes
    ----------
    broken
        ZeroMQ connections that broke while the sender was there.
    """

    def __init__(self, receivers: _Receivers, writer: RawWriter) -> None:
        self._receivers = receivers
        self._recorders = [Recorder(writer, index) for index in range(len(receivers))]
        self._writer = writer
        self.broken = 0
        self._stopped = False
        self._poller = zmq.Poller()
        for receiver in self._receivers:
            self._poller.register(receiver.socket, zmq.POLLIN)

    def stop(self) -> None:
        """Make `run` return soon."""
        self._stopped = True

    def run(self, seconds: float | None, shown: Status) -> None:
        """Go on until stopped or until so many seconds have passed; packets that have arrived by then are kept."""
        began = told = time.monotonic()
        while not self._stopped and (seconds is None or time.monotonic() < began + seconds):
            self._poller.poll(_MAX_SLEEP)
            self._keep()
            if time.monotonic() >= told + 1.0:
                told = time.monotonic()
                self.broken = sum(receiver.broken() for receiver in self._receivers)
                if self._writer.written:
                    shown.update(f"{self._writer.written} packets in {told - began:.0f} s")
        self._keep()

    def _keep(self) -> None:
        for receiver, recorder in zip(self._receivers, self._recorders, strict=True):
            while (packet := receiver.receive()) is not None:
                recorder.keep(packet, time.monotonic(), receiver.sender)
                if self._stopped:
                    return
