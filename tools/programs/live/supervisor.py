"""systemd, which keeps an installation running: told that the service runs, and each second that it still does."""

from __future__ import annotations

import os
import socket
from contextlib import suppress

from kinespace.stream.outputs import Sink
from kinespace.stream.status import Status


class Systemd(Sink):
    """Sends what sd_notify(3) sends: READY at the first status, at each one WATCHDOG and a line on the health.

    A recogniser that hangs sends no status, so that systemd starts it again (`WatchdogSec=`).

    Parameters
    ----------
    address
        Of systemd's socket; `@` begins a name that is no file.
    """

    def __init__(self, address: str) -> None:
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.settimeout(0)
        self._ready = "READY=1\n"

    def publish_status(self, status: Status) -> None:
        """Say that the service runs, and how."""
        self._send(f"{self._ready}WATCHDOG=1\nSTATUS={status.health}")
        self._ready = ""

    def close(self) -> None:
        """Say that the service ends."""
        self._send("STOPPING=1")
        self._socket.close()

    def _send(self, text: str) -> None:
        # Nobody may wait for systemd, and a recogniser goes on without it.
        with suppress(OSError):
            self._socket.sendto(text.encode(), self._address)


def supervisors() -> list[Sink]:
    """Give a sink for systemd where it has started this program and wants to know."""
    address = os.environ.get("NOTIFY_SOCKET", "")
    return [Systemd(address)] if address and hasattr(socket, "AF_UNIX") else []
