"""A source: a receiver of packets, their decoder, and perhaps a recorder and a reader of commands.

Packets of senders that take more than their share of the time are served last. A packet costs at most some
milliseconds, but a sender can send many. The time that each sender's packets take is a debt that time pays off. Packets
of a sender whose debt is too high are put aside until nothing else waits, one at a time; beyond a few megabytes the
oldest are dropped. A sender that is alone is never put aside.
"""

import math
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple, Protocol

import zmq

from kinespace.stream.feeds.preset import AskedMessage, Preset
from kinespace.stream.frame import Admitted, Announcement, Input
from kinespace.stream.inputs.admission import Admission
from kinespace.stream.inputs.commands import CommandReader
from kinespace.stream.inputs.decoder import Decoder, FeedDecoder
from kinespace.stream.inputs.detection import Survey
from kinespace.stream.inputs.kinerec import Recorder
from kinespace.stream.osc.messages import beginning_of
from kinespace.stream.osc.packet import encode_message
from kinespace.stream.osc.udp import LookedUp, OscReceiver
from kinespace.stream.packet import Packet, Sender, remember, sender_name
from kinespace.stream.status import InputCounts
from kinespace.stream.teaching.commands import Asked
from kinespace.stream.zeromq import ZmqReceiver

#: A port or a subscription on which packets come in.
Receiver = OscReceiver | ZmqReceiver
#: Senders that are named in the notes, at most.
_MAX_NAMED = 3
#: Packets of senders served last that are searched for a packet of another sender, at most.
_MAX_LOOKED_THROUGH = 256
#: Seconds that a packet's decoding is charged with, at most: a busy machine takes more, and no sender is to pay for it.
_MAX_CHARGE = 1e-3
#: Share of the time that a sender may take permanently.
SHARE = 0.25
#: Seconds that a sender may take at once.
MAX_AT_ONCE = 0.02
#: The highest debt, seconds, so that a sender that stops is soon treated like the others.
_MAX_DEBT = 0.1
#: Seconds that a frame takes after decoding, about the time of its recognition.
PER_EVENT = 5e-5
#: Seconds that each name of a skeleton takes that has not come lately; and skeletons that are remembered: fewer than
#: `Naming` remembers, which all sources share.
_PER_NAME, _MAX_SKELETONS = 1e-4, 32
#: Seconds after which a silent sender counts as gone.
_THERE = 1.0
#: Seconds without a frame after which a sender is silent, and packets are looked at otherwise.
SILENCE = 1.0
#: Seconds between two frames of a performer, at least, while the service cannot keep up: windows need no more.
APART = 0.045
#: Performers whose last frames are known then, at most.
_MAX_PERFORMERS = 1024
#: Senders whose debts are kept, at most; only a program that sends each packet from another port reaches the limit.
_MAX_SENDERS = 1024
#: Bytes of packets that are put aside, at most.
MAX_ASIDE = 4 << 20
#: Packets that are put aside, at most.
_MAX_PACKETS = 1024


class Unread(Protocol):
    """Looks at packets of which no frame comes."""

    def keep(self, packet: Packet, arrival: float, sender: Sender) -> None:
        """Take in a packet at a moment in seconds. Never raises."""

    def note(self, now: float) -> str:
        """Give a line for a person; empty when nothing is known."""


