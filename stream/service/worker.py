"""A worker: an ordinary service in a process of its own, whose frames come from a gateway and whose answers go back.

Performers of another worker come with the frames of their last seconds, so that the windows and averages here are soon
like those there. Messages are in msgpack.
"""

import gc
import math
import queue
import threading
import time
from collections.abc import Sequence
from multiprocessing import parent_process
from multiprocessing.reduction import ForkingPickler
from typing import Annotated, Any, NamedTuple

import msgspec
import numpy as np
import zmq

from kinespace.library import MotionLibrary, WindowIndex
from kinespace.stream.frame import Admitted, Announcement, Frame, NewSender
from kinespace.stream.inputs.source import TENDING
from kinespace.stream.outputs.sink import Sink
from kinespace.stream.packet import IdleSource
from kinespace.stream.recognition import Recognition
from kinespace.stream.recognizer import Performers, Recognizer, RecognizerCounts, SentJoints, Settings
from kinespace.stream.recognizer.performers import PerformerCounts
from kinespace.stream.recognizer.settings import index_for
from kinespace.stream.service.background import BackgroundViews, leave_signals_to_parent
from kinespace.stream.service.loop import Service
from kinespace.stream.status import InputCounts

_FLOATS: np.dtype[np.floating] = np.dtype("<f4")
_DOUBLES: np.dtype[np.floating] = np.dtype("<f8")
_Count = Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)]


class SentFrame(msgspec.Struct, array_like=True, gc=False):
    """A frame on its way to a worker.

    Attributes
    ----------
    positions, doubles
        Numbers of three for each joint, little-endian, and whether they are doubles.
    joints
        Their names; None where they are as before.
    begins
        Whether the performer begins: the worker forgets an earlier performer of this name.
    """

    performer: str
    time: float
    positions: bytes
    doubles: bool = False
    joints: tuple[str, ...] | None = None
    begins: bool = False

    @classmethod
    def of(cls, frame: Frame) -> "SentFrame":
        """Make the message of a frame; positions keep their precision."""
        doubles = frame.positions.dtype.itemsize == _DOUBLES.itemsize
        positions = frame.positions.astype(_DOUBLES if doubles else _FLOATS, copy=False)
        return cls(frame.performer, frame.time, positions.tobytes(), doubles)

    def events(self) -> list[Admitted]:
        """Give the frame, behind what it says of its performer."""
        positions = np.frombuffer(self.positions, _DOUBLES if self.doubles else _FLOATS).reshape(-1, 3)
        named = [] if self.joints is None else [Announcement(self.performer, self.joints)]
        begun = [NewSender(self.performer)] if self.begins else []
        return [*begun, *named, Frame(self.performer, self.time, positions)]


class Orders(msgspec.Struct, omit_defaults=True):
    """Frames for a worker.

    Attributes
    ----------
    frames
        Frames to be answered, in order.
    seen
        Frames of the last seconds of a performer, all or all but the newest of which another worker has answered.
    at
        When the message was sent, seconds on the machine's clock; 0 for one that is late by its nature.
    """

    frames: list[SentFrame] = []
    seen: list[SentFrame] = []
    at: float = 0.0


class Report(msgspec.Struct, array_like=True, frozen=True):
    """A worker's counters; it also shows that the worker is alive.

    Attributes
    ----------
    counts
        Counts of its frames, without those that another worker has answered.
    refused, doubted, compared
        The same as in `Performers`.
    stale
        Frames that were dropped because the worker was busy.
    """

    counts: PerformerCounts
    refused: dict[str, str] = {}
    doubted: dict[str, str] = {}
    compared: dict[str, str] = {}
    stale: _Count = 0


class Answers(msgspec.Struct, array_like=True, frozen=True):
    """A worker's answers, in order, and from time to time its report, which travel together."""

    answers: list[Recognition] = []
    report: Report | None = None


def _encoded(value: object) -> object:
    """Encode numbers of numpy's."""
    return value.astype(_DOUBLES, copy=False).tobytes() if isinstance(value, np.ndarray) else float(value)  # type: ignore[arg-type]


def _decoded(_: object, value: Any) -> object:  # noqa: ANN401 - of any message
    """Decode a recognition's scores; no other field is of a kind that msgspec does not know."""
    return np.frombuffer(value, _DOUBLES)


encode = msgspec.msgpack.Encoder(enc_hook=_encoded).encode
decode_orders = msgspec.msgpack.Decoder(Orders).decode
decode_answers = msgspec.msgpack.Decoder(Answers, dec_hook=_decoded).decode


#: Seconds between two reports.
REPORT_EVERY = 0.25
#: Seconds of the frames shown in which windows are compared, too: the windows before are shorter than the former
#: worker's, and would only mislead the averages.
_COMPARED = 0.5
#: Longest sleep while nothing comes, seconds.
_MAX_SLEEP = 0.1


class Terms(NamedTuple):
    """What the recognisers of all workers have in common; as for `Performers`."""

    settings: Settings
    most: int
    joints: SentJoints = SentJoints()
    classes: tuple[str, ...] = ()
    silence: float = 5.0


