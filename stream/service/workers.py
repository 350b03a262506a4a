"""Workers: processes of this machine that recognise; a gateway sends them frames, and their answers come back.

The gateway keeps the last seconds of each performer's frames. When a worker dies, hangs or comes, another one is shown
these, and goes on, so that its windows and averages are soon like those there: no worker knows that there are others. A
worker is an ordinary service, whose frames come from the gateway and whose answers go back. They talk by ZeroMQ in
msgpack, on an endpoint of this machine; each worker has a name that nobody else knows.
"""

import gc
import itertools
import math
import multiprocessing
import secrets
import sys
import tempfile
import time
from collections import Counter, deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from multiprocessing.reduction import ForkingPickler
from typing import Annotated, Any, NamedTuple

import msgspec
import zmq

from kinespace.library import MotionLibrary, Skeleton, WindowIndex
from kinespace.library.motion_library import MIN_JOINTS
from kinespace.library.naming import hdm05
from kinespace.library.windows.remembered import decoded_numbers, encoded_numbers
from kinespace.stream.frame import Admitted, Announcement, Frame, NewSender
from kinespace.stream.outputs.sink import Sink
from kinespace.stream.packet import IdleSource, remember
from kinespace.stream.present import MAX_REMEMBERED, Present
from kinespace.stream.recognition import Event, Recognition
from kinespace.stream.recognizer import Performers, Recognizer, SentJoints, Settings
from kinespace.stream.recognizer.decision import Events
from kinespace.stream.recognizer.recognizer import require_order
from kinespace.stream.recognizer.settings import index_for, needed_lead, sensitivity_for
from kinespace.stream.service.background import BackgroundViews, leave_signals_to_parent, signals_held
from kinespace.stream.service.loop import TENDING, Service
from kinespace.stream.status import InputCounts, PerformerCounts, RecognizerCounts

_Count = Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)]


class SentFrame(msgspec.Struct, array_like=True, gc=False):
    """A frame on its way to a worker.

    Attributes
    ----------
    joints
        The names of its joints; None where they are as before.
    begins
        Whether the performer begins: the worker forgets an earlier performer of this name.
    """

    frame: Frame
    joints: tuple[str, ...] | None = None
    begins: bool = False

    def events(self) -> list[Admitted]:
        """Give the frame, behind what it says of its performer."""
        performer = self.frame.performer
        named = [] if self.joints is None else [Announcement(performer, self.joints)]
        begun = [NewSender(performer)] if self.begins else []
        return [*begun, *named, self.frame]


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


encode = msgspec.msgpack.Encoder(enc_hook=encoded_numbers).encode
decode_orders = msgspec.msgpack.Decoder(Orders, dec_hook=decoded_numbers).decode
decode_answers = msgspec.msgpack.Decoder(Answers, dec_hook=decoded_numbers).decode


class Terms(NamedTuple):
    """What the recognisers of all workers have in common; as for `Performers`."""

    settings: Settings
    most: int
    joints: SentJoints = SentJoints()
    classes: tuple[str, ...] = ()
    silence: float = 5.0


#: Seconds without a report after which a worker counts as gone; it joins again when it wakes.
MAX_SILENT = 0.8
#: Seconds between two looks at the workers, above which this process itself was stopped for a while.
_STOPPED = 0.4
#: Seconds in which the last frames are answered and counted at the end.
_MAX_ENDING = 1.0
#: Seconds without an answer after which a performer makes room for a newcomer.
_UNHEARD = 1.0
#: Seconds in which a new worker must be ready, and in which one that was left out must come back before it is killed.
MAX_START, _MAX_ABSENT = 60.0, 2.0
#: Seconds between two starts of a worker that ends soon after it was started.
_PAUSE = 1.0
#: Seconds of frames that another worker is shown before those that it answers: the longest window.
HISTORY = 2.0
#: Seconds after which a frame that nobody has answered is only shown: it took so long until the worker was missed.
DUE = 1.5
#: Seconds after which the joints are sent again: a message may be lost.
_JOINTS_EVERY = 1.0


