"""The innocent performer: a thread that sends frames on schedule and notes when each was sent and answered."""

import json
import math
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from itertools import count
from typing import NamedTuple

import numpy as np
from chaos.attacks import INNOCENT, Place
from numpy.typing import NDArray

from kinespace.library.naming.hdm05 import SKELETON
from kinespace.stream import Announcement, Frame
from kinespace.stream.zeromq import Endpoint, ZmqReceiver
from kinespace.tools.feeding.feed import Cue, OscFrameSender, ZmqFrameSender
from kinespace.tools.feeding.service import Listener, Played, play

#: Makes faulty cues of the intended cues of a feed.
Fault = Callable[[list[Cue]], list[Cue]]

FRAME_RATE, ANSWER_RATE = 120.0, 30.0
_STATUS = b"status/"
NAMES = Announcement(INNOCENT, SKELETON.joints)
#: Seconds of answers that show that all is well again, and the share of them that must have come in time.
_WELL, _WELL_SHARE, _WELL_LATENCY = 0.5, 0.9, 0.05


class Performance(NamedTuple):
    """What was sent and received; moments as `time.perf_counter` reads them.

    Attributes
    ----------
    begun
        When the schedule began.
    sent
        When each frame was sent, by the time in it.
    came
        When the first answer to each frame came, by the time in the frame.
    """

    begun: float
    sent: dict[float, float]
    came: dict[float, float]

    @classmethod
    def of(cls, cues: Sequence[Cue], played: Played) -> "Performance":
        """Read the answers to cues, of which the last ones may not have been sent; of frames sent twice the first."""
        answers = [(json.loads(each.packet[1]), each.arrival) for each in played.received if each.packet[0] != _STATUS]
        moments = [(cue.frame.time, at) for cue, at in zip(cues, played.sent[0], strict=False)]
        came = {said["t"]: arrival for said, arrival in reversed(answers) if "t" in said}
        return cls(played.begun, dict(reversed(moments)), came)

    def latencies(self, begin: float, end: float) -> NDArray[np.float64]:
        """Give the seconds from each frame to its answer, for frames sent between two moments of the schedule."""
        due = ((self.sent.get(time, math.nan), at) for time, at in self.came.items())
        return np.array([at - sent for sent, at in due if begin <= sent - self.begun < end])

    def recovery(self, end: float) -> float:
        """Give the seconds from a moment of the schedule until answers come as they should; infinite for never."""
        last = max(self.sent.values(), default=0.0) - self.begun
        for moment in np.arange(end, last - _WELL, 0.05).tolist():
            latencies = self.latencies(moment, moment + _WELL)
            if np.count_nonzero(latencies < _WELL_LATENCY) >= _WELL_SHARE * _WELL * ANSWER_RATE:
                return float(moment - end)
        return math.inf


def cues_of(positions: NDArray[np.float32], begin: float = 1.0) -> list[Cue]:
    """Cue positions, shape (frames, 31, 3), metres, 120 a second; the first frame has this time."""
    frames = (Frame(INNOCENT, begin + k / FRAME_RATE, each) for k, each in enumerate(positions))
    return [Cue(k / FRAME_RATE, frame) for k, frame in enumerate(frames)]


def stream(  # noqa: PLR0913, PLR0917 - who performs what, where, how fast and how long
    place: Place,
    name: str,
    ended: threading.Event,
    positions: NDArray[np.float32],
    rate: float,
    seconds: float = math.inf,
) -> None:
    """Send positions again and again by OSC, joints once a second, for some seconds or until the end."""
    begun = time.monotonic()
    with closing(OscFrameSender(*place.osc)) as sender:
        for number in count():
            if number % round(rate) == 0:
                sender.announce(Announcement(name, SKELETON.joints))
            now = time.monotonic()
            sender.send(sender.encode(Frame(name, now, positions[number % len(positions)])))
            if now > begun + seconds or ended.wait(1 / rate):
                return


class Performer:
    """Plays cues over "osc" or "zmq" in a thread, and names its joints every second, until `end`."""

    def __init__(self, place: Place, cues: Sequence[Cue], over: str) -> None:
        answers = ZmqReceiver(Endpoint(place.answers, bind=False), f"class/{INNOCENT}/".encode())
        answers.socket.subscribe(_STATUS)
        self._listener, self._cues = Listener(answers), cues
        to_zmq = Endpoint(place.frames, bind=False)
        self._sender = ZmqFrameSender(to_zmq) if over == "zmq" else OscFrameSender(*place.osc)
        self._ended, self._thread = threading.Event(), ThreadPoolExecutor(1)

    def begin(self) -> float:
        """Begin once answers can come; give the moment, by `time.perf_counter`."""
        # The first status says that this subscriber is known.
        while not any(each.packet[0] == _STATUS for each in self._listener.listen_until(time.perf_counter() + 0.05)):
            pass
        self._played = self._thread.submit(play, self._until_ended(), [self._sender], self._listener)
        return time.perf_counter()

    def _until_ended(self) -> Iterator[Cue]:
        announced = -1.0
        for cue in self._cues:
            if self._ended.is_set():
                return
            if cue.due >= announced + 1.0:
                announced = cue.due
                self._sender.announce(NAMES)
            yield cue

    def end(self) -> Performance:
        """Stop; give what was sent and received."""
        self._ended.set()
        with self._thread, closing(self._sender), closing(self._listener):
            return Performance.of(self._cues, self._played.result())