class Source:
    """Frames from one address.

    Parameters
    ----------
    receiver
        The receiver of packets; closed by `close`.
    decoder
        The decoder of packets.
    admission
        Admits frames or refuses them, the same for all sources of a service; None admits all.

    Attributes
    ----------
    recorder
        Keeps every packet before it is decoded; None for no recording.
    pollable
        The socket.
    commands
        Reads the commands among the packets; None where nobody listens to them.
    unread
        Looks at packets while no frame comes of them; None: nobody does.
    place
        Where frames come in, for a person; empty for what browsers sent, who know another address.
    waited
        Seconds for which the last packet waited before it was taken in.
    lag
        Seconds for which the packet waited that was received last, at most; 0 when no more waits.
    patience
        In overload seconds, and else inf: then frames that waited for longer, and those shortly after another one of
        the same performer, are dropped unread, and counted.
    """

    def __init__(self, receiver: Receiver, decoder: Decoder, admission: Admission | None = None) -> None:
        self.receiver, self.pollable = receiver, receiver.socket
        self.decoder = decoder
        self.recorder: Recorder | Survey | None = None
        self.commands: CommandReader | None = None
        self.place = str(self)
        self.unread: Unread | None = None
        #: When a frame or an announcement last came, seconds on our clock.
        self._made = -math.inf
        self._admission = admission
        self.waited = self.lag = 0.0
        self._turns = Turns()
        self._last_was_aside, self.patience = False, math.inf
        self._stale = 0
        #: The time of the last frame that was not dropped, by its sender and its beginning.
        self._last: dict[tuple[Sender, bytes], float] = {}
        self._now = 0.0
        #: The joints that were announced lately.
        self._skeletons: dict[tuple[str, ...], None] = {}
        #: When no packet waited, seconds on our clock; inf before the first look.
        self._emptied = math.inf
        #: The sender's name where the transport names none, or the decoder has numbered the senders itself.
        self._itself = str(receiver), 0

    def __str__(self) -> str:
        return str(self.receiver)

    @property
    def has_put_aside(self) -> bool:
        """Whether packets were put aside; the socket does not wake the loop for them."""
        return bool(self._turns.aside)

    @property
    def counts(self) -> InputCounts:
        """Counts of all that came in; a copy."""
        unread = InputCounts(received=self._stale, stale=self._stale, thrown_away=self._turns.thrown_away)
        counts = self.receiver.counts + self.decoder.counts + unread
        return counts + self.commands.counts if self.commands else counts

    @property
    def notes(self) -> list[str]:
        """Notes on this source for a person, a line each."""
        recording = [self.recorder.note] if self.recorder and self.recorder.note else []
        last = [sender_name(sender) or "a sender" for sender in self._turns.last(self._now)[:_MAX_NAMED]]
        greedy = [f"{name} sends more than its share: served last" for name in last]
        unread = self.unread.note(self._now) if self.unread and self._now - self._made > SILENCE else ""
        return [*recording, *greedy, *([unread] if unread else self.decoder.refusals.lines())]

    def take(self, arrival: float) -> Sequence[Admitted | Asked] | None:
        """Take in one packet; give its commands and frames in order, or None when no packet waits. Never raises."""
        self._now = arrival
        taken = self._next(arrival)
        if taken is None:
            return None
        packet, arrival, self.waited, sender = taken
        if self.patience < math.inf and self._is_to_spare(packet, arrival, sender):
            self._stale += 1
            return ()
        known = None if self.decoder.expires else sender
        begun = time.perf_counter()
        asked = self.commands.read(packet, sender, arrival) if self.commands else None
        # A bundle may hold both commands and frames.
        has_frames = not (self.commands and asked) or self.commands.others > 0
        decoded = self.decoder.decode(packet, arrival, sender) if has_frames else ()
        if decoded:
            self._made = arrival
        elif self.unread and asked is None and arrival - self._made > SILENCE:
            self.unread.keep(packet, arrival, sender)
        took = min(time.perf_counter() - begun, _MAX_CHARGE)
        for each in decoded:
            if isinstance(each, Announcement) and each.joints not in self._skeletons:
                remember(self._skeletons, each.joints, None, _MAX_SKELETONS)
                took += _PER_NAME * len(each.joints)
        self._turns.charge(sender, took, len(decoded), self._now)
        admitted = self._admitted(decoded, arrival, known)
        # Answers to senders go by OSC only.
        if self._admission and sender and isinstance(packet, bytes):
            self._admission.replies_go_to(admitted, sender)
        return [*asked, *admitted] if asked else admitted

    def _next(self, now: float) -> "Waiting | None":
        """Take the next packet; packets of senders served last only when nothing else waits, and one in a row."""
        receiver, turns = self.receiver, self._turns
        for _ in range(_MAX_LOOKED_THROUGH):
            packet = receiver.receive()
            if packet is None:
                self._emptied, self.lag = now, 0.0
                break
            waited, sender = receiver.waited, receiver.sender
            self.lag = waited or max(now - self._emptied, 0.0)
            if self.recorder:
                self.recorder.keep(packet, now - waited, sender)
            taken = Waiting(packet, now - waited, waited, sender)
            if not turns.comes_last(sender, now):
                self._last_was_aside = False
                return taken
            turns.put_aside(taken)
        self._last_was_aside = bool(turns.aside) and not self._last_was_aside
        if not self._last_was_aside:
            return None
        taken = turns.take()
        return taken._replace(waited=now - taken.arrival)

    def _is_to_spare(self, packet: Packet, arrival: float, sender: Sender) -> bool:
        """Say whether a packet is a frame that waited for too long, or follows another one of its performer closely."""
        beginning, time = beginning_of(packet) if isinstance(packet, bytes) else (b"", 0.0)
        if not beginning:
            return False
        time = time or arrival
        if self.waited > self.patience or 0 <= time - self._last.get((sender, beginning), -math.inf) < APART:
            return True
        remember(self._last, (sender, beginning), time, _MAX_PERFORMERS)
        return False

    def tend(self, now: float) -> Sequence[Admitted]:
        """Do the work that is due by the clock; give the frames that it completed, in order. Never raises."""
        completed = self.decoder.expire(now)
        if completed:
            self._made = now
        return self._admitted(completed, now, None)

    def _admitted(self, events: Sequence[Input], arrival: float, sender: Sender) -> Sequence[Admitted]:
        if self._admission is None or not events:
            return events
        return self._admission.admit(events, arrival, sender or self._itself)

    def close(self) -> None:
        """Close the socket."""
        self.receiver.close()


