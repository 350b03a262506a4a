"""Zenoh: opened with our defaults, or with its own configuration file; one loop reads all messages."""

from __future__ import annotations

import json
import math
import socket
import time
from collections import deque
from contextlib import suppress
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

#: Where a gateway listens by default.
LISTEN = "tcp/127.0.0.1:7447"
#: Zenoh's own defaults, and ours:
#: - milliseconds after which a silent process counts as gone;
#: - microseconds after which a connection that takes no message is closed; our loop may wait for so long;
#: - shared memory between processes of one machine: each killed worker left 16 MB, in the gateway and in /dev/shm.
_REPLACED = {
    "transport/link/tx/lease": (10_000, 1000),
    "transport/link/tx/queue/congestion_control/block/wait_before_close": (5_000_000, 1_000_000),
    "transport/shared_memory/enabled": (True, False),
}


def open_session(listen: Sequence[str], connect: Sequence[str], file: Path | None) -> Any:  # noqa: ANN401 - Zenoh's
    """Open Zenoh.

    Parameters
    ----------
    listen, connect
        Endpoints like `tcp/10.0.0.1:7447`; they replace the endpoints of the file. Nobody need listen yet where we
        connect.
    file
        A configuration file of Zenoh, with keys and access rules; without a file Zenoh does not search by multicast.

    Raises
    ------
    ImportError
        Zenoh is not installed.
    ConnectionError
        An endpoint cannot be listened on; or no router is there, and the file demands one.
    ValueError
        An endpoint is none, or the file is not a configuration of Zenoh.
    """
    try:
        import zenoh  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise ImportError("Zenoh is missing: pip install 'kinespace[cluster]'") from error
    zenoh.init_log_from_env_or("off")
    try:
        config = zenoh.Config.from_file(str(file)) if file else zenoh.Config()
    except zenoh.ZError as error:
        raise ValueError(f"{file}: not a configuration of Zenoh: {error}") from error
    ours: dict[str, object] = {
        name: other for name, (usual, other) in _REPLACED.items() if json.loads(config.get_json(name)) == usual
    }
    if not file:
        ours |= {"mode": "peer", "scouting/multicast/enabled": False, "listen/endpoints": list(listen)}
    if listen:
        ours["listen/endpoints"] = list(listen)
    if connect:
        # Machines start in any order. A gateway that was started again is found at once.
        ours |= {"connect/endpoints": list(connect), "connect/exit_on_failure": False}
        ours["connect/retry"] = {"period_init_ms": 100, "period_max_ms": 250, "period_increase_factor": 2}
    places = ", ".join([*listen, *connect]) or str(file)
    try:
        for name, value in ours.items():
            config.insert_json5(name, json.dumps(value))
    except zenoh.ZError:
        raise ValueError(f"{places}: expected endpoints like {LISTEN}") from None
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        raise ConnectionError(f"Zenoh: {places}: {_reason(error)}") from error


def unreached(session: Any, connect: Sequence[str]) -> Sequence[str]:  # noqa: ANN401 - Zenoh's
    """Give the endpoints to connect to as long as there is no link to anybody."""
    return () if session.info.links() else connect


def _reason(error: Exception) -> str:
    """Give the last reason in Zenoh's chain of reasons, without places in its sources."""
    return str(error).split(" at ")[0].strip() or "cannot be opened"


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
        """Deal with the messages that wait, for so many seconds or a little longer; in the loop's thread."""
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
