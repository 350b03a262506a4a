"""A recogniser in a process of its own, as `kinespace live` is one, and its answers: received, and expected."""

import gc
import json
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from functools import partial
from typing import Any, Literal, NamedTuple

import zmq

from kinespace.library import MotionLibrary
from kinespace.stream import BackgroundViews, Performers, Recognizer, Settings, osc, zeromq
from kinespace.stream.inputs import Admission, OwnDecoder, Receiver, Source
from kinespace.stream.osc.packet import PacketError, decode_packet
from kinespace.stream.outputs import LAYOUTS, LayoutSink, Sink, ZmqSink
from kinespace.stream.recognition import Answer
from kinespace.stream.service.background import Child
from kinespace.stream.service.loop import Service
from kinespace.stream.zeromq import Endpoint
from kinespace.tools.cli.entry import check_interrupted
from kinespace.tools.cli.values import host_and_port
from kinespace.tools.feeding.feed import Cue, FrameSender, OscFrameSender, Pace, Packet, ZmqFrameSender

#: This machine.
LOOPBACK = "127.0.0.1"
_ANY = Endpoint(f"tcp://{LOOPBACK}:*", bind=True)
#: The poller counts milliseconds; the rest of a millisecond is slept in pieces of these seconds.
_SHORT_SLEEP = 5e-5
#: Milliseconds of the longest wait: the program ends within this time.
_MAX_WAIT = 100

#: Scores agree to the digits that every transport carries.
_SAME_SCORE = 1e-5


class ReceivedPacket(NamedTuple):
    """A packet, the receiver it came in on, and the `time.perf_counter` reading when it did."""

    receiver: Receiver
    packet: Packet
    arrival: float


class Listener:
    """Waits for packets on UDP ports and ZeroMQ endpoints.

    Parameters
    ----------
    receivers
        Where packets come in; closed by `close`.
    """

    def __init__(self, *receivers: Receiver) -> None:
        self._receivers = receivers
        self._poller = zmq.Poller()
        for receiver in receivers:
            self._poller.register(receiver.socket, zmq.POLLIN)

    def listen_until(self, moment: float) -> list[ReceivedPacket]:
        """Collect packets until a `time.perf_counter` reading; at least once, even when that is past."""
        received = list[ReceivedPacket]()
        while True:
            check_interrupted()
            remaining = moment - time.perf_counter()
            if self._poller.poll(min(_MAX_WAIT, max(0, int(remaining * 1000)))):
                for receiver in self._receivers:
                    while (packet := receiver.receive()) is not None:
                        received.append(ReceivedPacket(receiver, packet, time.perf_counter()))
            elif remaining <= 0:
                return received
            elif remaining < 1e-3:
                time.sleep(min(remaining, _SHORT_SLEEP))

    def close(self) -> None:
        """Give the sockets back."""
        for receiver in self._receivers:
            receiver.close()


#: Seconds after the last frame in which answers may still come: fewer than of the silence that ends a motion.
_LINGER = 0.7


class Played(NamedTuple):
    """What was sent and received; moments as `time.perf_counter` reads them.

    Attributes
    ----------
    begun
        When the schedule began.
    sent
        For each sender, when each frame was sent.
    received
        The packets that came back.
    """

    begun: float
    sent: list[list[float]]
    received: list[ReceivedPacket]


def play(cues: Iterable[Cue], senders: Sequence[FrameSender], listener: Listener, apart: float = 0.0) -> Played:
    """Send every frame when it is due, by further senders so many seconds apart; collect all that comes back."""
    pace, sent, received = Pace(), [list[float]() for _ in senders], list[ReceivedPacket]()
    for cue in cues:
        packets = [sender.encode(cue.frame) for sender in senders]
        for place, (sender, packet) in enumerate(zip(senders, packets, strict=True)):
            received += listener.listen_until(pace.moment(cue.due + place * apart))
            # Before the call, because the answer may be on its way before the call returns.
            sent[place].append(time.perf_counter())
            sender.send(packet)
    received += listener.listen_until(time.perf_counter() + _LINGER)
    return Played(pace.moment(0.0), sent, received)


def answer_in(packet: Packet) -> Answer | None:
    """Read the answer in a packet; None for other packets."""
    return osc.decode_answer(packet) if isinstance(packet, bytes) else zeromq.decode_answer(packet)


def classes_in(packet: Packet) -> list[str]:
    """List the recogniser's classes where a packet lists them; none for other packets."""
    with suppress(PacketError, ValueError, LookupError, TypeError):
        if isinstance(packet, bytes):
            messages = decode_packet(packet) if packet.startswith(b"/motion/classes\0") else ()
            return [str(name) for _, names in messages for name in names]
        if packet[0] == b"classes/":
            return [str(name) for name in json.loads(packet[-1])["classes"]]
    return []


class Expected(NamedTuple):
    """An answer that is to come: the index of its cue, and its content."""

    cue: int
    label: str
    score: float


def expected_answers(cues: Sequence[Cue], library: MotionLibrary, settings: Settings) -> list[Expected]:
    """Recognise a feed of one performer like the service, positions rounded as in packets."""
    recognizer = Recognizer(library, settings)
    expected = list[Expected]()
    for index, cue in enumerate(cues):
        (frame,) = osc.decode(osc.encode_frame(cue.frame), 0.0).events
        recognition = recognizer.push(frame)  # type: ignore[arg-type]  # a frame was encoded
        if recognition is not None:
            expected.append(Expected(index, recognition.label, recognition.score))
    return expected


