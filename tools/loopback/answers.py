"""The answers of a recogniser, or of an echo: received, each at its moment, and expected, computed beforehand."""

from __future__ import annotations

import json
import time
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from typing import NamedTuple

import zmq

from kinespace.library import MotionLibrary
from kinespace.stream import osc, zeromq
from kinespace.stream.osc.packet import PacketError, decode_packet
from kinespace.stream.recognition import Answer
from kinespace.stream.recognizer import Recognizer, Settings
from kinespace.tools.cli.entry import check_interrupted
from kinespace.tools.feeding.feed import Cue, Packet

#: The poller counts milliseconds; the rest of a millisecond is slept in pieces of these seconds.
_SHORT_SLEEP = 5e-5
#: Milliseconds of the longest wait: the program ends within this time.
_MAX_WAIT = 100

#: Scores agree to the digits that every transport carries.
_SAME_SCORE = 1e-5

Receiver = osc.OscReceiver | zeromq.ZmqReceiver


class Received(NamedTuple):
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

    def listen_until(self, moment: float) -> list[Received]:
        """Collect packets until a `time.perf_counter` reading; at least once, even when that is past."""
        received = list[Received]()
        while True:
            check_interrupted()
            remaining = moment - time.perf_counter()
            if self._poller.poll(min(_MAX_WAIT, max(0, int(remaining * 1000)))):
                for receiver in self._receivers:
                    while (packet := receiver.receive()) is not None:
                        received.append(Received(receiver, packet, time.perf_counter()))
            elif remaining <= 0:
                return received
            elif remaining < 1e-3:
                time.sleep(min(remaining, _SHORT_SLEEP))

    def close(self) -> None:
        """Give the sockets back."""
        for receiver in self._receivers:
            receiver.close()


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
