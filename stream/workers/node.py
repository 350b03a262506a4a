"""A worker on Zenoh: it works for every gateway whose terms it can fulfil."""

from __future__ import annotations

import math
import select
import threading
import time
import uuid
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote

import msgspec

from kinespace.library.naming import Naming
from kinespace.stream.recognizer import Performers, Recognizer, SentJoints
from kinespace.stream.recognizer.limits import index_for
from kinespace.stream.service.background_opener import BackgroundViews
from kinespace.stream.workers import terms as agreed
from kinespace.stream.workers.bus import Inbox, unreached
from kinespace.stream.workers.terms import decode_terms, key
from kinespace.stream.workers.wire import (
    ASK,
    FRAMES,
    GO_ON,
    REJOIN,
    TAKE_OVER,
    TERMS,
    WELCOME,
    Answers,
    decode_entries,
    decode_frames,
    decode_number,
    encode,
)
from kinespace.stream.workers.worker import Worker
from kinespace.stream.zeromq.frames import FormatError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from kinespace.library.motion_library import MotionLibrary
    from kinespace.library.windows.index import WindowIndex
    from kinespace.stream.workers.terms import Terms
    from kinespace.stream.workers.wire import Answered

#: Seconds between two reports.
REPORT_EVERY = 0.25
#: Seconds for which frames may wait, and seconds after a takeover in which they may wait for longer.
_MAX_AGE, _MAX_WARMING = 1.0, 4.0
#: Maximum seconds for which an answer waits for further answers, to travel with them.
_MAX_TOGETHER = 0.002
#: Seconds within which a worker that leaves hands its performers over.
_MAX_LEAVING = 10.0
#: Seconds after which a gateway that has not sent its terms, or its library, is asked again.
_ASK_AGAIN, _FETCH_AGAIN = 1.0, 20.0
#: Seconds after which a worker says that it sees no gateway.
_MAX_ALONE = 5.0
#: Seconds without a frame after which a performer may come from another gateway.
_SILENCE = 5.0


