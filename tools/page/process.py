"""The page in a process of its own, so that no browser ever makes a recogniser wait, and its link to the recogniser."""

import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, closing, suppress
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any, ClassVar
from urllib.parse import urlsplit

import msgspec
import zmq

from kinespace.stream.service.background import Child
from kinespace.stream.zeromq import Endpoint, Keyring
from kinespace.tools.cli.values import host_and_port, opening

#: The messages that a page always needs, and the messages that only an open page needs.
_TOPICS = (b"event/", b"done/", b"class/", b"classes/", b"status/", b"teach/")
_BODIES = b"body/"
#: Messages taken in one turn, at most, so that a flood leaves turns for the pages.
_MAX_IN_TURN = 512
#: Milliseconds to wait for the control socket.
_MAX_REPLY = 2000
_encode = msgspec.json.Encoder().encode


class Subscription:
    """A subscription to a recogniser's messages; it connects again by itself after the recogniser was away.

    Parameters
    ----------
    endpoint
        The endpoint at which the recogniser publishes.
    keyring
        Keys of both ends; None for none.
    """

    def __init__(self, endpoint: Endpoint, keyring: Keyring | None = None) -> None:
        self._socket = endpoint.open(zmq.SUB, keyring=keyring)
        for topic in _TOPICS:
            self._socket.subscribe(topic)
        self._bodies = False

    def fileno(self) -> int:
        """Give the file number that becomes readable when messages may have come."""
        return int(self._socket.getsockopt(zmq.FD))

    def want_bodies(self, *, wanted: bool) -> None:
        """Subscribe to bodies, or to none while no page is open."""
        if wanted != self._bodies:
            self._bodies = wanted
            (self._socket.subscribe if wanted else self._socket.unsubscribe)(_BODIES)

    def messages(self) -> Iterator[list[bytes]]:
        """Take the messages that wait."""
        for _ in range(_MAX_IN_TURN):
            try:
                yield self._socket.recv_multipart(zmq.NOBLOCK)
            except zmq.Again:
                return

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


def ask_control(endpoint: Endpoint, keyring: Keyring | None, command: Mapping[str, object]) -> dict[str, Any] | None:
    """Ask the control socket of a recogniser; from any thread.

    Parameters
    ----------
    endpoint
        The address of `--control`.
    keyring
        Keys of both ends; None for none.
    command
        The command.

    Returns
    -------
    The reply; None when no reply comes in two seconds.
    """
    # A socket that got no reply could not ask again: each command has its own.
    with closing(endpoint.open(zmq.REQ, keyring=keyring)) as asking, suppress(zmq.ZMQError, ValueError):
        asking.send(_encode(command), zmq.NOBLOCK)
        if asking.poll(_MAX_REPLY):
            reply = msgspec.json.decode(asking.recv(), type=dict[str, Any])
            return reply if "states" in reply else None
    return None


#: Seconds after which a process that is to end is killed.
_MAX_END = 5.0


@dataclass(frozen=True, slots=True)
class Plan(ABC):
    """A server of browsers, which another process gets.

    Attributes
    ----------
    name, option
        The process's name in messages, and the option that gives the address.
    address
        HOST:PORT of the server.
    source
        The ZeroMQ endpoint on which a recogniser publishes.
    keys
        Folder of the keys of all ZeroMQ; None for none.
    """

    name: ClassVar[str]
    option: ClassVar[str]
    address: str
    source: str
    keys: Path | None = None

    def serve(self, started: Callable[[str], None], wants_end: Callable[[], bool]) -> None:
        """Serve browsers; `started` gets the address, and `wants_end` is asked some times a second.

        Raises
        ------
        OSError
            The address is taken, or impossible.
        ValueError
            An address cannot be read, or the keys cannot be used.
        """
        with ExitStack() as opened:
            keyring = opened.enter_context(Keyring(self.keys)) if self.keys else None
            subscription = opened.enter_context(closing(Subscription(Endpoint.parse(self.source, bind=False), keyring)))
            self.server(subscription, keyring).serve(self.address, self.option, started, wants_end)

    @abstractmethod
    def server(self, subscription: Subscription, keyring: Keyring | None) -> Any:  # noqa: ANN401 - slow to load
        """Make the server (`server.ClientServer`)."""


@dataclass(frozen=True, slots=True)
class PagePlan(Plan):
    """A page to be served.

    Attributes
    ----------
    control
        The ZeroMQ endpoint of the recogniser's control socket; None: pages only look.
    libraries
        The files of the motions that may be named.
    """

    name = option = "page"
    control: str | None = None
    libraries: tuple[Path, ...] = ()

    def server(self, subscription: Subscription, keyring: Keyring | None) -> Any:  # noqa: ANN401 - as above
        """Make the page's server."""
        from kinespace.tools.page.server import Gate, PageServer  # noqa: PLC0415 - this process alone needs it

        to = self.control and Endpoint.parse(self.control, bind=False)
        if to:
            # What cannot be asked is said now, not when somebody teaches.
            with opening("--control"):
                to.open(zmq.REQ, keyring=keyring).close()
        control = partial(ask_control, to, keyring) if to else None
        return PageServer(subscription, control, Gate.for_host(host_and_port(self.address)[0]), self.libraries)


class PageProcess(AbstractContextManager["PageProcess"]):
    """A page, or another server of browsers, in a process that is started again once when it dies; a context manager.

    Parameters
    ----------
    plan
        The addresses of the page, or another server's.
    say
        Is given a line for a person when the process has died, from another thread.

    Attributes
    ----------
    name, address
        What it is called in messages, and the page's address.

    Raises
    ------
    OSError, ValueError
        As `Plan.serve`.
    """

    def __init__(self, plan: Plan, say: Callable[[str], object] = lambda _: None) -> None:
        self._say, self.name = say, plan.name
        #: Whether the page is to end; the lock is held while it is begun again or ended.
        self._ending, self._lock = False, threading.Lock()
        self._begin(plan)
        self._watching = threading.Thread(target=self._watch, args=(plan,), name="kinespace page", daemon=True)
        self._watching.start()

    def _begin(self, plan: Plan) -> None:
        self._child = Child(plan.name, plan.serve, max_end=_MAX_END)
        self.address = self._child.said

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._ending = True
            self._child.close()
        self._watching.join()

    def _watch(self, plan: Plan) -> None:
        wait([self._child.process.sentinel])
        with self._lock:
            if self._ending:
                return
            self._child.close()
            self._say(f"{plan.name}: its process died ({self._child.process.exitcode}) and is started again")
            # An open page finds it where it was.
            place = f"{plan.address.rpartition(':')[0]}:{urlsplit(self.address).port}"
            try:
                self._begin(replace(plan, address=place))
            except (OSError, ValueError) as error:
                self._say(f"{plan.name}: not started again: {error}")
                return
        self._say(f"{plan.name}: {self.address}")
        wait([self._child.process.sentinel])
        if not self._ending:
            self._say(f"{plan.name}: its process died again; kinespace goes on without it")
