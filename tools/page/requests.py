"""The browsers' requests, checked: HTTP requests, and the messages of an open page. No sockets."""

from __future__ import annotations

import ipaddress
import re
import secrets
from collections.abc import Mapping
from dataclasses import dataclass
from http import HTTPStatus
from importlib import resources
from typing import Annotated
from urllib.parse import parse_qs, urlsplit

import msgspec
from websockets.datastructures import Headers
from websockets.http11 import Response

from kinespace.tools.camera import models

#: Bytes of a message from a page, at most.
MAX_MESSAGE = 4096
#: The path of the WebSocket.
SOCKET = "/live"
_TYPES = {
    "html": "text/html; charset=utf-8",
    "css": "text/css; charset=utf-8",
    "js": "text/javascript; charset=utf-8",
    "svg": "image/svg+xml; charset=utf-8",
    # A browser compiles while it reads, if the type is this and no more.
    "wasm": "application/wasm",
}
_BYTES = "application/octet-stream"
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self' ws://{host}; "
    "worker-src {worker}; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
#: The camera's worker, alone in that it may compile, and its policy.
WORKER = "pose-worker.js"
_WORKER_POLICY = "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; connect-src 'self'"
_Short = Annotated[str, msgspec.Meta(max_length=256)]
_Count = Annotated[int, msgspec.Meta(ge=0, le=2**53)]


class Message(msgspec.Struct, forbid_unknown_fields=True):
    """A message of a page: the number of its last drawing, a command, or a body.

    Attributes
    ----------
    ack
        The number of the message that has been drawn.
    ask
        A command for the control socket.
    body
        A body that its camera sees, still to be read (`cameras.Landmarks`).
    """

    ack: _Count | None = None
    ask: Annotated[dict[_Short, _Short | float | bool], msgspec.Meta(max_length=8)] | None = None
    body: msgspec.Raw = msgspec.Raw()


_read = msgspec.json.Decoder(Message).decode


def read_message(text: str | bytes) -> Message:
    """Read a message of a page.

    Raises
    ------
    ValueError
        It is no text, too long, no JSON, or holds anything but one of the three.
    """
    if not isinstance(text, str) or len(text) > MAX_MESSAGE:
        raise ValueError(f"message: expected text of at most {MAX_MESSAGE} characters, got {len(text)} of another kind")
    try:
        message = _read(text)
    except RecursionError as error:
        raise ValueError("message: expected flat JSON") from error
    if (message.ack is not None) + (message.ask is not None) + bool(message.body) != 1:
        raise ValueError("message: expected one of ack, ask and body")
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
    no_camera
        Why pages cannot send what their cameras see; empty if they can.
    """

    token: str = ""
    names: frozenset[str] = frozenset({"localhost"})
    no_camera: str = ""

    @classmethod
    def for_host(cls, host: str, no_camera: str = "") -> Gate:
        """Ask for a token where other machines can reach us."""
        try:
            alone = ipaddress.ip_address(host).is_loopback
        except ValueError:
            alone = host == "localhost"
        return cls("" if alone else secrets.token_urlsafe(16), frozenset({"localhost", host.lower()}), no_camera)

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
            return static_file(path, host, self.no_camera)
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


def static_file(path: str, host: str, no_camera: str = "") -> Response:
    """Give a file of the page by its path; only files of `static/` itself, and those of the camera."""
    name = path.removeprefix("/") or "index.html"
    why_not = no_camera or ("" if models.browser_has_models() else models.MISSING_BROWSER)
    if name in (WORKER, *models.BROWSER) and why_not:
        return refusal(404, why_not)
    kind = _TYPES.get(name.rpartition(".")[2], _BYTES)
    if name in models.BROWSER:
        try:
            return response(200, models.browser_file(name), kind)
        except (OSError, ValueError) as error:
            return refusal(404, str(error))
    file = resources.files("kinespace.tools.page") / "static" / name
    if kind == _BYTES or "/" in name or "\\" in name or not file.is_file():
        return refusal(404, "no such file")
    worker = "'none'" if why_not else "'self'"
    policy = _WORKER_POLICY if name == WORKER else _POLICY.format(host=host, worker=worker)
    return response(200, file.read_bytes(), kind, {"Content-Security-Policy": policy})


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
