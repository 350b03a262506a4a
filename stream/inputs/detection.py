"""Detection: kinds of messages on a port, rates, senders, gaps, and the preset that fits best."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinespace.library import Clip, Skeleton
from kinespace.library.motion_library import MIN_JOINTS
from kinespace.library.naming import Naming, hdm05
from kinespace.library.recordings.formats.joint_choice import MAX_JOINTS
from kinespace.library.recordings.remarks import remarks
from kinespace.stream.feeds.preset import Preset
from kinespace.stream.feeds.unpackers import UNPACKERS, Unpacker
from kinespace.stream.frame import Announcement, Input
from kinespace.stream.inputs.clock import SenderClock
from kinespace.stream.inputs.decoder import Decoder, FeedDecoder, OwnDecoder
from kinespace.stream.osc.messages import SKELETON
from kinespace.stream.osc.packet import Message, PacketError
from kinespace.stream.packet import Packet, Sender, datagram_of, sender_name

#: Kinds of messages that are counted, at most; only a sender that makes up addresses reaches the limit.
MAX_KINDS = 200
_MAX_SENDERS = 50
#: Messages and packets that are kept for reading by each preset, at most.
_MAX_KEPT = 20_000
#: The preset of our own messages.
NATIVE = "native"
#: The addresses of our own messages.
OURS = ("/motion/frame", SKELETON)
#: Packings whose packets can be recognised.
_PACKINGS = ("osc", "rokoko", "zigsim", "xsens")
#: Share of a preset's joints that must come for the preset to fit.
_LIKELY = 0.25
_NUMBERED = re.compile(r"\d+")
_TAGS = {float: "f", int: "i", str: "s", bytes: "b", bool: "T", type(None): "N"}


@dataclass(slots=True)
class MessageKind:
    """Messages of one address, apart from numbers in it, and of one list of types."""

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


@dataclass(slots=True)
class Trace:
    """What came of one performer: its joints by our names, and what its frames show."""

    joints: tuple[str, ...] = hdm05.SKELETON.joints
    came: set[str] = field(default_factory=set)
    #: The arrivals of frames with all of these joints, and how many frames had another number of them.
    times: list[float] = field(default_factory=list)
    refused: int = 0
    clock: SenderClock = field(default_factory=SenderClock)
    #: The positions of the frames of which no joint is lost.
    positions: list[NDArray[np.floating]] = field(default_factory=list)

    def take(self, event: Input, arrival: float) -> None:
        """Take in a frame, or the names of its joints."""
        if isinstance(event, Announcement):
            self.joints = Naming().read(event.joints).joints
            self.came.update(self.joints)
            self.positions.clear()
            return
        self.clock.read(event.time, arrival)
        self.came.update(self.joints[: len(event.positions)])
        if len(self.joints) != len(event.positions):
            self.refused += 1
            return
        self.times.append(arrival)
        if np.isfinite(event.positions).all():
            self.positions.append(event.positions)

    @property
    def rate(self) -> float:
        """Frames a second; 0 for less than two moments."""
        span = self.times[-1] - self.times[0] if self.times else 0.0
        return (len(self.times) - 1) / span if span > 0 else 0.0

    def remarks(self) -> list[str]:
        """Say how times are read that are not seconds, and what is odd about the body, as of a recording's."""
        times = [self.clock.verdict.note] if self.clock.verdict.note else []
        # A stranger may announce any joints.
        is_body = MIN_JOINTS <= len({*self.joints}) == len(self.joints) <= MAX_JOINTS
        if not (is_body and self.rate and self.positions):
            return times
        return [*times, *remarks(Clip(Skeleton(self.joints), np.array(self.positions), self.rate))]


class Guess(NamedTuple):
    """How well a preset explains the messages.

    Attributes
    ----------
    preset
        The preset.
    understood
        Share of the messages that the preset can read.
    joints
        Joints that came, by the motion library's names.
    frames, refused
        Frames made of the messages, and frames that lack too many joints.
    heard
        What came of each performer.
    unknown
        Joints that came and that the preset does not name.
    at_rest
        Bones that never came, and stay as they are in the standard skeleton.
    refusals
        The last packets that could not be read, with the reason, a line each.
    """

    preset: Preset
    understood: float
    joints: tuple[str, ...]
    frames: int
    refused: int
    heard: Mapping[str, Trace]
    unknown: tuple[str, ...] = ()
    at_rest: tuple[str, ...] = ()
    refusals: tuple[str, ...] = ()

    @property
    def missing(self) -> tuple[str, ...]:
        """Joints of the preset that did not come; none where a sender may send some."""
        absent = (joint for joint in self.preset.sent if joint not in self.joints)
        return () if self.preset.closings.some else tuple(absent)

    @property
    def performers(self) -> list[str]:
        """The performers of whom frames came."""
        return [name for name, each in self.heard.items() if each.times]

    @property
    def rate(self) -> float:
        """Frames a second of the performer with the most frames; 0 for none."""
        return max(self.heard.values(), key=lambda each: len(each.times), default=Trace()).rate