class Kept(NamedTuple):
    """A frame that was sent: its number among the performer's frames, when its packet came, and its message."""

    number: int
    arrival: float
    sent: SentFrame


@dataclass(slots=True)
class Track:
    """The frames of a performer that were sent to workers, and the answers that came back.

    Attributes
    ----------
    newest, answered_at
        When the newest frame came, and the newest that was answered; before the first answer, when the performer came.
    events
        Gives the events: only the gateway knows of all answers, so that each motion starts and ends once.
    worker
        The worker that answers; empty for none.
    number, answered
        The numbers of the newest frame and of the last one answered; 0 for none.
    """

    newest: float
    answered_at: float
    events: Events
    worker: str = ""
    number: int = 0
    answered: int = 0
    _joints: tuple[str, ...] | None = None
    _joints_due: float = 0.0
    #: Never empty behind the first `send`, which a performer begins with.
    _kept: deque[Kept] = field(default_factory=deque)

    def send(self, frame: Frame, joints: tuple[str, ...] | None) -> SentFrame:
        """Make the message of the newest frame; it has the joints from time to time."""
        sent, now = SentFrame(frame), self.newest
        if joints != self._joints or now >= self._joints_due:
            sent.joints, self._joints, self._joints_due = joints, joints, now + _JOINTS_EVERY
        sent.begins = not self.number
        self.number += 1
        self._kept.append(Kept(self.number, now, sent))
        while self._kept[0].arrival < now - HISTORY - DUE:
            self._kept.popleft()
        return sent

    def accept(self, answer: Recognition, classes: Sequence[str]) -> tuple[Recognition, float] | None:
        """Take in an answer; give it with its events, and the arrival of its frame.

        Parameters
        ----------
        answer
            The answer of the performer's worker.
        classes
            The classes now; an answer by others, after an exchange, starts no motion.

        Returns
        -------
        None for an answer that is no news: its frame was answered before, or is unknown.
        """
        for kept in reversed(self._kept):
            if kept.number <= self.answered:
                return None
            if kept.sent.frame.time == answer.time:
                break
        else:
            return None
        self.answered, self.answered_at = kept.number, kept.arrival
        decide = self.events.push if answer.classes == classes else self.events.ends
        return replace(answer, events=decide(answer)), kept.arrival

    def is_idle(self, now: float) -> bool:
        """Say whether no answer has come for some time."""
        return now - self.answered_at >= _UNHEARD

    def end(self) -> Event | None:
        """End the motion that goes on."""
        return self.events.end(self._kept[-1].sent.frame.time)

    def exchange(self, classes: Sequence[str], lead: float) -> Event | None:
        """Go on with other classes, and the lead that they need; end the motion that goes on if its class is gone."""
        return self.events.exchange(classes, lead, self._kept[-1].sent.frame.time)

    def past(self, joints: tuple[str, ...] | None, now: float) -> tuple[list[SentFrame], list[SentFrame]]:
        """Give the frames that another worker is shown, and those that it answers."""
        kept = [each for each in self._kept if each.arrival >= self.answered_at - HISTORY]
        seen = [each.sent for each in kept if each.number <= self.answered or each.arrival < now - DUE]
        due = [each.sent for each in kept[len(seen) :]]
        for first in (seen or due)[:1]:
            (seen or due)[0] = msgspec.structs.replace(first, begins=True, joints=joints)
        return seen, due


@dataclass(slots=True)
class _Process:
    """A worker's process: when it was started, and since when it is not ready; its last report, and when that came."""

    process: Any
    begun: float
    absent_from: float
    report: Report | None = None
    #: Whether it has asked for the library: from then on it hears of others, also while it opens the first.
    has_asked: bool = False
    newest: float = 0.0
    reports: int = 0


def _told(what: str) -> property:
    """Make a property of a gateway of what its workers report by performer."""
    return property(lambda self: {name: why for each in self._reports for name, why in getattr(each, what).items()})


