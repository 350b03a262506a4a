"""A worker on Zenoh: it works for every gateway whose terms it can fulfil."""

from __future__ import annotations

import math
import select
import threading
import time
import uuid
from typing import TYPE_CHECKING, Any

from kinespace.stream.recognizer import Performers, Recognizer
from kinespace.stream.recognizer.limits import index_for
from kinespace.stream.workers import terms as agreed
from kinespace.stream.workers import wire
from kinespace.stream.workers.background_opener import BackgroundViews
from kinespace.stream.workers.bus import Inbox, unreached
from kinespace.stream.workers.worker import Worker

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from kinespace.library.motion_library import MotionLibrary
    from kinespace.library.windows.index import WindowIndex
    from kinespace.stream.workers.terms import Terms

#: Seconds between two reports.
REPORT_EVERY = 0.25
#: Seconds for which frames may wait.
_MAX_AGE = 1.0
#: Seconds after a takeover in which frames may wait for longer.
_MAX_WARMING = 4.0
#: Maximum seconds for which an answer waits for further answers, to travel with them.
_MAX_TOGETHER = 0.002
#: Seconds within which a worker that leaves hands its performers over.
_MAX_LEAVING = 10.0
#: Seconds after which a gateway that has not sent its library is asked again.
_FETCH_AGAIN = 20.0
#: Seconds after which a worker says that it sees no gateway.
_MAX_ALONE = 5.0


class Node:
    """Works until it is stopped.

    Parameters
    ----------
    session
        An open session of Zenoh; closed by `close`.
    show
        Prints a line for a person.
    connect
        The endpoints to which the session connects.
    name
        The worker's name; a random one when not given.
    read
        Reads a library as gateways write it; ValueError for other bytes.

    Attributes
    ----------
    counts
        How often it refused to work for a gateway; messages that could not be read; messages from other senders than
        their gateway; messages of frames that were lost on the way, or had waited for too long.
    libraries
        The library that was opened last, by its digest.
    """

    def __init__(
        self,
        session: Any,  # noqa: ANN401 - Zenoh's
        show: Callable[[str], None],
        *,
        connect: Sequence[str] = (),
        name: str = "",
        read: Callable[[bytes], MotionLibrary | WindowIndex] = agreed.library_in,
    ) -> None:
        import zenoh  # noqa: PLC0415 - an extra

        self.name = name or uuid.uuid4().hex[:12]
        self.counts = dict.fromkeys(("refused", "unread", "strangers", "dropped"), 0)
        self.session, self.inbox, self.show, self.read = session, Inbox(), show, read
        self.libraries: dict[str, MotionLibrary | WindowIndex] = {}
        self._memberships: dict[str, Membership] = {}
        self._connect, self._stopped = connect, False
        self._next_report = 0.0
        #: When to say that no gateway was seen.
        self._lonely = time.monotonic() + _MAX_ALONE
        self._said: set[str] = set()
        self._declared = [
            session.liveliness().declare_token(f"{wire.WORKERS}/{self.name}"),
            session.liveliness().declare_subscriber(
                f"{wire.GATEWAYS}/*",
                lambda sample: self.inbox.put(self._seen, wire.last_of(sample), sample.kind == zenoh.SampleKind.PUT),
                history=True,
            ),
        ]

    def ignore(self, why: str, line: str) -> None:
        """Count a gateway or a message that is ignored; print a line for a person, the first time."""
        self.counts[why] += 1
        if line not in self._said and len(self._said) < 100:
            self._said.add(line)
            self.show(line)

    def stop(self) -> None:
        """Make `run` return soon; from any thread or signal handler."""
        self._stopped = True

    def run(self) -> None:
        """Work until stopped, and then until other workers have the performers."""
        while not self._stopped:
            self.step(max(self._next_report - time.monotonic(), 0.0))
        self.leave()
        until = time.monotonic() + _MAX_LEAVING
        while not self.has_left and time.monotonic() < until:
            self.step(max(min(self._next_report, until) - time.monotonic(), 0.0))

    def leave(self) -> None:
        """Ask the gateways to give the performers to other workers."""
        for membership in self._memberships.values():
            membership.leave_in_order()

    @property
    def has_left(self) -> bool:
        """Whether no gateway needs this worker any more, once it was asked to leave."""
        return all(membership.has_left for membership in self._memberships.values())

    def step(self, longest: float) -> None:
        """Wait at most `longest` seconds for messages, and deal with them; report when it is time."""
        if self.inbox.is_empty:
            select.select([self.inbox], [], [], longest)
        # A worker that warms up is busy, but must go on reporting: a silent worker counts as gone.
        self.inbox.deal(REPORT_EVERY / 4)
        now = time.monotonic()
        is_due = now >= self._next_report
        for membership in self._memberships.values():
            if is_due:
                membership.report()
            else:
                membership.send_answers()
        if is_due:
            self._next_report = now + REPORT_EVERY
        if now >= self._lonely:
            places = unreached(self.session, self._connect)
            far = f"; not reached: {', '.join(places)}" if places else ""
            self.show(f"no gateway is seen yet{far}. Does one run, do certificates and access rules let us in?")
            self._lonely = math.inf

    def close(self) -> None:
        """Leave Zenoh: the gateways give the performers to others."""
        self.session.close()
        self.inbox.close()

    def _seen(self, gateway: str, is_there: bool) -> None:  # noqa: FBT001 - a sample's kind
        """Ask a gateway that has come for its terms; forget one that has gone."""
        if is_there:
            self._lonely = math.inf
            if gateway not in self._memberships:
                self._memberships[gateway] = Membership(self, gateway)
        elif membership := self._memberships.pop(gateway, None):
            membership.close()
            self.show(f"gateway {gateway} is gone")


