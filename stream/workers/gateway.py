"""A gateway: frames go to the workers that have their performers by Zenoh, and the workers' answers come back."""

from __future__ import annotations

import math
import time
import uuid
from collections import deque
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeAlias, cast

import msgspec

from kinespace.stream.inputs.source import TENDING
from kinespace.stream.status import InputCounts
from kinespace.stream.workers import terms as agreed
from kinespace.stream.workers.bus import Inbox, joined, unreached
from kinespace.stream.workers.router import Router
from kinespace.stream.workers.wire import GATEWAYS, WORKERS, FormatError, Orders, decode_answers, encode, key, last_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from kinespace.library.motion_library import MotionLibrary
    from kinespace.library.windows.index import WindowIndex
    from kinespace.stream.frame import Admitted
    from kinespace.stream.recognition import Event, Recognition
    from kinespace.stream.recognizer import Performers
    from kinespace.stream.workers.terms import Terms
    from kinespace.stream.workers.wire import SentFrame

    #: The recognisers as the service, the sinks and the lessons call them: in this process, or spread over workers.
    Recognising: TypeAlias = "Performers | Gateway"

#: Seconds without a report after which a worker counts as gone; it joins again when it wakes.
MAX_SILENT = 0.8
#: Seconds between two looks at the workers, above which this process itself was stopped for a while.
_STOPPED = 0.4
#: Seconds in which the last frames are answered at the end.
_MAX_ENDING = 0.5
#: Seconds between two messages of frames to a worker, at least, where its frames come closer together than `_SPARSE` on
#: average: being woken costs a worker as much as a frame.
_MIN_APART = 0.002
#: Seconds on average from which on frames are sent at once: the frames of a few performers never wait.
_SPARSE = 0.0004
#: The weight of the newest frames in that average.
_NEW = 0.05


