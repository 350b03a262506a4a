"""Frames and answers as WebSocket messages: pure functions between them and ZeroMQ's messages.

A frame is text, one JSON object: `performer`, `positions` (a list of [x, y, z] or {x, y, z} in metres for each joint,
null for what is lost), and perhaps `t` (seconds; 0 or none: the arrival) and `joints` (names, in the first frame and
when they change); or binary, the msgpack map of ZeroMQ. An answer is text: ZeroMQ's JSON with its topic as `type`; an
error is, too, for the client whose frame cannot be read.
"""

import asyncio
import ipaddress
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import msgspec
import numpy as np
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from kinespace.stream.packet import is_within
from kinespace.stream.zeromq import Endpoint, Keyring, ZmqSender
from kinespace.stream.zeromq.messages import VERSION
from kinespace.tools.cli.values import host_and_port
from kinespace.tools.page.process import Plan, Subscription
from kinespace.tools.page.server import ClientServer, Gate, refusal
from kinespace.tools.terminal.console import note, printable


class _Place(msgspec.Struct):
    """A joint's place by its axes."""

    x: float | None
    y: float | None
    z: float | None


class _Sent(msgspec.Struct):
    """A frame as a browser sends it."""

    performer: str
    positions: list[tuple[float | None, float | None, float | None] | _Place | None]
    t: float | None = None
    joints: list[str] | None = None


#: The place of a joint that is lost.
_NOWHERE = (None, None, None)
_read = msgspec.json.Decoder(_Sent).decode


def packed(message: str | bytes) -> tuple[bytes, str]:
    """Give a frame as ZeroMQ's msgpack map; anything else as it is: the recogniser counts it.

    Returns
    -------
    The bytes, and the reason why they are no frame, as the client is told it; empty for a frame.
    """
    if isinstance(message, bytes):
        return message, ""
    try:
        sent = _read(message)
    except (ValueError, RecursionError) as error:
        told = msgspec.json.encode({"type": "error", "text": f"no frame is read: {error}"}).decode()
        return message.encode(errors="replace"), told
    places = [(each.x, each.y, each.z) if isinstance(each, _Place) else each or _NOWHERE for each in sent.positions]
    with np.errstate(over="ignore"):
        positions = np.array(places, dtype=np.float64).astype("<f4").reshape(-1, 3)
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
    answers, frames
        The ZeroMQ endpoints on which the recogniser publishes, and on which it takes frames in.
    keys
        Folder of the keys of all ZeroMQ; None for none.
    origins
        Sites whose pages may connect, like https://editor.p5js.org; pages of this machine may anyway.
    networks
        Networks whose clients may connect; empty for all.
    """

    answers: str
    frames: str
    keys: Path | None = None
    origins: tuple[str, ...] = ()
    networks: tuple[str, ...] = ()
    name = "WebSocket"

    def serve(self, started: Callable[[str], None], wants_end: Callable[[], bool]) -> None:
        """Serve clients."""
        with ExitStack() as opened:
            keyring = opened.enter_context(Keyring(self.keys)) if self.keys else None
            subscription = Subscription(Endpoint.parse(self.answers, bind=False), keyring)
            server = SocketServer(opened.enter_context(closing(subscription)), self, keyring)
            server.serve(self.address, "--ws", started, wants_end)


def answer(gate: Gate, origins: Sequence[str], target: str, headers: Mapping[str, str]) -> Response | None:
    """Answer the request of a client; None opens its WebSocket.

    Browsers say which site a page is of, other programs do not. A page of another site may connect only if it is named.
    """
    host, origin = headers.get("host", ""), headers.get("origin")
    if not gate.knows(host):
        return refusal(403, "this name is not ours")
    if origin is not None and origin not in origins and not _is_near(origin, host):
        return refusal(403, f"a page of another site, {origin[:100]}: --ws-origin lets it in")
    return gate.checked(parse_qs(urlsplit(target).query).get("token", [""])[0])


def _is_near(origin: str, host: str) -> bool:
    """Say whether a page comes from this machine, or from the name by which it asks for us."""
    with suppress(ValueError):
        name, ours = urlsplit(origin).hostname, urlsplit(f"//{host}").hostname
        return name in ("localhost", ours) or ipaddress.ip_address(name or "").is_loopback
    return False


class _Client:
    """The answers that wait for a client."""

    def __init__(self) -> None:
        self.waiting, self.woken = deque[str](maxlen=MAX_WAITING), asyncio.Event()


class SocketServer(ClientServer):
    """Passes frames from clients to the recogniser, and its answers to all clients."""

    limits = {"max_size": _MAX_MESSAGE}  # noqa: RUF012 - never changed

    def __init__(self, subscription: Subscription, plan: SocketPlan, keyring: Keyring | None) -> None:
        super().__init__(subscription, Gate.for_host(host_and_port(plan.address)[0]))
        self._plan, self._keyring = plan, keyring
        self._networks = [ipaddress.ip_network(each) for each in plan.networks]
        self._clients: set[_Client] = set()
        self._told = set[str]()

    def take_messages(self) -> None:
        """Give all clients the answers that wait."""
        for parts in self._subscription.messages():
            text = as_text(parts)
            for client in self._clients:
                client.waiting.append(text)
                client.woken.set()

    def answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """Refuse a client of another network or site, and one too many."""
        headers = {name.lower(): value for name, value in request.headers.raw_items()}
        peer = str(connection.remote_address[0])
        if self._networks and not is_within(peer, self._networks):
            return refusal(403, "this network is not let in: see --allow-from")
        if len(self._clients) >= MAX_CLIENTS:
            return refusal(503, "too many clients")
        refused = answer(self._gate, self._plan.origins, request.path, headers)
        origin = printable(headers.get("origin", "")[:100])
        if (
            refused
            and "--ws-origin" in refused.body.decode()
            and origin not in self._told
            and len(self._told) < _MAX_TOLD
        ):
            self._told.add(origin)
            whose = "opened as a file" if origin == "null" else f"of {origin}"
            note(f"WebSocket: a page {whose} was refused: --ws-origin {origin} lets it in")
        return refused

    async def serve_client(self, connection: ServerConnection) -> None:
        """Serve one client until it leaves."""
        client = _Client()
        self._clients.add(client)
        sending = asyncio.create_task(_send(connection, client))
        with closing(ZmqSender(Endpoint.parse(self._plan.frames, bind=False), self._keyring)) as sender:
            await asyncio.sleep(_MEETING)
            with suppress(ConnectionClosed):
                async for message in connection:
                    frame, why = packed(message)
                    sender.send([frame])
                    if why:
                        client.waiting.append(why)
                        client.woken.set()
        self._clients.discard(client)
        sending.cancel()
        await asyncio.gather(sending, return_exceptions=True)


async def _send(connection: ServerConnection, client: _Client) -> None:
    """Send a client the answers that wait, in their order."""
    with suppress(ConnectionClosed):
        while True:
            await client.woken.wait()
            client.woken.clear()
            while client.waiting:
                await connection.send(client.waiting.popleft())
