"""The servers of browsers: one port for the page's files and the WebSockets of open pages; another for clients.

A page gets one message at a time. When it says that it has drawn the message, it gets all newer entries in one. A slow
or sleeping page delays no other page, and the server keeps no messages for it.

A WebSocket client sends frames and gets answers, by pure functions between them and ZeroMQ's messages. A frame is text,
one JSON object: `performer`, `positions` (a list of [x, y, z] or {x, y, z} in metres for each joint, null for what is
lost), and perhaps `t` (seconds; 0 or none: the arrival) and `joints` (names, in the first frame and when they change);
or binary, the msgpack map of ZeroMQ. An answer is text: ZeroMQ's JSON with its topic as `type`; an error is, too, for
the client whose frame cannot be read.
"""

import asyncio
import ipaddress
import re
import secrets
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from functools import lru_cache
from http import HTTPStatus
from importlib import resources
from pathlib import Path
from typing import Annotated, Any
from urllib.parse import parse_qs, urlsplit

import msgspec
import numpy as np
from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from kinespace.library import MotionLibrary, library_file
from kinespace.stream.feeds.unpackers import Place, axes_of
from kinespace.stream.packet import is_within
from kinespace.stream.teaching.commands import State, Step, as_json
from kinespace.stream.zeromq import Endpoint, Keyring, ZmqSender
from kinespace.stream.zeromq.messages import VERSION
from kinespace.tools.cli.arguments import library_at
from kinespace.tools.cli.console import note
from kinespace.tools.cli.values import host_and_port, opening, printable
from kinespace.tools.page.board import Board
from kinespace.tools.page.process import Plan, Subscription

#: Bytes of a message from a page, at most.
MAX_MESSAGE = 4096
#: The path of the WebSocket.
SOCKET = "/live"
_TYPES = {"html": "text/html", "css": "text/css", "js": "text/javascript", "svg": "image/svg+xml"}
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self' ws://{host}; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
_Short = Annotated[str, msgspec.Meta(max_length=256)]
_Count = Annotated[int, msgspec.Meta(ge=0, le=2**53)]


class PageMessage(msgspec.Struct, forbid_unknown_fields=True):
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


_read = msgspec.json.Decoder(PageMessage).decode


def read_message(text: str | bytes) -> PageMessage:
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
    def for_host(cls, host: str) -> "Gate":
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
        host, path = headers.get("host", ""), target.partition("?")[0]
        if not self.knows(host):
            return refusal(403, "this name is not ours")
        if path != SOCKET:
            return static_file(path, host)
        if headers.get("origin") != f"http://{host}":
            return refusal(403, "not our page")
        return self.checked(target)

    def checked(self, target: str) -> Response | None:
        """Refuse a wrong token in a path's query; None for the right one, or where none is needed."""
        shown = parse_qs(target.partition("?")[2]).get("token", [""])[0]
        if self.token and not secrets.compare_digest(shown.encode(errors="replace"), self.token.encode()):
            return refusal(401, "the address that kinespace printed has a token")
        return None

    def knows(self, host: str) -> bool:
        """Say whether a name, perhaps with a port, is an address or a name of ours."""
        if not re.fullmatch(r"[\w.:\[\]-]+", host, re.ASCII):
            return False
        name = ""
        try:
            name = urlsplit(f"//{host}").hostname or ""
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
    policy = {"Content-Security-Policy": _POLICY.format(host=host)}
    return response(200, file.read_bytes(), f"{kind}; charset=utf-8", policy)


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


#: The path of the classes' motions, their pictures a second, seconds of each, and classes of a library, at most.
MOTIONS = "/motions.json"
_PICTURES, _MAX_SECONDS, _MAX_CLASSES = 12, 4, 200


def motions_at(path: Path) -> Mapping[str, object]:
    """Give a motion of each class of a library's file, for small bodies: names, parents, frames (whole centimetres).

    There is none where no library can be read. The file is read again when it changes.
    """
    # A new example lies in a file of its own until it is quiet.
    return _motions_since(path, _written(path), _written(library_file.beside(path, "new")))