@dataclass(slots=True)
class _Member:
    """A worker that works for this gateway.

    Attributes
    ----------
    membership
        The worker's name for its membership, another one at each start.
    sends
        Sends frames; drops them if the way is full.
    newest
        When its last message came.
    leaves, let_go
        Whether it wants to end, and whether it knows that it may.
    """

    membership: str
    sends: Any
    newest: float
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
    library
        Motions to compare with.
    terms
        For the recognisers.
    connect
        The endpoints to which the session connects.
    show
        Prints a line for a person: a worker has come, leaves, or is gone.
    pack
        Writes a library for workers, which must read it alike.

    Attributes
    ----------
    name
        The gateway's name, another at every start.
    source
        The source of the answers; the service reads and closes it.
    """

    def __init__(  # noqa: PLR0913 - three by position
        self,
        session: Any,  # noqa: ANN401 - Zenoh's
        library: MotionLibrary | WindowIndex,
        terms: Terms,
        *,
        connect: Sequence[str] = (),
        show: Callable[[str], None] = lambda _: None,
        pack: Callable[[MotionLibrary | WindowIndex], bytes] = agreed.file_of,
    ) -> None:
        import zenoh  # noqa: PLC0415 - an extra

        self._zenoh: Any = zenoh
        self._packed = pack(library)
        super().__init__(library, msgspec.structs.replace(terms, digest=agreed.digest_of(self._packed)))
        self.name = uuid.uuid4().hex[:12]
        self.inbox = Inbox()
        self.source = GatewaySource(self)
        self._session, self._connect, self._show, self._pack = session, connect, show, pack
        self._looked = time.monotonic()
        self._members: dict[str, _Member] = {}
        self._lost, self._last_lost = 0, ""
        self._joined = set[str]()
        self._declared = [
            session.declare_queryable(key(self.name, "library"), self._reply),
            session.declare_subscriber(f"{key(self.name, 'back')}/*", self._note_message),
            session.liveliness().declare_subscriber(f"{WORKERS}/*", self._note_token),
            session.liveliness().declare_token(f"{GATEWAYS}/{self.name}"),
        ]

    def _reply(self, query: Any) -> None:  # noqa: ANN401 - Zenoh's
        with query:
            query.reply(query.key_expr, self._packed)

    def _note_message(self, sample: Any) -> None:  # noqa: ANN401 - Zenoh's
        self.inbox.put(self._take_in, last_of(sample), bytes(sample.payload))

    def _note_token(self, sample: Any) -> None:  # noqa: ANN401 - Zenoh's
        if sample.kind == self._zenoh.SampleKind.DELETE:
            self.inbox.put(self._drop, last_of(sample), "is gone")

    @property
    def ready(self) -> list[str]:
        """The workers that recognise, and do not want to end."""
        return [name for name, member in self._members.items() if not member.leaves]

    @property
    def _alive(self) -> list[str]:
        """The workers that recognise, or that wait until others have their performers."""
        return [name for name, member in self._members.items() if not member.let_go]

    @property
    def notes(self) -> list[str]:
        """Notes for a person, a line each."""
        lost = [f"workers lost so far: {self._lost}; last: {self._last_lost}"] if self._lost else []
        places = unreached(self._session, self._connect)
        far = [f"not reached: {', '.join(places)}"] if places else []
        return [f"workers of gateway {self.name}: {len(self.ready)}", *far, *super().notes, *lost]

    def set_sensitivity(self, share: float) -> None:
        """Recognise all performers with another sensitivity from the next hop on."""
        self._change(settings=replace(self.settings, sensitivity=share))

    def exchange(self, library: MotionLibrary | WindowIndex, order: Sequence[str] = ()) -> list[Event]:
        """Compare all performers with another library from now on; end the motions whose class it lacks."""
        ended = super().exchange(library, order)
        self._packed = self._pack(library)
        self._change(digest=agreed.digest_of(self._packed))
        return ended

    def _change(self, **changes: object) -> None:
        """Change the terms, and let the workers know."""
        self.terms = msgspec.structs.replace(self.terms, **changes)
        for worker in self._members:
            self._send(worker, Orders(terms=self.terms))

    def end(self) -> list[Event]:
        """Give the last events, and the ends of all motions going on, because no more frames will come."""
        asked = {worker: self._ask(worker) for worker in self.ready}
        until = time.monotonic() + _MAX_ENDING
        while time.monotonic() < until and any(self._last.get(name, 0) < number for name, number in asked.items()):
            time.sleep(0.001)
            self.inbox.deal()
        last = [event for recognition, _ in self.source.answers for event in recognition.events]
        self.source.answers.clear()
        return [*last, *super().end()]

    def _send_frames(self, worker: str, frames: list[SentFrame]) -> None:
        member = self._members[worker]
        if member.take(frames, time.monotonic()):
            self._flush(member)

    def _flush(self, member: _Member) -> None:
        """Send the frames that wait; Zenoh drops them if the way to the worker is full."""
        frames, member.held, member.sent_at = member.held, [], time.monotonic()
        member.messages += 1
        member.sends.put(encode(Orders(member.membership, frames=frames, number=member.messages)))

    def _send(self, worker: str, orders: Orders) -> None:
        member = self._members[worker]
        if member.held:
            self._flush(member)
        orders.member = member.membership
        self._put(worker, orders)

    def _put(self, worker: str, orders: Orders) -> None:
        """Send a message that is not dropped."""
        congestion = self._zenoh.CongestionControl.BLOCK
        self._session.put(key(self.name, "to", worker), encode(orders), congestion_control=congestion)

    def _drop(self, worker: str, why: str) -> None:
        if member := self._members.pop(worker, None):
            member.sends.undeclare()
            if not member.let_go:
                self._lost, self._last_lost = self._lost + 1, f"worker {worker} {why}"
                self._say(worker, why)
            self._remove(worker, self.ready, self._alive)

    def _take_in(self, worker: str, message: bytes) -> None:
        """Read a worker's message."""
        try:
            back = decode_answers(message)
        except FormatError:
            self.unread += 1
            return
        member = self._members.get(worker)
        if member is None or member.membership != back.member:
            self.outdated += len(back.answered)
            self._drop(worker, "began again")
            self._put(worker, Orders(back.member, self.terms, begins=True))
            if back.report and not back.report.leaves:
                self._welcome(worker, back.member)
            return
        member.newest = time.monotonic()
        self.source.answers += self.accept(worker, back)
        if back.report and back.report.leaves:
            self._let_go(worker, member)

    def _welcome(self, worker: str, membership: str) -> None:
        congestion = self._zenoh.CongestionControl.DROP
        sends = self._session.declare_publisher(key(self.name, "to", worker), congestion_control=congestion)
        self._members[worker] = _Member(membership, sends, time.monotonic())
        self._say(worker, "works")
        self._balance(self.ready, self._alive)

    def _let_go(self, worker: str, member: _Member) -> None:
        """Give the performers of a worker that wants to end to others, as long as there are any; then let it end."""
        if not member.leaves:
            member.leaves = True
            self._say(worker, "leaves")
            self._balance(self.ready, self._alive)
        has_performers = any(each.worker == worker for each in self._performers.values())
        if not member.let_go and not (has_performers and self.ready):
            member.let_go = True
            self._send(worker, Orders(let_go=True))

    def _say(self, worker: str, what: str) -> None:
        new = joined(self._session, self._joined)
        self._show(f"worker {worker} {what}; workers: {len(self.ready)}{'; joined: ' * bool(new)}{', '.join(new)}")

    @property
    def due_in(self) -> float:
        """Seconds until frames must be sent that wait for others, or the workers must be looked after."""
        sent = [member.sent_at for member in self._members.values() if member.held]
        return max(min(sent) + _MIN_APART - time.monotonic(), 0.0) if sent else TENDING

    def tend(self, now: float) -> None:
        """Send the frames that have waited long enough; drop the workers that do not report."""
        for member in self._members.values():
            if member.held and member.is_due(now):
                self._flush(member)
        if now - self._looked > _STOPPED:
            for member in self._members.values():
                member.newest = max(member.newest, now - MAX_SILENT / 2)
        self._looked = now
        for worker in [name for name, member in self._members.items() if now - member.newest > MAX_SILENT]:
            # Once it reports again it may join; now the way to it may be closed, and a message would wait.
            self._drop(worker, "does not report")

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
    pollable
        The inbox, which Zenoh's threads wake.
    counts
        No counts: answers are not input.
    lag
        0: the workers see what has waited.
    """

    #: No frames come in here.
    place = ""
    lag, patience = 0.0, math.inf

    def __init__(self, gateway: Gateway) -> None:
        self.answers = deque[tuple["Recognition", float]]()
        self.waited = 0.0
        self.pollable, self.counts = gateway.inbox, InputCounts()
        self._gateway = gateway

    @property
    def tended_within(self) -> float:
        """Seconds within which frames must be sent that wait for others, or the workers must be looked after."""
        return self._gateway.due_in

    @property
    def has_put_aside(self) -> bool:
        """Whether answers were read and not taken yet."""
        return bool(self.answers)

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
