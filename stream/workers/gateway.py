"""A gateway: frames go to the workers of their partitions by Zenoh, and the workers' answers come back."""

from __future__ import annotations

import math
import time
import uuid
from collections import deque
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, cast
from urllib.parse import unquote

import msgspec

from kinespace.library.windows.index import WindowIndex
from kinespace.stream.inputs.source import TENDING
from kinespace.stream.outputs.sink import Sink
from kinespace.stream.status import InputCounts
from kinespace.stream.workers import terms as agreed
from kinespace.stream.workers.bus import Inbox, unreached
from kinespace.stream.workers.partition import PARTITIONS
from kinespace.stream.workers.router import Router, together
from kinespace.stream.workers.terms import Terms, encode_terms, key
from kinespace.stream.workers.wire import FRAMES, REJOIN, TERMS, WELCOME, decode_answers, encode
from kinespace.stream.zeromq import answers
from kinespace.stream.zeromq.frames import FormatError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from kinespace.library.motion_library import MotionLibrary
    from kinespace.stream.frame import Admitted
    from kinespace.stream.recognition import Event, Recognition
    from kinespace.stream.recognizer import SentJoints, Settings
    from kinespace.stream.workers.wire import SentFrame

#: Seconds without a report after which a worker counts as gone; it joins again when it wakes.
MAX_SILENT = 0.8
#: Seconds between two looks at the workers, above which this process itself was stopped for a while.
_STOPPED = 0.4
#: Seconds in which the last frames are answered at the end.
_MAX_ENDING = 0.5
#: Seconds between two messages of frames to a worker, at least, where its frames come closer together than `_SPARSE` on
#: average: being woken costs a worker as much as a frame. The frames of fewer performers never wait.
_MIN_APART, _SPARSE = 0.002, 0.0004
#: The weight of the newest frames in that average.
_NEW = 0.05


@dataclass(slots=True)
class _Member:
    """A worker that works for this gateway.

    Attributes
    ----------
    number
        The number of its membership.
    sends
        Sends frames; drops them if the way is full.
    newest
        When its last message came.
    """

    number: int
    sends: Any
    newest: float
    ready: bool = False
    #: Whether it wants to end, and whether it knows that it may.
    leaves: bool = False
    let_go: bool = False
    #: Frames that wait for the next message, when the last message was sent, and how many messages were sent.
    held: list[SentFrame] = field(default_factory=list)
    sent_at: float = -math.inf
    messages: int = 0
    #: When the last frames came, and the average time between two frames, seconds.
    came: float = -math.inf
    spacing: float = 2 * _SPARSE

    def take(self, frames: list[SentFrame], now: float) -> bool:
        """Keep frames for the next message; say whether it is due."""
        apart = min(now - self.came, 2 * _SPARSE) / len(frames)
        self.spacing += _NEW * (apart - self.spacing)
        self.came = now
        self.held += frames
        return self.spacing > _SPARSE or self.is_due(now)

    def is_due(self, now: float) -> bool:
        """Say whether the last message was sent long enough ago."""
        return now - self.sent_at >= _MIN_APART


