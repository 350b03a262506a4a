"""The loop: frames from sources, through one recogniser per performer, to sinks; in overload by turns."""

import math
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import islice
from typing import TYPE_CHECKING, NamedTuple, Protocol, TypeAlias

import numpy as np
import zmq

from kinespace.stream.frame import Admitted, Frame
from kinespace.stream.inputs.admission import Admission
from kinespace.stream.inputs.commands import RequestSource
from kinespace.stream.inputs.source import APART, Source
from kinespace.stream.osc.messages import address_part
from kinespace.stream.outputs.sink import Message, Sink
from kinespace.stream.recognition import Classes, Event, EventKind, Gone, Outcome, Recognition
from kinespace.stream.recognizer import Performers
from kinespace.stream.status import InputCounts, RecognizerCounts, Status
from kinespace.stream.teaching import Asked, State, Step, commands

if TYPE_CHECKING:
    # A worker runs this loop itself.
    from kinespace.stream.service.workers import Gateway, GatewaySource, Worker

#: Seconds for which a packet may wait before it is taken in. When one waited longer, all that wait are taken in, and
#: performers are answered by turns, each by its newest frame.
LATE = 0.15
#: Seconds after which a frame is dropped unread then.
PATIENCE = 0.2
#: Packets that are all answered, even late: no more than wait when the machine has hesitated. And seconds after which
#: not even these are: listeners would take the past for the present.
MAX_HESITATION = 64
MAX_AGE = 1.0
#: Seconds for which turns go on after a late packet: else the loop would fall behind again at once.
CAUTION = 1.0
#: Frames of a performer that wait for its turn, at most: as many seconds as an answer needs.
MAX_WAITING = 24
#: Performers that wait for their turns, at most; only a program that makes up names reaches the limit.
MAX_PERFORMERS = 1024
#: Commands that wait, at most: each may take some hundredths of a second, and all are carried out before the end.
MAX_ASKED = 64


class Taken(NamedTuple):
    """A frame or announcement, and when its packet came, seconds as of `time.perf_counter`."""

    event: Admitted
    came: float


class Overload:
    """What waits for each performer's turn.

    Attributes
    ----------
    stale
        Frames that were dropped while they waited.
    """

    def __init__(self) -> None:
        self._cautious_until, self.stale = -math.inf, 0
        #: The performer who is to be answered first stands first; for some nothing waits.
        self._waiting: dict[str, list[Taken]] = {}

    @property
    def until(self) -> float:
        """Until when performers are answered by turns, seconds on the service's clock; inf while some wait."""
        return math.inf if self._waiting else self._cautious_until

    def keep(self, all_taken: Iterable[Taken], now: float, *, is_late: bool = False) -> None:
        """Keep frames and announcements until their performers' turns; `is_late`: one had waited for too long."""
        if is_late:
            self._cautious_until = now + CAUTION
        for taken in all_taken:
            name = taken.event.performer
            if name in self._waiting or len(self._waiting) < MAX_PERFORMERS:
                self._add(self._waiting.setdefault(name, []), taken)
            else:
                self.stale += 1

    def _add(self, waiting: list[Taken], taken: Taken) -> None:
        """Add to what waits for a performer; keep the newest frame, and of those before as many as windows need."""
        if len(waiting) > 1 and _apart(waiting[-2], taken) < APART and _apart(waiting[-1], taken) < APART:
            del waiting[-1]
            self.stale += 1
        waiting.append(taken)
        if len(waiting) > MAX_WAITING:
            del waiting[next((place for place, each in enumerate(waiting) if isinstance(each.event, Frame)), 0)]
            self.stale += 1

    def turns(self, most: int) -> list[Taken]:
        """Give all that waits for the performers who have waited for longest, in order; they wait no more."""
        names = [*islice((name for name, waiting in self._waiting.items() if waiting), most)]
        taken = [each for name in names for each in self._waiting.pop(name)]
        if len(self._waiting) + most >= MAX_PERFORMERS or not any(self._waiting.values()):
            self._waiting = {name: waiting for name, waiting in self._waiting.items() if waiting}
        # They keep their places: whoever had a turn comes behind all others, whose frames came earlier or later.
        self._waiting.update((name, []) for name in names if self._waiting)
        return taken


def _apart(before: Taken, after: Taken) -> float:
    """Give the seconds from one frame to another; inf where one is an announcement."""
    first, last = before.event, after.event
    return abs(last.time - first.time) if isinstance(first, Frame) and isinstance(last, Frame) else math.inf


