"""Admission: one sender for each performer, times that fit their arrival, names and addresses that are allowed.

OSC and plain ZeroMQ do not prove who sends. The first sender of a performer's frames keeps the performer until it has
been silent; frames of other senders under the same name are counted and reported. A frame whose time jumps by more than
some seconds waits for a second frame that agrees with it, so that one wrong packet restarts nothing. Times that are not
seconds are converted by their arrivals (`kinespace.stream.inputs.clock`).
"""

from collections import deque
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

from kinespace.stream.frame import Admitted, Announcement, Frame, Input, NewSender
from kinespace.stream.inputs.clock import SenderClock
from kinespace.stream.packet import Sender, remember, sender_name
from kinespace.stream.status import AdmissionCounts

#: Seconds by which a frame's time may differ both from the last frame's time and from the arrivals.
MAX_JUMP = 5.0
#: Names that are remembered, at most; only a sender that makes up names reaches the limit.
_MAX_NAMES = 1024
#: Ports of one host that are known to be other programs, at most.
_MAX_PORTS = 16
#: Packets in a row from one port after which a sender is known to keep to it.
_STEADY = 3
#: Seconds without one of them after which the sender may have started again at another port.
_RESTARTED = 0.5


@dataclass(slots=True)
class _Owner:
    """The sender of a performer, and its clock."""

    host: str
    port: int
    #: When its last frame came.
    last_seen: float
    #: Where the sender listens for answers; None where the transport does not say.
    reply_to: Sender = None
    #: When a packet last came from the owner's port.
    port_last_seen: float = 0.0
    #: Ports of the same host that send at the same time.
    other_ports: deque[int] = field(default_factory=lambda: deque(maxlen=_MAX_PORTS))
    #: The other port of the same host from which a packet last came.
    last_port: int = 0
    #: Packets in a row that came from the owner's port.
    in_a_row: int = 0
    #: Converts the sender's times.
    clock: SenderClock = field(default_factory=SenderClock)
    #: The converted time of its last admitted frame, seconds, and that frame's arrival.
    time: float | None = None
    arrival: float = 0.0
    #: A frame whose time jumped, and its arrival.
    odd: tuple[Frame, float] | None = None


