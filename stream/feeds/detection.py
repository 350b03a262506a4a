"""What arrives on a port, whatever it is: kinds of messages, rates, senders, gaps; which preset it looks like."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from kinespace.library.motion_library import MIN_JOINTS
from kinespace.library.naming import Naming
from kinespace.stream.feeds.decoder import FeedDecoder
from kinespace.stream.feeds.frame_assembler import FrameAssembler
from kinespace.stream.feeds.message_reader import Mapper, MessageError
from kinespace.stream.feeds.preset import Means
from kinespace.stream.feeds.unpackers import UNPACKERS
from kinespace.stream.frame import Frame
from kinespace.stream.inputs.decoder import OscDecoder
from kinespace.stream.inputs.refusals import Refusals
from kinespace.stream.osc.frames import SKELETON, decode
from kinespace.stream.osc.packet import PacketError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.stream.feeds.preset import Preset
    from kinespace.stream.feeds.unpackers import Unpacker
    from kinespace.stream.inputs.receiver import Sender
    from kinespace.stream.osc.packet import Message

#: Kinds of messages told apart; only somebody who makes up addresses gets there.
MOST_KINDS = 200
_MOST_SENDERS = 50
#: Messages and packets kept to be looked at as each preset's.
_MOST_KEPT = 20_000
#: The preset of our own messages, and their addresses.
NATIVE, OURS = "native", ("/motion/frame", SKELETON)
#: Ways to pack that tell by themselves whether a packet is of theirs.
_PACKINGS = ("osc", "rokoko", "zigsim", "xsens")
#: Joints a message must bring, relative to those a preset has, to say that this is it.
_LIKELY = 0.25
_NUMBERED = re.compile(r"\d+")
_TAGS = {float: "f", int: "i", str: "s", bytes: "b", bool: "T", type(None): "N", list: "[", tuple: "m"}


@dataclass(slots=True)
class Kind:
    """Messages of one address, numbers in it aside, and one list of types."""

    address: str
    types: str
    count: int = 0
    example: tuple[object, ...] = ()
    first: float = 0.0
    last: float = 0.0
    #: Longest time between two of them, seconds.
    longest_gap: float = 0.0

    @property
    def rate(self) -> float:
        """Messages a second."""
        return (self.count - 1) / (self.last - self.first) if self.last > self.first else 0.0


class Guess(NamedTuple):
    """How well a preset explains what came.

    Attributes
    ----------
    preset
        The preset.
    understood
        Share of the messages that it understands.
    joints
        Joints that came, by the motion library's names.
    missing
        Joints of the preset that did not.
    frames
        Frames that were made of what came.
    rate
        Frames a second of one performer.
    performers
        Who was there.
    """

    preset: Preset
    understood: float
    joints: tuple[str, ...]
    missing: tuple[str, ...]
    frames: int
    rate: float
    performers: tuple[str, ...]
    unknown: tuple[str, ...]
    refused: int


@dataclass(slots=True)
class Survey:
    """Collects what arrives.

    Attributes
    ----------
    packets, undecodable, bundles
        Datagrams; those that are no OSC; those that were bundles.
    largest
        Bytes of the largest datagram.
    senders
        Datagrams by host and port they came from.
    kinds
        Messages by address and types.
    announced
        The joint names that a sender of our own messages said last.
    """

    packets: int = 0
    undecodable: int = 0
    bundles: int = 0
    largest: int = 0
    senders: dict[str, int] = field(default_factory=dict)
    kinds: dict[tuple[str, str], Kind] = field(default_factory=dict)
    announced: tuple[str, ...] = ()
    _kept: list[tuple[bytes, float, Sender]] = field(default_factory=list)
    _refusals: Refusals = field(default_factory=Refusals)
    #: What was kept as each packing reads it; with how much there was then.
    _read: dict[str, tuple[int, list[tuple[list[Message], float, bool]]]] = field(default_factory=dict)

    def see(self, datagram: bytes, sender: str, arrival: float) -> None:
        """Take in one datagram, from `host:port`, at a moment in seconds."""
        self.packets += 1
        self.largest = max(self.largest, len(datagram))
        if sender in self.senders or len(self.senders) < _MOST_SENDERS:
            self.senders[sender] = self.senders.get(sender, 0) + 1
        read = (_unpacked(UNPACKERS[packing](), datagram) for packing in _PACKINGS)
        messages = next((each for each in read if each is not None), None)
        if messages is None:
            self.undecodable += 1
            why = "neither a message nor a bundle"
            self._refusals.note("packet that is no OSC", why, _host_and_port(sender), datagram)
            return
        self.bundles += datagram[:1] == b"#"
        for message in messages:
            self._count(message, arrival)
            if message.address == SKELETON and all(isinstance(each, str) for each in message.arguments):
                self.announced = tuple(map(str, message.arguments[1:]))
        if len(self._kept) < _MOST_KEPT:
            self._kept.append((datagram, arrival, _host_and_port(sender)))

    def _count(self, message: Message, arrival: float) -> None:
        types = shortened("".join(_TAGS.get(type(argument), "?") for argument in message.arguments))
        key = (_NUMBERED.sub("#", message.address), types)
        kind = self.kinds.get(key)
        if kind is None:
            if len(self.kinds) >= MOST_KINDS:
                return
            kind = self.kinds[key] = Kind(*key, first=arrival, example=tuple(message.arguments[:6]))
        elif kind.count:
            kind.longest_gap = max(kind.longest_gap, arrival - kind.last)
        kind.count += 1
        kind.last = arrival

    def looked_at_as(self, preset: Preset) -> Guess:
        """Say what a preset makes of everything that came."""
        if preset.name == NATIVE and self.announced:
            return self._as_our_own(preset)
        mapper, assembler = Mapper(preset), FrameAssembler(preset)
        understood = total = 0
        joints = dict[str, None]()
        times: dict[str, list[float]] = {}
        for messages, arrival, bundle in self._unpacked_as(preset.packing):
            for message in messages:
                total += 1
                joints_here = _joints_in(mapper, message)
                if joints_here is not None:
                    understood += 1
                    joints |= dict.fromkeys(joints_here)
            for made in assembler.push(messages, arrival, bundle=bundle):
                if isinstance(made, Frame):
                    times.setdefault(made.performer, []).append(arrival)
        came = {preset.joint_map[name] for name in joints} - {""}
        if preset.bones and came:
            # A bone that does not come stays as it is at rest.
            came = set(preset.joints)
        longest = max(times.values(), key=len, default=[])
        span = longest[-1] - longest[0] if longest else 0.0
        return Guess(
            preset=preset,
            understood=understood / total if total else 0.0,
            joints=tuple(joint for joint in preset.joints if joint in came),
            missing=tuple(joint for joint in preset.joints if joint not in came),
            frames=assembler.counts.frames,
            rate=(len(longest) - 1) / span if span > 0 else 0.0,
            performers=tuple(times),
            unknown=tuple(sorted(mapper.unknown)),
            refused=assembler.counts.incomplete,
        )

    def _as_our_own(self, preset: Preset) -> Guess:
        """Read our own messages, whose senders name their joints, as the recogniser does: by our names for them."""
        named = set(Naming().read(self.announced).joints)
        frames, times = 0, dict[str, list[float]]()
        for datagram, arrival, _ in self._kept:
            for event in decode(datagram, arrival).events:
                if isinstance(event, Frame) and len(event.positions) == len(self.announced):
                    times.setdefault(event.performer, []).append(arrival)
                frames += isinstance(event, Frame)
        whole, joints = sum(map(len, times.values())), tuple(each for each in preset.joints if each in named)
        longest = max(times.values(), key=len, default=[])
        span = longest[-1] - longest[0] if longest else 0.0
        ours = sum(kind.count for kind in self.kinds.values() if kind.address in OURS)
        return Guess(
            preset=preset,
            understood=ours / max(sum(kind.count for kind in self.kinds.values()), 1),
            joints=joints,
            missing=tuple(each for each in preset.joints if each not in named),
            frames=whole if len(joints) >= MIN_JOINTS else 0,
            rate=(len(longest) - 1) / span if span > 0 else 0.0,
            performers=tuple(times),
            unknown=(),
            refused=frames - whole,
        )

    def reasons(self, preset: Preset | None) -> list[str]:
        """Say why packets were refused last, a line for each kind, as a recogniser says it that reads this preset."""
        decoder = FeedDecoder(preset) if preset and preset.name != NATIVE else OscDecoder()
        for datagram, arrival, sender in self._kept:
            decoder.decode(datagram, arrival, sender)
        return [*self._refusals.lines(), *decoder.refusals.lines()]

    def _unpacked_as(self, packing: str) -> list[tuple[list[Message], float, bool]]:
        """Give what was kept as messages, by one way to pack; packets of other ways hold none."""
        if packing not in self._read or self._read[packing][0] != len(self._kept):
            unpack = UNPACKERS[packing]()
            read = [
                (_unpacked(unpack, datagram) or [], arrival, packing != "osc" or datagram[:1] == b"#")
                for datagram, arrival, _ in self._kept
            ]
            self._read[packing] = len(self._kept), read
        return self._read[packing][1]

    def guess(self, presets: Sequence[Preset]) -> Guess | None:
        """Give the preset that explains most of what came, None when none explains anything.

        Frames made count first, then joints found, then messages understood.
        """
        guesses = [self.looked_at_as(preset) for preset in presets]
        likely = [each for each in guesses if len(each.joints) >= _LIKELY * len(each.preset.joints)]
        return max(likely, key=_likelihood, default=None)


def _host_and_port(sender: str) -> Sender:
    host, _, port = sender.rpartition(":")
    return (host, int(port)) if port.isdigit() else None


def _unpacked(unpack: Unpacker, datagram: bytes) -> list[Message] | None:
    """Give a packet's messages, None where it is packed otherwise."""
    try:
        return unpack(datagram)
    except PacketError:
        return None


def _likelihood(guess: Guess) -> tuple[bool, float, int]:
    share = len(guess.joints) / len(guess.preset.joints)
    return guess.frames > 0, guess.understood * share, len(guess.joints)


def _joints_in(mapper: Mapper, message: Message) -> list[str] | None:
    """Name the joints a message holds; None when the preset does not understand it."""
    try:
        reading = mapper.read(message)
    except MessageError:
        return None
    if reading is None:
        return None
    if reading.means in (Means.JOINT, Means.FRAME) and reading.present and not reading.sightings:
        return None
    return [sighting.joint for sighting in reading.sightings if sighting.position is not None]


def shortened(types: str) -> str:
    """Write runs of one type as a count, like `if*93`."""
    return re.sub(r"(.)\1{3,}", lambda run: f"{run[1]}*{len(run[0])}", types)
