"""liblo's programs oscsend and oscdump, run as a person runs them; the lines of oscdump are read back."""

from __future__ import annotations

import re
import subprocess
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from programs import LOOPBACK, PATIENCE, free_udp_port

from kinespace.stream.osc import OscSender

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

#: Digits after the point in oscdump's floats.
DUMPED_TO = 6
_STRING = re.compile(r'"([^"]*)"|(\S+)')


class LibloTools(NamedTuple):
    """The paths of the programs."""

    oscsend: Path
    oscdump: Path

    def send(self, port: int, address: str, types: str = "", *values: object) -> None:
        """Let oscsend send one message."""
        command = [self.oscsend, f"osc.udp://{LOOPBACK}:{port}", address, types, *map(str, values)]
        subprocess.run(list(map(str, command)), check=True, timeout=PATIENCE)

    @contextmanager
    def dumping(self) -> Iterator[Dump]:
        """Let oscdump write the messages that come on a port to a file."""
        port = free_udp_port()
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "dump.osc"
            with file.open("wb") as output:
                process = subprocess.Popen([str(self.oscdump), "-L", f"osc.udp://:{port}"], stdout=output)
            try:
                dump = Dump(port, file)
                dump.wait_until_open()
                yield dump
            finally:
                process.kill()
                process.wait()


class Dumped(NamedTuple):
    """One message as oscdump prints it."""

    address: str
    types: str
    values: tuple[float | str, ...]


class Dump:
    """The messages that a running oscdump has heard."""

    def __init__(self, port: int, file: Path) -> None:
        self.port = port
        self.file = file

    def wait_until_open(self) -> None:
        """Send until a message is heard: nothing else tells that oscdump's port is open."""
        sender = OscSender(LOOPBACK, self.port)
        until = time.monotonic() + PATIENCE
        while not self.file.stat().st_size and time.monotonic() < until:
            sender.send(b"/hello\0\0,\0\0\0")
            time.sleep(0.02)
        sender.close()

    def messages(self) -> list[Dumped]:
        """Read the messages heard so far."""
        lines = self.file.read_text(encoding="utf-8").splitlines(keepends=True)
        read = [_read(line) for line in lines if line.endswith("\n")]
        return [message for message in read if message.address != "/hello"]

    def wait_for(self, enough: Callable[[list[Dumped]], bool]) -> list[Dumped]:
        """Wait until enough messages have been heard; give them."""
        until = time.monotonic() + PATIENCE
        while not enough(heard := self.messages()) and time.monotonic() < until:
            time.sleep(0.02)
        return heard


def _read(line: str) -> Dumped:
    """Read a line: time tag, address, types, and a value for each type that has a value."""
    _, address, *rest = line.split(maxsplit=3)
    types, values = (*rest, "", "")[:2]
    words = [match.group(1) if match.group(1) is not None else match.group(2) for match in _STRING.finditer(values)]
    typed = [word if kind in "sS" else float(word) for kind, word in zip(types, words, strict=True)]
    return Dumped(address, types, tuple(typed))
