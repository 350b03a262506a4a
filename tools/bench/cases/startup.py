"""`kinespace live` as a person starts it: the time until it can answer, and its memory then."""

from __future__ import annotations

import re
import subprocess
import sys
import time
from dataclasses import dataclass
from statistics import median
from typing import TYPE_CHECKING, Self

from kinespace.stream import osc
from kinespace.tools.bench.memory import resident_mb
from kinespace.tools.bench.recorded import Feed
from kinespace.tools.feeding.feed import Cue, OscFrameSender, Pace
from kinespace.tools.loopback.answer_listener import Listener, answer_in
from kinespace.tools.loopback.service_process import LOOPBACK

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from kinespace.stream.recognizer import LiveSignature

#: Seconds after which a start is given up.
_MAX_START = 60.0
#: Frames that are sent before the answers are checked.
_AT_ONCE = 10
#: Frames after which every window is full and has moved through its memory.
_SETTLED = 600
#: Seconds for each frame, so that no frame of many performers is lost.
_PER_FRAME = 0.0003
#: Starts, of which the median is taken.
_STARTS = 5


@dataclass(frozen=True, slots=True)
class Running:
    """The costs of starting and running.

    Attributes
    ----------
    startup_s
        Seconds from starting the command to its first answer, when the frames of a window are sent at once; median.
    resident_mb, resident_100_mb
        Memory with one performer and with a hundred; None where the system does not tell.
    """

    startup_s: float
    resident_mb: float | None
    resident_100_mb: float | None


def measure(
    positions: NDArray[np.float32], signature: LiveSignature, *, starts: int = _STARTS, many: int = 100
) -> Running:
    """Start `kinespace live` some times and feed it recorded frames.

    Parameters
    ----------
    positions
        Shape (frames, joints, 3), metres.
    signature
        Of the recogniser.
    starts
        How often the program is started to measure the start-up time.
    many
        The number of performers for `resident_100_mb`.
    """
    return Running(
        startup_s=median(_startup(positions, signature) for _ in range(starts)),
        resident_mb=_resident(positions, signature, 1),
        resident_100_mb=_resident(positions, signature, many),
    )


class _Live:
    """A running `kinespace live`, a sender to it and a listener to its answers."""

    def __init__(self, signature: LiveSignature, performers: int) -> None:
        receiver = osc.OscReceiver(LOOPBACK, 0)
        self.listener = Listener(receiver)
        addresses = ("--osc-in", f"{LOOPBACK}:0", "--osc-out", f"{LOOPBACK}:{receiver.address[1]}")
        options = ("--signature", signature, "--performers", f"{performers}", "--plain")
        self.started = time.perf_counter()
        command = [sys.executable, "-u", "-m", "kinespace", "live", *addresses, *options]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)  # noqa: S603 - our own program

    def __enter__(self) -> Self:
        try:
            self.sender = OscFrameSender(LOOPBACK, self._port())
        except BaseException:
            self._end()
            raise
        return self

    def _port(self) -> int:
        told = self.process.stdout.readline() if self.process.stdout else ""
        listening = re.search(rf"listening on OSC {re.escape(LOOPBACK)}:(\d+)", told)
        if not listening:
            raise ChildProcessError(f"kinespace live did not start: {told}")
        return int(listening[1])

    def __exit__(self, *_: object) -> None:
        self.sender.close()
        self._end()

    def _end(self) -> None:
        self.process.terminate()
        try:
            self.process.communicate(timeout=_MAX_START)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.communicate()
        self.listener.close()


def _startup(positions: NDArray[np.float32], signature: LiveSignature) -> float:
    feed = Feed(positions)
    with _Live(signature, 1) as live:
        while time.perf_counter() < live.started + _MAX_START:
            for frame in feed.take(_AT_ONCE):
                live.sender.send(live.sender.encode(Cue(0.0, frame, 0)))
            answers = [each for each in live.listener.listen_until(time.perf_counter()) if answer_in(each.packet)]
            if answers:
                return answers[0].arrival - live.started
    raise TimeoutError("kinespace live did not answer")


def _resident(positions: NDArray[np.float32], signature: LiveSignature, performers: int) -> float | None:
    spread = len(positions) // performers
    feeds = [Feed(positions, f"performer {index}", index * spread) for index in range(performers)]
    with _Live(signature, performers) as live:
        pace = Pace()
        for index in range(_SETTLED):
            pace.wait_for(index * performers * _PER_FRAME)
            for feed in feeds:
                live.sender.send(live.sender.encode(Cue(0.0, feed.next(), 0)))
        live.listener.listen_until(time.perf_counter() + _PER_FRAME * performers)
        return resident_mb(live.process.pid)