class AnswerMatcher:
    """Pairs answers with their frames, in order; answers that were skipped are lost.

    An answer names neither its frame nor its number. But its content is known beforehand, so it is paired with the next
    expected answer of the same content.
    """

    def __init__(self, expected: Sequence[Expected]) -> None:
        self._waiting = deque(expected)
        self.lost = 0

    def match(self, answer: Answer) -> Expected | None:
        """Give the expected answer that this answer is; None for an unexpected answer."""
        for skipped, expected in enumerate(self._waiting):
            if expected.label == answer.label and abs(expected.score - answer.score) < _SAME_SCORE:
                for _ in range(skipped + 1):
                    self._waiting.popleft()
                self.lost += skipped
                return expected
        return None

    @property
    def waiting(self) -> int:
        """How many expected answers have not come."""
        return len(self._waiting)


Transport = Literal["osc", "zmq"]
#: Seconds after which a connection is given up.
_MAX_START = 60.0
#: Milliseconds between two greetings.
_GREET_EVERY = 50
#: Seconds within which a process of ours notices that it is to end, and after which it is killed.
_LOOK_EVERY, _MAX_END = 0.1, 1.0


class Recognising(NamedTuple):
    """The terms of a recogniser in a process of its own: the library (None: the built-in one), and of `Performers`."""

    library: MotionLibrary | None
    settings: Settings
    most: int


def serve(port: int, terms: Recognising | None, started: Callable[[str], None], wants_end: Callable[[], bool]) -> None:
    """Recognise frames as `kinespace live` does, or send packets back unread, until the end is wanted.

    Parameters
    ----------
    port
        Where answers go by OSC on this machine; 0 for ZeroMQ.
    terms
        Of the recogniser; None for a bare echo.
    started, wants_end
        Gets the receiver's place and, of ZeroMQ, the address of answers; is asked some times a second.
    """
    receiver: Receiver
    sender: Any  # of the receiver's kind of packets
    sink: Sink
    if port:
        receiver, sender = osc.OscReceiver(LOOPBACK, 0), osc.OscSender(LOOPBACK, port)
        sink, answers = LayoutSink(LAYOUTS["native"](), sender), ""
    else:
        receiver, sender = zeromq.ZmqReceiver(_ANY), zeromq.ZmqSender(_ANY)
        sink, answers = ZmqSink(sender), sender.address
    poller = zmq.Poller()
    poller.register(receiver.socket, zmq.POLLIN)

    def echo(longest: float) -> None:
        poller.poll(round(1000 * longest))
        while (packet := receiver.receive()) is not None:
            sender.send(packet)

    step: Callable[[float], None] = echo
    if terms:
        known, views, admission = terms.library or MotionLibrary.builtin(), BackgroundViews(), Admission()
        performers = Performers(known, terms.settings, most=terms.most, views=views)
        source = Source(receiver, OwnDecoder(), admission)
        step = Service(performers, [source], [sink], admission=admission).step
    started(f"{receiver.place} {answers}")
    gc.freeze()
    while not wants_end():
        step(_LOOK_EVERY)


class Connected(NamedTuple):
    """A service in its own process, by its number; a sender of frames that reach it, and a receiver of its answers."""

    process_id: int
    sender: FrameSender
    receiver: Receiver


def _meet(sender: ZmqFrameSender, receiver: zeromq.ZmqReceiver, *, echoes: bool) -> None:
    """Wait until both have connected, or a minute has passed (TimeoutError): messages before that are lost."""
    until = time.monotonic() + _MAX_START
    while time.monotonic() < until:
        sender.greet()
        receiver.socket.poll(_GREET_EVERY)
        while (parts := receiver.receive()) is not None:
            # A greeting came back, or a status counts it.
            if echoes or (parts[0] == b"status/" and json.loads(parts[1])["inputs"]["received"]):
                return
    raise TimeoutError("ZeroMQ: the recogniser's process was not reached")


@contextmanager
def background_service(
    transport: Transport,
    *,
    library: MotionLibrary | None = None,
    settings: Settings | None = None,
    echoes: bool = False,
    performers: int = 32,
) -> Iterator[Connected]:
    """Start a recogniser, or an echo, in its own process on this machine, and connect to it; end both.

    Parameters
    ----------
    transport
        "osc" or "zmq".
    library
        The library to recognise with; the built-in library when not given.
    settings
        Of the recognisers.
    echoes
        Send every packet back unread instead, to measure the cost of everything around a recogniser.
    performers
        The number of performers at once, at most.

    Raises
    ------
    ValueError
        There is no room for a performer.
    ChildProcessError
        The process ended before it began.
    TimeoutError
        It did not connect within a minute.
    """
    with ExitStack() as opened:
        receiver = opened.enter_context(closing(osc.OscReceiver(LOOPBACK, 0))) if transport == "osc" else None
        terms = None if echoes else Recognising(library, settings or Settings(), performers)
        work = partial(serve, receiver.address[1] if receiver else 0, terms)
        child = opened.enter_context(closing(Child("recogniser", work, max_end=_MAX_END)))
        _, frames_to, answers_at = child.said.split(" ")
        if receiver:
            sender = opened.enter_context(closing(OscFrameSender(*host_and_port(frames_to))))
            yield Connected(child.process.pid or 0, sender, receiver)
            return
        peer = opened.enter_context(closing(ZmqFrameSender(Endpoint(frames_to, bind=False))))
        answers = opened.enter_context(closing(zeromq.ZmqReceiver(Endpoint(answers_at, bind=False))))
        _meet(peer, answers, echoes=echoes)
        yield Connected(child.process.pid or 0, peer, answers)
