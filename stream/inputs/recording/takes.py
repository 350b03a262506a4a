"""Raw recordings read as takes: the frames of each performer, decoded as the live sources decode them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from kinespace.library.naming import hdm05
from kinespace.library.recordings.formats.errors import RecordingError
from kinespace.library.recordings.formats.timed_frames import evened
from kinespace.library.skeleton import Skeleton, SkeletonMismatchError
from kinespace.stream.frame import Announcement
from kinespace.stream.inputs.clock import SenderClock
from kinespace.stream.inputs.recording.kinerec import RawFile
from kinespace.stream.inputs.recording.playback import decoded

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from kinespace.library import Clip
    from kinespace.stream.feeds import Preset
    from kinespace.stream.frame import Frame

#: Seconds by which a sender's clock may differ from the recorder's before the sender is taken to have begun anew.
_ASTRAY = 1.0


@dataclass(slots=True)
class Seen:
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
    sizes: dict[int, int] = field(default_factory=dict)
    clock: SenderClock = field(default_factory=SenderClock)

    def times(self) -> SenderClock:
        """Give a reader that converts the times from the recording's beginning on, now that their unit is known."""
        return SenderClock(self.clock.verdict)

    def skeleton(self) -> Skeleton:
        """Name the joints as announced; else as HDM05's when there are as many; else by number."""
        if self.joints:
            return Skeleton(self.joints)
        size = max(self.sizes, key=lambda size: self.sizes[size])
        if size == len(hdm05.SKELETON.joints):
            return hdm05.SKELETON
        return Skeleton(tuple(f"joint{number}" for number in range(1, size + 1)))


def events_of(recording: RawFile, preset: Preset | None) -> Iterator[tuple[float, Frame | Announcement]]:
    """Give frames and announcements of a recording, in order, each with its arrival in seconds."""
    for each in decoded(recording.header, recording.packets(), preset):
        for event in each.events:
            yield each.arrival, event


def seen_in(events: Iterator[tuple[float, Frame | Announcement]]) -> dict[str, Seen]:
    """List the performers of a recording."""
    seen: dict[str, Seen] = {}
    for arrival, event in events:
        each = seen.setdefault(event.performer, Seen())
        if isinstance(event, Announcement):
            each.joints = each.joints or event.joints
        else:
            each.frames += 1
            each.clock.read(event.time, arrival)
            each.sizes[len(event.positions)] = each.sizes.get(len(event.positions), 0) + 1
    return seen


def ordered_frames(
    recording: RawFile, preset: Preset | None, seen: Mapping[str, Seen]
) -> Iterator[tuple[str, float, float, NDArray[np.floating]]]:
    """Give the frames of some performers, in each performer's order of joints; frames of other joints are left out.

    Yields
    ------
    The performer, the frame's arrival and its time, both in seconds, and positions (joints, 3), metres.
    """
    skeletons = {name: each.skeleton() for name, each in seen.items()}
    clocks = {name: each.times() for name, each in seen.items()}
    orders: dict[str, NDArray[np.intp] | None] = {name: np.arange(len(each.joints)) for name, each in skeletons.items()}
    sizes = {name: len(each.joints) for name, each in skeletons.items()}
    for arrival, event in events_of(recording, preset):
        name = event.performer
        if name not in seen:
            continue
        if isinstance(event, Announcement):
            sizes[name] = len(event.joints)
            try:
                orders[name] = skeletons[name].order_from(event.joints)
            except SkeletonMismatchError:
                orders[name] = None
            continue
        seconds, order = clocks[name].read(event.time, arrival), orders[name]
        if order is not None and len(event.positions) == sizes[name]:
            yield name, arrival, seconds, event.positions[order]


def read_raw(path: Path, preset: Preset | None = None) -> list[Clip]:
    """Read a raw recording: a clip for each performer, by name, each from the recording's first packet on.

    Frames have the sender's times, shifted to the recorder's clock; a sender that began anew is shifted anew.

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
    seen = {name: each for name, each in seen_in(events_of(recording, preset)).items() if each.frames > 1}
    kept = _frames(recording, preset, seen)
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


def _frames(
    recording: RawFile, preset: Preset | None, seen: Mapping[str, Seen]
) -> dict[str, tuple[list[float], list[NDArray[np.float64]]]]:
    """Give each performer's frames, at seconds since the first packet."""
    kept: dict[str, tuple[list[float], list[NDArray[np.float64]]]] = {name: ([], []) for name in seen}
    ahead = dict.fromkeys(seen, 0.0)
    began = next(iter(recording.packets())).arrival
    for name, arrived, seconds, positions in ordered_frames(recording, preset, seen):
        if not np.isfinite(positions).all():
            continue
        times, rows = kept[name]
        time, arrival = seconds + ahead[name], arrived - began
        if abs(time - arrival) > _ASTRAY:
            ahead[name] = arrival - seconds
            time = arrival
        if not times or time > times[-1]:
            times.append(time)
            rows.append(np.asarray(positions, dtype=np.float64))
    return kept