# Of the two libraries that a page may have.
@lru_cache(maxsize=2)
def _motions_since(path: Path, *_: float) -> Mapping[str, object]:
    # Nothing was taught yet, or nobody wants a library.
    with suppress(OSError, ValueError):
        return _motions_of(library_at(path))
    return {}


def _written(path: Path) -> float:
    """Say when a file was written last; 0 where there is none."""
    try:
        return path.stat().st_mtime
    except OSError:
        return 0.0


def _motions_of(library: MotionLibrary) -> Mapping[str, object]:
    body, shown = {"names": library.skeleton.joints, "parents": library.skeleton.parents}, dict[str, object]()
    motions = {each.class_name: each for each in library.motions}
    for name, motion in [*motions.items()][:_MAX_CLASSES]:
        times = np.arange(0.0, min(motion.duration, _MAX_SECONDS), 1 / _PICTURES)
        # By rounding the last time may be the motion's end.
        frames = motion.positions[np.minimum((times * motion.frame_rate).astype(int), motion.frames - 1)]
        shown[name] = {**body, "frames": np.rint(100 * frames.reshape(len(frames), -1)).astype(int).tolist()}
    return shown


#: Seconds between two looks for messages.
_LOOK = 0.2


class _Client:
    """A page or a program that is served: what waits for it; of a page also what it has seen, and was sent, by number.

    Parameters
    ----------
    most
        Messages that wait, at most: the newest.
    """

    def __init__(self, most: int) -> None:
        self.ready, self.woken = asyncio.Event(), asyncio.Event()
        self.ready.set()
        self.woken.set()
        self.waiting: deque[Any] = deque(maxlen=most)
        self.seen = self.sent = 0


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
    #: Messages that wait for a client, at most.
    most: int

    def __init__(self, subscription: Subscription, gate: Gate) -> None:
        self._subscription, self._gate = subscription, gate
        self._clients = set[_Client]()

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
            self._serve_client, host, port, process_request=self._answer, compression=None, server_header=None,
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

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        headers = {name.lower(): value for name, value in request.headers.raw_items()}
        return self.answer(str(connection.remote_address[0]), request.path, headers)

    async def _serve_client(self, connection: ServerConnection) -> None:
        """Serve one client until it leaves."""
        client = _Client(self.most)
        self._clients.add(client)
        sending = asyncio.create_task(self.send(connection, client))
        try:
            with suppress(ConnectionClosed):
                await self.receive(connection, client)
        finally:
            self._clients.discard(client)
            sending.cancel()
            await asyncio.gather(sending, return_exceptions=True)

    @abstractmethod
    def answer(self, peer: str, path: str, headers: Mapping[str, str]) -> Response | None:
        """Answer an HTTP request; None goes on to a WebSocket."""

    @abstractmethod
    async def send(self, connection: ServerConnection, client: _Client) -> None:
        """Send a client what comes for it, until it is cancelled or the connection is closed."""

    @abstractmethod
    async def receive(self, connection: ServerConnection, client: _Client) -> None:
        """Take what a client sends, until it leaves."""


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
    libraries
        The files of the motions that may be named.
    """

    scheme, most = "http", MAX_REPLIES
    limits = {"max_size": MAX_MESSAGE, "max_queue": 4, "open_timeout": _MAX_OPENING}  # noqa: RUF012 - never changed

    def __init__(
        self, subscription: Subscription, control: Control | None, gate: Gate, libraries: Iterable[Path] = ()
    ) -> None:
        super().__init__(subscription, gate)
        self.board = Board()
        self._control, self._libraries = control, [*libraries]
        self._clock = time.monotonic
        #: Whether the control's classes and settings may have changed, and the question that is on its way.
        self._stale = True
        self._asking: asyncio.Task[object] | None = None

    def take_messages(self) -> None:
        """Take the messages that wait, and ask for the classes and settings where they may have changed."""
        now, before = self._clock(), self.board.number
        self._subscription.want_bodies(wanted=bool(self._clients))
        for parts in self._subscription.messages():
            self.board.take(parts, now)
            if parts[0] in (b"teach/", b"classes/"):
                self._stale = True
        if self.board.number != before:
            self._wake()
        # Again while the control has not replied: it may have come later than we, or again.
        if self._stale and self._control and self._clients and (self._asking is None or self._asking.done()):
            self._asking = asyncio.create_task(self._ask({"do": "list"}))

    def _wake(self) -> None:
        for page in self._clients:
            page.woken.set()

    def answer(self, peer: str, path: str, headers: Mapping[str, str]) -> Response | None:
        """Answer an HTTP request; None goes on to a WebSocket."""
        del peer
        if path.partition("?")[0] == MOTIONS and self._gate.knows(headers.get("host", "")):
            return self._gate.checked(path) or response(200, self._motions(), "application/json")
        if refused := self._gate.answer(path, headers):
            return refused
        return None if len(self._clients) < MAX_PAGES else refusal(503, "too many pages are open")

    def _motions(self) -> bytes:
        """Encode a motion of each class as JSON; what was taught hides the library's."""
        return msgspec.json.encode({name: each for path in self._libraries for name, each in motions_at(path).items()})

    async def receive(self, connection: ServerConnection, client: _Client) -> None:
        """Take a page's drawings and commands; one that sends rubbish is closed."""
        self.take_messages()
        try:
            async for text in connection:
                message = read_message(text)
                if message.ack == client.sent:
                    client.seen = client.sent
                    client.ready.set()
                if message.ask is not None:
                    # Other messages take the page's replies along while this one is asked.
                    client.waiting.append(await self._ask(message.ask))
                    self._wake()
        except ValueError as error:
            await connection.close(1008, str(error)[:100])

    async def send(self, connection: ServerConnection, client: _Client) -> None:
        """Send the new entries whenever the page has drawn the last message."""
        while True:
            await client.ready.wait()
            await client.woken.wait()
            client.woken.clear()
            message = self.board.news(client.seen, self._clock(), client.waiting)
            client.waiting.clear()
            client.sent = self.board.number
            client.ready.clear()
            await connection.send(message)
            await asyncio.sleep(_PACE)

    async def _ask(self, command: dict[str, Any]) -> dict[str, Any]:
        """Ask the control socket; every page gets the changes."""
        if self._control is None:
            return {"states": [as_json(State("", Step.REFUSED, reason=_NO_CONTROL))]}
        self.board.take_command(command, self._clock())
        reply = await asyncio.to_thread(self._control, command)
        if reply is None:
            return {"states": [as_json(State("", Step.REFUSED, reason=_NO_REPLY))]}
        states, self._stale = reply.pop("states"), False
        # A refusal has nothing else.
        if reply:
            self.board.take_reply(reply)
        self._wake()
        return {"states": states}


