"""`make soak`: an hour of a stage in ten minutes. Performers come and go, motions are taught and undone, pages look on.

Every event comes six times as often as on a stage. Memory, descriptors and threads of the recogniser and of the page's
process are read while nobody is there: once the teacher remembers as much as it may, and at the end.
"""

import argparse
import json
import os
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from itertools import count
from pathlib import Path
from typing import NamedTuple

import numpy as np
import zmq
from chaos.attacks import Place, place_of
from chaos.performer import stream
from chaos.trial import ended_with, memory_of, page_of, started
from chaos.trials import slow
from numpy.typing import NDArray
from programs import Program
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from kinespace.stream.teaching.teacher import REMEMBERED
from kinespace.tools.programs import bench
from kinespace.tools.programs.bench import machine

#: Performers, frames a second of each, and seconds for which each is there and is away: longer than a silence.
PERFORMERS, FRAME_RATE, THERE, AWAY = 8, 30.0, 4.5, 5.5
#: Seconds between two taught examples, and for which a page is open.
TAUGHT_EVERY, OPEN = 10.0, 10.0
#: Seconds of the stage before the first measurement, longer than a teacher remembers; and until all have gone.
WARM, QUIET = REMEMBERED + 30.0, 9.0
#: Megabytes by which a process may grow, and the threads that asyncio's pool may begin when pages ask at once.
MAX_GROWTH = 10.0
POOL = min(32, (os.cpu_count() or 1) + 4)


class Held(NamedTuple):
    """Resident megabytes, descriptors and threads of a process."""

    memory: float
    descriptors: int
    threads: int

    @classmethod
    def by(cls, process: int) -> "Held":
        """Read them, as Linux tells."""
        return cls(memory_of(process), *(len([*Path(f"/proc/{process}/{each}").iterdir()]) for each in ("fd", "task")))


def held(program: Program) -> dict[str, Held]:
    """Read a recogniser and the process of its page."""
    return {"live": Held.by(program.process.pid), "page": Held.by(page_of(program))}


class Stage:
    """The performers, the teacher and the reader of the page, each in a thread, from `begin` to `end`."""

    def __init__(self, place: Place, control: str, page: str) -> None:
        self._place, self._control, self._page = place, control, page
        self._positions: NDArray = bench.positions()[:: round(bench.FRAME_RATE / FRAME_RATE)]
        self._ended, self._threads = threading.Event(), list[threading.Thread]()
        self.came = self.taught = self.opened = self.answers = 0

    def begin(self) -> None:
        """Let everything happen."""
        self._ended.clear()
        once = (self._teach, self._look_on, self._count)
        works: list[tuple[Callable[..., None], tuple[int, ...]]] = [(each, ()) for each in once]
        works += [(self._perform, (number,)) for number in range(PERFORMERS)]
        self._threads = [threading.Thread(target=work, args=numbers) for work, numbers in works]
        for thread in self._threads:
            thread.start()

    def end(self) -> None:
        """Let everybody leave, and wait until the recogniser has seen it."""
        self._ended.set()
        for thread in self._threads:
            thread.join()
        time.sleep(QUIET)

    def _perform(self, number: int) -> None:
        self._ended.wait(number * (THERE + AWAY) / PERFORMERS)
        for times in count(number):
            if self._ended.is_set():
                return
            self.came += 1
            positions = np.roll(self._positions, -times * len(self._positions) // PERFORMERS, axis=0)
            stream(self._place, f"p{number}", self._ended, positions, FRAME_RATE, THERE)
            self._ended.wait(AWAY)

    def _teach(self) -> None:
        """Take the last two seconds of somebody as an example, and undo it; by turns give it a name of its own."""
        with zmq.Context() as context, context.socket(zmq.REQ) as asking:
            asking.linger = 0
            asking.connect(self._control)
            while not self._ended.wait(TAUGHT_EVERY / 2):
                for number in range(PERFORMERS):
                    last = {"do": "last", "performer": f"p{number}", "seconds": 2.0, "class": f"mine {self.taught % 3}"}
                    asking.send(json.dumps(last).encode())
                    if json.loads(asking.recv())["states"][0]["state"] == "checking":
                        break
                self._ended.wait(TAUGHT_EVERY / 2)
                asking.send(b'{"do": "undo"}')
                self.taught += json.loads(asking.recv())["states"][0]["state"] == "done"

    def _count(self) -> None:
        """Count the answers."""
        with zmq.Context() as context, context.socket(zmq.SUB) as answers:
            answers.connect(self._place.answers)
            answers.subscribe(b"class/")
            while not self._ended.is_set():
                if answers.poll(100):
                    answers.recv_multipart()
                    self.answers += 1

    def _look_on(self) -> None:
        """Open a page, draw all its messages, close it."""
        address = self._page.replace("http", "ws") + "live"
        while not self._ended.is_set():
            self.opened += 1
            with connect(address, origin=self._page.rstrip("/")) as page:  # type: ignore[arg-type]  # a string
                until = time.monotonic() + OPEN
                while time.monotonic() < until and not self._ended.is_set():
                    try:
                        message = page.recv(timeout=0.5)
                    except TimeoutError:
                        continue
                    except ConnectionClosed:
                        break
                    size = int.from_bytes(message[:4], "little")
                    page.send(json.dumps({"ack": json.loads(message[4 : 4 + size])["number"]}))


def main() -> int:
    """Run it; return the exit status: 1 where something grew, or the program did not end well."""
    parser = argparse.ArgumentParser(prog="make soak", description=__doc__)
    parser.add_argument("--seconds", type=float, default=600.0, help="in all (default %(default)s)")
    parser.add_argument("--slow", action="store_true", help="leave the recogniser 15 %% of a core")
    options = parser.parse_args()
    with ExitStack() as opened:
        folder = opened.enter_context(tempfile.TemporaryDirectory())
        arguments = ("--teach", f"{folder}/mine.npz", "--control", "tcp://127.0.0.1:*", "--page", "127.0.0.1:0")
        program = opened.enter_context(started(arguments))
        control = program.expect(r"ZeroMQ (tcp://\S+) \(control\)")[1]
        stage = Stage(place_of(program), control, program.expect(r"page: (http\S+)")[1])
        if options.slow:
            threading.Thread(target=slow, args=(program, Path(folder), options.seconds), daemon=True).start()
        found: list[dict[str, Held]] = []
        for seconds in (WARM, options.seconds - WARM - 2 * QUIET):
            stage.begin()
            ending = time.monotonic() + seconds
            while time.monotonic() < ending:
                time.sleep(min(30.0, ending - time.monotonic()))
                _say({"after": round(time.monotonic() - ending + seconds), "answers": stage.answers, **held(program)})
            stage.end()
            found.append(held(program))
            _say({"nobody": "there", **found[-1]})
        ended, printed = ended_with(program), program.output
    before, after = found
    most = MAX_GROWTH, 0, POOL
    grown = [
        name
        for name, now in after.items()
        if any(held > was + more for held, was, more in zip(now, before[name], most, strict=True))
    ]
    _say({"came": stage.came, "taught": stage.taught, "pages": stage.opened, "grown": grown, "ended": ended})
    _say({"on": machine(), "counts": printed.strip().splitlines()[-1]})
    return int(bool(grown) or ended != 0 or "Traceback" in program.errors)


def _say(found: dict[str, object]) -> None:
    print("; ".join(f"{name} {each}" for name, each in found.items()), flush=True)  # noqa: T201 - a program's output


if __name__ == "__main__":
    sys.exit(main())