class Admission:
    """Admits frames and announcements, or refuses them.

    Parameters
    ----------
    silence
        Seconds without a frame after which a performer may have another sender.
    allowed
        The performers that are allowed; empty for all.
    """

    def __init__(self, *, silence: float = 5.0, allowed: Collection[str] = ()) -> None:
        self.counts = AdmissionCounts()
        self._silence = silence
        self._allowed = frozenset(allowed)
        self._owners: dict[str, _Owner] = {}
        #: Announcements of senders that have sent no frame yet, by performer, host and port, with their arrivals.
        self._pending: dict[tuple[str, str, int], tuple[Announcement, float]] = {}
        #: By performer: the owner, the other sender, and when a packet last came from the other sender.
        self._conflicts: dict[str, tuple[str, str, float]] = {}

    def notes(self, now: float) -> list[str]:
        """List the performers that have several senders now, a line each."""
        return [
            f"two senders are called {name}: {owner}, {other}; only the first is used"
            for name, (owner, other, last_seen) in self._conflicts.items()
            if now - last_seen <= self._silence
        ]

    @property
    def clocks(self) -> dict[str, str]:
        """The performers whose times are not seconds, and how they are converted."""
        return {name: note for name, owner in self._owners.items() if (note := owner.clock.verdict.note)}

    def senders(self, performer: str | None = None) -> list[tuple[str, int]]:
        """Give the sender of a performer, or the senders of all performers, where they are known."""
        owners = self._owners.values() if performer is None else [self._owners.get(performer)]
        return [owner.reply_to for owner in owners if owner and owner.reply_to]

    def replies_go_to(self, events: Sequence[Admitted], sender: Sender) -> None:
        """Note where the sender of some admitted frames listens for answers."""
        for event in events:
            if owner := self._owners.get(event.performer):
                owner.reply_to = sender

    def admit(self, events: Sequence[Input], arrival: float, sender: Sender) -> Sequence[Admitted]:
        """Admit the frames and announcements of one packet that are believed, in order.

        Parameters
        ----------
        events
            The decoder's output.
        arrival
            When the packet came, seconds on our clock.
        sender
            Host and port; a source that does not know its senders gives a name of its own and 0.
        """
        host, port = sender or ("", 0)
        admitted: list[Admitted] = []
        for event in events:
            if self._allowed and event.performer not in self._allowed:
                self.counts.not_allowed += 1
            elif isinstance(event, Announcement):
                admitted += self._announcement(event, arrival, host, port)
            else:
                admitted += self._frame(event, arrival, host, port)
        return admitted

    def _announcement(self, event: Announcement, arrival: float, host: str, port: int) -> Sequence[Admitted]:
        """Admit an announcement of the performer's sender; another sender's waits for frames from the same port."""
        owner = self._owners.get(event.performer)
        # The owner of one port may have begun again at another, but only its frames say so.
        elsewhere = owner and owner.host == host and port != owner.port and owner.in_a_row >= _STEADY
        restarted = owner and elsewhere and arrival - owner.port_last_seen > _RESTARTED
        if owner and not elsewhere and self._is_owner(owner, arrival, host, port):
            return (event,)
        if owner and not restarted and arrival - owner.last_seen <= self._silence:
            self._refuse(event.performer, owner, arrival, host, port)
            return ()
        remember(self._pending, (event.performer, host, port), (event, arrival), _MAX_NAMES)
        return ()

    def _frame(self, frame: Frame, arrival: float, host: str, port: int) -> Sequence[Admitted]:
        name = frame.performer
        owner = self._owners.get(name)
        first: list[Admitted] = []
        if owner is None or arrival - owner.last_seen > self._silence:
            if owner and (owner.host != host or (owner.port != port and owner.in_a_row >= _STEADY)):
                first.append(NewSender(name))
            # Names are ordered by their last change of sender.
            self._owners.pop(name, None)
            owner = _Owner(host, port, arrival, port_last_seen=arrival)
            remember(self._owners, name, owner, _MAX_NAMES)
        elif not self._is_owner(owner, arrival, host, port):
            self._refuse(name, owner, arrival, host, port)
            return ()
        announced = self._pending.pop((name, host, port), None)
        if announced and arrival - announced[1] <= self._silence:
            first.append(announced[0])
        owner.last_seen = arrival
        # Several senders' times are not converted, because mixed they look like no clock at all.
        seconds = owner.clock.read(frame.time, arrival)
        if seconds != frame.time:
            frame = replace(frame, time=seconds)
        return (*first, *self._in_time(owner, frame, arrival))

    def _is_owner(self, owner: _Owner, arrival: float, host: str, port: int) -> bool:
        """Tell the performer's sender from other senders; some programs send each packet from another port.

        Another port of the same host belongs to another program if packets come from the first port again after it, or
        all the time.
        """
        if host != owner.host:
            return False
        if port == owner.port:
            if owner.last_port:
                owner.other_ports.append(owner.last_port)
                owner.last_port = 0
            owner.port_last_seen = arrival
            owner.in_a_row += 1
            return True
        if owner.in_a_row >= _STEADY and arrival - owner.port_last_seen <= _RESTARTED:
            return False
        owner.in_a_row = 0
        if port in owner.other_ports and arrival - owner.port_last_seen <= self._silence:
            return False
        if arrival - owner.port_last_seen > self._silence:
            owner.port, owner.port_last_seen, owner.last_port = port, arrival, 0
            owner.other_ports.clear()
        else:
            owner.last_port = port
        return True

    def _refuse(self, name: str, owner: _Owner, arrival: float, host: str, port: int) -> None:
        self.counts.other_sender += 1
        two = sender_name((owner.host, owner.port)), sender_name((host, port))
        remember(self._conflicts, name, (*two, arrival), _MAX_PORTS)

    def _in_time(self, owner: _Owner, frame: Frame, arrival: float) -> Sequence[Frame]:
        """Admit a frame whose time follows the last one; admit one that jumps with the next one that agrees."""
        odd, owner.odd = owner.odd, None
        if owner.time is None or _goes_on(owner.time, owner.arrival, frame.time, arrival):
            self.counts.odd_times += odd is not None
            owner.time, owner.arrival = frame.time, arrival
            return (frame,)
        if odd and _goes_on(odd[0].time, odd[1], frame.time, arrival):
            owner.time, owner.arrival = frame.time, arrival
            return (odd[0], frame)
        self.counts.odd_times += odd is not None
        owner.odd = frame, arrival
        return ()


def _goes_on(time: float, arrival: float, later: float, later_arrival: float) -> bool:
    """Say whether a frame's time follows another's: closely, or with the distance of the arrivals."""
    step = later - time
    return abs(step) <= MAX_JUMP or abs(step - (later_arrival - arrival)) <= MAX_JUMP
