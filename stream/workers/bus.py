"""Zenoh: opened with our defaults, or with its own configuration file; one loop reads all messages."""

from __future__ import annotations

import json
import math
import re
import socket
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import Any

from kinespace.stream.workers.certificates import admitting
from kinespace.stream.workers.terms import MAX_LIBRARY

#: Where a gateway listens by default.
LISTEN = "tcp/127.0.0.1:7447"
#: Zenoh's own defaults, and ours:
#: - milliseconds after which a silent process counts as gone;
#: - microseconds after which a connection that takes no message is closed; our loop may wait for so long;
#: - shared memory between processes of one machine: each killed worker left 16 MB, in the gateway and in /dev/shm;
#: - bytes of a message: a library is the largest;
#: - endpoints that are listened on where nobody asked for any.
_REPLACED = {
    "transport/link/tx/lease": (10_000, 1000),
    "transport/link/tx/queue/congestion_control/block/wait_before_close": (5_000_000, 1_000_000),
    "transport/shared_memory/enabled": (True, False),
    "transport/link/rx/max_message_size": (1 << 30, MAX_LIBRARY + (1 << 16)),
    "listen/endpoints": ({"router": ["tcp/[::]:7447"], "peer": ["tcp/[::]:0"]}, []),
}
#: Transports of Zenoh on which both ends can prove who they are.
_PROVING = ("tls/", "quic/")
#: An endpoint that this machine alone reaches.
_is_here = re.compile(r"unix.*|\w+/(127\.[\d.]+|localhost|\[::1\]):").match


def open_session(
    listen: Sequence[str],
    connect: Sequence[str],
    file: Path | None,
    keys: Path | None = None,
    *,
    to_anybody: bool = False,
) -> Any:  # noqa: ANN401 - Zenoh's
    """Open Zenoh.

    Parameters
    ----------
    listen, connect
        Endpoints like `tcp/10.0.0.1:7447`; they replace the endpoints of the file. Nobody need listen yet where we
        connect.
    file
        A configuration file of Zenoh, with keys and access rules; without a file Zenoh does not search by multicast.
    keys
        A folder of certificates (`certificates`), for endpoints by TLS.
    to_anybody
        Whether other machines may connect without a certificate.

    Raises
    ------
    ImportError
        Zenoh is not installed.
    ConnectionError
        An endpoint cannot be listened on; or no router is there, and the file demands one.
    ValueError
        An endpoint is none, or is open to other machines without certificates; or the file is not a configuration of
        Zenoh; or the folder has no certificate of ours.
    """
    try:
        import zenoh  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise ImportError("Zenoh is missing: pip install 'kinespace[cluster]'") from error
    zenoh.init_log_from_env_or("off")
    places = ", ".join([*listen, *connect]) or str(file)
    config = _config(zenoh, listen, connect, file, keys)
    if far := [] if to_anybody else _open_to_others(config):
        raise ValueError(
            f"--listen {far[0]}: expected an endpoint on this machine, tls/... with --keys or client certificates in "
            "--zenoh, which admit known workers alone, or --open, which admits anybody"
        )
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        # The last reason in Zenoh's chain of reasons, without places in its sources.
        reason = str(error).split(" at ")[0].strip() or "cannot be opened"
        raise ConnectionError(f"Zenoh: {places}: {reason}") from error


def _config(zenoh: Any, listen: Sequence[str], connect: Sequence[str], file: Path | None, keys: Path | None) -> Any:  # noqa: ANN401 - Zenoh's
    """Make a configuration of Zenoh."""
    try:
        config = zenoh.Config.from_file(str(file)) if file else zenoh.Config()
    except zenoh.ZError as error:
        raise ValueError(f"{file}: not a configuration of Zenoh: {error}") from error
    ours: dict[str, object] = {
        name: other for name, (usual, other) in _REPLACED.items() if json.loads(config.get_json(name)) == usual
    }
    if not file:
        ours |= {"mode": "peer", "scouting/multicast/enabled": False}
    if listen:
        ours["listen/endpoints"] = list(listen)
    if connect:
        # Machines start in any order. A gateway that was started again is found at once.
        ours |= {"connect/endpoints": list(connect), "connect/exit_on_failure": False}
        ours["connect/retry"] = {"period_init_ms": 100, "period_max_ms": 250, "period_increase_factor": 2}
    if keys and any(each.startswith(_PROVING) for each in (*listen, *connect)):
        ours |= admitting(keys)
    try:
        for name, value in ours.items():
            config.insert_json5(name, json.dumps(value))
    except zenoh.ZError:
        raise ValueError(f"{', '.join([*listen, *connect])}: expected endpoints like {LISTEN}") from None
    return config


def _open_to_others(config: Any) -> list[str]:  # noqa: ANN401 - Zenoh's
    """List the endpoints of a configuration that other machines reach without a certificate."""
    proved = _PROVING if json.loads(config.get_json("transport/link/tls/enable_mtls")) else ()
    places = json.loads(config.get_json("listen/endpoints"))
    places = chain(*places.values()) if isinstance(places, dict) else places
    return [each for each in places if not (each.startswith(proved) or _is_here(each))]


def joined(session: Any, known: set[str]) -> list[str]:  # noqa: ANN401 - Zenoh's
    """Name the ends of new links: where they are and, by TLS, who proved to be there; add the links to the known."""
    links = [(each.auth_identifier, str(each.dst)) for each in session.info.links()]
    # Where nobody proves anything, other machines are named all the same.
    new = [f"{who or 'somebody'} at {to}" for who, to in links if to not in known and (who or not _is_here(to))]
    known.update(to for _, to in links)
    return new


def unreached(session: Any, connect: Sequence[str]) -> Sequence[str]:  # noqa: ANN401 - Zenoh's
    """Give the endpoints to connect to as long as there is no link to anybody."""
    return () if session.info.links() else connect


class Inbox:
    """Keeps the messages of Zenoh's threads, in their order, for one loop, which can poll the inbox or wait for it."""

    def __init__(self) -> None:
        self._waiting: deque[tuple[Callable[..., None], tuple[Any, ...]]] = deque()
        self._wakes, self._woken = socket.socketpair()
        for end in (self._wakes, self._woken):
            end.setblocking(False)  # noqa: FBT003 - a socket's own method
        self._awake = False

    def fileno(self) -> int:
        """Give the number of the socket that can be polled."""
        return self._woken.fileno()

    def put(self, deal_with: Callable[..., None], *arguments: object) -> None:
        """Keep a message; from any thread."""
        self._waiting.append((deal_with, arguments))
        if not self._awake:
            self._awake = True
            # A full socket wakes the loop, too; behind a closed socket there is no loop.
            with suppress(OSError):
                self._wakes.send(b"!")

    def deal(self, longest: float = math.inf) -> None:
        """Deal with the messages that wait, for `longest` seconds or a little more; in the loop's thread."""
        ends = time.monotonic() + longest
        if self._awake:
            with suppress(BlockingIOError):
                self._woken.recv(64)
            self._awake = False
        for _ in range(len(self._waiting)):
            deal_with, arguments = self._waiting.popleft()
            deal_with(*arguments)
            if time.monotonic() > ends:
                break

    @property
    def is_empty(self) -> bool:
        """Whether no message waits."""
        return not self._waiting

    def close(self) -> None:
        """Close the sockets."""
        self._wakes.close()
        self._woken.close()