class _Sent(msgspec.Struct):
    """A frame as a browser sends it."""

    performer: str
    positions: list[Place]
    t: float | None = None
    joints: list[str] | None = None


_read_frame = msgspec.json.Decoder(_Sent).decode


def packed(message: str | bytes) -> tuple[bytes, str]:
    """Give a frame as ZeroMQ's msgpack map; anything else as it is: the recogniser counts it.

    Returns
    -------
    The bytes, and the reason why they are no frame, as the client is told it; empty for a frame.
    """
    if isinstance(message, bytes):
        return message, ""
    try:
        sent = _read_frame(message)
    except (ValueError, RecursionError) as error:
        told = msgspec.json.encode({"type": "error", "text": f"no frame is read: {error}"}).decode()
        return message.encode(errors="replace"), told
    with np.errstate(over="ignore"):
        positions = np.array([*map(axes_of, sent.positions)], dtype=np.float64).astype("<f4").reshape(-1, 3)
    header = {"v": VERSION, "performer": sent.performer, "t": sent.t or 0.0, "shape": positions.shape, "dtype": "<f4"}
    joints = {} if sent.joints is None else {"joints": sent.joints}
    return msgspec.msgpack.encode(header | joints | {"data": positions.tobytes()}), ""


def as_text(parts: Sequence[bytes]) -> str:
    """Give one of the recogniser's messages, topic and JSON, as one JSON object."""
    kind = parts[0].partition(b"/")[0]
    return (b'{"type":"' + kind + b'",' + parts[1].removeprefix(b"{")).decode()