#: Hops whose time is remembered for the percentiles: a minute or more of one performer's hops.
_MAX_HOPS = 2048
#: Seconds between two statuses, and between two lists of classes.
STATUS_EVERY = 1.0
CLASSES_EVERY = 5.0
#: Seconds between two refusals of commands that are said, at least.
REFUSED_EVERY = 1.0
#: Seconds for which packets that have waited are taken in before some performers are answered, at most.
_MAX_CATCHING_UP = 0.1
#: Performers that are then answered together; others after them only until answers have taken as long as packets: what
#: waits meanwhile grows old.
_TURNS = 8
#: Seconds that no packet has waited.
_ENDLESS = 1e6
#: Packets of one source that are taken in together, then recognised, then answered, at most: the processor's caches
#: then hold what a step needs, and one send wakes the listeners. More would keep the first packet waiting for too long.
_MAX_TOGETHER = 32
#: How often one source's packets are taken together, at most, before the other sources and the clock get their turn.
_MAX_IN_TURN = 8
#: Longest sleep while nothing comes, seconds: work that is due by the clock, and `stop`, wait no longer.
TENDING = 0.02
#: Steps after being stopped, at most: more than any socket holds, and few enough for the loop to end while a feed goes
#: on.
_MAX_LAST_STEPS = 32
#: Seconds after being stopped in which packets that have arrived are still answered, at most.
MAX_ENDING = 0.5
#: What may be a source, and the recognisers of several performers: here, or in workers.
AnySource: TypeAlias = "Source | RequestSource | GatewaySource | Worker"
Recognising: TypeAlias = "Performers | Gateway"


class Commanded(Protocol):
    """Carries out the commands that come in; a sink of the service, too, if it needs frames."""

    #: Whether performers are answered now, and the classes that are answered.
    answers: bool
    classes: Sequence[str]

    @property
    def muted(self) -> str:
        """The performer who is answered "unknown" for now, because of a lesson; empty for nobody."""

    def carry_out(self, asked: Asked) -> object:
        """Carry out a command. Never raises."""

    def tend(self, now: float) -> None:
        """Do the work that is due by the clock. Never raises."""


