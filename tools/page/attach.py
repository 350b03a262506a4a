"""The two ends that a recogniser opens for its own page: a publisher on this machine, and a control door."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from kinespace.stream.outputs import ZmqSink
from kinespace.stream.outputs.body_sink import BodySink
from kinespace.stream.zeromq import Endpoint, ZmqSender
from kinespace.tools.page.process import PagePlan, PageProcess, require_websockets
from kinespace.tools.teaching.door import Allowed, RequestDoor

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from kinespace.stream.outputs import Sink
    from kinespace.stream.outputs.body_sink import Followed
    from kinespace.stream.zeromq import Keyring
    from kinespace.tools.teaching.commanded import Commanded

_HERE = Endpoint("tcp://127.0.0.1:*", bind=True)


class Ends(NamedTuple):
    """A page, and a recogniser's ends of the link to it, to be closed with its other sinks and sources."""

    sinks: Sequence[Sink] = ()
    doors: Sequence[RequestDoor] = ()
    page: PageProcess | None = None


NO_ENDS = Ends()


def ends_for_page(
    address: str,
    performers: Followed,
    desk: Commanded | None = None,
    *,
    keyring: Keyring | None = None,
    keys: Path | None = None,
    recordings: Path | None = None,
    osc_to: str | None = None,
    zmq_to: str | None = None,
) -> Ends:
    """Start a page, and open the ends of the link to it.

    Parameters
    ----------
    address
        HOST:PORT of the page.
    performers
        The performers whose bodies are shown.
    desk
        Carries out the page's commands; None: the page only looks.
    keyring, keys
        The keys of all ZeroMQ, and their folder; None for none.
    recordings, osc_to, zmq_to
        The folder of recordings that may be played, and the addresses to which they are played.

    Raises
    ------
    ImportError, OSError, ValueError
        As `tools.page.process.PageProcess`.
    """
    require_websockets()
    sender = ZmqSender(_HERE, keyring)
    doors = [RequestDoor(_HERE, desk, Allowed(), keyring)] if desk else []
    control = doors[0].address if doors else None
    plan = PagePlan(sender.address, address, control, recordings, osc_to, zmq_to, keys)
    return Ends([ZmqSink(sender), BodySink(sender, performers)], doors, PageProcess(plan))