class Node:
    """Works until it is stopped.

    Parameters
    ----------
    session
        An open session of Zenoh; closed by `close`.
    library
        The only library with which it works; with None it takes every gateway's library.
    show
        Prints a line for a person.
    connect
        The endpoints to which the session connects.
    name
        The worker's name; a random one when not given.
    read
        Reads a library as gateways write it; ValueError for other bytes.
    clock
        Seconds.

    Attributes
    ----------
    refused
        Gateways for which it does not work.
    unread, strangers, conflicts, dropped
        Messages that could not be read; messages from other senders than their gateway; frames of performers whom
        another gateway sends already; messages of frames that were lost on the way, or had waited for too long.
    """

    def __init__(  # noqa: PLR0913 - all but the first three by keyword
        self,
        session: Any,  # noqa: ANN401 - Zenoh's
        library: MotionLibrary | None,
        show: Callable[[str], None],
        *,
        connect: Sequence[str] = (),
        name: str = "",
        read: Callable[[bytes], MotionLibrary | WindowIndex] = agreed.library_in,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        import zenoh  # noqa: PLC0415 - an extra

        self.name = name or uuid.uuid4().hex[:12]
        self.refused = self.unread = self.strangers = self.conflicts = self.dropped = 0
        self.session, self.inbox, self.show, self.clock = session, Inbox(), show, clock
        self._digest = agreed.digest_of(agreed.file_of(library)) if library else None
        self._memberships: dict[str, Membership] = {}
        #: Gateways that are there, and when those whose terms or library have not come yet are asked again.
        self._gateways: set[str] = set()
        self._asked: dict[str, float] = {}
        #: The library that was opened last, by its digest.
        self._libraries: dict[str, MotionLibrary | WindowIndex] = {}
        if library:
            self._libraries[self._digest or ""] = library
        #: The gateway of each performer, and when the performer's last frame came.
        self._holders: dict[str, tuple[str, float]] = {}
        self._connect, self._read, self._stopped = connect, read, False
        self._next_report = 0.0
        #: When to say that no gateway was seen.
        self._lonely = clock() + _MAX_ALONE
        self._said: set[str] = set()
        put = self.inbox.put
        self._declared = [
            session.liveliness().declare_token(key("worker", self.name)),
            session.liveliness().declare_subscriber(
                f"{agreed.GATEWAYS}/*",
                lambda sample: put(self._seen, str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT),
                history=True,
            ),
        ]

    @property
    def counts(self) -> dict[str, int]:
        """Counts of ignored gateways, messages and frames, by the reason."""
        counted = {"refused": self.refused, "unread": self.unread, "strangers": self.strangers}
        return {**counted, "conflicts": self.conflicts, "dropped": self.dropped}

    def note_stranger(self, gateway: str) -> None:
        """Count a message whose sender is not the gateway."""
        self.strangers += 1
        self._say_once(f"another program publishes on the keys of gateway {gateway}; its messages are ignored")

    def _refuse(self, gateway: str, why: str) -> None:
        self.refused += 1
        self._say_once(f"not working for gateway {gateway}: {why}")

    def _say_once(self, line: str) -> None:
        """Print a line for a person, the first time."""
        if line not in self._said and len(self._said) < 100:
            self._said.add(line)
            self.show(line)

    def stop(self) -> None:
        """Make `run` return soon; from any thread or signal handler."""
        self._stopped = True

    def run(self) -> None:
        """Work until stopped, and then until other workers have the performers."""
        while not self._stopped:
            self.step(max(self._next_report - self.clock(), 0.0))
        self.leave()
        until = self.clock() + _MAX_LEAVING
        while not self.has_left and self.clock() < until:
            self.step(max(min(self._next_report, until) - self.clock(), 0.0))

    def leave(self) -> None:
        """Ask the gateways to give the performers to other workers."""
        for membership in self._memberships.values():
            membership.leave_in_order()

    @property
    def has_left(self) -> bool:
        """Whether no gateway needs this worker any more, once it was asked to leave."""
        return all(membership.has_left for membership in self._memberships.values())

    def step(self, longest: float) -> None:
        """Wait at most so many seconds for messages, and deal with them; report when it is time."""
        if self.inbox.is_empty:
            select.select([self.inbox], [], [], longest)
        # A worker that warms up is busy, but must go on reporting: a silent worker counts as gone.
        self.inbox.deal(REPORT_EVERY / 4)
        for membership in self._memberships.values():
            membership.send_answers()
        now = self.clock()
        if now >= self._next_report:
            self._next_report = now + REPORT_EVERY
            self._look_after_gateways(now)
            for membership in self._memberships.values():
                membership.report()

    def _look_after_gateways(self, now: float) -> None:
        self._holders = {who: held for who, held in self._holders.items() if now - held[1] <= _SILENCE}
        for gateway in [each for each, again in self._asked.items() if now >= again]:
            self._ask(gateway)
        if now >= self._lonely:
            places = unreached(self.session, self._connect)
            far = f"; not reached: {', '.join(places)}" if places else ""
            self.show(f"no gateway is seen yet{far}. Does one run, do certificates and access rules let us in?")
            self._lonely = math.inf

    def close(self) -> None:
        """Leave Zenoh: the gateways give the performers to others."""
        self.session.close()
        self.inbox.close()

    def _seen(self, token: str, is_there: bool) -> None:  # noqa: FBT001 - a sample's kind
        """Ask a gateway that has come for its terms; forget one that has gone."""
        gateway = unquote(token.rpartition("/")[2])
        if is_there:
            self._lonely = math.inf
            self._gateways.add(gateway)
            if gateway not in self._memberships:
                self._ask(gateway)
            return
        self._gateways.discard(gateway)
        self._asked.pop(gateway, None)
        if membership := self._memberships.pop(gateway, None):
            membership.close()
            self.show(f"gateway {gateway} is gone")

    def _ask(self, gateway: str) -> None:
        """Ask for a gateway's terms. A question may be lost while a connection begins: it is asked again."""
        self._asked[gateway] = self.clock() + _ASK_AGAIN
        self._query(gateway, "terms", self.take_terms)

    def _query(self, gateway: str, what: str, deal_with: Callable[[str, bytes], None]) -> None:
        def answered(reply: Any) -> None:  # noqa: ANN401 - Zenoh's
            if reply.ok:
                self.inbox.put(deal_with, gateway, bytes(reply.ok.payload))

        self.session.get(key(gateway, what), answered)

    def take_terms(self, gateway: str, message: bytes) -> None:
        """Work for a gateway on its terms, or on its changed terms, if this worker can; fetch its library first."""
        if self._asked.pop(gateway, None) is None and gateway not in self._memberships:
            return  # it was answered before, or has gone
        try:
            terms = decode_terms(message)
            why = terms.refusal(self._digest)
        except FormatError as error:
            terms, why = None, str(error)
        if terms is None or why:
            self._refuse(gateway, why)
        elif terms.digest in self._libraries:
            self._open(gateway, terms)
        else:
            self._asked[gateway] = self.clock() + _FETCH_AGAIN
            self._query(gateway, "library", lambda _, file: self._fetched(gateway, terms.digest, file))

    def _fetched(self, gateway: str, digest: str, file: bytes) -> None:
        if self._asked.pop(gateway, None) is None:
            return
        if agreed.digest_of(file) != digest:
            self._refuse(gateway, f"the library that came is not {digest[:12]}")
            # It may have been exchanged meanwhile.
            self._asked[gateway] = self.clock() + _ASK_AGAIN
            return
        try:
            # One library at a time is enough: the gateways of one performance share it.
            self._libraries = {digest: self._read(file)}
        except ValueError as error:
            self._refuse(gateway, str(error))
            return
        # The terms may have changed meanwhile.
        self._ask(gateway)

    def _open(self, gateway: str, terms: Terms) -> None:
        """Open the library's windows in a thread, so that performers get answers meanwhile."""
        library, membership = self._libraries[terms.digest], self._memberships.get(gateway)
        if membership and membership.terms.digest == terms.digest:
            membership.change(terms)
            return

        def work() -> None:
            index = index_for(library, terms.settings)
            # A recogniser prepares what all recognisers share, some of which takes a second: no frame waits for it.
            Recognizer(index, terms.settings)
            self.inbox.put(self._begin, gateway, terms, index)

        threading.Thread(target=work, name="kinespace opening", daemon=True).start()

    def _begin(self, gateway: str, terms: Terms, index: WindowIndex) -> None:
        if membership := self._memberships.get(gateway):
            membership.change(terms, index)
        elif gateway in self._gateways:
            self._memberships[gateway] = Membership(self, gateway, terms, index)
            self.show(f"working for gateway {gateway}, library {terms.digest[:12]}")

    def holds(self, gateway: str, performer: str) -> bool:
        """Say whether a performer belongs to this gateway; False if another gateway sends the performer."""
        now = self.clock()
        holder, newest = self._holders.get(performer, (gateway, now))
        if holder != gateway and holder in self._memberships and now - newest <= _SILENCE:
            self.conflicts += 1
            self._say_once(f"two gateways have performer {performer}: {holder}, {gateway}; only the first gets answers")
            return False
        self._holders[performer] = gateway, now
        return True


class Membership:
    """The work for one gateway.

    Parameters
    ----------
    node
        The worker.
    gateway, terms, index
        The gateway's name, its terms, and the windows of its library.

    Attributes
    ----------
    terms
        The terms now.
    has_left
        Whether the gateway has let the worker go.
    """

    def __init__(self, node: Node, gateway: str, terms: Terms, index: WindowIndex) -> None:
        import zenoh  # noqa: PLC0415 - an extra

        self.terms = terms
        self._node, self._gateway, self._index = node, gateway, index
        self._member = 0
        self._leaves, self.has_left = False, False
        #: The number of the last message of frames.
        self._number = 0
        #: Answers that wait for further answers, and when the first of them was made.
        self._answers: list[Answered] = []
        self._answered_at = 0.0
        #: Until this time old frames are recognised, too, because performers were taken over.
        self._warm = 0.0
        self._begin()
        place = key(gateway, "back", node.name)
        self._back = node.session.declare_publisher(place, congestion_control=zenoh.CongestionControl.BLOCK)
        self._subscriber = node.session.declare_subscriber(key(gateway, "to", node.name), self._came)
        self.report()

    def _begin(self) -> None:
        terms = self.terms
        performers = Performers(
            self._index,
            terms.settings,
            most=terms.most,
            # The gateway drops a silent performer; a worker may forget it later.
            silence=2 * terms.silence,
            joints=SentJoints(terms.assumed, Naming.asked(terms.naming)),
            views=BackgroundViews(),
            classes=terms.classes,
        )
        self._worker = Worker(performers)
        self._worker.terms = terms.number
        #: Messages that were dropped before this membership.
        self._dropped = self._node.dropped

    def change(self, terms: Terms, index: WindowIndex | None = None) -> None:
        """Work on changed terms, perhaps with another library; the gateway ends the motions whose class it lacks."""
        if terms.number <= self.terms.number:
            return
        self.terms, performers = terms, self._worker.performers
        if index:
            self._index = index
            performers.exchange(index, terms.classes)
        if terms.settings.sensitivity is not None:
            performers.set_sensitivity(terms.settings.sensitivity)
        self._worker.terms = terms.number

    def leave_in_order(self) -> None:
        """Go on until the gateway says that other workers have the performers."""
        self._leaves, self.has_left = True, not self._member
        self.report()

    def close(self) -> None:
        """Stop working for the gateway."""
        self._subscriber.undeclare()
        self._back.undeclare()

    def _came(self, sample: Any) -> None:  # noqa: ANN401 - Zenoh's
        """Keep a message for the loop, in one of Zenoh's threads, if it is the gateway's own."""
        source = sample.source_info
        if source and str(source.source_id.zid) == self.terms.session:
            self._node.inbox.put(self._obey, bytes(sample.payload), source.source_sn, self._node.clock())
        else:
            self._node.inbox.put(self._node.note_stranger, self._gateway)

    def _obey(self, message: bytes, number: int, came: float) -> None:
        """Take in a gateway's message; a message of frames that may be lost on the way has a number."""
        kind, content = message[:1], message[1:]
        try:
            if kind == FRAMES:
                self._recognise(content, number, came)
            elif kind == WELCOME:
                self._member, self._number = decode_number(content), 0
                self.report()
            elif kind == REJOIN:
                self._rejoin()
            elif kind == TAKE_OVER:
                self._worker.take_over(decode_entries(content), self._node.clock())
                self._warm = self._node.clock() + _MAX_WARMING
            elif kind == GO_ON:
                self._worker.go_on(decode_entries(content), self._node.clock())
            elif kind == ASK:
                self.report(decode_number(content))
            elif kind == TERMS:
                self._node.take_terms(self._gateway, content)
            else:
                raise FormatError(f"kind: expected one of ours, got {kind!r}")  # noqa: TRY301 - counted alike
        except FormatError:
            self._node.unread += 1

    def _rejoin(self) -> None:
        """Begin again: the gateway has given our performers to others. A worker that leaves is done."""
        if self._leaves:
            self.send_answers()
            self.has_left = True
            return
        self._member, self._answers = 0, []
        self._begin()

    def _recognise(self, message: bytes, number: int, came: float) -> None:
        """Recognise frames, unless they have waited too long."""
        now = self._node.clock()
        if number:
            self._node.dropped += max(number - self._number - 1, 0)
            self._number = number
            if now - came > _MAX_AGE and now > self._warm:
                self._node.dropped += 1
                return
        frames = [each for each in decode_frames(message) if self._node.holds(self._gateway, each[0].performer)]
        if answered := self._worker.push(frames, now):
            self._answered_at = self._answered_at if self._answers else now
            self._answers += answered
        if self._node.clock() - self._answered_at > _MAX_TOGETHER:
            self.send_answers()

    def send_answers(self) -> None:
        """Send the answers that wait."""
        if self._answers:
            answers, self._answers = self._answers, []
            self._back.put(encode(Answers(self._member, answers)))

    def report(self, question: int = 0) -> None:
        """Send a report, which also shows that the worker is alive, or asks for membership, or answers a question."""
        self.send_answers()
        dropped = self._node.dropped - self._dropped
        report = self._worker.report(self._node.clock())
        report = msgspec.structs.replace(report, dropped=dropped, leaves=self._leaves)
        self._back.put(encode(Answers(self._member, [], report, question)))