#: Clients at once, at most.
MAX_CLIENTS = 64
#: Bytes of a message from a client, at most: as over ZeroMQ.
_MAX_MESSAGE = 256_000
#: Answers that wait for a client, at most.
MAX_WAITING = 512
#: Refused sites that are told, at most.
_MAX_TOLD = 8
#: Seconds in which a client's own socket reaches the recogniser: earlier frames would be lost.
_MEETING = 0.1


@dataclass(frozen=True, slots=True)
class SocketPlan(Plan):
    """WebSockets to be served.

    Attributes
    ----------
    frames
        The ZeroMQ endpoint on which the recogniser takes frames in.
    origins
        Sites whose pages may connect, like https://editor.p5js.org; pages of this machine may anyway.
    networks
        Networks whose clients may connect; empty for all.
    """

    name, option = "WebSocket", "--ws"
    frames: str = ""
    origins: tuple[str, ...] = ()
    networks: tuple[str, ...] = ()

    def server(self, subscription: Subscription, keyring: Keyring | None) -> "SocketServer":
        """Make the server of WebSocket clients."""
        return SocketServer(subscription, self, keyring)


def answer(gate: Gate, origins: Sequence[str], target: str, headers: Mapping[str, str]) -> Response | None:
    """Answer the request of a client; None opens its WebSocket.

    Browsers say which site a page is of, other programs do not. A page of another site may connect only if it is named.
    """
    host, origin = headers.get("host", ""), headers.get("origin")
    if not gate.knows(host):
        return refusal(403, "this name is not ours")
    if origin is not None and origin not in origins and not _is_near(origin, host):
        return refusal(403, f"a page of another site, {origin[:100]}: --ws-origin lets it in")
    return gate.checked(target)


def _is_near(origin: str, host: str) -> bool:
    """Say whether a page comes from this machine, or from the name by which it asks for us."""
    with suppress(ValueError):
        name, ours = urlsplit(origin).hostname, urlsplit(f"//{host}").hostname
        return name in ("localhost", ours) or ipaddress.ip_address(name or "").is_loopback
    return False


class SocketServer(ClientServer):
    """Passes frames from clients to the recogniser, and its answers to all clients."""

    limits, most = {"max_size": _MAX_MESSAGE}, MAX_WAITING

    def __init__(self, subscription: Subscription, plan: SocketPlan, keyring: Keyring | None) -> None:
        super().__init__(subscription, Gate.for_host(host_and_port(plan.address)[0]))
        self._plan, self._keyring = plan, keyring
        self._networks = [ipaddress.ip_network(each) for each in plan.networks]
        self._told = set[str]()

    def take_messages(self) -> None:
        """Give all clients the answers that wait."""
        for parts in self._subscription.messages():
            text = as_text(parts)
            for client in self._clients:
                client.waiting.append(text)
                client.woken.set()

    def answer(self, peer: str, path: str, headers: Mapping[str, str]) -> Response | None:
        """Refuse a client of another network or site, and one too many."""
        if self._networks and not is_within(peer, self._networks):
            return refusal(403, "this network is not let in: see --allow-from")
        if len(self._clients) >= MAX_CLIENTS:
            return refusal(503, "too many clients")
        refused = answer(self._gate, self._plan.origins, path, headers)
        origin = printable(headers.get("origin", "")[:100])
        is_told = origin in self._told or len(self._told) >= _MAX_TOLD
        if refused and "--ws-origin" in refused.body.decode() and not is_told:
            self._told.add(origin)
            whose = "opened as a file" if origin == "null" else f"of {origin}"
            note(f"WebSocket: a page {whose} was refused: --ws-origin {origin} lets it in")
        return refused

    async def receive(self, connection: ServerConnection, client: _Client) -> None:
        """Pass a client's frames on; tell it of those that cannot be read."""
        with closing(ZmqSender(Endpoint.parse(self._plan.frames, bind=False), self._keyring)) as sender:
            await asyncio.sleep(_MEETING)
            async for message in connection:
                frame, why = packed(message)
                sender.send([frame])
                if why:
                    client.waiting.append(why)
                    client.woken.set()

    async def send(self, connection: ServerConnection, client: _Client) -> None:
        """Send a client the answers that wait, in their order."""
        while True:
            await client.woken.wait()
            client.woken.clear()
            while client.waiting:
                await connection.send(client.waiting.popleft())
