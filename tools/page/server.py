"""The page's server: one port for the files and for the WebSockets of open pages.

A page gets one message at a time. When it says that it has drawn the message, it gets all newer entries in one. A slow
or sleeping page delays no other page, and the server keeps no messages for it.
"""

from __future__ import annotations

import asyncio
import ipaddress
import re
import secrets
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from http import HTTPStatus
from importlib import resources
from typing import Annotated, Any
from urllib.parse import parse_qs, urlsplit

import msgspec
from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from kinespace.tools.cli.values import host_and_port, opening
from kinespace.tools.page.board import Board
from kinespace.tools.page.process import Subscription

#: Bytes of a message from a page, at most.
MAX_MESSAGE = 4096
#: The path of the WebSocket.
SOCKET = "/live"
_TYPES = {
    "html": "text/html; charset=utf-8",
    "css": "text/css; charset=utf-8",
    "js": "text/javascript; charset=utf-8",
    "svg": "image/svg+xml; charset=utf-8",
}
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self' ws://{host}; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
_Short = Annotated[str, msgspec.Meta(max_length=256)]
_Count = Annotated[int, msgspec.Meta(ge=0, le=2**53)]


class Message(msgspec.Struct, forbid_unknown_fields=True):
    """A message of a page: the number of its last drawing, or a command.

    Attributes
    ----------
    ack
        The number of the message that has been drawn.
    ask
        A command for the control socket.
    """

    ack: _Count | None = None
    ask: Annotated[dict[_Short, _Short | float | bool], msgspec.Meta(max_length=8)] | None = None


_read = msgspec.json.Decoder(Message).decode


def read_message(text: str | bytes) -> Message:
    """Read a message of a page.

    Raises
    ------
    ValueError
        It is no text, too long, no JSON, or holds anything but one of the two.
    """
    if not isinstance(text, str) or len(text) > MAX_MESSAGE:
        raise ValueError(f"message: expected text of at most {MAX_MESSAGE} characters, got {len(text)} of another kind")
    try:
        message = _read(text)
    except RecursionError as error:
        raise ValueError("message: expected flat JSON") from error
    if (message.ack is None) == (message.ask is None):
        raise ValueError("message: expected one of ack and ask")
    return message


@dataclass(frozen=True, slots=True)
class Gate:
    """Decides which browsers may see the page.

    Attributes
    ----------
    token
        The secret that a page must show to open its WebSocket; empty on an address that only this machine reaches.
    names
        Names of this machine, besides its addresses, under which a browser may ask for the page.
    """

    token: str = ""
    names: frozenset[str] = frozenset({"localhost"})

    @classmethod
    def for_host(cls, host: str) -> Gate:
        """Ask for a token where other machines can reach us."""
        try:
            alone = ipaddress.ip_address(host).is_loopback
        except ValueError:
            alone = host == "localhost"
        return cls("" if alone else secrets.token_urlsafe(16), frozenset({"localhost", host.lower()}))

    def answer(self, target: str, headers: Mapping[str, str]) -> Response | None:
        """Answer an HTTP request; None opens a WebSocket.

        A page of another site may open sockets to this machine, and may call this machine by a name of its own: the
        host must be an address or a name of ours, and a WebSocket must come from our own page.

        Parameters
        ----------
        target
            The path with its query.
        headers
            By lower-case name.
        """
        host = headers.get("host", "")
        if not self.knows(host):
            return refusal(403, "this name is not ours")
        path, _, query = target.partition("?")
        if path != SOCKET:
            return static_file(path, host)
        if headers.get("origin") != f"http://{host}":
            return refusal(403, "not our page")
        return self.checked(parse_qs(query).get("token", [""])[0])

    def checked(self, shown: str) -> Response | None:
        """Refuse a wrong token; None for the right one, or where none is needed."""
        if self.token and not secrets.compare_digest(shown.encode(errors="replace"), self.token.encode()):
            return refusal(401, "the address that kinespace printed has a token")
        return None

    def knows(self, host: str) -> bool:
        """Say whether a name, perhaps with a port, is an address or a name of ours."""
        if not re.fullmatch(r"[\w.:\[\]-]+", host, re.ASCII):
            return False
        try:
            name = urlsplit(f"//{host}").hostname or ""
        except ValueError:
            return False
        try:
            ipaddress.ip_address(name)
        except ValueError:
            return name in self.names
        return True


def static_file(path: str, host: str) -> Response:
    """Give a file of the page by its path; only files of `static/` itself."""
    name = path.removeprefix("/") or "index.html"
    kind = _TYPES.get(name.rpartition(".")[2])
    file = resources.files("kinespace.tools.page") / "static" / name
    if kind is None or "/" in name or "\\" in name or not file.is_file():
        return refusal(404, "no such file")
    return response(200, file.read_bytes(), kind, {"Content-Security-Policy": _POLICY.format(host=host)})


