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