class Service:
    """Recognises the frames of some sources and passes the answers to some sinks.

    Parameters
    ----------
    performers
        The recognisers.
    sources, sinks
        Where frames come from, and where answers go; who has opened them closes them.
    admission
        The admission of the sources, for the status.
    control
        Carries out commands; without it each is refused.
    clock
        Seconds; stamps arrivals and paces the status.
    """

    def __init__(  # noqa: PLR0913 - all by keyword but three
        self,
        performers: Recognising,
        sources: Sequence[AnySource],
        sinks: Sequence[Sink],
        *,
        admission: Admission | None = None,
        control: Commanded | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.performers = performers
        self.sources = sources
        self.sinks = sinks
        self._clock = clock
        self._admission = admission or Admission()
        self._control = control
        #: How long the last hops took, seconds.
        self._hop_times = deque[float](maxlen=_MAX_HOPS)
        #: Frames of each performer since the last status, and frames a second before it.
        self._frames, self._rates = Counter[str](), dict[str, float]()
        #: The share of the answers due that were given, and the counts behind it.
        self._answered, self._counted = 1.0, RecognizerCounts()
        self._next_status = self._next_classes = self._next_refusal = clock()
        #: When the last step ends; inf before it was stopped.
        self._over = math.inf
        self._overload = Overload()
        #: Commands that wait.
        self._asked = deque[Asked]()
        #: The motions whose starts were published: performer and class.
        self._begun: set[tuple[str, str]] = set()
        #: How often each performer has done a motion: performer and index of the class, which a renamed class keeps.
        self._done = Counter[tuple[str, int]]()
        #: When the loop last looked at its sources.
        self._looked = clock()
        self._poller = zmq.Poller()
        for source in sources:
            self._poller.register(source.pollable, zmq.POLLIN)
        #: Handing frames to sinks that ignore them would cost every frame a call for each sink.
        self._watching = [sink for sink in sinks if hasattr(sink, "publish_frame")]

    def stop(self) -> None:
        """Make `run` return soon; from any thread or signal handler."""
        self._over = min(self._over, time.perf_counter() + MAX_ENDING)

    def ask(self, asked: Asked) -> None:
        """Carry out a command at the next turn; from any thread."""
        self._asked.append(asked)

    def run(self) -> None:
        """Run until stopped; answer packets that have arrived by then, end motions, let all performers leave."""
        try:
            while self._over == math.inf:
                self.step(TENDING)
            for _ in range(_MAX_LAST_STEPS):
                if time.perf_counter() < self._over:
                    self.step(0.0)
            while self._asked:
                self._carry_out(self._asked.popleft())
        finally:
            self._publish_events(self.performers.end())
            self._publish_gone(self.performers.names)

    def step(self, longest: float) -> None:
        """Wait at most `longest` seconds for packets, and deal with all that have come."""
        self._publish_on_time()
        self._tend()
        sleep = min(longest, max(self._next_status - self._clock(), 0.0))
        aside = any(source.has_put_aside for source in self.sources)
        is_busy = aside or self._asked or self._overload.until == math.inf
        self._poller.poll(0 if is_busy else math.ceil(sleep * 1000))
        began = self._clock()
        # Every source is asked, even when nothing came: one poll is cheaper than finding out which source it was, and a
        # receiver looks after its connections.
        for source in self.sources:
            left = _MAX_IN_TURN
            while left and time.perf_counter() < self._over and self._deal_with_waiting(source):
                left -= 1
        self._looked = now = self._clock()
        until = 2 * now - began
        while self._overload.until == math.inf:
            self._deal_with(self._overload.turns(_TURNS), newest_only=True)
            if self._clock() >= until:
                break

    def _deal_with_waiting(self, source: AnySource) -> bool:
        """Take in some packets, recognise, answer; say whether more may wait."""
        # One alone: some take hundredths of a second, in which nobody is answered.
        if self._asked:
            self._carry_out(self._asked.popleft())
        taken: list[Taken] = []
        is_overloaded = self._clock() < self._overload.until
        source.patience = PATIENCE if is_overloaded else math.inf
        packets, more, asked = 0, not is_overloaded, len(self._asked)
        # A command is carried out before the frames behind it.
        while more and max(packets, len(taken)) < _MAX_TOGETHER and len(self._asked) == asked:
            packets, more = packets + 1, self._take(source, taken)
        if is_overloaded or source.lag > LATE:
            self._catch_up(source, taken)
            return False
        self._deal_with(taken)
        return more

    def _take(self, source: AnySource, taken: list[Taken]) -> bool:
        """Take in a packet: carry out its commands, add its frames and announcements; say whether one waited."""
        started = time.perf_counter()
        events = source.take(self._clock())
        if events is None:
            return False
        for event in events:
            if isinstance(event, Asked) and event.command and len(self._asked) < MAX_ASKED:
                self._asked.append(event)
            elif isinstance(event, Asked):
                why = event.refusal or f"too many commands: expected at most {MAX_ASKED} that wait"
                self._carry_out(replace(event, command=None, refusal=why))
            else:
                taken.append(Taken(event, started - source.waited))
        return True

    def _carry_out(self, asked: Asked) -> None:
        """Carry out a command; of those that are refused one is said in a second."""
        refused = [] if asked.command else [State("", Step.REFUSED, reason=asked.refusal)]
        if isinstance(asked.command, commands.Reset):
            self._forget_counts(asked.command.performer)
        if refused and (now := self._clock()) >= self._next_refusal:
            self._next_refusal = now + REFUSED_EVERY
            tell(self.sinks, refused[0])
        if self._control and asked.command:
            self._control.carry_out(asked)
        elif asked.reply:
            asked.reply(refused, {})

    def _catch_up(self, source: AnySource, taken: list[Taken]) -> None:
        """Take in all that waits; answer it all if it is little and not too old, else let performers wait for turns."""
        until = self._clock() + _MAX_CATCHING_UP
        lag = source.lag if taken else 0.0
        while self._clock() < until and self._take(source, taken):
            lag = max(lag, source.lag)
            if len(taken) > MAX_HESITATION:
                # What has waited before overload was noticed is only thinned.
                source.patience = min(source.patience, _ENDLESS)
        if source.patience < math.inf or lag > MAX_AGE:
            self._overload.keep(taken, self._clock(), is_late=lag > LATE)
        else:
            self._deal_with(taken)

    def _tend(self) -> None:
        for source in self.sources:
            started = time.perf_counter()
            now = self._clock()
            taken = [Taken(event, started) for event in source.tend(now)]
            if now < self._overload.until:
                self._overload.keep(taken, now)
            else:
                self._deal_with(taken)
        if self._control:
            self._control.tend(self._clock())

    def _deal_with(self, taken: Sequence[Taken], *, newest_only: bool = False) -> None:
        """Recognise frames, publish the answers, and count them."""
        if not taken:
            return
        events = [each.event for each in taken]
        answers = self.performers.push_all(events, self._clock(), newest_only=newest_only)
        for answer, (_, came) in zip(answers, taken, strict=True):
            if answer is not None:
                self.publish(answer, time.perf_counter() - came)
        for event in events:
            if isinstance(event, Frame):
                self._frames[event.performer] += 1
                tell(self._watching, event)

    def _as_answered(self, recognition: Recognition) -> Recognition:
        """Give an answer as listeners get it: nothing is known before anything is taught, or in a lesson."""
        if self._control is None or (self._control.answers and recognition.performer != self._control.muted):
            return recognition
        ends = tuple(each for each in recognition.events if each.kind is EventKind.END)
        outcome = Outcome.UNKNOWN if recognition.outcome is Outcome.NAMED else recognition.outcome
        answer = recognition.performer, recognition.time, outcome, (), np.zeros(0), recognition.movement
        return Recognition(*answer, guess=-1, events=ends)

    def publish(self, recognition: Recognition, took: float) -> None:
        """Publish an answer, made here or elsewhere, and what happened; its frame came `took` seconds ago."""
        recognition = self._as_answered(recognition)
        tell(self.sinks, recognition)
        self._publish_events(recognition.events)
        if done := recognition.done:
            self._done[done.performer, done.index] += 1
            tell(self.sinks, replace(done, count=self._done[done.performer, done.index]))
        self._hop_times.append(took)

    def _publish_events(self, events: Sequence[Event]) -> None:
        """Publish starts and ends of motions; no end of a motion whose start was not published."""
        for event in events:
            motion = event.performer, event.label
            if event.kind is EventKind.END and motion not in self._begun:
                continue
            (self._begun.add if event.kind is EventKind.START else self._begun.discard)(motion)
            tell(self.sinks, event)

    def _forget_counts(self, performer: str) -> None:
        """Count a performer's motions from 1 again, by the name or as it stands in addresses; for none everybody's."""
        for motion in [each for each in self._done if performer in ("", each[0], address_part(each[0]))]:
            del self._done[motion]

    def _publish_gone(self, performers: Sequence[str]) -> None:
        gone = {*performers}
        self._begun = {motion for motion in self._begun if motion[0] not in gone}
        for performer in performers:
            self._forget_counts(performer)
            tell(self.sinks, Gone(performer))

    def _publish_on_time(self) -> None:
        now = self._clock()
        if now >= self._next_classes:
            self._next_classes = now + CLASSES_EVERY
            tell(self.sinks, Classes(tuple((self._control or self.performers).classes)))
        if now >= self._next_status:
            elapsed = now - self._next_status + STATUS_EVERY
            self._next_status = now + STATUS_EVERY
            # After a stop of this process packets wait, and nobody knows who is silent.
            paused = self.performers.end_paused(now) if now - self._looked < MAX_AGE else []
            self._publish_events([*paused, *self.performers.drop_silent(now)])
            self._publish_gone(self.performers.take_gone())
            # Of performers alone: thousands of names may have been counted for which there was no room.
            self._rates = {name: self._frames[name] / elapsed for name in self.performers.names}
            self._frames.clear()
            self._note_answered()
            tell(self.sinks, self.status())

    def status(self) -> Status:
        """Give the counters as they are now."""
        notes = [note for source in self.sources for note in source.notes]
        notes += [note for sink in self.sinks for note in (*sink.notes, sink.error) if note]
        promised, missed = self.performers.promise
        p50, p99 = np.percentile(self._hop_times or (0.0,), (50, 99)).tolist()
        return Status(
            inputs=sum((source.counts for source in self.sources), start=InputCounts(stale=self._overload.stale)),
            outcomes=self.performers.counts,
            unsent=sum(sink.failed + sink.raised for sink in self.sinks),
            performers={name: self._rates.get(name, 0.0) for name in self.performers.names},
            hop_p50=p50,
            hop_p99=p99,
            refused={name: why + self._from(name) for name, why in self.performers.refused.items()},
            doubted=self.performers.doubted,
            compared=self.performers.compared,
            admission=replace(self._admission.counts),
            clocks={name: clock for name, clock in self._admission.clocks.items() if name in self.performers.names},
            listening=tuple(source.place for source in self.sources if source.place),
            notes=(*dict.fromkeys(notes), *self._admission.notes(self._clock())),
            promised=promised,
            missed=missed,
            answered=self._answered,
        )

    def _note_answered(self) -> None:
        """Note the share of the answers due since the last status that were given."""
        total = self.performers.counts.recognizers
        since, self._counted = total - self._counted, total
        given, left_out = max(since.hops, 0), max(since.skipped, 0)
        self._answered = given / (given + left_out) if left_out else 1.0

    def _from(self, performer: str) -> str:
        """Give the sender of a performer's frames, where it is known."""
        return "".join(f", from {host}:{port}" for host, port in self._admission.senders(performer))


def tell(sinks: Iterable[Sink], message: Message) -> None:
    """Give all sinks a message; an error of one is counted there, and keeps what is told from nobody else."""
    for sink in sinks:
        try:
            sink.send(message)
        except BrokenPipeError:
            # Whoever read what this program prints has gone: all programs end then.
            raise
        except Exception as error:  # noqa: BLE001 - whatever strangers make a sink tell, it ends nobody else's answers
            sink.raised += 1
            sink.error = f"{type(sink).__name__}: {type(error).__name__}: {error}"
