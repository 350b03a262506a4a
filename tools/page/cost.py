"""The cost of the page: `python -m kinespace.tools.page.cost` prints it, on Linux.

One performer at 60 frames a second is recognised in a process of its own while 0, 1 and 5 pages are open, in turns. The
pages here draw nothing and say at once that they have drawn: a browser asks for less. One more page sleeps all the
while.
"""

from __future__ import annotations

import asyncio
import json
import math
import multiprocessing
import sys
import time
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed

from kinespace.stream import Frame
from kinespace.tools.bench import recorded
from kinespace.tools.bench.memory import core_seconds, resident_mb
from kinespace.tools.feeding.feed import Cue, Pace
from kinespace.tools.loopback.answer_listener import Listener
from kinespace.tools.loopback.service_process import BackgroundService
from kinespace.tools.page.process import PagePlan, PageProcess

if TYPE_CHECKING:
    from collections.abc import Sequence
    from multiprocessing.connection import Connection

    from numpy.typing import NDArray

    from kinespace.tools.feeding.feed import FrameSender, Packet

_PAGES, _RATE = (0, 1, 5), 60.0
#: Seconds of a turn that do not count: pages come and go.
_SETTLING = 1.0
#: How often turns are drawn with replacement for the interval of a difference.
_DRAWS = 2000


@dataclass(frozen=True, slots=True)
class _Turn:
    """Some seconds with some pages open.

    Attributes
    ----------
    pages
        The number of pages.
    lags
        Seconds from a frame to its answer, shape (answers,).
    recogniser, server
        Shares of a core.
    messages
        Messages to pages, a second.
    memory
        Megabytes of the page's process at the end.
    """

    pages: int
    lags: NDArray[np.float64]
    recogniser: float
    server: float
    messages: float
    memory: float


def _rounded(time: float) -> float:
    return round(time, 3)


def _time_of(packet: Packet) -> float:
    """Give the time in an answer; NaN for another packet."""
    if isinstance(packet, bytes):
        return math.nan
    told = json.loads(packet[1]) if packet[0].startswith(b"class/") else {}
    return _rounded(told.get("t", math.nan))


async def _page(address: str, counts: list[int], *, awake: bool) -> None:
    """Keep a page open that draws nothing, or one that sleeps."""
    host = address.removeprefix("http://").removesuffix("/")
    async with connect(f"ws://{host}/live", origin=f"http://{host}") as socket:  # type: ignore[arg-type]
        with suppress(ConnectionClosed):
            async for message in socket:
                if awake and isinstance(message, bytes):
                    counts.append(len(message))
                    told = json.loads(message[4 : 4 + int.from_bytes(message[:4], "little")])
                    await socket.send(json.dumps({"ack": told["number"]}))
                if not awake:
                    await asyncio.Event().wait()


async def _browse(wanted: Connection, address: str) -> None:
    """Open as many pages as is asked; each time say how many messages came before. None ends it."""
    counts = list[int]()
    sleeping, pages = asyncio.create_task(_page(address, counts, awake=False)), list[asyncio.Task[None]]()
    while (number := await asyncio.to_thread(wanted.recv)) is not None:
        wanted.send(len(counts))
        counts.clear()
        while len(pages) > number:
            pages.pop().cancel()
        pages += [asyncio.create_task(_page(address, counts, awake=True)) for _ in range(number - len(pages))]
    for each in (sleeping, *pages):
        each.cancel()


def _browser(wanted: Connection, address: str) -> None:
    asyncio.run(_browse(wanted, address))


class _Feed:
    """The performer: frames go out on schedule, and each answer is timed."""

    def __init__(self, sender: FrameSender, listener: Listener) -> None:
        self._sender, self._listener = sender, listener
        self._positions, self._pace = recorded.positions(), Pace()
        #: When each frame was sent, by the time in it.
        self._sent: dict[float, float] = {}

    def play(self, seconds: float) -> NDArray[np.float64]:
        """Send frames for so many seconds; give the seconds from each frame to its answer."""
        lags = list[float]()
        for _ in range(round(seconds * _RATE)):
            index = len(self._sent)
            frame = Frame("ann", 1.0 + index / _RATE, self._positions[2 * index % len(self._positions)])
            packet = self._sender.encode(Cue(index / _RATE, frame, index))
            for heard in self._listener.listen_until(self._pace.moment(index / _RATE)):
                lags += [heard.arrival - at for at in [self._sent.get(_time_of(heard.packet))] if at]
            self._sent[_rounded(frame.time)] = time.perf_counter()
            self._sender.send(packet)
        return np.array(lags)


