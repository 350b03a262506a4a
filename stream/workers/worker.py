"""A worker on Zenoh: it works for a gateway whose terms it can fulfil.

Its work is an ordinary service: frames come from the gateway, answers go back. Performers of another worker come with
the frames of their last seconds, so that the windows and averages here are soon like those there.
"""

from __future__ import annotations

import math
import select
import threading
import time
import uuid
from collections.abc import Callable, Sequence
from typing import Any

from kinespace.library.motion_library import MotionLibrary
from kinespace.library.windows.index import WindowIndex
from kinespace.stream.frame import Admitted, Frame
from kinespace.stream.inputs.source import TENDING
from kinespace.stream.outputs.sink import Sink
from kinespace.stream.recognition import Recognition
from kinespace.stream.recognizer import Performers, Recognizer, RecognizerCounts
from kinespace.stream.recognizer.limits import index_for
from kinespace.stream.service.background_opener import BackgroundViews
from kinespace.stream.service.loop import Service
from kinespace.stream.status import InputCounts
from kinespace.stream.workers import terms as agreed
from kinespace.stream.workers.bus import Inbox, unreached
from kinespace.stream.workers.terms import Terms
from kinespace.stream.workers.wire import GATEWAYS, WORKERS, Answers, FormatError, Orders, Report, decode, encode, key
from kinespace.stream.workers.wire import last_of as name_of

#: Seconds between two reports.
REPORT_EVERY = 0.25
#: Seconds of the frames shown in which windows are compared, too: the windows before are shorter than the former
#: worker's, and would only mislead the averages.
_COMPARED = 0.5
#: Seconds in a second by which two clocks may drift apart.
_DRIFT = 1e-3
#: Longest sleep while nothing comes, seconds.
_MAX_SLEEP = 0.1
#: Seconds for which a gateway may take to answer a question, and after which it is asked again.
_MAX_ANSWER = 20.0
_ASKED_AGAIN = 0.5
#: Seconds after which a worker says that it sees no gateway.
_MAX_ALONE = 5.0
#: Numpy reads the head of an array by Python's parser, which CPython 3.11 sometimes fails at in two threads at once.
_READS = threading.Lock()


