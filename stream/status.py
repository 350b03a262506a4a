"""The counters of a running service: counts, rates, hop times, and the last packets that were refused."""

from dataclasses import dataclass, field, fields
from typing import Self

from kinespace.stream.packet import Packet, Sender, sender_name

#: Seconds of a hop's 99th percentile beyond which answers are late.
_LATE = 0.1
#: Share of the answers due below which they are late, too.
_FEW = 0.9
#: Characters of a refusal's reason, at most.
_MAX_REASON = 160
#: Bytes of a refused packet that are shown, at most.
_MAX_EXCERPT = 24


@dataclass(slots=True)
class Counts:
    """Counts that are added up, or taken off each other, field by field; a field may hold counts, too."""

    def __add__(self, other: Self) -> Self:
        return type(self)(*(getattr(self, each.name) + getattr(other, each.name) for each in fields(self)))

    def __sub__(self, other: Self) -> Self:
        return type(self)(*(getattr(self, each.name) - getattr(other, each.name) for each in fields(self)))


@dataclass(slots=True)
class InputCounts(Counts):
    """Counts of all that came in, before it is assigned to performers."""

    #: Datagrams or ZeroMQ messages.
    received: int = 0
    #: Packets or messages that cannot be read.
    malformed: int = 0
    #: Messages with addresses or topics that are not ours.
    foreign: int = 0
    #: Packets that the system dropped because they came faster than they were received.
    overrun: int = 0
    #: Sequence numbers that were skipped.
    missing: int = 0
    #: Frames refused because too many joints in them were absent for too long, or because they were impossible.
    incomplete: int = 0
    #: ZeroMQ connections that broke while the sender was there: a message above the size limit, or the network.
    broken: int = 0
    #: Packets of senders that took more than their share, dropped because others came first.
    thrown_away: int = 0
    #: Frames that waited when the service could not keep up, dropped because others of the performer came.
    stale: int = 0


@dataclass(slots=True)
class AdmissionCounts:
    """Counts of all that was not believed."""

    #: Frames and announcements of a performer from a sender other than the performer's own.
    other_sender: int = 0
    #: Frames of performers that are not allowed.
    not_allowed: int = 0
    #: Frames whose time no other frame confirmed.
    odd_times: int = 0


@dataclass(slots=True)
class RecognizerCounts(Counts):
    """Counts of a recogniser's frames, by their fate."""

    #: Frames taken into the window.
    frames: int = 0
    #: Frames refused because they were not newer than the newest frame.
    out_of_order: int = 0
    #: How often the window was started again: after a gap, or when a sender began again.
    restarts: int = 0
    #: Windows answered.
    hops: int = 0
    #: Windows not answered, because frames had waited for too long and newer ones had come.
    skipped: int = 0


@dataclass(slots=True)
class PerformerCounts(Counts):
    """Counts of the frames of all performers, by their fate."""

    #: Frames of a performer for whom there was no room.
    no_room: int = 0
    #: Frames with too few of the library's joints, or with another number of joints than were named.
    other_joints: int = 0
    #: Performers dropped after silence.
    dropped: int = 0
    #: Sums over all recognisers, of dropped performers too.
    recognizers: RecognizerCounts = field(default_factory=RecognizerCounts)
    #: Frames that came while the library was being restricted to the performer's joints.
    opening: int = 0


@dataclass(frozen=True, slots=True)
class Status:
    """A service's counters at one moment.

    Attributes
    ----------
    inputs
        Counts of all that came in.
    outcomes
        Counts of the frames, by their fate.
    unsent
        Answers that the system would not send.
    performers
        Frames per second of each performer now followed.
    hop_p50, hop_p99
        Seconds from the arrival of a frame's packet to its recognition, over the last hops; 0 before the first.
    refused
        Performers whose frames are refused for their joints, with the reason.
    admission
        Counts of doubtful frames: other senders of a performer, performers that are not allowed, times that jump.
    doubted
        Performers with joints that cannot be believed, and the reason.
    compared
        Performers with other joints than the library's: the convention of their names, and how many joints are
        compared.
    clocks
        Performers whose senders' times are not in seconds, and how the times are read.
    promised, missed
        False alarms an hour that are promised of motions that were done, 0 where none is said; and the share of the
        library's own motions that this misses, None where that is not known.
    notes
        Notes for a person, a line each: trouble with a recording, the last reason why packets were refused.
    listening
        Where frames come in.
    answered
        Share of the answers due in the last second that were given, 0 to 1: less in overload.
    """

    inputs: InputCounts
    outcomes: PerformerCounts
    unsent: int
    performers: dict[str, float]
    hop_p50: float
    hop_p99: float
    refused: dict[str, str] = field(default_factory=dict)
    admission: AdmissionCounts = field(default_factory=AdmissionCounts)
    doubted: dict[str, str] = field(default_factory=dict)
    compared: dict[str, str] = field(default_factory=dict)
    clocks: dict[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    promised: float = 0.0
    missed: float | None = None
    listening: tuple[str, ...] = ()
    answered: float = 1.0

    @property
    def frames_per_second(self) -> float:
        """Frames per second of all performers together."""
        return float(sum(self.performers.values()))

    @property
    def health(self) -> str:
        """One line for programs that keep the service running: `ok`, `waiting`, `refusing` or `late`, and numbers."""
        if not self.performers:
            state = "waiting"
        elif self.refused:
            state = "refusing"
        else:
            state = "late" if self.hop_p99 > _LATE or self.answered < _FEW else "ok"
        count = f"{len(self.performers)} performers, {self.frames_per_second:.0f} frames a second"
        share = "" if self.answered == 1 else f", {self.answered:.0%} answered"
        return f"{state}: {count}, {self.lost} lost, hop {1e3 * self.hop_p99:.1f} ms{share}"

    @property
    def lost(self) -> int:
        """Count of all that came, or should have come, and was not used."""
        inputs, outcomes, admission = self.inputs, self.outcomes, self.admission
        unread = inputs.malformed + inputs.overrun + inputs.missing + inputs.incomplete + inputs.broken
        dropped = inputs.thrown_away + inputs.stale + admission.other_sender + admission.odd_times
        refused = outcomes.opening + outcomes.no_room + outcomes.other_joints + outcomes.recognizers.out_of_order
        return unread + dropped + refused


class Refusals:
    """The last refusal of each kind, like malformed and foreign."""

    def __init__(self) -> None:
        self._last: dict[str, tuple[str, Sender, Packet]] = {}

    def note(self, kind: str, reason: str, sender: Sender, packet: Packet) -> None:
        """Keep a refusal in place of the one before; its text is made only when a person asks."""
        self._last[kind] = reason, sender, packet

    def lines(self) -> list[str]:
        """Describe the last refusal of each kind, a line each."""
        return [f"last {kind}: {_described(*refused)}" for kind, refused in self._last.items()]


def _described(reason: str, sender: Sender, packet: Packet) -> str:
    first = packet if isinstance(packet, bytes) else b" ".join(packet[:2])
    excerpt = ascii(first[:_MAX_EXCERPT])[1:] + ("..." if len(first) > _MAX_EXCERPT else "")
    came_from = f", from {sender_name(sender)}" if sender else ""
    shown = "".join(character if character.isprintable() else "\N{REPLACEMENT CHARACTER}" for character in reason)
    return f"{shown[:_MAX_REASON]}{came_from}: {excerpt}"
