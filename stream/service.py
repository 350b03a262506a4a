"""The loop: packets from sources, through one recogniser per performer, to sinks. Nothing else in the house loops."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Protocol, Self, runtime_checkable

import zmq

from kinespace.stream import onepart, osc, zeromq
from kinespace.stream.frame import Announcement, Frame
from kinespace.stream.receiver import ReceivingSource
from kinespace.stream.status import HopTimes, InputCounts, Rates, Status

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from kinespace.stream.receiver import MessageReceiver, PacketReceiver
    from kinespace.stream.recognition import Event, Recognition
    from kinespace.stream.recognizer import Performers

#: Seconds between two statuses, and between two lists of classes.
STATUS_EVERY = 1.0
CLASSES_EVERY = 5.0
#: Packets of one source that are taken in, then recognised, then answered, each in one go, at most: what a step needs
#: is in the processor's caches then, and one send wakes up who listens. More would keep the first waiting for too long.
#: How many it is follows what waits: a packet that comes alone is answered before anybody looks for another.
_MOST_TOGETHER = 32
#: Packets taken from one source before the others, and the clock, get their turn.
_AT_ONCE = 256
#: Longest sleep while nothing comes, seconds: how soon `stop` is heard.
_LONGEST_SLEEP = 0.1
#: Steps after being stopped: more than any socket holds, and a feed that goes on does not keep us for ever.
_LAST_STEPS = 32
#: Seconds between two turns of sources that have something to do even when nothing comes.
_TENDING = 0.02


class Source(Protocol):
    """Where frames come from."""

    @property
    def pollable(self) -> object:
        """What `zmq.Poller` can wait for: a file number's owner or a ZeroMQ socket."""

    @property
    def counts(self) -> InputCounts:
        """What came in so far."""

    def take(self, arrival: float) -> Sequence[Frame | Announcement] | None:
        """Take in one packet; what it held, in order, or None when nothing is waiting. Never raises."""

    def close(self) -> None:
        """Give sockets back."""


@runtime_checkable
class TendedSource(Protocol):
    """A source that has something to do even when nothing comes."""

    def tend(self, now: float) -> Sequence[Frame | Announcement]:
        """Do what is due by the clock; what came of it, in order. Never raises."""


class Sink(Protocol):
    """Where answers go."""

    @property
    def failed(self) -> int:
        """Answers that could not be sent."""

    def publish(self, recognition: Recognition) -> None:
        """Pass on one recognition."""

    def publish_event(self, event: Event) -> None:
        """Pass on that a motion started or ended."""

    def publish_classes(self, classes: Sequence[str]) -> None:
        """Pass on which classes there are."""

    def publish_status(self, status: Status) -> None:
        """Pass on how the service does."""

    def close(self) -> None:
        """Give sockets back."""


class OscSource(ReceivingSource[bytes]):
    """Frames from UDP datagrams."""

    def __init__(self, receiver: PacketReceiver) -> None:
        super().__init__(receiver)
        self.receiver = receiver

    def __str__(self) -> str:
        host, port = self.receiver.address
        return f"OSC {host}:{port}"

    @property
    def counts(self) -> InputCounts:
        """What came in so far."""
        self._counts.overrun = self.receiver.kernel_drops
        return super().counts

    def _understood(self, packet: bytes, arrival: float) -> Sequence[Frame | Announcement]:
        received = osc.decode(packet, arrival)
        self._counts.malformed += received.malformed
        self._counts.foreign += received.foreign
        return received.events


