"""UDP: the endpoint that receives datagrams, and the endpoint that sends them."""

import socket
import struct
import sys
import threading
import time
from functools import lru_cache
from typing import Any

from kinespace.stream.packet import Networks, is_within
from kinespace.stream.status import InputCounts

#: Bytes of waiting datagrams that the system keeps; the usual default holds 0.2 s of a busy feed.
RECEIVE_BUFFER = 4 << 20
#: With this option Linux says how many datagrams it dropped before each one; Python has no name for it.
_SO_RXQ_OVFL = 40
_COUNTS_DROPS = sys.platform == "linux"
#: With this option Linux says when each datagram arrived, on the clock of the day; Python has no name for it.
_SO_TIMESTAMPNS = 35
_TIMESPEC = struct.Struct("@ll")
#: Seconds that no datagram waits: a longer wait means that the clock of the day was set.
_MAX_WAITED = 300.0
#: Seconds between two attempts to look a host up.
_LOOK_UP_EVERY = 5.0


def _resolved(host: str, port: int) -> tuple[int, int, tuple[Any, ...]]:
    """Look a host up: address family, socket kind and socket address; raises OSError naming the host."""
    try:
        family, kind, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
    except OSError as error:
        raise OSError(error.errno, f"{host}:{port}: {error.strerror}") from error
    return family, kind, address


def is_ours(host: str) -> bool:
    """Say whether an address in numbers is this machine's: no program can bind the address of another machine."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind((host, 0))
        except OSError:
            return False
    return True


class LookedUp:
    """A host that a thread looks up: a name server may take half a minute, and the feed must not wait.

    Parameters
    ----------
    host, port
        As typed.
    """

    def __init__(self, host: str, port: int) -> None:
        #: The numeric address; None until it is known.
        self.address: tuple[Any, ...] | None = None
        try:
            self.address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM, flags=socket.AI_NUMERICHOST)[0][4]
        except OSError:
            threading.Thread(target=self._look_up, args=(host, port), name="kinespace look-up", daemon=True).start()

    def _look_up(self, host: str, port: int) -> None:
        while self.address is None:
            try:
                self.address = _resolved(host, port)[2]
            except OSError:
                time.sleep(_LOOK_UP_EVERY)


class OscReceiver:
    """A UDP socket on which frames come in.

    Parameters
    ----------
    host, port
        Where to listen; port 0 lets the system choose (then `address` holds it).
    networks
        Networks whose datagrams are read, those of others as empty ones; empty for all.

    Attributes
    ----------
    address, place
        Host and port it listens on; and as recordings name them: `osc`, a space, host and port.
    counts
        Counts of the datagrams that the system dropped because they came faster than they were received (known on Linux
        only).
    waited
        Seconds for which the last datagram waited in the system (known on Linux only).
    sender
        Host and port the last datagram came from; None before the first.

    Raises
    ------
    OSError
        The port is taken, or the host is not this machine's.
    """

    def __init__(self, host: str, port: int, networks: Networks = ()) -> None:
        family, kind, address = _resolved(host, port)
        self._networks = networks
        self._is_admitted = lru_cache(maxsize=1024)(lambda host: is_within(host, networks))
        self.socket = socket.socket(family, kind)
        try:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
            if _COUNTS_DROPS:
                self.socket.setsockopt(socket.SOL_SOCKET, _SO_RXQ_OVFL, 1)
                self.socket.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
            self.socket.settimeout(0.0)
            self.socket.bind(address)
        except OSError as error:
            self.socket.close()
            raise OSError(error.errno, f"{host}:{port}: {error.strerror}") from error
        self.address: tuple[str, int] = self.socket.getsockname()[:2]
        self.place = "osc {}:{}".format(*self.address)
        self.counts = InputCounts()
        self.waited = 0.0
        self.sender: tuple[str, int] | None = None

    def __str__(self) -> str:
        return "OSC {}:{}".format(*self.address)

    def receive(self) -> bytes | None:
        """Take the next datagram; None when there is none now."""
        ancillary: list[tuple[int, int, bytes]] = []
        try:
            if _COUNTS_DROPS:
                datagram, ancillary, _, sender = self.socket.recvmsg(65535, 128)
            else:
                datagram, sender = self.socket.recvfrom(65535)
        except (BlockingIOError, InterruptedError):
            return None
        except ConnectionError:
            return b""  # Windows reports here that an earlier answer reached no program: counted as a bad packet.
        for _, kind, value in ancillary:
            if kind == _SO_RXQ_OVFL:
                self.counts.overrun = int.from_bytes(value[:4], sys.byteorder)
            elif kind == _SO_TIMESTAMPNS:
                seconds, nanoseconds = _TIMESPEC.unpack(value)
                waited = time.time() - seconds - nanoseconds * 1e-9
                self.waited = waited if 0.0 <= waited < _MAX_WAITED else 0.0
        self.sender = sender[:2]
        if self._networks and not self._is_admitted(sender[0]):
            return b""
        return datagram

    def send_to(self, datagram: bytes, target: tuple[Any, ...]) -> bool:
        """Send from the port listened on to a numeric address; False when the system does not send it."""
        try:
            self.socket.sendto(datagram, target)
        except OSError:
            return False
        return True

    def close(self) -> None:
        """Give the port back."""
        self.socket.close()


class OscSender:
    """A UDP socket that sends to one place.

    Parameters
    ----------
    host, port
        The place to send to.
    asks
        Count the datagrams that the other machine sends back because no program listens there. The place must then
        be in reach when the socket is made.

    Attributes
    ----------
    failed
        Datagrams that the system refused to send (no receiver, buffer full).

    Raises
    ------
    OSError
        The host's name cannot be resolved, or the place is not in reach.
    ValueError
        The port is 0, at which nobody listens.
    """

    def __init__(self, host: str, port: int, *, asks: bool = False) -> None:
        if not port:
            raise ValueError(f"address: expected HOST:PORT, the port from 1 to 65535, got '{host}:0'")
        family, kind, address = _resolved(host, port)
        self.target: tuple[Any, ...] = address
        self.socket = socket.socket(family, kind)
        self.socket.settimeout(0.0)
        self.failed = self._unheard = 0
        self._asks = asks
        if asks:
            try:
                self.socket.connect(address)
            except OSError as error:
                self.socket.close()
                raise OSError(error.errno, f"{host}:{port}: {error.strerror}") from error

    def __str__(self) -> str:
        return "{}:{}".format(*self.target)

    def send(self, datagram: bytes) -> None:
        """Send one datagram; a failure is counted, never raised: the next one may succeed."""
        try:
            if self._asks:
                self._send_and_ask(datagram)
            else:
                self.socket.sendto(datagram, self.target)
        except OSError:
            self.failed += 1

    def _send_and_ask(self, datagram: bytes) -> None:
        try:
            self.socket.send(datagram)
        except ConnectionError:
            # An earlier datagram came back, and this one was not sent.
            self._unheard += 1
            self.socket.send(datagram)

    @property
    def unheard(self) -> int:
        """Datagrams known to have reached no program, where it `asks`; other machines may send no notice of them."""
        if self._asks and self.socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):
            self._unheard += 1
        return self._unheard

    def close(self) -> None:
        """Give the socket back."""
        self.socket.close()