class Membership:
    """The work for one gateway.

    Parameters
    ----------
    node
        The worker.
    gateway
        The gateway's name.

    Attributes
    ----------
    has_left
        Whether the gateway has let the worker go.
    """

    def __init__(self, node: Node, gateway: str) -> None:
        import zenoh  # noqa: PLC0415 - an extra

        self._node, self._gateway, self._name = node, gateway, uuid.uuid4().hex
        #: The newest terms, and the digest and the windows of the library that is open.
        self._terms: Terms | None = None
        self._digest = ""
        self._index: WindowIndex | None = None
        self._worker: Worker | None = None
        #: The digest of the library that is being fetched and opened, and when it is fetched again.
        self._wanted, self._fetch_at = "", 0.0
        self._is_refused = self._is_over = self._leaves = self.has_left = False
        #: The number of the last message of frames, and how many such messages were dropped.
        self._number = self._dropped = 0
        #: Answers that wait for further answers, and when the first of them was made.
        self._answers: list[wire.Answered] = []
        self._answered_at = 0.0
        #: Until this time old frames are recognised, too, because performers were taken over.
        self._warm = 0.0
        place = wire.key(gateway, "back", node.name)
        self._back = node.session.declare_publisher(place, congestion_control=zenoh.CongestionControl.BLOCK)
        self._subscriber = node.session.declare_subscriber(
            wire.key(gateway, "to", node.name),
            lambda sample: node.inbox.put(self._guarded, self._obey, bytes(sample.payload), time.monotonic()),
        )
        self.report()

    def leave_in_order(self) -> None:
        """Go on until the gateway says that other workers have the performers."""
        self._leaves, self.has_left = True, not self._worker
        self.report()

    def close(self) -> None:
        """Stop working for the gateway."""
        self._is_over = True
        self._subscriber.undeclare()
        self._back.undeclare()

    def _guarded(self, deal_with: Callable[..., None], *arguments: object) -> None:
        """Deal with what the gateway has sent: whatever it is, the worker works on for other gateways."""
        try:
            deal_with(*arguments)
        except wire.FormatError as error:
            self._node.ignore("unread", f"gateway {self._gateway}: {error}")
        except Exception as error:  # noqa: BLE001 - of any kind, by terms or a library that no gateway of ours has
            self._refuse(f"{type(error).__name__}: {error}")

    def _refuse(self, why: str) -> None:
        self._is_refused, self._worker, self._terms = True, None, None
        self._node.ignore("refused", f"not working for gateway {self._gateway}: {why}")

    def _obey(self, message: bytes, came: float) -> None:
        """Take in a message, if it is the gateway's."""
        orders = wire.decode_orders(message)
        if orders.member != self._name:
            line = f"another program publishes on the keys of gateway {self._gateway}; its messages are ignored"
            self._node.ignore("strangers", line)
        elif not self._is_over:
            self._carry_out(orders, came)

    def _carry_out(self, orders: wire.Orders, came: float) -> None:
        if orders.terms:
            self._agree(orders.terms, begins=orders.begins)
        if orders.frames and self._worker:
            self._recognise(self._worker, orders, came)
        if orders.question:
            self.report(orders.question)
        if orders.let_go or (orders.begins and self._leaves):
            self.send_answers()
            self.has_left = True

    def _agree(self, terms: Terms, *, begins: bool) -> None:
        """Work on terms, or on changed terms, if this worker can; fetch and open their library first."""
        if self._is_refused:
            return
        if why := terms.refusal:
            self._refuse(why)
            return
        before, self._terms = self._terms, terms
        if self._index is None or terms.digest != self._digest:
            self._open(terms)
        elif self._worker is None or begins:
            self._begin(terms, self._index)
        elif before != terms:
            self._change(self._worker.performers, terms, self._index)

    def _begin(self, terms: Terms, index: WindowIndex) -> None:
        """Begin without performers."""
        performers = Performers(
            index,
            terms.settings,
            most=terms.most,
            # The gateway drops a silent performer; a worker may forget it later.
            silence=2 * terms.silence,
            joints=terms.joints,
            views=BackgroundViews(),
            classes=terms.classes,
        )
        self._worker, self._answers, self._number, self._dropped = Worker(performers), [], 0, 0

    @staticmethod
    def _change(performers: Performers, terms: Terms, index: WindowIndex) -> None:
        performers.exchange(index, terms.classes)
        if terms.settings.sensitivity is not None:
            performers.set_sensitivity(terms.settings.sensitivity)

    def _open(self, terms: Terms) -> None:
        """Fetch the library, unless it is known, and open it."""
        now, node = time.monotonic(), self._node
        if terms.digest == self._wanted and now < self._fetch_at:
            return
        self._wanted, self._fetch_at = terms.digest, now + _FETCH_AGAIN
        if terms.digest in node.libraries:
            self._open_windows(terms, node.libraries[terms.digest])
        else:
            node.session.get(wire.key(self._gateway, "library"), lambda reply: self._replied(terms, reply))

    def _replied(self, terms: Terms, reply: Any) -> None:  # noqa: ANN401 - Zenoh's
        if reply.ok:
            self._node.inbox.put(self._guarded, self._fetched, terms, bytes(reply.ok.payload))

    def _fetched(self, terms: Terms, file: bytes) -> None:
        node = self._node
        if agreed.digest_of(file) != terms.digest:
            # It may have been exchanged meanwhile.
            line = f"not working for gateway {self._gateway}: the library that came is not {terms.digest[:12]}"
            node.ignore("refused", line)
            return
        # One library at a time is enough: the gateways of one performance share it.
        node.libraries = {terms.digest: node.read(file)}
        self._open_windows(terms, node.libraries[terms.digest])

    def _open_windows(self, terms: Terms, library: MotionLibrary | WindowIndex) -> None:
        """Open the library's windows in a thread, so that performers get answers meanwhile."""

        def work() -> None:
            try:
                index = index_for(library, terms.settings)
                # A recogniser prepares what all recognisers share, some of which takes a second: no frame waits for it.
                Recognizer(index, terms.settings)
            except Exception as error:  # noqa: BLE001 - as in `_guarded`
                self._node.inbox.put(self._refuse, f"{type(error).__name__}: {error}")
            else:
                self._node.inbox.put(self._guarded, self._opened, terms.digest, index)

        threading.Thread(target=work, name="kinespace opening", daemon=True).start()

    def _opened(self, digest: str, index: WindowIndex) -> None:
        """Begin, or go on with another library; the gateway ends the motions whose class it lacks."""
        if self._is_over or not self._terms or self._terms.digest != digest:
            return
        self._digest, self._index = digest, index
        if self._worker:
            self._change(self._worker.performers, self._terms, index)
            return
        self._begin(self._terms, index)
        self._node.show(f"working for gateway {self._gateway}, library {digest[:12]}")
        self.report()

    def _recognise(self, worker: Worker, orders: wire.Orders, came: float) -> None:
        """Recognise frames, unless they have waited too long."""
        now, dropped = time.monotonic(), 0
        if orders.number:
            dropped = max(orders.number - self._number - 1, 0)
            self._number = orders.number
        is_old = orders.number > 0 and now - came > _MAX_AGE and now > self._warm
        if dropped := dropped + is_old:
            self._dropped += dropped
            self._node.counts["dropped"] += dropped
        if is_old:
            return
        if any(frame.take_over for frame in orders.frames):
            self._warm = now + _MAX_WARMING
        try:
            answered = worker.push(orders.frames, now)
        except Exception as error:
            raise wire.FormatError(f"frames: {error}") from error
        if answered:
            self._answered_at = self._answered_at if self._answers else now
            self._answers += answered
        if time.monotonic() - self._answered_at > _MAX_TOGETHER:
            self.send_answers()

    def send_answers(self) -> None:
        """Send the answers that wait."""
        if self._answers:
            answers, self._answers = self._answers, []
            self._back.put(wire.encode(wire.Answers(self._name, answers)))

    def report(self, question: int = 0) -> None:
        """Send a report, which also shows that the worker is alive, or ask for terms, or answer a question."""
        self.send_answers()
        if self._terms and self._terms.digest != self._digest:
            self._open(self._terms)
        if self._worker:
            report = self._worker.report(time.monotonic(), dropped=self._dropped, leaves=self._leaves)
            self._back.put(wire.encode(wire.Answers(self._name, [], report, question)))
        elif not (self._terms or self._is_refused):
            self._back.put(wire.encode(wire.Answers(self._name)))