class ZmqSource(ReceivingSource[list[bytes]]):
    """Frames from ZeroMQ messages."""

    def __init__(self, receiver: MessageReceiver) -> None:
        super().__init__(receiver)
        self.receiver = receiver
        self._gaps = zeromq.SequenceGaps()

    def __str__(self) -> str:
        return f"ZeroMQ {self.receiver.address}"

    @property
    def counts(self) -> InputCounts:
        """What came in so far."""
        self._counts.missing = self._gaps.missing
        return super().counts

    def _understood(self, packet: list[bytes], arrival: float) -> Sequence[Frame | Announcement]:
        if not (packet and packet[0].startswith(b"frame/")):
            if len(packet) == 1:
                return self._take_one_part(packet[0], arrival)
            self._counts.foreign += 1
            return ()
        try:
            numbered = zeromq.decode(packet, arrival)
        except zeromq.FormatError:
            self._counts.malformed += 1
            return ()
        return self._seen(numbered)

    def _take_one_part(self, payload: bytes, arrival: float) -> Sequence[Frame | Announcement]:
        if onepart.is_osc(payload):
            received = osc.decode(payload, arrival)
            self._counts.malformed += received.malformed
            self._counts.foreign += received.foreign
            return received.events
        if not onepart.is_map(payload):
            self._counts.foreign += 1
            return ()
        try:
            numbered = onepart.decode(payload, arrival)
        except zeromq.FormatError:
            self._counts.malformed += 1
            return ()
        return self._seen(numbered)

    def _seen(self, numbered: zeromq.NumberedFrame) -> Sequence[Frame | Announcement]:
        self._gaps.see(numbered.frame.performer, numbered.seq)
        return (numbered.announcement, numbered.frame) if numbered.announcement else (numbered.frame,)


class OscSink:
    """Answers as OSC bundles to one host and port."""

    def __init__(self, sender: osc.OscSender) -> None:
        self.sender = sender

    def __str__(self) -> str:
        host, port = self.sender.target[:2]
        return f"OSC {host}:{port}"

    @property
    def failed(self) -> int:
        """Answers the system would not take."""
        return self.sender.failed

    def publish(self, recognition: Recognition) -> None:
        """Send one recognition."""
        self.sender.send(osc.encode_recognition(recognition))

    def publish_event(self, event: Event) -> None:
        """Send one event."""
        self.sender.send(osc.encode_event(event))

    def publish_classes(self, classes: Sequence[str]) -> None:
        """Send the class names."""
        self.sender.send(osc.encode_classes(classes))

    def publish_status(self, status: Status) -> None:
        """Send the status."""
        self.sender.send(osc.encode_status(status))

    def close(self) -> None:
        """Close the socket."""
        self.sender.close()


class ZmqSink:
    """Answers as ZeroMQ messages."""

    def __init__(self, sender: zeromq.ZmqSender) -> None:
        self.sender = sender

    def __str__(self) -> str:
        return f"ZeroMQ {self.sender.address}"

    @property
    def failed(self) -> int:
        """Answers ZeroMQ would not take."""
        return self.sender.failed

    def publish(self, recognition: Recognition) -> None:
        """Send one recognition."""
        self.sender.send(zeromq.encode_recognition(recognition))

    def publish_event(self, event: Event) -> None:
        """Send one event."""
        self.sender.send(zeromq.encode_event(event))

    def publish_classes(self, classes: Sequence[str]) -> None:
        """Send the class names."""
        self.sender.send(zeromq.encode_classes(classes))

    def publish_status(self, status: Status) -> None:
        """Send the status."""
        self.sender.send(zeromq.encode_status(status))

    def close(self) -> None:
        """Close the socket."""
        self.sender.close()


