"""A source whose every packet is also written to a raw recording, before anybody makes sense of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from stream.feeds.source import FeedSource
from stream.onepart import ZmqPackets
from stream.rawfile import RawPacket
from stream.service import TendedSource, ZmqSource

if TYPE_CHECKING:
    from collections.abc import Sequence

    from stream.frame import Announcement, Frame
    from stream.rawfile import RawWriter
    from stream.service import OscSource
    from stream.status import InputCounts


def described(source: OscSource | ZmqSource | FeedSource) -> str:
    """Say where packets come in, and as whose they are read, as a raw recording's header does."""
    if isinstance(source, ZmqSource):
        return f"zmq {source.receiver.address}"
    host, port = source.receiver.address
    if isinstance(source, FeedSource):
        kind = "zmq" if isinstance(source.receiver, ZmqPackets) else "osc"
        return f"{kind} {host}:{port} feed {source.preset.name}"
    return f"osc {host}:{port}"


class TappedSource:
    """A source for the service that records on the way.

    Parameters
    ----------
    source
        Where packets come in; closed by `close`.
    writer, index
        Where they are written, and which of the recording's sources this is.
    """

    def __init__(self, source: OscSource | ZmqSource | FeedSource, writer: RawWriter, index: int) -> None:
        self._source = source
        self._writer = writer
        self._index = index
        self._receive = source.receiver.receive
        self._arrival = 0.0
        source.receiver.receive = self._recorded  # type: ignore[method-assign, assignment]  # the tap itself

    def __str__(self) -> str:
        return str(self._source)

    @property
    def pollable(self) -> object:
        """The socket."""
        return self._source.pollable

    @property
    def counts(self) -> InputCounts:
        """What came in so far."""
        return self._source.counts

    def take(self, arrival: float) -> Sequence[Frame | Announcement] | None:
        """Take in one packet, and keep it."""
        self._arrival = arrival
        return self._source.take(arrival)

    def tend(self, now: float) -> Sequence[Frame | Announcement]:
        """Do what the source has to do even when nothing comes."""
        return self._source.tend(now) if isinstance(self._source, TendedSource) else ()

    def close(self) -> None:
        """Close the socket."""
        self._source.close()

    def _recorded(self) -> bytes | list[bytes] | None:
        packet = self._receive()
        if packet is not None:
            parts = (packet,) if isinstance(packet, bytes) else tuple(packet)
            self._writer.write(RawPacket(self._arrival, self._index, self._sender(), parts))
        return packet

    def _sender(self) -> str:
        """Who sent the packet, `host:port`; empty where the transport does not tell."""
        sender = None if isinstance(self._source, ZmqSource) else self._source.receiver.sender
        return f"{sender[0]}:{sender[1]}" if sender else ""
