"""A gateway: frames go to the workers of their partitions by Zenoh, and the workers' answers come back."""

from __future__ import annotations

import math
import time
import uuid
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote

from kinespace.stream.cluster import charter as chartered
from kinespace.stream.cluster.bus import Inbox, unreached
from kinespace.stream.cluster.charter import Charter, decode_back, encode_charter, key
from kinespace.stream.inputs.source import TENDING
from kinespace.stream.outputs.sink import Sink
from kinespace.stream.workers.answer_source import AnswerSource
from kinespace.stream.workers.ledger import Ledger
from kinespace.stream.workers.partition import PARTITIONS
from kinespace.stream.workers.spread import Spread, together
from kinespace.stream.workers.wire import FRAMES, REJOIN, WELCOME, encode_frames, encode_number
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
#: Seconds between two messages of frames to a worker, at least, where its frames come closer together than `_SPARSE` on
#: average: being woken costs a worker as much as a frame. The frames of fewer performers never wait.
_MIN_APART, _SPARSE = 0.0005, 0.0004
#: The weight of the newest frames in that average.
_NEW = 0.05


@dataclass(slots=True)
class _Member:
    number: int
    #: Sends frames; drops them if the way is full.
    sends: Any
    heard: float
    ready: bool = False
    #: Whether it wants to end, and whether it was told that it may.
    leaves: bool = False
    let_go: bool = False
    #: Frames that wait for the next message, when the last message was sent, and how many messages were sent.
    held: list[SentFrame] = field(default_factory=list)
    told: float = -math.inf
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
        return now - self.told >= _MIN_APART


