"""Raw recordings decoded again, as the live sources decode them, and read as takes of each performer."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kinespace.library import Clip, Skeleton
from kinespace.library.naming import hdm05
from kinespace.library.recordings.formats.errors import RecordingError
from kinespace.library.recordings.formats.joint_choice import few
from kinespace.library.recordings.formats.measures import evened
from kinespace.stream.feeds import Preset, builtin_preset, parse_preset
from kinespace.stream.frame import Announcement, Frame, Input
from kinespace.stream.inputs.clock import SenderClock
from kinespace.stream.inputs.decoder import Decoder, FeedDecoder, OwnDecoder
from kinespace.stream.inputs.kinerec import RawFile, RawHeader, RawPacket
from kinespace.stream.packet import Sender

#: Seconds after the last packet at which frames that are still open are closed: longer than any frame waits.
_AFTERWARDS = 1.0
#: Seconds by which a sender's clock may differ from the recorder's before the sender is taken to have begun again.
_ASTRAY = 1.0


def decoded(
    header: RawHeader, packets: Iterable[RawPacket], preset: Preset | None = None
) -> Iterator[tuple[float, Input]]:
    """Give frames and announcements of packets, by the decoders of the live sources, each with its arrival in seconds.

    Malformed and foreign packets give nothing. Frames that are still open after the last packet come last.

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
    decoders = [_decoder(header, source, preset) for source in header.sources]
    is_osc = [source.startswith("osc ") for source in header.sources]
    ended = 0.0
    for packet in packets:
        ended = packet.arrival + _AFTERWARDS
        decoder = decoders[packet.source]
        early = decoder.expire(packet.arrival)
        whole = b"".join(packet.parts) if is_osc[packet.source] else list(packet.parts)
        held = decoder.decode(whole, packet.arrival, _sender(packet))
        yield from ((packet.arrival, event) for event in (*early, *held))
    yield from ((ended, event) for decoder in decoders for event in decoder.expire(ended))


def _decoder(header: RawHeader, source: str, preset: Preset | None) -> Decoder:
    """Make the decoder of a source that a header names: `osc` or `zmq`, an address, perhaps `feed` and a preset."""
    name = source.partition(" feed ")[2]
    if preset is None and name in header.presets:
        preset = parse_preset(header.presets[name], name, f"preset {name} in the recording")
    elif preset is None and name:
        preset = builtin_preset(name)
    return FeedDecoder(preset) if preset else OwnDecoder()


def _sender(packet: RawPacket) -> Sender:
    host, _, port = packet.sender.rpartition(":")
    return (host, int(port)) if port.isascii() and port.isdigit() else None


@dataclass(slots=True)
class SeenJoints:
    """A first look at one performer in a recording.

    Attributes
    ----------
    frames
        The number of frames.
    joints
        The joints as first announced; empty when they never were.
    sizes
        The number of frames for each number of joints.
    clock
        Reads the times of the frames.
    """

    frames: int = 0
    joints: tuple[str, ...] = ()
    sizes: Counter[int] = field(default_factory=Counter)
    clock: SenderClock = field(default_factory=SenderClock)

    def skeleton(self) -> Skeleton:
        """Name the joints as announced; else as HDM05's when there are as many; else by number."""
        if self.joints:
            return Skeleton(few(self.joints))
        ((size, _),) = self.sizes.most_common(1)
        if size == len(hdm05.SKELETON.joints):
            return hdm05.SKELETON
        return Skeleton(few([f"joint{number}" for number in range(1, size + 1)]))


def seen_in(events: Iterator[tuple[float, Frame | Announcement]]) -> dict[str, SeenJoints]:
    """List the performers of a recording."""
    seen: dict[str, SeenJoints] = {}
    for arrival, event in events:
        each = seen.setdefault(event.performer, SeenJoints())
        if isinstance(event, Announcement):
            each.joints = each.joints or event.joints
        else:
            each.frames += 1
            each.clock.read(event.time, arrival)
            each.sizes[len(event.positions)] += 1
    return seen


def ordered_frames(
    recording: RawFile, preset: Preset | None, seen: Mapping[str, SeenJoints]
) -> Iterator[tuple[str, float, float, NDArray[np.floating]]]:
    """Give the frames of some performers, in each performer's order of joints; frames of other joints are left out.

    Yields
    ------
    The performer, the frame's arrival and its time, both in seconds, and positions (joints, 3), metres.
    """
    skeletons = {name: each.skeleton() for name, each in seen.items()}
    # Their unit is known now: times are converted from the recording's beginning on.
    clocks = {name: SenderClock(each.clock.verdict) for name, each in seen.items()}
    #: The number of joints that a performer's frames have now, and their order; None where some are missing.
    orders: dict[str, tuple[int, NDArray[np.intp] | None]] = {}
    for name, each in skeletons.items():
        orders[name] = len(each.joints), np.arange(len(each.joints))
    for arrival, event in decoded(recording.header, recording.packets(), preset):
        name = event.performer
        if name not in seen:
            continue
        if isinstance(event, Announcement):
            whole = {*event.joints}.issuperset(skeletons[name].joints)
            orders[name] = len(event.joints), skeletons[name].order_from(event.joints) if whole else None
            continue
        seconds, (size, order) = clocks[name].read(event.time, arrival), orders[name]
        if order is not None and len(event.positions) == size:
            yield name, arrival, seconds, event.positions[order]


def read_raw(path: Path, preset: Preset | None = None) -> list[Clip]:
    """Read a raw recording: a clip for each performer, by name, each from the recording's first packet on.

    Frames have the sender's times, shifted to the recorder's clock, and again when the sender began again.

    Parameters
    ----------
    path
        The recording.
    preset
        Another product's feed to read it as; None for the feed that the recording names.

    Raises
    ------
    RecordingError
        No performer has two frames of the same joints.
    ValueError
        The file is no raw recording, or names an unknown feed.
    OSError
        The file cannot be opened.
    """
    recording = RawFile(path)
    every = seen_in(decoded(recording.header, recording.packets(), preset))
    seen = {name: each for name, each in every.items() if each.frames > 1}
    kept: dict[str, tuple[list[float], list[NDArray[np.float64]]]] = {name: ([], []) for name in seen}
    ahead = dict.fromkeys(seen, 0.0)
    began = next(iter(recording.packets())).arrival if seen else 0.0
    for name, arrived, seconds, positions in ordered_frames(recording, preset, seen):
        times, rows = kept[name]
        time, arrival = seconds + ahead[name], arrived - began
        if not np.isfinite(positions).all():
            continue
        if abs(time - arrival) > _ASTRAY:
            ahead[name], time = arrival - seconds, arrival
        if not times or time > times[-1]:
            times.append(time)
            rows.append(np.asarray(positions, dtype=np.float64))
    clips = [
        replace(
            evened(np.array(times), np.array(positions), begin=0.0).clip(seen[name].skeleton()),
            name=path.stem if len(seen) == 1 else f"{path.stem} {name}",
            actor=name,
        )
        for name, (times, positions) in sorted(kept.items())
        if len(set(times)) > 1
    ]
    if not clips:
        raise RecordingError(f"{path}: expected a performer with at least 2 frames, got none")
    return clips