def _turn(feed: _Feed, pages: int, browser: Connection, processes: Sequence[int | None], seconds: float) -> _Turn:
    """Play for so many seconds while so many pages are open; the recogniser's and the page's process are measured."""

    def opened() -> int:
        """Have so many pages open; give the number of messages since the last call."""
        browser.send(pages)
        messages: int = browser.recv()
        return messages

    def used() -> list[float]:
        return [core_seconds(each) or 0.0 for each in processes]

    opened()
    feed.play(_SETTLING)
    opened()
    before = used()
    lags = feed.play(seconds)
    recogniser, server = ((now - then) / seconds for now, then in zip(used(), before, strict=True))
    return _Turn(pages, lags, recogniser, server, opened() / seconds, resident_mb(processes[1]) or 0.0)


def measure(seconds: float, rounds: int) -> list[_Turn]:
    """Play motions while 0, 1 and 5 pages are open by turns, so many seconds each and so many times."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    with ExitStack() as opened:
        service = opened.enter_context(BackgroundService("zmq", watched=True))
        shown = opened.enter_context(PageProcess(PagePlan(service.watched_at, "127.0.0.1:0")))
        browser = context.Process(target=_browser, args=(theirs, shown.address), daemon=True)
        browser.start()
        opened.callback(browser.kill)
        sender, receiver = service.connect()
        opened.enter_context(closing(sender))
        feed = _Feed(sender, opened.enter_context(closing(Listener(receiver))))
        feed.play(2 * _SETTLING)
        # The order changes from round to round: a busy moment of the machine meets all alike.
        order = [_PAGES[(turn + turn // len(_PAGES)) % len(_PAGES)] for turn in range(rounds * len(_PAGES))]
        turns = [_turn(feed, pages, ours, (service.process_id, shown.process_id), seconds) for pages in order]
        ours.send(None)
    return turns


def _percentile(turns: list[_Turn]) -> float:
    return float(np.percentile(np.concatenate([turn.lags for turn in turns]), 99)) * 1000


def _interval(turns: list[_Turn], others: list[_Turn]) -> tuple[float, float]:
    """Give the 95 % interval of the difference of two p99, milliseconds (bootstrap over turns)."""
    rng = np.random.default_rng(1)

    def drawn(of: list[_Turn]) -> list[_Turn]:
        return [of[each] for each in rng.integers(len(of), size=len(of))]

    differences = [_percentile(drawn(turns)) - _percentile(drawn(others)) for _ in range(_DRAWS)]
    return float(np.percentile(differences, 2.5)), float(np.percentile(differences, 97.5))


def main(seconds: float = 8.0, rounds: int = 8) -> None:
    """Measure in turns, and print what came of it."""
    turns = measure(seconds, rounds)
    print(f"{rounds} turns of {seconds:g} s each; one performer at {_RATE:g} frames a second; a further page sleeps")
    none = [turn for turn in turns if turn.pages == 0]
    for pages in _PAGES:
        of = [turn for turn in turns if turn.pages == pages]
        middle = np.median(np.concatenate([turn.lags for turn in of])) * 1000
        recogniser, server, messages = np.mean([(turn.recogniser, turn.server, turn.messages) for turn in of], axis=0)
        low, high = _interval(of, none)
        told = f" ({_percentile(of) - _percentile(none):+.2f}, 95 %: {low:+.2f} to {high:+.2f})" if pages else ""
        print(
            f"{pages} pages: answer after {middle:.2f} ms (p50), {_percentile(of):.2f} ms (p99){told}; recogniser "
            f"{recogniser:.1%} of a core, page's process {server:.1%}, {messages:.0f} messages/s, "
            f"memory {of[-1].memory - of[0].memory:+.1f} MB"
        )


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 8.0)