class Gateway(Spread):
    """Takes the place of `Performers`; its workers may run on other machines.

    Parameters
    ----------
    session
        An open session of Zenoh; closed with the source.
    library, settings, most, silence, joints
        The same as for `Performers`.
    naming
        The naming of `joints`, written as in `--naming`.
    connect
        The endpoints that the session was told to connect to.
    tell
        Prints a line for a person: a worker has come, leaves, or is gone.
    clock
        Seconds, the service's own.

    Attributes
    ----------
    name
        The gateway's name, new at every start.
    source
        The source of the answers; the service reads and closes it.
    strangers
        Messages whose sender is not a worker.
    """

    def __init__(  # noqa: PLR0913 - all by keyword
        self,
        session: Any,  # noqa: ANN401 - Zenoh's
        library: MotionLibrary,
        settings: Settings,
        *,
        most: int,
        joints: SentJoints,
        naming: str,
        connect: Sequence[str] = (),
        tell: Callable[[str], None] = lambda _: None,
        silence: float = 5.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        ledger = Ledger(most=most, silence=silence)
        super().__init__(library, library.classes, settings, joints, ledger)
        self.name = uuid.uuid4().hex[:12]
        self.strangers = 0
        self.inbox = Inbox()
        self._session, self._connect, self._tell_person, self._clock = session, connect, tell, clock
        self._looked = clock()
        self._file = chartered.file_of(library)
        self._charter = Charter(
            chartered.own_version(),
            chartered.PROTOCOL,
            PARTITIONS,
            str(session.zid()),
            chartered.digest_of(self._file),
            settings,
            joints.assumed,
            naming,
            most,
            silence,
        )
        self._members: dict[str, _Member] = {}
        self._there: set[str] = set()
        self._numbers = 0
        self._lost, self._last_lost = 0, ""
        self._declared: list[Any] = []
        self.source = GatewaySource(self)
        self._declare()

    def _declare(self) -> None:
        import zenoh  # noqa: PLC0415 - an extra

        self._zenoh: Any = zenoh
        own, put = self._session, self.inbox.put
        self._declared += [
            own.declare_queryable(key(self.name, "charter"), lambda query: self._reply(query, self._encoded_charter)),
            own.declare_queryable(key(self.name, "library"), lambda query: self._reply(query, self._file)),
            own.declare_subscriber(
                f"{key(self.name, 'back')}/*",
                lambda sample: put(self._heard, str(sample.key_expr), bytes(sample.payload)),
            ),
            own.liveliness().declare_subscriber(
                f"{chartered.WORKERS}/*",
                lambda sample: put(self._seen, str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT),
                history=True,
            ),
            own.liveliness().declare_token(key("gateway", self.name)),
        ]
        self._identity = self._declared[0].id

    @property
    def _encoded_charter(self) -> bytes:
        return encode_charter(self._charter)

    @staticmethod
    def _reply(query: Any, payload: bytes) -> None:  # noqa: ANN401 - Zenoh's
        with query:
            query.reply(query.key_expr, payload)

    @property
    def _ready(self) -> list[str]:
        return [name for name, member in self._members.items() if member.ready and not member.leaves]

    @property
    def notes(self) -> list[str]:
        """Notes for a person, a line each."""
        lost = [f"workers lost so far: {self._lost}; last: {self._last_lost}"] if self._lost else []
        strange = [f"{self.strangers} messages whose sender is not a worker"] if self.strangers else []
        former = [f"{self.former} answers of former owners or to frames answered before"] if self.former else []
        places = unreached(self._session, self._connect)
        far = [f"not reached: {', '.join(places)}"] if places else []
        return [f"workers of gateway {self.name}: {len(self._ready)}", *far, *super().notes, *lost, *strange, *former]

    def _give(self, worker: str, frames: list[SentFrame]) -> None:
        member = self._members[worker]
        if member.take(frames, self._clock()):
            self._flush(worker, member)

    def _flush(self, worker: str, member: _Member) -> None:
        """Send the frames that wait; Zenoh drops them if the way to the worker is full."""
        frames, member.held, member.told = member.held, [], self._clock()
        for each in together(frames):
            member.messages += 1
            self._put(worker, FRAMES + encode_frames(each), member.messages)

    def _tell(self, worker: str, message: bytes) -> None:
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
            self._lose(worker, self._ready)

    def _heard(self, place: str, message: bytes) -> None:
        """Read a worker's message."""
        worker = unquote(place.rpartition("/")[2])
        try:
            back = decode_back(message)
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
            self.former += len(back.answers.answered)
            self._tell(worker, REJOIN)
        else:
            member.heard = self._clock()
            self.source.bring(self.take_back(worker, back.answers))
            if not member.ready:
                member.ready = True
                self._say(worker, "works")
                self._assign(self._ready)
            if back.answers.report and back.answers.report.leaves and not member.leaves:
                member.leaves = True
                self._say(worker, "leaves")
                self._assign(self._ready, [worker])
            self._let_go()

    def _say(self, worker: str, what: str) -> None:
        self._tell_person(f"worker {worker} {what}; workers: {len(self._ready)}")

    def _let_go(self) -> None:
        """Let the workers end whose performers are with others."""
        for name, member in self._members.items():
            if member.leaves and not member.let_go and all(name != move.former for move in self._moves.values()):
                member.let_go = True
                self._tell(name, REJOIN)

    def _welcome(self, worker: str, member: _Member | None) -> None:
        """Give a new worker a number; forget an earlier membership."""
        if member is None or member.ready:
            self._drop(worker, "began anew")
            self._numbers += 1
            sends = self._session.declare_publisher(
                key(self.name, "to", worker), congestion_control=self._zenoh.CongestionControl.DROP
            )
            member = self._members[worker] = _Member(self._numbers, sends, self._clock())
        self._tell(worker, WELCOME + encode_number(member.number))

    @property
    def due_in(self) -> float:
        """Seconds until frames must be sent that wait for others, or the workers must be looked after."""
        told = [member.told for member in self._members.values() if member.held]
        return max(min(told) + _MIN_APART - self._clock(), 0.0) if told else TENDING

    def tend(self, now: float) -> None:
        """Send the frames that have waited long enough; drop the workers that do not report."""
        for name, member in self._members.items():
            if member.held and member.is_due(now):
                self._flush(name, member)
        if now - self._looked > _STOPPED:
            for member in self._members.values():
                member.heard = max(member.heard, now - MAX_SILENT / 2)
        self._looked = now
        for worker in [name for name, member in self._members.items() if now - member.heard > MAX_SILENT]:
            # Once it reports again it is told to begin anew; now the way to it may be closed, and a message would wait.
            self._drop(worker, "does not report")

    def sink(self) -> Sink:
        """Make a sink that publishes the answers in JSON."""
        return ZenohSink(self._session, self.name)

    def close(self) -> None:
        """Leave the bus."""
        self._session.close()
        self.inbox.close()


class GatewaySource(AnswerSource):
    """The answers of all workers."""

    def __init__(self, gateway: Gateway) -> None:
        super().__init__()
        self._gateway = gateway

    @property
    def tended_within(self) -> float:
        """Seconds within which frames must be sent that wait for others, or the workers must be looked after."""
        return self._gateway.due_in

    @property
    def pollable(self) -> object:
        """The inbox, which Zenoh's threads wake."""
        return self._gateway.inbox

    @property
    def notes(self) -> list[str]:
        """Notes for a person, a line each."""
        return self._gateway.notes

    def read(self, now: float) -> None:  # noqa: ARG002 - as in `AnswerSource`
        """Read the messages that have come."""
        self._gateway.inbox.deal()

    def tend(self, now: float) -> Sequence[Admitted]:
        """Look after the workers."""
        self._gateway.inbox.deal()
        self._gateway.tend(now)
        return ()

    def close(self) -> None:
        """Leave the bus."""
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
