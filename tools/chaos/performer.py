"""The innocent performer: a process that sends frames on schedule and notes when each was sent and answered."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, Self

import msgspec
import numpy as np

from kinespace.stream import osc, zeromq
from kinespace.stream.frame import Announcement, Frame
from kinespace.stream.zeromq import Endpoint, ZmqReceiver
from kinespace.tools.chaos.attacks import INNOCENT
from kinespace.tools.feeding.feed import Cue
from kinespace.tools.loopback.answer_listener import Listener

if TYPE_CHECKING:
    from collections.abc import Sequence
    from multiprocessing.connection import Connection

    from numpy.typing import NDArray

    from kinespace.tools.chaos.attacks import Place

FRAME_RATE = 120.0
ANSWER_RATE = 30.0
#: Seconds within which the performer's process must have begun.
_MAX_START = 60.0
#: Makes faulty cues of the intended cues of a feed.
Fault = Callable[[list[Cue]], list[Cue]]


class Sent(NamedTuple):
    """A packet of the schedule: when it is due, the time in its frame, and its bytes."""

    due: float
    time: float
    parts: list[bytes]


class Answer(NamedTuple):
    """An answer: the time of its frame, when it came, and the joints that it doubts."""

    time: float
    arrival: float
    doubted: bool


@dataclass(frozen=True, slots=True)
class Performance:
    """The frames sent and answers heard; moments as `time.perf_counter` reads them, which all processes share.

    Attributes
    ----------
    begun
        When the schedule began.
    sent
        When each frame was sent, by the time in it; for frames sent twice the first.
    answers
        In the order in which they came.
    told
        The last status.
    """

    begun: float
    sent: dict[float, float]
    answers: list[Answer]
    told: dict[str, object]

    def latencies(self, begin: float, end: float) -> NDArray[np.float64]:
        """Give the seconds from each frame to its answer, for frames sent between two moments of the schedule."""
        found: dict[float, float] = {}
        for answer in self.answers:
            at = self.sent.get(answer.time)
            if at is not None and begin <= at - self.begun < end:
                found.setdefault(answer.time, answer.arrival - at)
        return np.array(list(found.values()))

    def late(self, seconds: float) -> int:
        """Count the answers that came more than some seconds after their frame."""
        return sum(each.arrival - self.sent.get(each.time, each.arrival) > seconds for each in self.answers)

    def answered(self, begin: float, end: float) -> int:
        """Count the answers to frames that were sent between two moments of the schedule."""
        return len(self.latencies(begin, end))


def schedule(
    positions: NDArray[np.float32],
    joints: Sequence[str],
    *,
    befalls: tuple[float, float, Fault] | None,
    over: str,
    begin: float = 0.0,
) -> list[Sent]:
    """Make the packets of a feed.

    Parameters
    ----------
    positions
        Positions of each frame, shape (frames, joints, 3), metres, 120 a second.
    joints
        Their names, announced every second.
    befalls
        The seconds from and until which a fault affects the feed, and the fault; None for no fault.
    over
        "osc" or "zmq".
    begin
        The time in the first frame but one second.
    """
    first = 1.0 + begin
    cues = [Cue(k / FRAME_RATE, Frame(INNOCENT, first + k / FRAME_RATE, each), k) for k, each in enumerate(positions)]
    if befalls:
        start, end = (round(moment * FRAME_RATE) for moment in befalls[:2])
        cues = [*cues[:start], *befalls[2](cues[start:end]), *cues[end:]]
    announcement = Announcement(INNOCENT, tuple(joints))
    packets: list[Sent] = []
    announced = -1.0
    for cue in cues:
        again = cue.due >= announced + 1.0
        announced = cue.due if again else announced
        if over == "zmq":
            parts = zeromq.encode_frame(cue.frame, cue.seq, announcement.joints if again else None)
            packets.append(Sent(cue.due, cue.frame.time, parts))
            continue
        if again:
            packets.append(Sent(cue.due, float("nan"), [osc.encode_announcement(announcement)]))
        packets.append(Sent(cue.due, cue.frame.time, [osc.encode_frame(cue.frame)]))
    return packets


class Performer:
    """A performer in a process of its own; a context manager.

    Parameters
    ----------
    place
        The recogniser's addresses.
    packets
        As `schedule` makes them.
    over
        "osc" or "zmq".
    """

    def __init__(self, place: Place, packets: Sequence[Sent], over: str) -> None:
        context = multiprocessing.get_context("spawn")
        self._connection, self._theirs = context.Pipe()
        arguments = (self._theirs, place, list(packets), over)
        self._process = context.Process(target=_perform, args=arguments, daemon=True)

    def __enter__(self) -> Self:
        self._process.start()
        self._theirs.close()
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.join()
        self._connection.close()

    def begin(self) -> float:
        """Let the performer begin once answers can be heard; give the moment, by `time.perf_counter`."""
        self._connection.send(None)
        if not self._connection.poll(_MAX_START):
            raise TimeoutError("the performer's process did not meet the recogniser")
        begun: float = self._connection.recv()
        return begun

    def end(self) -> Performance:
        """Let the performer stop, and give its frames and answers."""
        self._connection.send(None)
        performance: Performance = self._connection.recv()
        return performance


def _perform(connection: Connection, place: Place, packets: Sequence[Sent], over: str) -> None:
    """Run in the performer's process."""
    connection.recv()
    answers = ZmqReceiver(Endpoint(place.answers, bind=False), f"class/{INNOCENT}/".encode())
    answers.socket.subscribe(b"status/")
    sender = zeromq.ZmqSender(Endpoint(place.frames, bind=False)) if over == "zmq" else osc.OscSender(*place.osc)
    with closing(Listener(answers)) as listener, closing(sender):
        while not any(each.packet[0] == b"status/" for each in listener.listen_until(time.perf_counter() + 0.05)):
            pass
        heard, sent, begun = [], dict[float, float](), time.perf_counter()
        connection.send(begun)
        for packet in packets:
            if connection.poll():
                break
            heard += listener.listen_until(begun + packet.due)
            # Before the call, because the answer may be on its way before the call returns.
            sent.setdefault(packet.time, time.perf_counter())
            sender.send(packet.parts if over == "zmq" else packet.parts[0])  # type: ignore[arg-type]  # of its kind
        while not connection.poll():
            heard += listener.listen_until(time.perf_counter() + 0.05)
        connection.recv()
    told: dict[str, object] = {}
    replies = list[Answer]()
    for each in heard:
        topic, said = bytes(each.packet[0]), msgspec.json.decode(bytes(each.packet[1]))
        if topic == b"status/":
            told = said
        elif topic == f"class/{INNOCENT}/".encode() and "t" in said:
            replies.append(Answer(said["t"], each.arrival, bool(said["doubted"]) or said["outcome"] == "implausible"))
    connection.send(Performance(begun, sent, replies, told))
