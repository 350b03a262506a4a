"""A TCP connection that can be cut, as by a cable that is pulled out: what is sent waits until it is whole again."""

from __future__ import annotations

import socket
import threading
from contextlib import suppress
from typing import Self

#: Seconds for which the connection is cut.
CUT = 5.0


class Proxy:
    """Passes everything on between those who connect to `port` and a program on this machine. A context manager."""

    def __init__(self, to_port: int) -> None:
        self._to = ("127.0.0.1", to_port)
        self._listening = socket.create_server(("127.0.0.1", 0))
        self._connections: list[socket.socket] = []
        self._whole = threading.Event()
        self._whole.set()
        self.port: int = self._listening.getsockname()[1]

    def __enter__(self) -> Self:
        threading.Thread(target=self._accept, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        for each in (self._listening, *self._connections):
            with suppress(OSError):
                # Closing alone would not wake who waits for it.
                each.shutdown(socket.SHUT_RDWR)
            each.close()

    def cut(self) -> None:
        """Pass nothing on for some seconds."""
        self._whole.clear()
        threading.Timer(CUT, self._whole.set).start()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                threading.Thread(target=self._begin, args=(self._listening.accept()[0],), daemon=True).start()

    def _begin(self, near: socket.socket) -> None:
        self._whole.wait()
        self._connections.append(near)
        # The program may be gone; then whoever connects tries again.
        with suppress(OSError), near, socket.create_connection(self._to) as far:
            self._connections.append(far)
            threading.Thread(target=self._pass_on, args=(far, near), daemon=True).start()
            self._pass_on(near, far)

    def _pass_on(self, source: socket.socket, sink: socket.socket) -> None:
        with suppress(OSError):
            while data := source.recv(1 << 16):
                self._whole.wait()
                sink.sendall(data)
            sink.shutdown(socket.SHUT_RDWR)