class Gateway(Router):
    """Takes the place of `Performers`; its workers may run on other machines.

    Parameters
    ----------
    session
        An open session of Zenoh; closed by `close`.
    library, settings, most, silence, joints, classes
        The same as for `Performers`.
    naming
        The naming of `joints`, written as in `--naming`.
    connect
        The endpoints to which the session connects.
    show
        Prints a line for a person: a worker has come, leaves, or is gone.
    pack
        Writes a library for workers, which must read it alike.
    clock
        Seconds, the service's own.

    Attributes
    ----------
    name
        The gateway's name, another at every start.
    source
        The source of the answers; the service reads and closes it.
    strangers
        Messages whose sender is not a worker.
    """

    def __init__(  # noqa: PLR0913 - all by keyword
        self,
        session: Any,  # noqa: ANN401 - Zenoh's
        library: MotionLibrary | WindowIndex,
        settings: Settings,
        *,
        most: int,
        joints: SentJoints,
        naming: str,
        classes: Sequence[str] = (),
        connect: Sequence[str] = (),
        show: Callable[[str], None] = lambda _: None,
        pack: Callable[[MotionLibrary | WindowIndex], bytes] = agreed.file_of,
        silence: float = 5.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__(library, settings, most=most, silence=silence, joints=joints, classes=classes)
        self.name = uuid.uuid4().hex[:12]
        self.strangers = 0
        self.inbox = Inbox()
        self.source = GatewaySource(self)
        self._session, self._connect, self._show, self._clock, self._pack = session, connect, show, clock, pack
        self._looked = clock()
        self._packed = pack(library)
        self._terms = Terms(
            agreed.own_version(),
            agreed.PROTOCOL,
            PARTITIONS,
            str(session.zid()),
            agreed.digest_of(self._packed),
            settings,
            joints.assumed,
            naming,
            most,
            silence,
            tuple(classes),
        )
        self._members: dict[str, _Member] = {}
        self._there: set[str] = set()
        self._lost, self._last_lost = 0, ""
        self._declare()

    def _declare(self) -> None:
        import zenoh  # noqa: PLC0415 - an extra

        self._zenoh: Any = zenoh
        own, put = self._session, self.inbox.put
        self._declared = [
            own.declare_queryable(key(self.name, "terms"), lambda query: self._reply(query, encode_terms(self._terms))),
            own.declare_queryable(key(self.name, "library"), lambda query: self._reply(query, self._packed)),
            own.declare_subscriber(
                f"{key(self.name, 'back')}/*",
                lambda sample: put(self._take_in, str(sample.key_expr), bytes(sample.payload)),
            ),
            own.liveliness().declare_subscriber(
                f"{agreed.WORKERS}/*",
                lambda sample: put(self._seen, str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT),
                history=True,
            ),
            own.liveliness().declare_token(key("gateway", self.name)),
        ]
        self._identity = self._declared[0].id

    @staticmethod
    def _reply(query: Any, payload: bytes) -> None:  # noqa: ANN401 - Zenoh's
        with query:
            query.reply(query.key_expr, payload)

    @property
    def ready(self) -> list[str]:
        """The workers that recognise."""
        return [name for name, member in self._members.items() if member.ready and not member.leaves]

    @property
    def _alive(self) -> list[str]:
        """The workers that recognise, or that wait until others have their performers."""
        return [name for name, member in self._members.items() if member.ready and not member.let_go]

    @property
    def notes(self) -> list[str]:
        """Notes for a person, a line each."""
        lost = [f"workers lost so far: {self._lost}; last: {self._last_lost}"] if self._lost else []
        strange = [f"{self.strangers} messages whose sender is not a worker"] if self.strangers else []
        places = unreached(self._session, self._connect)
        far = [f"not reached: {', '.join(places)}"] if places else []
        return [f"workers of gateway {self.name}: {len(self.ready)}", *far, *super().notes, *lost, *strange]

    def set_sensitivity(self, share: float) -> None:
        """Recognise all performers with another sensitivity from the next hop on."""
        self.settings = replace(self.settings, sensitivity=share)
        self._change(self.classes, settings=self.settings)

    def exchange(self, library: MotionLibrary | WindowIndex, order: Sequence[str] = ()) -> list[Event]:
        """Compare all performers with another library from now on; end the motions whose class it lacks."""
        motions = library.library if isinstance(library, WindowIndex) else library
        self._packed = self._pack(library)
        digest = agreed.digest_of(self._packed)
        self._change(tuple(order) or motions.classes, digest=digest, classes=tuple(order))
        return [event for each in self._performers.values() if (event := each.end_unless(self.classes))]

    def end(self) -> list[Event]:
        """Give the last events, and the ends of all motions going on, because no more frames will come."""
        asked = {worker: self._ask(worker) for worker in self.ready}
        until = self._clock() + _MAX_ENDING
        while self._clock() < until and any(self._last.get(name, 0) < number for name, number in asked.items()):
            time.sleep(0.001)
            self.inbox.deal()
        last = [event for recognition, _ in self.source.answers for event in recognition.events]
        self.source.answers.clear()
        return [*last, *super().end()]

    def _change(self, answered: tuple[str, ...], **changes: object) -> None:
        """Let the workers know of changed terms."""
        self._class_lists.append(answered)
        self._terms = msgspec.structs.replace(self._terms, number=self._terms.number + 1, **changes)
        for worker in self._members:
            self._send(worker, TERMS + encode_terms(self._terms))

    def _send_frames(self, worker: str, frames: list[SentFrame]) -> None:
        member = self._members[worker]
        if member.take(frames, self._clock()):
            self._flush(worker, member)

    def _flush(self, worker: str, member: _Member) -> None:
        """Send the frames that wait; Zenoh drops them if the way to the worker is full."""
        frames, member.held, member.sent_at = member.held, [], self._clock()
        for each in together(frames):
            member.messages += 1
            self._put(worker, FRAMES + encode(each), member.messages)

    def _send(self, worker: str, message: bytes) -> None:
        if (member := self._members.get(worker)) and member.held:
            self._flush(worker, member)
        self._put(worker, message, 0)

    def _put(self, worker: str, message: bytes, number: int) -> None:
        """Send a message; one with a number may be dropped, and the worker counts the numbers that it misses."""
        source = self._zenoh.SourceInfo(self._identity, number)
        if number:
            self._members[worker].sends.put(message, source_info=source)
        else:
            congestion = self._zenoh.CongestionControl.BLOCK
            self._session.put(key(self.name, "to", worker), message, congestion_control=congestion, source_info=source)

    def _seen(self, token: str, is_there: bool) -> None:  # noqa: FBT001 - a sample's kind
        """Note that a worker has come or has gone."""
        worker = unquote(token.rpartition("/")[2])
        if is_there:
            self._there.add(worker)
            return
        self._there.discard(worker)
        self._drop(worker, "is gone")

    def _drop(self, worker: str, why: str) -> None:
        member = self._members.pop(worker, None)
        if member:
            member.sends.undeclare()
            if not member.let_go:
                self._lost, self._last_lost = self._lost + 1, f"worker {worker} {why}"
                self._say(worker, why)
            self._remove(worker, self.ready, self._alive)

    def _take_in(self, place: str, message: bytes) -> None:
        """Read a worker's message."""
        worker = unquote(place.rpartition("/")[2])
        try:
            back = decode_answers(message)
        except FormatError:
            self.unread += 1
            return
        member = self._members.get(worker)
        if worker not in self._there:
            # A worker's first message may overtake its token; the worker repeats the message.
            self.strangers += back.member != 0
        elif back.member == 0:
            self._welcome(worker, member)
        elif member is None or member.number != back.member:
            self.outdated += len(back.answered)
            self._send(worker, REJOIN)
        else:
            member.newest = self._clock()
            self.source.answers += self.accept(worker, back)
            self._follow(worker, member, leaves=bool(back.report and back.report.leaves))

    def _follow(self, worker: str, member: _Member, *, leaves: bool) -> None:
        """Give performers to a worker that is ready now, take them from a worker that leaves, and let it end then."""
        if not member.ready:
            member.ready = True
            self._say(worker, "works")
            self._assign(self.ready, self._alive)
        if leaves and not member.leaves:
            member.leaves = True
            self._say(worker, "leaves")
            self._assign(self.ready, self._alive)
        for name, each in self._members.items():
            if each.leaves and not each.let_go and all(name != move.former for move in self._moves.values()):
                each.let_go = True
                self._send(name, REJOIN)

    def _say(self, worker: str, what: str) -> None:
        self._show(f"worker {worker} {what}; workers: {len(self.ready)}")

    def _welcome(self, worker: str, member: _Member | None) -> None:
        """Give a worker a number; forget an earlier membership."""
        if member is None or member.ready:
            self._drop(worker, "began again")
            congestion = self._zenoh.CongestionControl.DROP
            sends = self._session.declare_publisher(key(self.name, "to", worker), congestion_control=congestion)
            member = self._members[worker] = _Member(next(self._numbers), sends, self._clock())
        # The terms may have changed since the worker asked for them.
        self._send(worker, TERMS + encode_terms(self._terms))
        self._send(worker, WELCOME + encode(member.number))

    @property
    def due_in(self) -> float:
        """Seconds until frames must be sent that wait for others, or the workers must be looked after."""
        sent = [member.sent_at for member in self._members.values() if member.held]
        return max(min(sent) + _MIN_APART - self._clock(), 0.0) if sent else TENDING

    def tend(self, now: float) -> None:
        """Send the frames that have waited long enough; drop the workers that do not report."""
        for name, member in self._members.items():
            if member.held and member.is_due(now):
                self._flush(name, member)
        if now - self._looked > _STOPPED:
            for member in self._members.values():
                member.newest = max(member.newest, now - MAX_SILENT / 2)
        self._looked = now
        for worker in [name for name, member in self._members.items() if now - member.newest > MAX_SILENT]:
            # Once it reports again it may join; now the way to it may be closed, and a message would wait.
            self._drop(worker, "does not report")

    def sink(self) -> Sink:
        """Make a sink that publishes the answers in JSON."""
        return ZenohSink(self._session, self.name)

    def close(self) -> None:
        """Leave Zenoh; without effect a second time."""
        self._session.close()
        self.inbox.close()


class GatewaySource:
    """The answers of all workers, as a source for the service.

    Attributes
    ----------
    answers
        Answers that were not taken yet, each with the arrival of its frame.
    waited
        Seconds since the frame of the last answer came.
    """

    def __init__(self, gateway: Gateway) -> None:
        self.answers = deque[tuple["Recognition", float]]()
        self.waited = 0.0
        self._gateway = gateway

    @property
    def pollable(self) -> object:
        """The inbox, which Zenoh's threads wake."""
        return self._gateway.inbox

    @property
    def tended_within(self) -> float:
        """Seconds within which frames must be sent that wait for others, or the workers must be looked after."""
        return self._gateway.due_in

    @property
    def has_put_aside(self) -> bool:
        """Whether answers were read and not taken yet."""
        return bool(self.answers)

    @property
    def counts(self) -> InputCounts:
        """No counts: answers are not input."""
        return InputCounts()

    @property
    def notes(self) -> list[str]:
        """Notes for a person, a line each."""
        return self._gateway.notes

    def take(self, arrival: float) -> Sequence[Admitted] | None:
        """Give the next answer as an event, which `Gateway.push_all` gives back; None when none has come."""
        if not self.answers:
            self._gateway.inbox.deal()
        if not self.answers:
            return None
        recognition, at = self.answers.popleft()
        self.waited = max(arrival - at, 0.0)
        return (cast("Admitted", recognition),)

    def tend(self, now: float) -> Sequence[Admitted]:
        """Look after the workers."""
        self._gateway.inbox.deal()
        self._gateway.tend(now)
        return ()

    def close(self) -> None:
        """Leave Zenoh."""
        self._gateway.close()


class ZenohSink(Sink):
    """Publishes answers in JSON, as over ZeroMQ.

    Parameters
    ----------
    session, gateway
        An open session, and the gateway's name.
    """

    def __init__(self, session: Any, gateway: str) -> None:  # noqa: ANN401 - Zenoh's
        self._session, self._gateway = session, gateway

    def __str__(self) -> str:
        return f"Zenoh {key(self._gateway, 'answer')}/**"

    def publish(self, recognition: Recognition) -> None:
        """Publish one recognition."""
        self._put(recognition.performer, "class", answers.encode_recognition(recognition)[1])

    def publish_event(self, event: Event) -> None:
        """Publish one event."""
        self._put(event.performer, "event", answers.encode_event(event)[1])

    def publish_gone(self, performer: str) -> None:
        """Publish that a performer has left."""
        self._put(performer, "class", answers.encode_gone(performer)[1])

    def _put(self, performer: str, what: str, message: bytes) -> None:
        self._session.put(key(self._gateway, "answer", performer, what), message)
