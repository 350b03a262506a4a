"""A server of WebSocket clients: one port, served in a process of its own until that is to end."""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

from websockets.asyncio.server import ServerConnection, serve
from websockets.http11 import Request, Response

from kinespace.tools.cli.values import host_and_port, opening
from kinespace.tools.page.link import Subscription
from kinespace.tools.page.requests import Gate

#: Seconds between two looks for messages.
_LOOK = 0.2


class ClientServer(ABC):
    """Takes a recogniser's messages and serves clients.

    Parameters
    ----------
    subscription
        The recogniser's messages.
    gate
        Decides which clients are served.
    """

    #: Of the printed address, and of `websockets.asyncio.server.serve`.
    scheme, limits = "ws", dict[str, Any]()

    def __init__(self, subscription: Subscription, gate: Gate) -> None:
        self._subscription, self._gate = subscription, gate

    def serve(self, address: str, option: str, started: Callable[[str], None], wants_end: Callable[[], bool]) -> None:
        """Serve at HOST:PORT, which `option` gave; `started` and `wants_end` are as in `Plan.serve`.

        Raises
        ------
        OSError
            The address is taken, or impossible.
        """
        # Windows' own loop cannot wait for ZeroMQ.
        with opening(option), asyncio.Runner(loop_factory=asyncio.SelectorEventLoop) as runner:
            try:
                runner.run(self.run(*host_and_port(address), started, wants_end))
            except OSError as error:
                raise OSError(error.errno, f"{address}: {error.strerror}") from error

    async def run(self, host: str, port: int, started: Callable[[str], None], wants_end: Callable[[], bool]) -> None:
        """As `serve`, in a loop that runs."""
        loop = asyncio.get_running_loop()
        loop.add_reader(self._subscription.fileno(), self.take_messages)
        serving = serve(
            self.serve_client, host, port, process_request=self.answer, compression=None, server_header=None,
            **self.limits,
        )  # fmt: skip
        async with serving as server:
            port = next(iter(server.sockets)).getsockname()[1]
            named = f"[{host}]" if ":" in host else host
            started(f"{self.scheme}://{named}:{port}/" + (f"?token={self._gate.token}" if self._gate.token else ""))
            while not wants_end():
                # The file number wakes us for the first of several messages alone, and at times for none.
                self.take_messages()
                await asyncio.sleep(_LOOK)
        loop.remove_reader(self._subscription.fileno())

    @abstractmethod
    def take_messages(self) -> None:
        """Take the recogniser's messages that wait."""

    @abstractmethod
    def answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """Answer an HTTP request; None goes on to a WebSocket."""

    @abstractmethod
    async def serve_client(self, connection: ServerConnection) -> None:
        """Serve one client until it leaves."""