class Worker:
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
    inbox
        The messages that wait.
    is_outdated
        Whether the gateway has changed its terms.
    counts
        How often it refused to work for a gateway; messages that could not be read; frames that were dropped because
        they had waited for too long, and messages of frames that were lost on the way.
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
        self.counts = dict.fromkeys(("refused", "unread", "stale", "missing"), 0)
        self.session, self.inbox, self.is_outdated = session, Inbox(), False
        self._show, self._connect, self._read, self._stopped = show, connect, read, False
        #: The gateways that are there, the first that was seen first, and those for which this worker cannot work.
        self._gateways, self._refused = dict[str, None](), set[str]()
        self._work: _Work | None = None
        self._digest = ""
        self._index: WindowIndex | None = None
        self._asks: threading.Thread | None = None
        self._ask_at, self._lonely = 0.0, time.monotonic() + _MAX_ALONE
        self._said = set[str]()
        self._declared = [
            session.liveliness().declare_token(f"{WORKERS}/{self.name}"),
            session.liveliness().declare_subscriber(
                f"{GATEWAYS}/*",
                lambda sample: self.inbox.put(self._see, name_of(sample), sample.kind == zenoh.SampleKind.PUT),
                history=True,
            ),
        ]

    def stop(self) -> None:
        """Make `run` return soon; from any thread or signal handler."""
        self._stopped = True

    def run(self, *, once: bool = False) -> None:
        """Work until stopped; `once`: or until the first gateway is gone, or none was seen for some seconds."""
        while not (self._stopped or (once and not self._gateways and self._lonely == math.inf)):
            self.step(_MAX_SLEEP)

    def step(self, longest: float) -> None:
        """Wait at most `longest` seconds for messages, and deal with them."""
        if self._work:
            self._work.service.step(longest)
        else:
            if self.inbox.is_empty:
                select.select([self.inbox], [], [], longest)
            self.inbox.deal()
        now = time.monotonic()
        wanted = next((each for each in self._gateways if each not in self._refused), None)
        if wanted and (self.is_outdated or not self._work) and now >= self._ask_at:
            self._ask_at, self.is_outdated = math.inf, False
            self._asks = threading.Thread(target=self._open, args=(wanted,), name="kinespace opening", daemon=True)
            self._asks.start()
        if now >= self._lonely:
            places = unreached(self.session, self._connect)
            far = f"; not reached: {', '.join(places)}" if places else ""
            self._show(f"no gateway is seen yet{far}. Does one run, do certificates and access rules let us in?")
            self._lonely = math.inf

    def close(self) -> None:
        """Say that this worker leaves, and leave Zenoh: the gateway gives the performers to others."""
        if self._work:
            self._work.send(leaves=True)
            self._work = None
        self.session.close()
        self.inbox.close()

    def ignore(self, why: str, line: str) -> None:
        """Count a gateway or a message that is ignored; print a line for a person, the first time."""
        self.counts[why] += 1
        if line not in self._said and len(self._said) < 100:
            self._said.add(line)
            self._show(line)

    def _see(self, gateway: str, is_there: bool) -> None:  # noqa: FBT001 - a sample's kind
        """Note a gateway that has come, or has gone."""
        if is_there:
            self._lonely = math.inf
            self._gateways[gateway] = None
        elif gateway in self._gateways:
            del self._gateways[gateway]
            self._refused.discard(gateway)
            if self._work and self._work.gateway == gateway:
                self._end_work()
            self._show(f"gateway {gateway} is gone")

    def _end_work(self) -> None:
        if self._work:
            self._work.end()
        self._work = None

    def _open(self, gateway: str) -> None:
        """Ask for the terms, fetch their library unless it is known, and open it; in a thread of its own."""
        try:
            terms = decode(Terms, self._asked(gateway, "terms"))
            if terms.refusal:
                raise ValueError(terms.refusal)  # noqa: TRY301 - all reasons are told alike
            index = self._index
            if terms.digest != self._digest or index is None:
                file = self._asked(gateway, "library")
                if agreed.digest_of(file) != terms.digest:
                    # It may have been exchanged meanwhile.
                    line = f"not working for gateway {gateway}: the library that came is not {terms.digest[:12]}"
                    self.inbox.put(self.ignore, "refused", line)
                    raise TimeoutError  # noqa: TRY301 - as above
                with _READS:
                    index = index_for(self._read(file), terms.settings)
            # A recogniser prepares what all recognisers share, some of which takes a second: no frame waits for it.
            Recognizer(index, terms.settings)
        except TimeoutError:
            self.inbox.put(self._ask_again)
        except Exception as error:  # noqa: BLE001 - of any kind, by terms or a library that no gateway of ours has
            self.inbox.put(self._refuse, gateway, error)
        else:
            self.inbox.put(self._opened, gateway, terms, index)

    def _asked(self, gateway: str, what: str) -> bytes:
        for reply in self.session.get(key(gateway, what), timeout=_MAX_ANSWER):
            if reply.ok:
                return bytes(reply.ok.payload)
        raise TimeoutError

    def _ask_again(self) -> None:
        self._ask_at = time.monotonic() + _ASKED_AGAIN
        self.is_outdated = self._work is not None

    def _refuse(self, gateway: str, error: Exception) -> None:
        self._ask_at = 0.0
        if self._work and self._work.gateway == gateway:
            self._end_work()
        self._refused.add(gateway)
        reason = f"{error}" if isinstance(error, ValueError) else f"{type(error).__name__}: {error}"
        self.ignore("refused", f"not working for gateway {gateway}: {reason}")

    def _opened(self, gateway: str, terms: Terms, index: WindowIndex) -> None:
        """Begin, or go on with other terms; the gateway ends the motions whose class they lack."""
        self._ask_at = 0.0
        if gateway not in self._gateways:
            return
        self._digest, self._index = terms.digest, index
        try:
            if self._work:
                self._work.change(terms, index)
                return
            self._work = _Work(self, gateway, terms, index)
        except Exception as error:  # noqa: BLE001 - as in `_open`
            self._refuse(gateway, error)
            return
        self._show(f"working for gateway {gateway}, library {terms.digest[:12]}")
        self._work.send()