@dataclass(slots=True)
class Survey:
    """Collects packets.

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
        The joint names of the last announcement in our own messages.
    """

    packets: int = 0
    undecodable: int = 0
    bundles: int = 0
    largest: int = 0
    senders: dict[str, int] = field(default_factory=dict)
    kinds: dict[tuple[str, str], MessageKind] = field(default_factory=dict)
    announced: tuple[str, ...] = ()
    _kept: list[tuple[bytes, float, Sender]] = field(default_factory=list)

    #: There is nothing to say of it as a recorder.
    note = ""

    def keep(self, packet: Packet, arrival: float, sender: Sender) -> None:
        """Take in a packet as a source's recorder, at a moment in seconds."""
        datagram, name = datagram_of(packet), sender_name(sender)
        self.packets += 1
        self.largest = max(self.largest, len(datagram))
        if name in self.senders or len(self.senders) < _MAX_SENDERS:
            self.senders[name] = self.senders.get(name, 0) + 1
        if len(self._kept) < _MAX_KEPT:
            self._kept.append((datagram, arrival, sender))
        read = (_unpacked(UNPACKERS[packing](), datagram) for packing in _PACKINGS)
        messages = next((each for each in read if each is not None), None)
        if messages is None:
            self.undecodable += 1
            return
        self.bundles += datagram[:1] == b"#"
        for message in messages:
            self._count(message, arrival)
            if message.address == SKELETON and all(isinstance(each, str) for each in message.arguments):
                self.announced = tuple(map(str, message.arguments[1:]))

    def _count(self, message: Message, arrival: float) -> None:
        types = shortened("".join(_TAGS.get(type(argument), "?") for argument in message.arguments))
        key = (_NUMBERED.sub("#", message.address), types)
        kind = self.kinds.get(key)
        if kind is None:
            if len(self.kinds) >= MAX_KINDS:
                return
            kind = self.kinds[key] = MessageKind(*key, first=arrival, example=tuple(message.arguments[:6]))
        elif kind.count:
            kind.longest_gap = max(kind.longest_gap, arrival - kind.last)
        kind.count += 1
        kind.last = arrival

    def looked_at_as(self, preset: Preset) -> Guess:
        """Read all packets by a preset, as a recogniser reads them, and say how well it fits."""
        decoder: Decoder = OwnDecoder() if preset.name == NATIVE else FeedDecoder(preset)
        heard, events = dict[str, Trace](), 0
        for datagram, arrival, sender in self._kept:
            for event in decoder.decode(datagram, arrival, sender):
                heard.setdefault(event.performer, Trace()).take(event, arrival)
                events += 1
        came, counts = set[str]().union(*(each.came for each in heard.values())), decoder.counts
        unknown, at_rest, understood = list[str](), list[str](), events
        if isinstance(decoder, FeedDecoder):
            understood, mapper = decoder.counts.understood, decoder.assembler.mapper
            named = preset.named([*mapper.known])
            came = {*named.values()} - {"", *decoder.assembler.never_seen}
            unknown = sorted(mapper.unknown or (set(mapper.known) - set(named) if preset.closings.some else ()))
            if preset.bones and came:
                # A bone that does not come stays at rest.
                at_rest, came = [name for name in preset.joint_map if name not in mapper.known], set(preset.sent)
        frames = sum(len(each.times) for each in heard.values())
        return Guess(
            preset,
            understood / max(understood + counts.malformed + counts.foreign, 1),
            tuple(joint for joint in preset.sent if joint in came),
            frames if len(came) >= MIN_JOINTS else 0,
            counts.incomplete + sum(each.refused for each in heard.values()),
            heard,
            tuple(unknown),
            tuple(at_rest),
            tuple(decoder.refusals.lines()),
        )

    def guess(self, presets: Sequence[Preset]) -> Guess | None:
        """Give the preset that explains most of the packets, None when none explains any.

        It is chosen by the frames made, then the joints found, then the messages read.
        """
        guesses = [self.looked_at_as(preset) for preset in presets]
        # So many joints must come for a preset to fit.
        fewest = [MIN_JOINTS if each.closings.some else _LIKELY * len(each.sent) for each in presets]
        enough = zip(guesses, fewest, strict=True)
        likely = [each for each, least in enough if each.understood and len(each.joints) >= least]
        return max(likely, key=_likelihood, default=None)


def _unpacked(unpack: Unpacker, datagram: bytes) -> list[Message] | None:
    """Give a packet's messages, None when it is packed otherwise."""
    try:
        return unpack(datagram)
    except PacketError:
        return None


def _likelihood(guess: Guess) -> tuple[bool, float, int]:
    share = len(guess.joints) / len(guess.preset.sent)
    return guess.frames > 0, guess.understood * share, len(guess.joints)


def shortened(types: str) -> str:
    """Write runs of one type as a count, like `if*93`."""
    return re.sub(r"(.)\1{3,}", lambda run: f"{run[1]}*{len(run[0])}", types)