class Gateway(Present[Track]):
    """Takes the place of `Performers`.

    Parameters
    ----------
    count
        How many workers.
    library
        Motions to compare with.
    terms
        For the recognisers.

    Attributes
    ----------
    terms
        The terms now.
    source
        Where the workers' messages come in; the service reads and closes it.
    publish
        Gets each answer, and for how many seconds its frame has waited for it.
    outdated
        Answers that were not passed on: of former workers, or to performers who have left.
    unsent
        Frames that no worker got, because there was none, or because it takes none.

    Raises
    ------
    ChildProcessError
        A worker ended before it was ready.
    TimeoutError
        A worker was not ready within a minute.
    """

    def __init__(self, count: int, library: MotionLibrary | WindowIndex, terms: Terms) -> None:
        super().__init__(terms.most, terms.silence)
        self.terms = terms
        self._know(library, terms.classes)
        self.publish: Callable[[Recognition, float], None] = lambda *_: None
        self.outdated = self.unsent = 0
        # A sender may announce its joints once, so announcements are kept through a silence.
        self._announced: dict[str, tuple[str, ...]] = {}
        #: The processes by their names; those that recognise have sent a report.
        self._workers: dict[str, _Process] = {}
        self._numbers = itertools.count(1)
        #: The counts of workers that have ended.
        self._past = Report(PerformerCounts())
        self._lost = 0
        self._last_lost, self._looked = "", time.monotonic()
        with ExitStack() as opened:
            # Only this user can open the folder. Windows has no such sockets.
            folder = opened.enter_context(tempfile.TemporaryDirectory(prefix="kinespace-"))
            context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
            opened.callback(context.destroy, linger=0)
            self.socket = context.socket(zmq.ROUTER)
            self.source = GatewaySource(self)
            self.socket.setsockopt(zmq.ROUTER_MANDATORY, 1)
            self.socket.bind("tcp://127.0.0.1:*" if sys.platform == "win32" else f"ipc://{folder}/gateway")
            self._place = str(self.socket.getsockopt_string(zmq.LAST_ENDPOINT))
            opened.callback(self._kill_all)
            for _ in range(count):
                self._start(time.monotonic())
            self._wait_until_ready()
            self._opened = opened.pop_all()

    def _know(self, library: MotionLibrary | WindowIndex, order: Sequence[str]) -> None:
        motions = library.library if isinstance(library, WindowIndex) else library
        require_order(order, motions)
        self._skeleton, self._packed = motions.skeleton, bytes(ForkingPickler.dumps(library))
        #: The sensitivity of all recognisers.
        self.sensitivity = sensitivity_for(motions, self.settings)
        self._lead = needed_lead(motions, self.settings)
        self.classes = tuple(order) or motions.classes
        self.terms = self.terms._replace(classes=tuple(order))

    # --- as `Performers` ---

    @property
    def settings(self) -> Settings:
        """The settings of all recognisers."""
        return self.terms.settings

    @property
    def promise(self) -> tuple[float, float | None]:
        """False alarms an hour that `done` promises; what is missed the workers know."""
        return self.settings.promised, None

    def set_sensitivity(self, share: float) -> None:
        """Recognise all performers with another sensitivity soon."""
        self.terms = self.terms._replace(settings=replace(self.settings, sensitivity=share))
        self.sensitivity = share
        self._tell_all(bytes(ForkingPickler.dumps(None)))

    def exchange(self, library: MotionLibrary | WindowIndex, order: Sequence[str] = ()) -> list[Event]:
        """Compare all performers with another library soon; end the motions whose class it lacks."""
        self._know(library, order)
        self._tell_all(self._packed)
        return [event for each in self._here.values() if (event := each.exchange(self.classes, self._lead))]

    @property
    def reported(self) -> Report:
        """The sums of all that workers have counted."""
        return _summed([self._past, *self._reports])

    @property
    def counts(self) -> PerformerCounts:
        """Counts of what happened to all frames so far, as far as workers have reported it."""
        return replace(self.reported.counts, no_room=self._counts.no_room, dropped=self._counts.dropped)

    #: What workers tell of performers: why frames are refused, and joints doubted, and by which they are compared.
    refused, doubted, compared = (_told(what) for what in ("refused", "doubted", "compared"))

    def carried(self, name: str) -> None:
        """Give nothing: no worker tells which joints carry an answer, because nearly nobody asks."""

    def skeleton_of(self, name: str) -> Skeleton | None:
        """Give the joints of a performer's frames, by our names where we know them; None for an unknown performer."""
        if name not in self._here:
            return None
        own = self._skeleton if self._skeleton.parents else hdm05.SKELETON
        return own.linked(self._joints_of(name))

    def _joints_of(self, name: str) -> tuple[str, ...]:
        wanted, sent = self._skeleton.joints, self.terms.joints
        return sent.naming.met(self._announced.get(name) or sent.assumed or wanted, wanted).joints

    def ordered(self, frame: Frame) -> Frame | None:
        """Give a frame in the order of the library's joints; None if it has too few joints."""
        wanted, joints = self._skeleton.joints, self._joints_of(frame.performer)
        if len(frame.positions) != len(joints) or len(set(joints).intersection(wanted)) < MIN_JOINTS:
            return None
        if joints == wanted:
            return frame
        return replace(frame, positions=frame.positions[self._skeleton.nearest_from(joints)])

    def end(self) -> list[Event]:
        """Wait for the last answers and counts; give the ends of all motions going on: no more frames will come."""
        # A worker's next report may be under way already; the one behind it counts all that was sent until now.
        until = time.monotonic() + _MAX_ENDING
        last = {name: each.reports + 2 for name, each in self._workers.items()}
        while time.monotonic() < until and any(each.reports < last[name] for name, each in self._workers.items()):
            time.sleep(0.001)
            self.read()
        return super().end()

    def push_all(
        self, events: Sequence[Admitted], arrival: float, *, newest_only: bool = False
    ) -> list[Recognition | None]:
        """Send frames to their workers, in order; their answers go to `publish` later."""
        # The workers see for themselves what has waited.
        del newest_only
        for_worker: dict[str, list[SentFrame]] = {}
        for event in events:
            if isinstance(event, Frame) and (track := self._come(event.performer, arrival)):
                sent = track.send(event, self._announced.get(event.performer))
                for_worker.setdefault(track.worker, []).append(sent)
            elif isinstance(event, Frame):
                self._counts.no_room += 1
            elif isinstance(event, Announcement):
                remember(self._announced, event.performer, event.joints, MAX_REMEMBERED * self.most)
            elif isinstance(event, NewSender):
                self._announced.pop(event.performer, None)
                self._forget(event.performer)
        for worker, frames in for_worker.items():
            if not (worker and self._send(worker, encode(Orders(frames, at=time.monotonic())))):
                self.unsent += len(frames)
        return [None] * len(events)

    def _begin(self, name: str, now: float) -> Track:  # noqa: ARG002 - as any of `Present`
        worker = min(load, key=load.__getitem__) if (load := self._load()) else ""
        return Track(now, now, Events(self._lead), worker)

    # --- workers ---

    @property
    def ready(self) -> list[str]:
        """The workers that recognise."""
        return [name for name, each in self._workers.items() if each.report]

    @property
    def _reports(self) -> list[Report]:
        return [each.report for each in self._workers.values() if each.report]

    def _start(self, now: float) -> None:
        name = f"{next(self._numbers)} {secrets.token_hex(16)}"
        process = multiprocessing.get_context("spawn").Process(target=work, args=(name, self._place), daemon=True)
        # An interrupt after the start and before the assignment would leave a process that nobody ends.
        with signals_held():
            process.start()
            self._workers[name] = _Process(process, now, now + MAX_START)

    def _wait_until_ready(self) -> None:
        until = time.monotonic() + MAX_START
        while len(self.ready) < len(self._workers):
            ended = [name for name, each in self._workers.items() if not each.process.is_alive()]
            if ended:
                raise ChildProcessError(f"worker {_named(ended[0])} ended before it was ready")
            if time.monotonic() > until:
                raise TimeoutError(f"the workers were not ready within {MAX_START:g} s")
            time.sleep(0.005)
            self.read()

    def _load(self) -> dict[str, int]:
        """Count the performers of each worker."""
        counts = Counter(each.worker for each in self._here.values())
        return {worker: counts[worker] for worker in self.ready}

    def _balance(self, now: float) -> None:
        """Give each performer without a worker to the one with the fewest, and one performer of the one with most."""
        if not (load := self._load()):
            return
        most = max(load, key=load.__getitem__)
        spared = most if load[most] > min(load.values()) + 1 else None
        for name, track in self._here.items():
            if track.worker in load and track.worker != spared:
                continue
            if track.worker == spared:
                spared = None
                load[most] -= 1
            track.worker = least = min(load, key=load.__getitem__)
            load[least] += 1
            seen, due = track.past(self._announced.get(name), now)
            self._send(least, encode(Orders(due, seen)))

    def _send(self, worker: str, *parts: bytes) -> bool:
        """Send a message to a worker; say whether there is room on the way to it."""
        try:
            self.socket.send_multipart([worker.encode(), *parts], zmq.NOBLOCK)
        except zmq.ZMQError:
            return False
        return True

    def _tell_all(self, library: bytes) -> None:
        """Tell all workers of another library, and of the terms."""
        for worker in (name for name, each in self._workers.items() if each.has_asked):
            self._send(worker, b"", library, bytes(ForkingPickler.dumps(self.terms)))

    def _drop(self, worker: str, report: Report, why: str) -> None:
        """Take its performers from a worker, and keep the counts of its last report."""
        self._past, self._workers[worker].report = _summed([self._past, report]), None
        self._lost, self._last_lost = self._lost + 1, f"worker {_named(worker)} {why}"
        for track in self._here.values():
            track.worker = "" if track.worker == worker else track.worker

    def read(self) -> None:
        """Read the messages that have come."""
        while True:
            try:
                name, message = self.socket.recv_multipart(zmq.NOBLOCK)
            except zmq.Again:
                return
            worker, now = name.decode(errors="replace"), time.monotonic()
            each = self._workers.get(worker)
            if each and not message:
                # Its first word: it needs the library.
                each.has_asked = True
                self._send(worker, b"", self._packed, bytes(ForkingPickler.dumps(self.terms)))
            elif each:
                back = decode_answers(message)
                each.newest, each.report = now, back.report or each.report
                each.reports += back.report is not None
                for answer in back.answers:
                    self._accept(worker, answer, now)

    def _accept(self, worker: str, answer: Recognition, now: float) -> None:
        """Pass on an answer, if it is its performer's worker's, and news."""
        track = self._here.get(answer.performer)
        if track and track.worker == worker and (accepted := track.accept(answer, self.classes)):
            recognition, arrival = accepted
            self.publish(recognition, max(now - arrival, 0.0))
        else:
            self.outdated += 1

    @property
    def notes(self) -> list[str]:
        """Notes for a person, a line each."""
        counts = {"frames that no worker took": self.unsent, "answers late or of lost workers": self.outdated}
        lost = [f"workers lost so far: {self._lost}; last: {self._last_lost}"] if self._lost else []
        return [f"workers: {len(self.ready)}", *(f"{count} {what}" for what, count in counts.items() if count), *lost]

    def tend(self, now: float) -> None:
        """Read messages; drop workers that do not report, kill those that hang, start others; move a performer."""
        self.read()
        was_stopped, self._looked = now - self._looked > _STOPPED, now
        for name, each in [*self._workers.items()]:
            each.newest = max(each.newest, now - MAX_SILENT / 2) if was_stopped else each.newest
            alive = each.process.is_alive()
            if each.report and not (alive and now - each.newest <= MAX_SILENT):
                self._drop(name, each.report, "does not report" if alive else "is gone")
            if each.report:
                each.absent_from = now
            elif now - each.absent_from > _MAX_ABSENT:
                each.process.kill()
            # A worker that ends at its start is not started without pause.
            if not alive and now - each.begun > _PAUSE:
                del self._workers[name]
                self._start(now)
        self._balance(now)

    def _kill_all(self) -> None:
        for each in self._workers.values():
            each.process.kill()
            each.process.join()
        self._workers.clear()

    def close(self) -> None:
        """End the workers; without effect a second time."""
        self._opened.close()


