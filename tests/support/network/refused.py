"""The network is refused while tests run, in their process and in the programs that they start: this machine alone."""

import errno
import ipaddress
import socket
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache, wraps
from typing import Any

_SENDING = {"socket.connect", "socket.sendto", "socket.sendmsg"}
_LOOKING_UP = {"socket.getaddrinfo", "socket.gethostbyname", "socket.gethostbyaddr"}
_NAMES = {"", "localhost", "localhost.localdomain", "ip6-localhost", "ip6-loopback"}


@cache
def refuse() -> None:
    """Refuse every address but this machine's own ones, and every look-up of another name; for the whole process.

    Multicast is let out through the loopback interface alone.
    """
    sys.addaudithook(_judge)
    for name in ("bind", "connect", "connect_ex", "sendto"):
        setattr(socket.socket, name, _looking_first(getattr(socket.socket, name)))


def _judge(event: str, arguments: tuple[object, ...]) -> None:
    """Raise the error of a machine without a network where something would leave it."""
    if event in _SENDING:
        sock, address = arguments[:2]
        if isinstance(sock, socket.socket) and isinstance(address, tuple) and not _is_near(sock, str(address[0])):
            raise OSError(errno.ENETUNREACH, f"tests ask no network, and {address} is on one")
    elif event in _LOOKING_UP:
        name = arguments[0]
        text = name.decode(errors="replace") if isinstance(name, bytes) else str(name or "")
        if not _is_known(text):
            raise socket.gaierror(socket.EAI_NONAME, f"tests ask no network, and {text!r} would be looked up in one")


def _looking_first(method: Callable[..., Any]) -> Callable[..., Any]:
    """Judge a name before a socket looks it up: Python tells of no look-up within these methods."""

    @wraps(method)
    def judged(self: socket.socket, *arguments: Any) -> Any:  # noqa: ANN401 - as the method takes them
        if isinstance(arguments[-1], tuple):
            _judge("socket.getaddrinfo", arguments[-1])
        return method(self, *arguments)

    return judged


def _is_known(name: str) -> bool:
    """Say whether nobody needs to be asked for a name's address."""
    if name.lower() in _NAMES or name == socket.gethostname():
        return True
    with suppress(ValueError):
        ipaddress.ip_address(name.partition("%")[0])
        return True
    return False


def _is_near(sock: socket.socket, host: str) -> bool:
    """Say whether packets from a socket to a host stay on this machine."""
    if _is_known(host) and not host[:1].isdigit() and ":" not in host:
        return True
    try:
        address = ipaddress.ip_address(host.partition("%")[0])
    except ValueError:
        return False
    near = getattr(address, "ipv4_mapped", None) or address
    if near.is_loopback or near.is_unspecified:
        return True
    return near.is_multicast and _leaves_by_loopback(sock)


def _leaves_by_loopback(sock: socket.socket) -> bool:
    if sock.family == socket.AF_INET:
        return ipaddress.ip_address(sock.getsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, 4)).is_loopback
    number = sock.getsockopt(socket.IPPROTO_IPV6, socket.IPV6_MULTICAST_IF)
    return number > 0 and socket.if_indextoname(number).startswith("lo")
