"""`kinespace latency`: from the last byte of a frame sent to its answer received, and a bare echo of the packets.

Feeds a recogniser in another process over loopback and times its answers; the same packets go to a bare echo in the
same run.
"""

import argparse
import time
from collections.abc import Sequence
from itertools import cycle, product, repeat
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from kinespace.library import MotionLibrary
from kinespace.stream import Announcement, Frame, Settings
from kinespace.tools.cli.arguments import add_settings, positive, settings_of
from kinespace.tools.cli.console import table_of, tell
from kinespace.tools.feeding import service
from kinespace.tools.feeding.feed import Cue, without_pause

#: Seconds between the connection of both processes and the first frame.
_SETTLE = 0.2
#: Seconds of feed whose latencies do not count: caches fill, ZeroMQ peers connect.
_WARM_UP = 0.5
#: The percentiles that are printed, by name.
_PERCENTILES = {"p50": 50, "p95": 95, "p99": 99, "p999": 99.9, "max": 100}
#: Every eighth of the library's motions is played, so that there are some of each class.
EVERY = 8


class Latency(NamedTuple):
    """The result of one run.

    Attributes
    ----------
    transport, rate_hz
        The transport and the frame rate.
    sent
        Frames sent.
    answered
        Answers received.
    lost
        Answers due that did not come.
    seconds
        Latency of each answer, seconds, shape (answers,).
    echo_seconds
        Round trip of each echoed packet, seconds.
    """

    transport: service.Transport
    rate_hz: float
    sent: int
    answered: int
    lost: int
    seconds: NDArray[np.float64]
    echo_seconds: NDArray[np.float64]

    def percentile(self, percent: float, *, echo: bool = False) -> float:
        """Give a percentile of the latencies in milliseconds; NaN when there is none."""
        seconds = self.echo_seconds if echo else self.seconds
        return float(np.percentile(seconds, percent)) * 1000 if seconds.size else float("nan")

    def as_json(self) -> dict[str, object]:
        """Give the figures by name; milliseconds, null where there is none."""
        figures = {name: each for name, each in self._asdict().items() if not isinstance(each, np.ndarray)}
        for prefix, (name, percent) in product(("", "echo_"), _PERCENTILES.items()):
            value = self.percentile(percent, echo=bool(prefix))
            figures[f"{prefix}{name}_ms"] = None if np.isnan(value) else round(value, 4)
        return figures


def measure(transport: service.Transport, *, rate_hz: float, seconds: float, settings: Settings) -> Latency:
    """Feed a recogniser in another process and time its answers.

    The feed plays every eighth motion of the built-in library, one after the other, again and again. Each frame carries
    its time, so that the answered frames are known beforehand. Every packet also goes, half a frame later, to a process
    that sends it straight back.

    Parameters
    ----------
    transport
        "osc" or "zmq".
    rate_hz
        Frames per second.
    seconds
        The length of the feed.
    settings
        Of the recogniser.

    Raises
    ------
    ValueError
        No frame would be answered after the first half second, which warms up.
    """
    library = MotionLibrary.builtin()
    warm = int(_WARM_UP * rate_hz)
    positions = without_pause(library.motions[::EVERY], rate_hz)
    moments = [k / rate_hz for k in range(round(seconds * rate_hz))]
    frames = map(Frame, repeat("latency"), (1.0 + each for each in moments), cycle(positions))
    cues = [*map(Cue, moments, frames)]
    expected = service.expected_answers(cues, library, settings)
    if not expected or expected[-1].cue < warm:
        raise ValueError(f"--seconds: expected enough for an answer after the first {_WARM_UP:g} s, got {seconds:g}")
    with (
        service.background_service(transport, settings=settings) as background,
        service.background_service(transport, echoes=True) as echo,
    ):
        listener, senders = service.Listener(background.receiver, echo.receiver), (background.sender, echo.sender)
        background.sender.announce(Announcement("latency", library.skeleton.joints))
        # Greetings from the connection are not part of the run.
        listener.listen_until(time.perf_counter() + _SETTLE)
        _, (sent, echo_sent), received = service.play(cues, senders, listener, 0.5 / rate_hz)
    matcher = service.AnswerMatcher(expected)
    echoes = [each for each in received if each.receiver is echo.receiver]
    own = [each for each in received if each.receiver is background.receiver]
    pairs = [(matcher.match(answer), each.arrival) for each in own if (answer := service.answer_in(each.packet))]
    return Latency(
        transport=transport,
        rate_hz=rate_hz,
        sent=len(cues),
        answered=sum(found is not None for found, _ in pairs),
        lost=matcher.lost + matcher.waiting,
        seconds=np.array([arrival - sent[found.cue] for found, arrival in pairs if found and found.cue >= warm]),
        echo_seconds=np.array([each.arrival - at for each, at in zip(echoes, echo_sent, strict=False)][warm:]),
    )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.add_argument("--transport", choices=("osc", "zmq", "both"), default="both")
    parser.add_argument("--rate", type=positive, default=120.0, help="frames per second (default %(default)s)")
    parser.add_argument("--seconds", type=positive, default=20.0, help="of each run (default %(default)s)")
    add_settings(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object; needs one --transport")


def run(options: argparse.Namespace) -> None:
    """Measure each transport and print a table, or one JSON object."""
    transports: Sequence[service.Transport] = ("osc", "zmq") if options.transport == "both" else (options.transport,)
    if options.json and len(transports) > 1:
        raise ValueError("--json: expected --transport osc or zmq with it, got both")
    settings = settings_of(options)
    found = [measure(each, rate_hz=options.rate, seconds=options.seconds, settings=settings) for each in transports]
    tell(options, found[0].as_json(), table_for(found))


def table_for(latencies: Sequence[Latency]) -> Table:
    """Draw two rows for each run: the recogniser's, and the echo's."""
    rows = list[list[str]]()
    for each in latencies:
        rate, counts = f"{each.rate_hz:g}", (each.sent, each.answered, each.lost)
        rows.append([each.transport, rate, *_percentiles(each, echo=False), *map(str, counts)])
        rows.append([f"{each.transport} echo", rate, *_percentiles(each, echo=True)])
    headings = ("", "Hz", "p50", "p95", "p99", "p99.9", "max", "sent", "answered", "lost")
    return table_of("Frame sent to answer received, milliseconds", headings, rows)


def _percentiles(latency: Latency, *, echo: bool) -> list[str]:
    return [f"{latency.percentile(percent, echo=echo):.2f}" for percent in _PERCENTILES.values()]