#: Seconds of the longest sleep without packets, and packets of a source in one turn, at most: a flood ends nothing.
_MAX_SLEEP, _MAX_IN_TURN = 0.1, 10_000


def taking(sources: Sequence[Source], seconds: float, is_over: Callable[[], bool] = lambda: False) -> Iterator[float]:
    """Take in what comes to sources for some seconds, or until it is over, for their recorders; packets alone.

    Yields
    ------
    The moment after each turn, seconds; packets that have arrived by the end are taken in.
    """
    poller, ending = zmq.Poller(), False
    for source in sources:
        poller.register(source.pollable, zmq.POLLIN)
    until = time.monotonic() + seconds
    while not ending:
        for source in sources:
            source.tend(time.monotonic())
        left = until - time.monotonic()
        ending = left <= 0 or is_over()
        poller.poll(0 if ending else round(1000 * min(_MAX_SLEEP, left)) + 1)
        for source in sources:
            for _ in range(_MAX_IN_TURN):
                if source.take(time.monotonic()) is None:
                    break
        yield time.monotonic()


class Waiting(NamedTuple):
    """A packet that was put aside: its arrival in seconds on our clock, how long it had waited then, and its sender."""

    packet: Packet
    arrival: float
    waited: float
    sender: Sender


class Turns:
    """Keeps the debts of one receiver's senders, and the packets that were put aside.

    Attributes
    ----------
    aside
        The packets that were put aside, the oldest first.
    thrown_away
        Packets that were put aside and then dropped for want of room.
    """

    def __init__(self) -> None:
        self.thrown_away = 0
        #: Each sender's debt in seconds, and the moment of that debt.
        self._debts: dict[Sender, tuple[float, float]] = {}
        self.aside = deque[Waiting]()
        self._aside_bytes = 0
        #: How many of each sender's packets are put aside.
        self._aside_of: Counter[Sender] = Counter()
        self._before: Sender = None
        #: When a packet last came from another sender than the packet before, seconds on our clock.
        self._changed = float("-inf")

    def comes_last(self, sender: Sender, now: float) -> bool:
        """Note a packet's sender, and say whether the packet is to be put aside; `now` in seconds."""
        if sender != self._before:
            self._before = sender
            # The very first sender is not another than the one before.
            self._changed = now if self._debts else self._changed
        if now - self._changed >= _THERE:
            return False
        # A sender's packets stay in their order: behind those that are put aside.
        return self._aside_of[sender] > 0 or self._due(sender, now) > MAX_AT_ONCE

    def _due(self, sender: Sender, now: float) -> float:
        """Give a sender's debt as it is now."""
        debt, at = self._debts.get(sender, (0.0, now))
        return max(debt - SHARE * max(now - at, 0.0), 0.0)

    def charge(self, sender: Sender, seconds: float, events: int, now: float) -> None:
        """Note the seconds that a packet took, and the number of its frames and announcements."""
        debt = min(self._due(sender, now) + seconds + PER_EVENT * events, _MAX_DEBT)
        remember(self._debts, sender, (debt, now), _MAX_SENDERS)

    def put_aside(self, waiting: Waiting) -> None:
        """Keep a packet until nothing else waits; the oldest packets make room for it."""
        self.aside.append(waiting)
        self._aside_of[waiting.sender] += 1
        self._aside_bytes += _size(waiting.packet)
        while self._aside_bytes > MAX_ASIDE or len(self.aside) > _MAX_PACKETS:
            self.take()
            self.thrown_away += 1

    def take(self) -> Waiting:
        """Take the oldest packet that was put aside."""
        waiting = self.aside.popleft()
        self._aside_of[waiting.sender] -= 1
        if not self._aside_of[waiting.sender]:
            del self._aside_of[waiting.sender]
        self._aside_bytes -= _size(waiting.packet)
        return waiting

    def last(self, now: float) -> list[Sender]:
        """List the senders whose packets are put aside."""
        if now - self._changed >= _THERE:
            return []
        return [sender for sender in self._debts if self._due(sender, now) > MAX_AT_ONCE / 2]


