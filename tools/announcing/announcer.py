"""Announces a recogniser: mDNS names its OSC port (`_osc._udp`) and its OSCQuery (`_oscjson._tcp`), HTTP describes it.

Only where the OSC port listens: on this machine, on one network, or on all. Performers' names are described to this
machine alone.
"""

from __future__ import annotations

import asyncio
import ipaddress
import json
import socket
import threading
from collections.abc import Sequence
from contextlib import closing, suppress
from functools import partial
from typing import Any

from websockets.asyncio.server import ServerConnection, serve
from websockets.http11 import Request, Response

from kinespace.stream.outputs import Sink
from kinespace.stream.packet import Networks, is_within
from kinespace.stream.status import Status
from kinespace.tools.announcing.description import Known, described, host_info, reply
from kinespace.tools.announcing.finding import OSC_SERVICE
from kinespace.tools.page.requests import Gate, response

QUERY_SERVICE = "_oscjson._tcp.local."
#: Seconds that a client may take for a request, and clients at once, at most: their threads would take the
#: recogniser's time.
_MAX_REQUEST, MAX_CLIENTS = 5.0, 32
#: Seconds in which mDNS says farewell, at most.
_MAX_FAREWELL = 5.0


class _Connection(ServerConnection):
    """A client's connection; one client too many is let go."""

    def __init__(self, here: set[_Connection], *arguments: Any, **options: Any) -> None:  # noqa: ANN401 - passed on
        super().__init__(*arguments, **options)
        self.here = here

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin to read the request."""
        super().connection_made(transport)
        self.here.add(self)
        if len(self.here) > MAX_CLIENTS:
            self.transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        """Make room for another one."""
        self.here.discard(self)
        super().connection_lost(exc)


class Announcer(Sink):
    """Announces an OSC port until it is closed; a sink, because classes and performers change.

    Parameters
    ----------
    place
        Host and port on which frames come in by OSC.
    known
        What is described at first.
    networks
        Networks whose clients are answered; empty for all.

    Attributes
    ----------
    name, address
        What it is called in messages, and the address of the description.
    clients
        The connections now.

    Raises
    ------
    OSError
        No port could be opened for HTTP.
    """

    name = "OSCQuery"

    def __init__(self, place: tuple[str, int], known: Known, networks: Networks = ()) -> None:
        host, port = place
        self._known, self._near = known, ipaddress.ip_address(host).is_loopback
        self._title = f"kinespace {port}"
        self._info = host_info(self._title, host, port)
        self._gate, self._networks = Gate.for_host(host), networks
        listening = socket.create_server((host, 0), family=socket.AF_INET6 if ":" in host else socket.AF_INET)
        self._query_port = listening.getsockname()[1]
        self.address = f"http://{host}:{self._query_port}/"
        self._zeroconf: Any = None
        self.clients = set[_Connection]()
        self._ended, self._loop, self._closed = threading.Event(), asyncio.SelectorEventLoop(), asyncio.Event()
        # A client that comes when no more files may be opened waits.
        self._loop.set_exception_handler(lambda *_: None)
        self._serving = threading.Thread(target=self._serve, args=(listening,), name="kinespace OSCQuery", daemon=True)
        self._announcing = threading.Thread(target=self._announce, args=place, name="kinespace mDNS", daemon=True)
        self._serving.start()
        self._announcing.start()

    def publish_classes(self, classes: Sequence[str]) -> None:
        """Describe these classes from now on."""
        if tuple(classes) != tuple(self._known.classes):
            self._known = self._known._replace(classes=tuple(classes))

    def publish_status(self, status: Status) -> None:
        """Describe the performers who are followed, to this machine alone."""
        if self._near and [*status.performers] != [*self._known.performers]:
            self._known = self._known._replace(performers=tuple(status.performers))

    def _serve(self, listening: socket.socket) -> None:
        """Answer clients until we are closed."""
        with closing(self._loop):
            self._loop.run_until_complete(self._run(listening))

    async def _run(self, listening: socket.socket) -> None:
        made: Any = partial(_Connection, self.clients)
        # Every request gets its answer at once: no WebSocket is ever opened.
        async with serve(
            _nothing, sock=listening, process_request=self._answer, create_connection=made, compression=None,
            open_timeout=_MAX_REQUEST, server_header=None,
        ):  # fmt: skip
            await self._closed.wait()
            for each in self.clients:
                each.transport.abort()

    def _answer(self, connection: ServerConnection, request: Request) -> Response:
        """Answer a request for a path, with its query."""
        let_in = not self._networks or is_within(str(connection.remote_address[0]), self._networks)
        headers = {name.lower(): value for name, value in request.headers.raw_items()}
        allowed = let_in and self._gate.knows(headers.get("host", ""))
        status, found = reply(described(self._known), self._info, request.path) if allowed else (403, None)
        return response(status, b"" if found is None else json.dumps(found).encode(), "application/json")

    def _announce(self, host: str, port: int) -> None:
        """Say by mDNS where we are; this takes a second or two, in which others may claim the name."""
        from zeroconf import InterfaceChoice, NonUniqueNameException, ServiceInfo, Zeroconf  # noqa: PLC0415 - an extra

        everywhere = ipaddress.ip_address(host).is_unspecified
        with suppress(OSError, NonUniqueNameException):
            self._zeroconf = Zeroconf(InterfaceChoice.All if everywhere else [host])
            addresses = [socket.gethostbyname(socket.gethostname())] if everywhere else [host]
            packed = [ipaddress.ip_address(each).packed for each in addresses]
            server = f"kinespace-{port}.local."
            for service, its_port in ((OSC_SERVICE, port), (QUERY_SERVICE, self._query_port)):
                if self._ended.is_set():
                    return
                info = ServiceInfo(service, f"{self._title}.{service}", its_port, addresses=packed, server=server)
                self._zeroconf.register_service(info, allow_name_change=True)

    def close(self) -> None:
        """Say farewell, and close all sockets."""
        self._ended.set()
        self._loop.call_soon_threadsafe(self._closed.set)
        self._serving.join()
        self._announcing.join(_MAX_FAREWELL)
        if self._zeroconf:
            self._zeroconf.close()


async def _nothing(_: ServerConnection) -> None:
    """Serve a WebSocket, of which there is none."""
