"""A network of this machine's own, with a cable that can be pulled out."""

from __future__ import annotations

import os
import shutil
import subprocess
import threading
import time
from contextlib import ExitStack
from typing import Self

#: Seconds for which the cable is out.
_CUT = 5.0
#: The network between two namespaces, one for each process that runs, and the host in it of each namespace.
_NETWORK, _HERE, _THERE = f"10.213.{os.getpid() % 256}.{{}}", 1, 2


class Network:
    """A network namespace with a cable to ours. A context manager.

    Raises
    ------
    OSError
        The system has no namespaces, or does not allow them.
    """

    def __init__(self) -> None:
        self._name, self._ends = f"kinespace{os.getpid()}", (f"kin{os.getpid()}a", f"kin{os.getpid()}b")
        #: The words that begin a command behind the cable, and our address.
        self.within = ("ip", "netns", "exec", self._name)
        self.hosts = (_NETWORK.format(_HERE),)
        #: When the cable was last plugged in.
        self.plugged = time.monotonic()
        self._plugging = threading.Timer(_CUT, self._plug)

    def __enter__(self) -> Self:
        if not shutil.which("ip"):
            raise OSError("there is no `ip`")
        here, there = self._ends
        with ExitStack() as stack:
            _ip("netns", "add", self._name)
            stack.callback(self.__exit__)
            _ip("link", "add", here, "type", "veth", "peer", "name", there, "netns", self._name)
            for end, host, within in ((here, _HERE, ()), (there, _THERE, ("-n", self._name))):
                _ip(*within, "address", "add", f"{_NETWORK.format(host)}/30", "dev", end)
                _ip(*within, "link", "set", end, "up")
            stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        if self._plugging.ident:
            self._plugging.join()
        # The cable's ends vanish with the namespace.
        _ip("netns", "delete", self._name)

    @property
    def is_whole(self) -> bool:
        """Whether the cable is plugged in."""
        return not self._plugging.is_alive()

    def cut(self) -> None:
        """Pull the cable out for some seconds."""
        _ip("link", "set", self._ends[0], "down")
        self._plugging.start()

    def _plug(self) -> None:
        _ip("link", "set", self._ends[0], "up")
        self.plugged = time.monotonic()


def _ip(*arguments: str) -> None:
    done = subprocess.run(["ip", *arguments], capture_output=True, text=True, check=False)  # noqa: S603, S607 - found
    if done.returncode:
        raise OSError(f"ip {' '.join(arguments)}: {done.stderr.strip()}")