def _size(packet: Packet) -> int:
    return len(packet) if isinstance(packet, bytes) else sum(map(len, packet))


class FeedSource(Source):
    """Frames from OSC packets of another product.

    Parameters
    ----------
    receiver
        Where the packets come in. Only a UDP port can also send messages to the sender.
    preset
        The meaning of the packets.
    sender
        The host that gets the messages, for presets that have any.
    admission
        Admits frames or refuses them; None admits all.

    Attributes
    ----------
    unasked
        Packets to the sender that the system would not send.
    """

    decoder: FeedDecoder

    def __init__(
        self, receiver: Receiver, preset: Preset, admission: Admission | None = None, *, sender: str = "127.0.0.1"
    ) -> None:
        self.preset = preset
        super().__init__(receiver, FeedDecoder(preset), admission)
        self.unasked = 0
        self._asked = -math.inf
        self._sender = LookedUp(sender, preset.asking.port) if preset.asking else None

    def __str__(self) -> str:
        return f"{self.preset.name} {str(self.receiver).partition(' ')[2]}"

    def tend(self, now: float) -> Sequence[Admitted]:
        """Close frames that wait for too long, and send the sender its messages when they are due."""
        asking, is_silent = self.preset.asking, now - self._made > SILENCE
        if asking and now - self._asked >= asking.every and (is_silent or not asking.while_silent):
            self._asked = now
            self._send(asking.messages)
        return super().tend(now)

    def _send(self, messages: Sequence[AskedMessage]) -> None:
        if self._sender is None or not isinstance(self.receiver, OscReceiver):
            return
        target = self._sender.address
        packets = packets_for_sender(self.preset, messages, self.receiver.address[1])
        self.unasked += sum(target is None or not self.receiver.send_to(packet, target) for packet in packets)

    def close(self) -> None:
        """Ask the sender to stop, and close the socket."""
        if self.preset.asking:
            self._send(self.preset.asking.farewell)
        super().close()


def packets_for_sender(preset: Preset, messages: Sequence[AskedMessage], port: int) -> list[bytes]:
    """Encode messages for the sender, those with `{joint}` once for each joint; `port` is the port we listen on."""
    packets = list[bytes]()
    for each in messages:
        asks_for_joints = "{joint}" in each.address + "".join(map(str, each.arguments))
        joints = [name for name, target in preset.joint_map.items() if target] if asks_for_joints else [""]
        for joint in joints:
            arguments = [_filled(argument, joint, port) for argument in each.arguments]
            packets.append(encode_message(each.address.replace("{joint}", joint), *arguments))
    return packets


def _filled(argument: str | float, joint: str, port: int) -> str | float:
    """Put a joint and a port in their places; the port alone is sent as a number."""
    if argument == "{port}":
        return port
    return argument.replace("{joint}", joint).replace("{port}", str(port)) if isinstance(argument, str) else argument