class GatewaySource(IdleSource):
    """The messages of all workers, as a source of the service; no frames come in here."""

    def __init__(self, gateway: Gateway) -> None:
        self.gateway, self.pollable = gateway, gateway.socket

    @property
    def counts(self) -> InputCounts:
        """Counts of what was dropped on the way to recognisers."""
        return InputCounts(stale=self.gateway.reported.stale)

    @property
    def notes(self) -> list[str]:  # type: ignore[override]  # they change
        """Notes for a person, a line each."""
        return self.gateway.notes

    def take(self, arrival: float) -> None:  # noqa: ARG002 - as any source
        """Read the messages that have come; they hold no frames."""
        self.gateway.read()

    def tend(self, now: float) -> Sequence[Admitted]:
        """Look after the workers."""
        self.gateway.tend(now)
        return ()

    def close(self) -> None:
        """End the workers."""
        self.gateway.close()


def _named(worker: str) -> str:
    """Give a worker's number."""
    return worker.partition(" ")[0]


def _summed(reports: Sequence[Report]) -> Report:
    """Add up reports: the counts that the gateway does not know itself."""
    counts = sum((each.counts for each in reports), start=PerformerCounts())
    return Report(counts, stale=sum(each.stale for each in reports))


#: Seconds between two reports.
REPORT_EVERY = 0.25
#: Seconds of the frames shown in which windows are compared, too: the windows before are shorter than the former
#: worker's, and would only mislead the averages.
_COMPARED = 0.5


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

    def __init__(self, socket: zmq.Socket[bytes], index: WindowIndex | None, terms: Terms) -> None:
        self.pollable = socket
        self._performers = Performers(
            index or MotionLibrary.builtin(),
            views=BackgroundViews(),
            # The gateway drops a silent performer; a worker may forget it later.
            **terms._replace(silence=2 * terms.silence)._asdict(),
        )
        self.service = Service(self._performers, [self], [self])
        self.counts = InputCounts()
        self._answers, self._next_report = list[Recognition](), 0.0
        #: Counts of the frames that were only shown, which the former worker has counted, too.
        self._shown = RecognizerCounts()
        #: Libraries are opened in a thread, so that no frame waits.
        self._opener = ThreadPoolExecutor(1, "kinespace opening")
        self._opening = deque[Future[tuple[WindowIndex | None, Terms]]]()

    def run(self) -> None:
        """Work until the gateway's process is gone."""
        parent = multiprocessing.parent_process()
        while parent is None or parent.is_alive():
            self.service.step(TENDING)

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
            self._opening.append(self._opener.submit(_opened, parts))
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
        while self._opening and self._opening[0].done():
            index, terms = self._opening.popleft().result()
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
        counts.recognizers -= self._shown
        stale = self.service.status().inputs.stale
        return Report(counts, performers.refused, performers.doubted, performers.compared, stale)

    def _follow(self, seen: list[Admitted]) -> None:
        """Follow frames that another worker has answered; compare those of the last second."""
        before, now = self._performers.counts.recognizers, time.monotonic()
        times = [each.time if isinstance(each, Frame) else -math.inf for each in seen]
        older = next(place for place, moment in enumerate(times) if moment >= times[-1] - _COMPARED)
        self._performers.push_all(seen[:older], now, newest_only=True)
        self._performers.push_all(seen[older:], now)
        self._shown += self._performers.counts.recognizers - before
