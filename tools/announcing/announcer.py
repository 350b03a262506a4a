"""Announces a recogniser: mDNS names its OSC port (`_osc._udp`) and its OSCQuery (`_oscjson._tcp`), HTTP describes it.

Only where the OSC port listens: on this machine, on one network, or on all. Performers' names are described to this
machine alone.
"""

from __future__ import annotations

import ipaddress
import json
import socket
import threading
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import TYPE_CHECKING, Any

from kinespace.stream.outputs import Sink
from kinespace.stream.packet import is_within
from kinespace.tools.announcing.description import Known, described, host_info, reply
from kinespace.tools.announcing.finding import OSC_SERVICE
from kinespace.tools.page.requests import Gate

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.stream.packet import Networks
    from kinespace.stream.status import Status

QUERY_SERVICE = "_oscjson._tcp.local."
#: Seconds that a client may take for a request.
_MAX_REQUEST = 5.0
#: Seconds in which mDNS says farewell, at most.
_MAX_FAREWELL = 5.0


class Announcer(Sink):
    """Announces an OSC port until it is closed; a sink, because classes and performers change.

    Parameters
    ----------
    place
        Host and port on which frames come in by OSC.
    known
        What is described at first.
    networks
        Networks whose clients are answered, and this machine; empty for all.

    Attributes
    ----------
    name, address
        What it is called in messages, and the address of the description.

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
        self._server = _Server((host, 0), self, Gate.for_host(host), networks)
        self.address = f"http://{host}:{self._server.server_port}/"
        self._zeroconf: Any = None
        self._ended = threading.Event()
        serving = threading.Thread(target=self._server.serve_forever, name="kinespace OSCQuery", daemon=True)
        self._announcing = threading.Thread(target=self._announce, args=place, name="kinespace mDNS", daemon=True)
        serving.start()
        self._announcing.start()

    def publish_classes(self, classes: Sequence[str]) -> None:
        """Describe these classes from now on."""
        if tuple(classes) != tuple(self._known.classes):
            self._known = self._known._replace(classes=tuple(classes))

    def publish_status(self, status: Status) -> None:
        """Describe the performers who are followed, to this machine alone."""
        if self._near and [*status.performers] != [*self._known.performers]:
            self._known = self._known._replace(performers=tuple(status.performers))

    def reply(self, target: str) -> tuple[int, dict[str, Any] | None]:
        """Answer a request for a path, with its query."""
        return reply(described(self._known), self._info, target)

    def _announce(self, host: str, port: int) -> None:
        """Say by mDNS where we are; this takes a second or two, in which others may claim the name."""
        from zeroconf import InterfaceChoice, NonUniqueNameException, ServiceInfo, Zeroconf  # noqa: PLC0415 - an extra

        everywhere = ipaddress.ip_address(host).is_unspecified
        with suppress(OSError, NonUniqueNameException):
            self._zeroconf = Zeroconf(InterfaceChoice.All if everywhere else [host])
            addresses = [socket.gethostbyname(socket.gethostname())] if everywhere else [host]
            packed = [ipaddress.ip_address(each).packed for each in addresses]
            server = f"kinespace-{port}.local."
            for service, its_port in ((OSC_SERVICE, port), (QUERY_SERVICE, self._server.server_port)):
                if self._ended.is_set():
                    return
                info = ServiceInfo(service, f"{self._title}.{service}", its_port, addresses=packed, server=server)
                self._zeroconf.register_service(info, allow_name_change=True)

    def close(self) -> None:
        """Say farewell, and close all sockets."""
        self._ended.set()
        self._server.shutdown()
        self._server.server_close()
        self._announcing.join(_MAX_FAREWELL)
        if self._zeroconf:
            self._zeroconf.close()


class _Server(ThreadingHTTPServer):
    daemon_threads = True

    def __init__(self, place: tuple[str, int], announcer: Announcer, gate: Gate, networks: Networks) -> None:
        self.announcer, self.gate, self.networks = announcer, gate, networks
        if ":" in place[0]:
            self.address_family = socket.AF_INET6
        super().__init__(place, _Handler)


class _Handler(BaseHTTPRequestHandler):
    server: _Server
    timeout = _MAX_REQUEST

    def do_GET(self) -> None:
        """Answer a request."""
        peer, networks = str(self.client_address[0]), self.server.networks
        let_in = not networks or is_within(peer, networks) or ipaddress.ip_address(peer).is_loopback
        allowed = let_in and self.server.gate.knows(self.headers.get("Host", ""))
        status, found = self.server.announcer.reply(self.path) if allowed else (403, None)
        body = b"" if found is None else json.dumps(found).encode()
        self.send_response(status)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: object) -> None:
        """Print nothing: a client may ask some times a second."""
