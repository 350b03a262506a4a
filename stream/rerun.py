"""A raw recording through the recognisers again: the same packets at the same times give the same answers."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from kinespace.stream.feeds import builtin_preset
from kinespace.stream.feeds.preset import parse_preset
from kinespace.stream.feeds.source import FeedSource
from kinespace.stream.frame import Announcement, Frame
from kinespace.stream.onepart import ZmqPackets
from kinespace.stream.service import OscSource, TendedSource, ZmqSource

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from kinespace.stream.feeds import Preset
    from kinespace.stream.rawfile import RawHeader, RawPacket
    from kinespace.stream.recognition import Recognition
    from kinespace.stream.recognizer import Performers

#: Seconds of recorded time between two looks for performers who fell silent, as the service looks.
_SILENCE_EVERY = 1.0
#: Seconds after the last packet at which frames that are still open are closed: longer than any waits for a joint.
_AFTERWARDS = 1.0


class Decoded(NamedTuple):
    """What one packet of a recording held: when it came, and frames and announcements in order."""

    arrival: float
    events: Sequence[Frame | Announcement]


def decoded(header: RawHeader, packets: Iterable[RawPacket], preset: Preset | None = None) -> Iterator[Decoded]:
    """Decode packets as the live sources do, by those sources; what they count as malformed or foreign holds nothing.

    After the last packet comes what was still open then, if anything was.

    Parameters
    ----------
    header, packets
        Of a raw recording.
    preset
        Another product's feed that the packets are read as; None for what the header says of each source, by the
        preset that it keeps or, in an older recording, the built-in one of that name.

    Raises
    ------
    ValueError
        An older recording's header names a feed that is not built in: it was somebody's own preset, which must be
        given. Or the preset that it keeps is one that this version cannot read.
    """
    plays = [_Played() for _ in header.sources]
    sources = [_source(header, told, played, preset) for told, played in zip(header.sources, plays, strict=True)]
    ended = 0.0
    for packet in packets:
        ended = packet.arrival + _AFTERWARDS
        source = sources[packet.source]
        early = source.tend(packet.arrival) if isinstance(source, TendedSource) else ()
        plays[packet.source].play(packet)
        yield Decoded(packet.arrival, (*early, *(source.take(packet.arrival) or ())))
    if late := [event for source in sources if isinstance(source, TendedSource) for event in source.tend(ended)]:
        yield Decoded(ended, late)


def _source(header: RawHeader, told: str, played: _Played, preset: Preset | None) -> OscSource | ZmqSource | FeedSource:
    """Make the source that a header tells of: `osc` or `zmq`, an address, and perhaps `feed` and a preset's name."""
    kind, _, rest = told.partition(" ")
    name = rest.partition(" feed ")[2]
    meant = preset or (preset_kept(header, name) if name else None)
    if kind == "osc":
        packets = _PlayedPackets(played)
        return FeedSource(packets, meant) if meant else OscSource(packets)
    messages = _PlayedMessages(played)
    return FeedSource(ZmqPackets(messages), meant) if meant else ZmqSource(messages)


def preset_kept(header: RawHeader, name: str) -> Preset:
    """Give the preset that a recording's packets were read by; the built-in one where the recording keeps none.

    Raises
    ------
    PresetError
        It keeps none and none of that name is built in, or what it keeps cannot be read.
    """
    if name in header.presets:
        return parse_preset(header.presets[name], name, f"preset {name} in the recording")
    return builtin_preset(name)


class _Played:
    """The packet that is played: taken once, and gone."""

    def __init__(self) -> None:
        self.sender: tuple[str, int] | None = None
        self._parts: list[bytes] | None = None

    def play(self, packet: RawPacket) -> None:
        """Let a packet come."""
        host, _, port = packet.sender.rpartition(":")
        self.sender = (host, int(port)) if port.isdigit() else None
        self._parts = list(packet.parts)

    def take(self) -> list[bytes] | None:
        """Take its parts; None when it was taken."""
        parts, self._parts = self._parts, None
        return parts


class _PlayedPackets:
    """A UDP port's place, in which the packet that is played comes."""

    kernel_drops = 0
    address = ("", 0)
    socket = None

    def __init__(self, played: _Played) -> None:
        self._played = played

    @property
    def sender(self) -> tuple[str, int] | None:
        return self._played.sender

    def receive(self) -> bytes | None:
        parts = self._played.take()
        return b"".join(parts) if parts else None

    def broken(self) -> int:
        return 0

    def send_to(self, datagram: bytes, target: tuple[str, int]) -> bool:  # noqa: ARG002 - as a UDP port has it
        return True

    def close(self) -> None: ...


class _PlayedMessages:
    """A subscription's place, in which the message that is played comes."""

    address = ""
    socket = None

    def __init__(self, played: _Played) -> None:
        self._played = played

    def broken(self) -> int:
        return 0

    def receive(self) -> list[bytes] | None:
        return self._played.take()

    def close(self) -> None: ...


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
