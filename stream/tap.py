"""A source whose every packet is also written to a raw recording, before anybody makes sense of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from stream.rawfile import RawPacket
from stream.service import OscSource, ZmqSource

if TYPE_CHECKING:
    from collections.abc import Sequence

    from stream.frame import Announcement, Frame
    from stream.rawfile import RawWriter
    from stream.status import InputCounts


def described(source: OscSource | ZmqSource) -> str:
    """Say where packets come in, as a raw recording's header does."""
    if isinstance(source, OscSource):
        host, port = source.receiver.address
        return f"osc {host}:{port}"
    return f"zmq {source.receiver.address}"


class TappedSource:
    """A source for the service that records on the way.

    Parameters
    ----------
    source
        Where packets come in; closed by `close`.
    writer, index
        Where they are written, and which of the recording's sources this is.
    """

    def __init__(self, source: OscSource | ZmqSource, writer: RawWriter, index: int) -> None:
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

    def close(self) -> None:
        """Close the socket."""
        self._source.close()

    def _recorded(self) -> bytes | list[bytes] | None:
        packet = self._receive()
        if packet is not None:
            parts = (packet,) if isinstance(packet, bytes) else tuple(packet)
            sender = getattr(self._source.receiver, "sender", "")
            self._writer.write(RawPacket(self._arrival, self._index, sender, parts))
        return packet