_GUARDS = {
    "Cache-Control": "no-store",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


def refusal(status: int, why: str) -> Response:
    """Refuse a request with a line of text."""
    return response(status, f"kinespace: {why}\n".encode(), "text/plain; charset=utf-8")


def response(status: int, body: bytes, kind: str, further: Mapping[str, str] | None = None) -> Response:
    """Make a response that no other site may use."""
    fields = {"Content-Length": str(len(body)), "Connection": "close", "Content-Type": kind}
    return Response(status, HTTPStatus(status).phrase, Headers({**fields, **_GUARDS, **(further or {})}), body)


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


Control = Callable[[Mapping[str, object]], dict[str, Any] | None]

#: Open pages, at most.
MAX_PAGES = 16
#: Seconds between two messages to a page, at least.
_PACE = 1 / 35
#: Replies that wait for a page, at most.
MAX_REPLIES = 8
#: Seconds that a page may take for the handshake, or for a file.
_MAX_OPENING = 20.0
_NO_CONTROL = "start kinespace live with --teach FILE to teach from here"
_NO_REPLY = "the recogniser does not reply"


class _Page:
    """One open page: the newest entry that it has seen, the number of its last message, replies to send."""

    def __init__(self) -> None:
        self.ready, self.woken = asyncio.Event(), asyncio.Event()
        self.ready.set()
        self.woken.set()
        self.seen = self.sent = 0
        #: The newest: a page that draws nothing gets no further ones.
        self.replies: deque[dict[str, Any]] = deque(maxlen=MAX_REPLIES)

    def acknowledged(self, number: int) -> None:
        """Note that a message was drawn."""
        if number == self.sent:
            self.seen = number
            self.ready.set()


class PageServer(ClientServer):
    """Serves the page and keeps the board.

    Parameters
    ----------
    subscription
        The recogniser's messages.
    control
        Asks the recogniser's control socket, and gives the reply, None without one; None: pages only look.
    gate
        Decides which browsers may see the page.
    """

    scheme = "http"
    limits = {"max_size": MAX_MESSAGE, "max_queue": 4, "open_timeout": _MAX_OPENING}  # noqa: RUF012 - never changed

    def __init__(self, subscription: Subscription, control: Control | None, gate: Gate) -> None:
        super().__init__(subscription, gate)
        self.board = Board()
        self._control = control
        self._pages: set[_Page] = set()
        self._clock = time.monotonic
        #: Whether the control's classes and settings may have changed, and the question that is on its way.
        self._stale = True
        self._asking: asyncio.Task[object] | None = None

    def take_messages(self) -> None:
        """Take the messages that wait, and ask for the classes and settings where they may have changed."""
        now, before = self._clock(), self.board.number
        self._subscription.want_bodies(wanted=bool(self._pages))
        for parts in self._subscription.messages():
            self.board.take(parts, now)
            if parts[0] in (b"teach/", b"classes/"):
                self._stale = True
        if self.board.number != before:
            self._wake()
        self._ask_for_state()

    def _ask_for_state(self) -> None:
        """Ask the control again while it has not replied: it may have come later than we, or again."""
        if self._stale and self._control and self._pages and (self._asking is None or self._asking.done()):
            self._asking = asyncio.create_task(self._ask({"do": "list"}))

    def _wake(self) -> None:
        for page in self._pages:
            page.woken.set()

    def answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """Answer an HTTP request; None goes on to a WebSocket."""
        del connection
        headers = {name.lower(): value for name, value in request.headers.raw_items()}
        if response := self._gate.answer(request.path, headers):
            return response
        return None if len(self._pages) < MAX_PAGES else refusal(503, "too many pages are open")

    async def serve_client(self, connection: ServerConnection) -> None:
        """Serve one page until it leaves; one that sends rubbish is closed."""
        page = _Page()
        self._pages.add(page)
        self.take_messages()
        sending = asyncio.create_task(self._send(connection, page))
        try:
            async for text in connection:
                message = read_message(text)
                if message.ack is not None:
                    page.acknowledged(message.ack)
                if message.ask is not None:
                    reply = await self._ask(message.ask)
                    # Only now: other messages take the page's replies along while this one is asked.
                    page.replies.append(reply)
                    self._wake()
        except ValueError as error:
            await connection.close(1008, str(error)[:100])
        except ConnectionClosed:
            pass
        finally:
            self._pages.discard(page)
            sending.cancel()
            await asyncio.gather(sending, return_exceptions=True)

    async def _send(self, connection: ServerConnection, page: _Page) -> None:
        """Send the new entries whenever the page has drawn the last message."""
        with suppress(ConnectionClosed):
            while True:
                await page.ready.wait()
                await page.woken.wait()
                page.woken.clear()
                replies = [*page.replies]
                page.replies.clear()
                message = self.board.news(page.seen, self._clock(), replies)
                page.sent = self.board.number
                page.ready.clear()
                await connection.send(message)
                await asyncio.sleep(_PACE)

    async def _ask(self, command: dict[str, Any]) -> dict[str, Any]:
        """Ask the control socket; every page gets the changes."""
        if self._control is None:
            return {"states": [_refused(_NO_CONTROL)]}
        self.board.take_command(command, self._clock())
        reply = await asyncio.to_thread(self._control, command)
        if reply is None:
            return {"states": [_refused(_NO_REPLY)]}
        states, self._stale = reply.pop("states"), False
        self.board.take_reply(reply)
        self._wake()
        return {"states": states}


def _refused(reason: str) -> dict[str, Any]:
    return {"performer": "", "state": "refused", "seconds": 0.0, "reason": reason}