class _Work(Sink):
    """The work for one gateway: the source of a service, and its sink."""

    place = ""
    patience = math.inf
    tended_within = TENDING

    def __init__(self, worker: Worker, gateway: str, terms: Terms, index: WindowIndex) -> None:
        import zenoh  # noqa: PLC0415 - an extra

        self.gateway, self.pollable, self._worker = gateway, worker.inbox, worker
        self._performers = Performers(
            index,
            terms.settings,
            most=terms.most,
            # The gateway drops a silent performer; a worker may forget it later.
            silence=2 * terms.silence,
            joints=terms.joints,
            views=BackgroundViews(),
            classes=terms.classes,
        )
        self.service = Service(self._performers, [self], [self])
        self.lag = self.waited = 0.0
        self.counts = InputCounts()
        self._number, self._taken, self._is_over = 0, list["Admitted"](), False
        #: The delay of the quickest message lately, and when one last came.
        self._quickest, self._noted = math.inf, 0.0
        self._answers, self._next_report = list["Recognition"](), 0.0
        #: Counts of the frames that were only shown, which the former worker has counted, too.
        self._shown = RecognizerCounts()
        congestion = zenoh.CongestionControl.BLOCK
        self._back = worker.session.declare_publisher(key(gateway, "back", worker.name), congestion_control=congestion)
        self._subscriber = worker.session.declare_subscriber(
            key(gateway, "to", worker.name),
            lambda sample: worker.inbox.put(self._obey, bytes(sample.payload)),
        )

    @property
    def has_put_aside(self) -> bool:
        """Whether messages wait for which the loop is not woken again."""
        return not self._worker.inbox.is_empty

    def change(self, terms: Terms, index: WindowIndex) -> None:
        """Go on with other terms."""
        self._performers.exchange(index, terms.classes)
        if terms.settings.sensitivity is not None:
            self._performers.set_sensitivity(terms.settings.sensitivity)

    def end(self) -> None:
        """Take in no more frames, and send no more answers, also those of the turn that goes on."""
        self._is_over = True
        self._subscriber.undeclare()
        self._back.undeclare()

    def publish(self, recognition: Recognition) -> None:
        """Keep an answer until no message waits, or until the next one is taken in."""
        self._answers.append(recognition)

    def take(self, arrival: float) -> Sequence[Admitted] | None:
        """Deal with a message; give its frames that are to be answered, or None when no message waits."""
        self.tend(arrival)
        if self._worker.inbox.is_empty:
            self.lag = 0.0
            return None
        self._taken = []
        self._worker.inbox.deal(-1.0)
        return self._taken

    def tend(self, now: float) -> Sequence[Admitted]:
        """Send the answers that wait, and from time to time a report."""
        if not self._is_over and (self._answers or now >= self._next_report):
            self.send(report=now >= self._next_report)
        return ()

    def send(self, *, report: bool = True, leaves: bool = False) -> None:
        """Send the answers that wait, and a report."""
        answers, self._answers = self._answers, []
        if report:
            self._next_report = time.monotonic() + REPORT_EVERY
        self._back.put(encode(Answers(answers, self._report(leaves=leaves) if report else None)))

    def _report(self, *, leaves: bool) -> Report:
        performers = self._performers
        counts = performers.counts
        counts.recognizers.add(self._shown, -1)
        stale = self.service.status().inputs.stale
        self._worker.counts |= {"stale": stale, "missing": self.counts.missing}
        told = performers.refused, performers.doubted, performers.compared
        return Report(counts, *told, stale, self.counts.missing, leaves)

    def _obey(self, message: bytes) -> None:
        """Take in a message of the gateway."""
        try:
            orders = decode(Orders, message)
            seen = [event for each in orders.seen for event in each.events()]
            events = [event for each in orders.frames for event in each.events()]
        except FormatError as error:
            self._worker.ignore("unread", f"gateway {self.gateway}: {error}")
            return
        if orders.number:
            self.counts.missing += max(orders.number - self._number - 1, 0)
            self._number = orders.number
            self._note_delay(orders.at, time.monotonic())
        self._worker.is_outdated |= orders.changed
        if seen:
            self._follow(seen)
        is_late = self.waited > self.patience
        for event in events:
            if is_late and isinstance(event, Frame):
                self.counts.stale += 1
            else:
                self._taken.append(event)

    def _note_delay(self, sent: float, now: float) -> None:
        """Note how much longer than the quickest a message took; the clocks of two machines differ, and drift."""
        delay, elapsed = now - sent, now - self._noted
        self._quickest, self._noted = min(self._quickest + _DRIFT * elapsed, delay), now
        self.lag = self.waited = delay - self._quickest

    def _follow(self, seen: list[Admitted]) -> None:
        """Follow frames that another worker has answered; compare those of the last second."""
        before, now = self._performers.counts.recognizers, time.monotonic()
        times = [each.time if isinstance(each, Frame) else -math.inf for each in seen]
        older = next(place for place, time_ in enumerate(times) if time_ >= times[-1] - _COMPARED)
        self._performers.push_all(seen[:older], now, newest_only=True)
        self._performers.push_all(seen[older:], now)
        self._shown.add(self._performers.counts.recognizers)
        self._shown.add(before, -1)

    def close(self) -> None:
        """Nothing: the worker ends its work."""
