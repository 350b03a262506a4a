"""A stand-in for Qualisys Track Manager: it sends frames only after the handshake."""

from __future__ import annotations

import re
import socket
import threading
import time
from contextlib import contextmanager
from importlib import resources
from typing import TYPE_CHECKING

from golden import Moment, message, qtm
from programs import LOOPBACK, PATIENCE, ghost_cues

from kinespace.library.naming.hdm05 import SKELETON
from kinespace.stream.osc.packet import decode_packet

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


class FakeQtm:
    """Waits for `Connect` and `StreamFrames`, then sends a ghost at 30 Hz until it is told to disconnect."""

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((LOOPBACK, 0))
        self._socket.settimeout(1 / 30)
        self.port: int = self._socket.getsockname()[1]
        #: The commands that came, in their order.
        self.told: list[str] = []
        self._cues = ghost_cues("kickLFront1Reps", 2.5)[::4]
        self._over = threading.Event()
        self._disconnected = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        client: tuple[str, int] | None = None
        streaming, number, begin = False, 0, time.monotonic()
        while not self._over.is_set():
            try:
                packet, came_from = self._socket.recvfrom(2000)
            except TimeoutError:
                packet = b""
            for command in decode_packet(packet) if packet else ():
                text = str(command.arguments[0])
                self.told.append(text)
                if found := re.fullmatch(r"Connect (\d+)", text):
                    client = came_from[0], int(found[1])
                    self._socket.sendto(message("/qtm/cmd_res", "s", "QTM RT Interface connected"), client)
                elif text.startswith("StreamFrames"):
                    streaming = text != "StreamFrames Stop"
                    begin, number = time.monotonic(), 0
                elif text == "Disconnect":
                    client = None
                    self._disconnected.set()
            while client and streaming and number < (time.monotonic() - begin) * 30:
                places = dict(zip(SKELETON.joints, self._cues[number % len(self._cues)].frame.positions, strict=True))
                (frame,) = qtm(Moment(places, 1.0 + number / 30, number))
                self._socket.sendto(frame, client)
                number += 1

    def wait_for_goodbye(self) -> bool:
        """Wait until the command to disconnect has come."""
        return self._disconnected.wait(PATIENCE)

    def close(self) -> None:
        """Stop."""
        self._over.set()
        self._thread.join()
        self._socket.close()


@contextmanager
def fake_qtm(folder: Path) -> Iterator[tuple[FakeQtm, Path]]:
    """Run one, and give it with a preset that connects to its port."""
    preset = folder / "ours.toml"
    text = (resources.files("kinespace.stream.feeds") / "presets" / "qtm.toml").read_text(encoding="utf-8")
    fake = FakeQtm()
    try:
        preset.write_text(text.replace("port = 22225", f"port = {fake.port}"), encoding="utf-8")
        yield fake, preset
    finally:
        fake.close()
