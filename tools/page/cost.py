"""The cost of the page: `python -m kinespace.tools.page.cost` prints it, on Linux.

One performer at 60 frames a second is recognised in a process of its own while 0, 1 and 5 pages are open, in turns. The
pages here draw nothing and say at once that they have drawn: a browser asks for less. One more page sleeps all the
while.
"""

from __future__ import annotations

import asyncio
import json
import os
import sys
import threading
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed

from kinespace.stream import Frame
from kinespace.tools.bench import recorded
from kinespace.tools.feeding.feed import Cue, Pace
from kinespace.tools.loopback.answer_listener import Listener
from kinespace.tools.loopback.service_process import BackgroundService
from kinespace.tools.page.process import PagePlan, PageProcess

_PAGES, _RATE = (0, 1, 5), 60.0


@dataclass(slots=True)
class _Cost:
    """One run: hops (p50, p99) in milliseconds, shares of a core, growth of the page's process in MB."""

    pages: int
    hop: tuple[float, float]
    recogniser: float
    server: float
    messages: float
    growth: float


def _processor(process: int) -> float:
    """Give the processor's seconds of a process, as Linux tells."""
    fields = Path(f"/proc/{process}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _memory(process: int) -> float:
    return int(Path(f"/proc/{process}/statm").read_text(encoding="ascii").split()[1]) * os.sysconf("SC_PAGESIZE") / 1e6


async def _watch(address: str, pages: int, ended: threading.Event, counts: list[int]) -> None:
    """Keep pages open that draw nothing, and one that sleeps."""
    host = address.removeprefix("http://").removesuffix("/")

    async def page(*, awake: bool) -> None:
        async with connect(f"ws://{host}/live", origin=f"http://{host}") as socket:  # type: ignore[arg-type]
            while not ended.is_set():
                try:
                    message = await asyncio.wait_for(socket.recv(), 0.5)
                except (TimeoutError, ConnectionClosed):
                    continue
                if awake and isinstance(message, bytes):
                    counts.append(len(message))
                    told = json.loads(message[4 : 4 + int.from_bytes(message[:4], "little")])
                    await socket.send(json.dumps({"ack": told["number"]}))

    await asyncio.gather(page(awake=False), *(page(awake=True) for _ in range(pages)))


def measure(pages: int, seconds: float) -> _Cost:
    """Play motions for so many seconds while so many pages are open."""
    positions = recorded.positions()
    ended, counts = threading.Event(), list[int]()
    with ExitStack() as opened:
        service = opened.enter_context(BackgroundService("osc", watched=True))
        shown = opened.enter_context(PageProcess(PagePlan(service.watched_at, "127.0.0.1:0")))
        sender, receiver = service.connect()
        opened.enter_context(closing(sender))
        listener = opened.enter_context(closing(Listener(receiver)))
        watching = threading.Thread(target=lambda: asyncio.run(_watch(shown.address, pages, ended, counts)))
        watching.start()
        processes = service.process_id or 0, shown.process_id or 0
        pace, before, memory = Pace(), [0.0, 0.0], 0.0
        for index in range(round((seconds + 2) * _RATE)):
            if index == round(2 * _RATE):
                before, memory = [_processor(each) for each in processes], _memory(processes[1])
                counts.clear()
            frame = Frame("ann", 1.0 + index / _RATE, positions[2 * index % len(positions)])
            packet = sender.encode(Cue(index / _RATE, frame, index))
            listener.listen_until(pace.moment(index / _RATE))
            sender.send(packet)
        used = [(_processor(each) - begun) / seconds for each, begun in zip(processes, before, strict=True)]
        growth = _memory(processes[1]) - memory
        messages = len(counts) / seconds
        ended.set()
        watching.join()
    assert service.status is not None  # noqa: S101 - for mypy
    hop = service.status.hop_p50 * 1000, service.status.hop_p99 * 1000
    return _Cost(pages, hop, used[0], used[1], messages, growth)


def main(seconds: float = 20.0, rounds: int = 3) -> None:
    """Measure in turns, and print the medians."""
    runs = [measure(pages, seconds) for _ in range(rounds) for pages in _PAGES]
    print(f"{rounds} rounds of {seconds:g} s; one performer at {_RATE:g} frames a second; a further page sleeps")
    for pages in _PAGES:
        of = [run for run in runs if run.pages == pages]
        hop = np.median([run.hop for run in of], axis=0)
        recogniser, server, messages, growth = np.median(
            [(run.recogniser, run.server, run.messages, run.growth) for run in of], axis=0
        )
        print(
            f"{pages} pages: hop {hop[0]:.2f} ms (p50) {hop[1]:.2f} ms (p99), recogniser {recogniser:.1%} of a core, "
            f"page's process {server:.1%}, {messages:.0f} messages/s, memory {growth:+.1f} MB"
        )


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 20.0)