class Service:
    """Recognises what comes from some sources and tells some sinks.

    Parameters
    ----------
    performers
        The recognisers.
    sources, sinks
        Where frames come from and answers go; closed by `close`, or on leaving the `with` block.
    clock
        Seconds; stamps arrivals and paces the status.
    """

    def __init__(
        self,
        performers: Performers,
        sources: Sequence[Source],
        sinks: Sequence[Sink],
        *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.performers = performers
        self.sources = sources
        self.sinks = sinks
        self._clock = clock
        self._hop_times = HopTimes()
        self._rates = Rates(clock())
        self._latest_rates: dict[str, float] = {}
        self._next_status = self._next_classes = clock()
        self._stopped = False
        self._together = 1
        self._poller = zmq.Poller()
        for source in sources:
            self._poller.register(source.pollable, zmq.POLLIN)
        self._tended = [source for source in sources if isinstance(source, TendedSource)]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Give all sockets back."""
        for source in self.sources:
            source.close()
        for sink in self.sinks:
            sink.close()

    def stop(self) -> None:
        """Make `run` return soon; from any thread or signal handler."""
        self._stopped = True

    def run(self) -> None:
        """Go on until stopped; what has arrived by then is still answered, and every motion going on is ended."""
        while not self._stopped:
            self.step(_LONGEST_SLEEP)
        for _ in range(_LAST_STEPS):
            self.step(0.0)
        for ended in self.performers.end():
            for sink in self.sinks:
                sink.publish_event(ended)

    def step(self, longest: float) -> None:
        """Wait at most `longest` seconds for something to come, and deal with all that has."""
        self._tell_time()
        sleep = min(longest, max(self._next_status - self._clock(), 0.0))
        if self._tended:
            sleep = min(sleep, _TENDING)
            self._tend()
        if not self._poller.poll(round(sleep * 1000)):
            return
        # Every source is asked: one poll is cheaper than finding out which of them it was.
        for source in self.sources:
            left = _AT_ONCE
            while left and (taken := self._deal_with_waiting(source, left)):
                left -= taken

    def _deal_with_waiting(self, source: Source, most: int) -> int:
        """Take in some packets, recognise, answer; give how many, 0 when no more wait."""
        taken: list[Frame | Announcement] = []
        begun: list[float] = []
        wanted = min(self._together, most)
        for _ in range(wanted):
            started = time.perf_counter()
            events = source.take(self._clock())
            if events is None:
                wanted, self._together = 0, max(self._together // 2, 1)
                break
            taken += events
            begun += [started] * len(events)
        else:
            self._together = min(2 * self._together, _MOST_TOGETHER)
        self._deal_with(taken, begun)
        return wanted

    def _tend(self) -> None:
        for source in self._tended:
            started = time.perf_counter()
            events = source.tend(self._clock())
            self._deal_with(events, [started] * len(events))

    def _deal_with(self, events: Sequence[Frame | Announcement], begun: Sequence[float]) -> None:
        """Recognise what was taken in and tell the sinks; `begun` says of each when its packet was first looked at."""
        if not events:
            return
        for event in events:
            if isinstance(event, Frame):
                self._rates.count(event.performer)
        answers = self.performers.push_all(events, self._clock())
        for recognition, started in zip(answers, begun, strict=True):
            if recognition is None:
                continue
            for sink in self.sinks:
                sink.publish(recognition)
                for happened in recognition.events:
                    sink.publish_event(happened)
            self._hop_times.add(time.perf_counter() - started)

    def _tell_time(self) -> None:
        now = self._clock()
        if now >= self._next_classes:
            self._next_classes = now + CLASSES_EVERY
            for sink in self.sinks:
                sink.publish_classes(self.performers.library.classes)
        if now >= self._next_status:
            self._next_status = now + STATUS_EVERY
            for ended in self.performers.drop_silent(now):
                for sink in self.sinks:
                    sink.publish_event(ended)
            self._latest_rates = self._rates.read(now)
            status = self.status()
            for sink in self.sinks:
                sink.publish_status(status)

    def status(self) -> Status:
        """Give the counters as they are now."""
        return Status(
            inputs=sum((source.counts for source in self.sources), start=InputCounts()),
            outcomes=self.performers.counts,
            unsent=sum(sink.failed for sink in self.sinks),
            performers={name: self._latest_rates.get(name, 0.0) for name in self.performers.names},
            hop_p50=self._hop_times.percentile(50),
            hop_p99=self._hop_times.percentile(99),
            refused=self.performers.refused,
            doubted=self.performers.doubted,
        )
