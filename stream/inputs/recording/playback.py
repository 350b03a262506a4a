"""A raw recording decoded again: the same packets at the same times are the same frames."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from kinespace.stream.feeds.decoder import FeedDecoder
from kinespace.stream.feeds.preset import builtin_preset, parse_preset
from kinespace.stream.inputs.decoder import OscDecoder, ZmqDecoder

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from kinespace.stream.feeds import Preset
    from kinespace.stream.frame import Input
    from kinespace.stream.inputs.decoder import Decoder
    from kinespace.stream.inputs.recording.kinerec import RawHeader, RawPacket
    from kinespace.stream.packet import Sender

#: Seconds after the last packet at which frames that are still open are closed: longer than any frame waits.
_AFTERWARDS = 1.0


class Decoded(NamedTuple):
    """The content of one packet of a recording: when it came, and frames and announcements in order."""

    arrival: float
    events: Sequence[Input]


def decoded(header: RawHeader, packets: Iterable[RawPacket], preset: Preset | None = None) -> Iterator[Decoded]:
    """Decode packets by the decoders of the live sources; malformed and foreign packets give nothing.

    Frames that are still open after the last packet come last.

    Parameters
    ----------
    header, packets
        Header and packets of a raw recording.
    preset
        Another product's feed to read the packets as; None for the feed that the header names for each source, by the
        preset that the recording keeps or, in an older recording, the built-in preset of that name.

    Raises
    ------
    ValueError
        An older recording's header names a feed that is not built in: it was a user's own preset, which must be given.
        Or this version cannot read the preset that the recording keeps.
    """
    decoders = [_decoder(header, told, preset) for told in header.sources]
    ended = 0.0
    for packet in packets:
        ended = packet.arrival + _AFTERWARDS
        decoder = decoders[packet.source]
        early = decoder.expire(packet.arrival)
        held = decoder.decode(list(packet.parts), packet.arrival, _sender(packet))
        yield Decoded(packet.arrival, (*early, *held))
    if late := [event for decoder in decoders for event in decoder.expire(ended)]:
        yield Decoded(ended, late)


def _decoder(header: RawHeader, told: str, preset: Preset | None) -> Decoder:
    """Make the decoder of a source that a header names: `osc` or `zmq`, an address, perhaps `feed` and a preset."""
    kind, _, rest = told.partition(" ")
    name = rest.partition(" feed ")[2]
    meant = preset or (preset_kept(header, name) if name else None)
    if meant:
        return FeedDecoder(meant)
    return OscDecoder() if kind == "osc" else ZmqDecoder()


def _sender(packet: RawPacket) -> Sender:
    host, _, port = packet.sender.rpartition(":")
    return (host, int(port)) if port.isascii() and port.isdigit() else None


def preset_kept(header: RawHeader, name: str) -> Preset:
    """Give the preset by which a recording's packets were read; the built-in one where the recording keeps none.

    Raises
    ------
    PresetError
        The recording keeps none and none of that name is built in, or the preset that it keeps cannot be read.
    """
    if name in header.presets:
        return parse_preset(header.presets[name], name, f"preset {name} in the recording")
    return builtin_preset(name)
