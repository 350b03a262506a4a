"""Raw recordings played into a recogniser from the page: from any second, at any speed, paused."""

from __future__ import annotations

import threading
import time
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from kinespace.stream.inputs.recording.kinerec import ENDING, RawFile
from kinespace.stream.zeromq import Endpoint
from kinespace.tools.feeding.packets import cut, open_senders, send_packet

if TYPE_CHECKING:
    from kinespace.tools.page.requests import Play

#: Seconds without a change after which a file is listed: a file that grows is being recorded.
_SETTLED = 3.0
#: Maximum number of recordings that are listed, the newest first.
_MAX_LISTED = 50


@dataclass(frozen=True, slots=True)
class PagePlan:
    """A page to be served.

    Attributes
    ----------
    source
        The ZeroMQ endpoint on which a recogniser publishes.
    address
        HOST:PORT of the page.
    control
        The ZeroMQ endpoint of the recogniser's control socket; None: pages only look.
    recordings
        The folder of recordings that may be played; None: none may.
    osc_to, zmq_to
        Where their packets go: the addresses on which the recogniser listens.
    keys
        Folder of the keys of all ZeroMQ; None for none.
    """

    source: str
    address: str
    control: str | None = None
    recordings: Path | None = None
    osc_to: str | None = None
    zmq_to: str | None = None
    keys: Path | None = None


class Player:
    """Plays one recording at a time, in a thread of its own.

    Parameters
    ----------
    plan
        Where recordings are, and where they go.
    """

    def __init__(self, plan: PagePlan) -> None:
        self._plan, self._folder = plan, plan.recordings or Path()
        self._lengths: dict[tuple[str, int, float], float] = {}
        self._name, self._at, self._speed = "", 0.0, 0.0
        self._stopped = threading.Event()
        self._thread: threading.Thread | None = None
        self._trouble = ""

    def described(self) -> dict[str, object]:
        """Describe the recordings, with their seconds, and the recording that is played; from any thread."""
        return {
            "recordings": self._listed(),
            "playing": self._name,
            "at": round(self._at, 2),
            "speed": self._speed if self._thread and self._thread.is_alive() else 0.0,
            "trouble": self._trouble,
        }

    def _listed(self) -> list[tuple[str, float]]:
        found = [(path.name, path.stat()) for path in self._folder.glob(f"*{ENDING}")]
        settled = [each for each in found if each[1].st_mtime < time.time() - _SETTLED]
        newest = sorted(settled, key=lambda each: -each[1].st_mtime)[:_MAX_LISTED]
        return [(name, self._length(name, told.st_size, told.st_mtime)) for name, told in newest]

    def _length(self, name: str, size: int, changed: float) -> float:
        key = name, size, changed
        if key not in self._lengths:
            try:
                arrivals = [packet.arrival for packet in RawFile(self._folder / name).packets()]
            except (OSError, ValueError):
                arrivals = []
            self._lengths[key] = arrivals[-1] - arrivals[0] if arrivals else 0.0
        return self._lengths[key]

    def play(self, wanted: Play) -> str:
        """Play from a second on, or stop there with speed 0; give the reason why it cannot, or an empty text."""
        if wanted.recording not in {name for name, _ in self._listed()}:
            return "no such recording"
        self.stop()
        self._name, self._at, self._speed, self._trouble = wanted.recording, wanted.at, wanted.speed, ""
        if wanted.speed > 0:
            self._stopped = threading.Event()
            self._thread = threading.Thread(
                target=self._run, args=(self._stopped,), name="kinespace recording", daemon=True
            )
            self._thread.start()
        return ""

    def _run(self, stopped: threading.Event) -> None:
        plan, begin, speed = self._plan, self._at, self._speed
        try:
            with ExitStack() as opened:
                recording = RawFile(self._folder / self._name)
                zmq_to = Endpoint.parse(plan.zmq_to, bind=False) if plan.zmq_to else None
                senders = open_senders(opened, recording, plan.osc_to, zmq_to, plan.keys)
                begun = 0.0
                for due, packet in cut(recording.packets(), begin, None):
                    begun = begun or time.monotonic() - due / speed
                    if stopped.wait(max(begun + due / speed - time.monotonic(), 0.0)):
                        return
                    send_packet(packet, recording, senders)
                    self._at = begin + due
        except (OSError, ValueError) as error:
            self._trouble = str(error)

    def stop(self) -> None:
        """Stop playing."""
        self._stopped.set()
        if self._thread:
            self._thread.join()
            self._thread = None
