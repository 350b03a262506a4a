"""A raw recording through the recognisers again: the same packets at the same times give the same answers."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from stream import osc, zeromq
from stream.frame import Announcement, Frame

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from stream.performers import Performers
    from stream.rawfile import RawHeader, RawPacket
    from stream.recognition import Recognition

#: Seconds of recorded time between two looks for performers who fell silent, as the service looks.
_SILENCE_EVERY = 1.0


class Decoded(NamedTuple):
    """What one packet of a recording held: when it came, and frames and announcements in order."""

    arrival: float
    events: Sequence[Frame | Announcement]


def decoded(header: RawHeader, packets: Iterable[RawPacket]) -> Iterator[Decoded]:
    """Decode packets as the live sources do; what they would count as malformed or foreign holds nothing."""
    kinds = [source.partition(" ")[0] for source in header.sources]
    for packet in packets:
        if kinds[packet.source] == "osc":
            yield Decoded(packet.arrival, osc.decode(b"".join(packet.parts), packet.arrival).events)
            continue
        try:
            numbered = zeromq.decode(packet.parts, packet.arrival)
        except zeromq.FormatError:
            yield Decoded(packet.arrival, ())
        else:
            announced = (numbered.announcement,) if numbered.announcement else ()
            yield Decoded(packet.arrival, (*announced, numbered.frame))


def recognitions(performers: Performers, stream: Iterable[Decoded]) -> Iterator[Recognition]:
    """Push what was recorded through recognisers, with its own times; give every answer."""
    look = -float("inf")
    for arrival, events in stream:
        if arrival >= look:
            look = arrival + _SILENCE_EVERY
            performers.drop_silent(arrival)
        for event in events:
            if isinstance(event, Announcement):
                performers.announce(event, arrival)
            elif (recognition := performers.push(event, arrival)) is not None:
                yield recognition