def work(name: str, place: str) -> None:
    """Work until the gateway's process is gone; runs in a process of its own.

    Parameters
    ----------
    name
        The worker's name, which only the gateway knows.
    place
        The gateway's endpoint.
    """
    leave_signals_to_parent(termination=True)
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    socket = context.socket(zmq.DEALER)
    socket.linger, socket.identity = 0, name.encode()
    socket.connect(place)
    # The gateway answers a first word with the library.
    socket.send(b"")
    worker = Worker(socket, *_opened(socket.recv_multipart()))
    gc.freeze()
    worker.run()


def _opened(parts: list[bytes]) -> tuple[WindowIndex | None, Terms]:
    """Open a library, and prepare what all recognisers share, which may take a second; None: it is as it was."""
    library: MotionLibrary | WindowIndex | None
    terms: Terms
    library, terms = (ForkingPickler.loads(part) for part in parts[1:])
    if library is None:
        return None, terms
    index = index_for(library, terms.settings)
    Recognizer(index, terms.settings)
    return index, terms


class Worker(Sink, IdleSource):
    """The source of a service, and its sink.

    Parameters
    ----------
    socket
        The way to the gateway.
    index, terms
        For the recognisers.
    """

    tended_within = TENDING

    def __init__(self, socket: zmq.Socket[bytes], index: WindowIndex | None, terms: Terms) -> None:
        self.pollable = socket
        self._performers = Performers(
            index or MotionLibrary.builtin(),
            terms.settings,
            most=terms.most,
            # The gateway drops a silent performer; a worker may forget it later.
            silence=2 * terms.silence,
            joints=terms.joints,
            views=BackgroundViews(),
            classes=terms.classes,
        )
        self.service = Service(self._performers, [self], [self])
        self.counts = InputCounts()
        self._answers, self._next_report = list[Recognition](), 0.0
        #: Counts of the frames that were only shown, which the former worker has counted, too.
        self._shown = RecognizerCounts()
        #: Libraries that come and libraries that are open: no frame waits for the thread between.
        self._came: queue.SimpleQueue[list[bytes]] = queue.SimpleQueue()
        self._open: queue.SimpleQueue[tuple[WindowIndex | None, Terms]] = queue.SimpleQueue()
        threading.Thread(target=self._open_all, name="kinespace opening", daemon=True).start()

    def run(self) -> None:
        """Work until the gateway's process is gone."""
        parent = parent_process()
        while parent is None or parent.is_alive():
            self.service.step(_MAX_SLEEP)

    def _open_all(self) -> None:
        while True:
            self._open.put(_opened(self._came.get()))

    def publish_recognition(self, recognition: Recognition) -> None:
        """Keep an answer until no message waits, or until the next one is taken in."""
        self._answers.append(recognition)

    def take(self, arrival: float) -> Sequence[Admitted] | None:
        """Deal with a message; give its frames that are to be answered, or None when no message waits."""
        self.tend(arrival)
        try:
            parts = self.pollable.recv_multipart(zmq.NOBLOCK)
        except zmq.Again:
            self.lag = 0.0
            return None
        if len(parts) > 1:
            self._came.put(parts)
            return ()
        orders = decode_orders(parts[0])
        if orders.at:
            self.lag = self.waited = max(arrival - orders.at, 0.0)
        if orders.seen:
            self._follow([event for each in orders.seen for event in each.events()])
        events = [event for each in orders.frames for event in each.events()]
        if self.waited <= self.patience:
            return events
        kept = [event for event in events if not isinstance(event, Frame)]
        self.counts.stale += len(events) - len(kept)
        return kept

    def tend(self, now: float) -> Sequence[Admitted]:
        """Go on with another library that is open; send the answers that wait, and from time to time a report."""
        while not self._open.empty():
            index, terms = self._open.get()
            if index is not None:
                self._performers.exchange(index, terms.classes)
            if terms.settings.sensitivity is not None:
                self._performers.set_sensitivity(terms.settings.sensitivity)
        if self._answers or now >= self._next_report:
            report = self._report(now) if now >= self._next_report else None
            answers, self._answers = self._answers, []
            try:
                self.pollable.send(encode(Answers(answers, report)), zmq.NOBLOCK)
            except zmq.Again:
                self.failed += 1
        return ()

    def _report(self, now: float) -> Report:
        self._next_report = now + REPORT_EVERY
        performers, counts = self._performers, self._performers.counts
        counts.recognizers.add(self._shown, -1)
        stale = self.service.status().inputs.stale
        return Report(counts, performers.refused, performers.doubted, performers.compared, stale)

    def _follow(self, seen: list[Admitted]) -> None:
        """Follow frames that another worker has answered; compare those of the last second."""
        before, now = self._performers.counts.recognizers, time.monotonic()
        times = [each.time if isinstance(each, Frame) else -math.inf for each in seen]
        older = next(place for place, moment in enumerate(times) if moment >= times[-1] - _COMPARED)
        self._performers.push_all(seen[:older], now, newest_only=True)
        self._performers.push_all(seen[older:], now)
        self._shown.add(self._performers.counts.recognizers)
        self._shown.add(before, -1)
