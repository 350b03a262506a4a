"""A gateway: frames go to the workers that have their performers by Zenoh, and the workers' answers come back.

It keeps the last seconds of each performer's frames. When a worker comes or goes, another one is shown these, and goes
on: no worker knows that there are others.
"""

from __future__ import annotations

import math
import time
import uuid
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import msgspec

from kinespace.library.motion_library import MIN_JOINTS, MotionLibrary
from kinespace.library.naming import hdm05
from kinespace.library.skeleton import Skeleton
from kinespace.library.windows.index import WindowIndex
from kinespace.stream.frame import Admitted, Announcement, Frame, NewSender
from kinespace.stream.inputs.source import TENDING
from kinespace.stream.recognition import Event, Recognition
from kinespace.stream.recognizer import Settings
from kinespace.stream.recognizer.decision import Decision
from kinespace.stream.recognizer.limits import needed_lead, usual_sensitivity
from kinespace.stream.recognizer.performers import MAX_REMEMBERED, Newcomers, PerformerCounts, remember
from kinespace.stream.recognizer.recognizer import MAX_PAUSE
from kinespace.stream.status import InputCounts
from kinespace.stream.workers import terms as agreed
from kinespace.stream.workers import wire
from kinespace.stream.workers.bus import Inbox, joined, unreached
from kinespace.stream.workers.terms import Terms
from kinespace.stream.workers.track import Track
from kinespace.stream.workers.wire import Answers, FormatError, Orders, Report, decode, encode, key, last_of

#: Seconds without a report after which a worker counts as gone; it joins again when it wakes.
MAX_SILENT = 0.8
#: Seconds between two looks at the workers, above which this process itself was stopped for a while.
_STOPPED = 0.4
#: Seconds in which the last frames are answered at the end.
_MAX_ENDING = 0.5
#: Seconds without an answer after which a performer makes room for a newcomer.
_UNHEARD = 1.0


class _Member:
    """A worker that works for this gateway: the way to it, when its last message came, its reports."""

    def __init__(self, sends: Any, report: Report) -> None:  # noqa: ANN401 - Zenoh's
        self.sends, self.report, self.newest = sends, report, time.monotonic()
        self.messages = self.reports = 0

    def send(self, frames: list[wire.SentFrame]) -> None:
        """Send frames; Zenoh drops them if the way is full."""
        self.messages += 1
        self.sends.put(encode(Orders(frames=frames, number=self.messages, at=time.monotonic())))


class Gateway:
    """Takes the place of `Performers`; its workers may run on other machines.

    Parameters
    ----------
    session
        An open session of Zenoh; closed by `source.close`.
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
    terms
        The terms now.
    source
        Where the workers' messages come in; the service reads and closes it.
    publish
        Gets each answer, and for how many seconds its frame has waited for it.
    outdated
        Answers that were not passed on: of former workers, or to performers who have left.
    unread
        Workers' messages and answers that could not be read.
    unsent
        Frames that no worker got, because there was none.
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
        self._pack, self.terms = pack, terms
        self._know(library, terms.classes)
        self.most, self.silence = terms.most, terms.silence
        self.name = uuid.uuid4().hex[:12]
        self.inbox = Inbox()
        self.source = GatewaySource(self)
        self.publish: Callable[[Recognition, float], None] = lambda *_: None
        self.outdated = self.unread = self.unsent = 0
        self._session, self._connect, self._show = session, connect, show
        self._tracks: dict[str, Track] = {}
        self._newcomers = Newcomers(self.most)
        # A sender may announce its joints once, so announcements are kept through a silence.
        self._announced: dict[str, tuple[str, ...]] = {}
        self._ended, self._gone = list["Event"](), list[str]()
        #: The workers whose tokens are there, and those of them that work.
        self._there, self._members = set[str](), dict[str, _Member]()
        #: The counts of workers that have ended.
        self._past = Report(PerformerCounts())
        self._no_room = self._dropped = self._lost = 0
        self._last_lost, self._joined, self._looked = "", set[str](), time.monotonic()
        live = session.liveliness()
        self._declared = [
            session.declare_queryable(key(self.name, "terms"), lambda query: _reply(query, encode(self.terms))),
            session.declare_queryable(key(self.name, "library"), lambda query: _reply(query, self._packed)),
            session.declare_subscriber(
                f"{key(self.name, 'back')}/*",
                lambda sample: self.inbox.put(self._take_in, last_of(sample), bytes(sample.payload)),
            ),
            live.declare_subscriber(
                f"{wire.WORKERS}/*",
                lambda sample: self.inbox.put(self._see, last_of(sample), sample.kind == zenoh.SampleKind.PUT),
                history=True,
            ),
            live.declare_token(f"{wire.GATEWAYS}/{self.name}"),
        ]

    def _know(self, library: MotionLibrary | WindowIndex, order: Sequence[str]) -> None:
        motions = library.library if isinstance(library, WindowIndex) else library
        self._skeleton, self._packed = motions.skeleton, self._pack(library)
        self._usual_sensitivity, self._lead = usual_sensitivity(motions), needed_lead(motions, self.settings)
        self.classes = tuple(order) or motions.classes
        self.terms = msgspec.structs.replace(self.terms, classes=tuple(order), digest=agreed.digest_of(self._packed))

    # --- as `Performers` ---

    @property
    def names(self) -> tuple[str, ...]:
        """The performers now followed, in the order of their first frames."""
        return tuple(self._tracks)

    @property
    def settings(self) -> Settings:
        """The settings of all recognisers."""
        return self.terms.settings

    @property
    def sensitivity(self) -> float:
        """The sensitivity of all recognisers."""
        return self._usual_sensitivity if self.settings.sensitivity is None else self.settings.sensitivity

    @property
    def promise(self) -> tuple[float, float | None]:
        """False alarms an hour that `done` promises; what is missed the workers know."""
        return self.settings.promised, None

    def set_sensitivity(self, share: float) -> None:
        """Recognise all performers with another sensitivity soon."""
        self.terms = msgspec.structs.replace(self.terms, settings=replace(self.settings, sensitivity=share))
        self._send_all(Orders(changed=True))

    def exchange(self, library: MotionLibrary | WindowIndex, order: Sequence[str] = ()) -> list[Event]:
        """Compare all performers with another library soon; end the motions whose class it lacks."""
        self._know(library, order)
        self._send_all(Orders(changed=True))
        return [event for each in self._tracks.values() if (event := each.exchange(self.classes, self._lead))]

    @property
    def reported(self) -> Report:
        """The sums of all that workers have counted."""
        return _summed([self._past, *(member.report for member in self._members.values())])

    @property
    def counts(self) -> PerformerCounts:
        """Counts of what happened to all frames so far, as far as workers have reported it."""
        counts = self.reported.counts
        counts.no_room, counts.dropped = self._no_room, self._dropped
        return counts

    @property
    def refused(self) -> dict[str, str]:
        """Performers whose frames are refused for their joints, with the reason."""
        return self._told("refused")

    @property
    def doubted(self) -> dict[str, str]:
        """Performers with joints that cannot be believed, and the reason."""
        return self._told("doubted")

    @property
    def compared(self) -> dict[str, str]:
        """The joints by which performers are compared, if these are not all."""
        return self._told("compared")

    def _told(self, what: str) -> dict[str, str]:
        """Give what workers tell of performers."""
        reports = [getattr(member.report, what) for member in self._members.values()]
        return {name: text for told in reports for name, text in told.items()}

    def carried(self, name: str) -> None:
        """Give nothing: no worker tells which joints carry an answer, because nearly nobody asks."""

    def skeleton_of(self, name: str) -> Skeleton | None:
        """Give the joints of a performer's frames, by our names where we know them; None for an unknown performer."""
        if name not in self._tracks:
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

    def drop_silent(self, now: float) -> list[Event]:
        """Forget performers that sent nothing for `silence` seconds; give the ends of motions."""
        for name in [name for name, each in self._tracks.items() if now - each.newest > self.silence]:
            self._forget(name)
            self._gone = [*self._gone[-MAX_REMEMBERED * self.most :], name]
        ended, self._ended = self._ended, []
        return ended

    def end_paused(self, now: float) -> list[Event]:
        """Give the ends of the motions of performers who send nothing for now."""
        paused = (each for each in self._tracks.values() if now - each.newest > MAX_PAUSE)
        return [event for each in paused if (event := each.end())]

    def take_gone(self) -> list[str]:
        """Give the performers who were dropped since the last call."""
        gone, self._gone = self._gone, []
        return [name for name in gone if name not in self._tracks]

    def end(self) -> list[Event]:
        """Wait for the last answers; give the ends of all motions going on, because no more frames will come."""
        until, hop = time.monotonic() + _MAX_ENDING, self.settings.hop
        while time.monotonic() < until and any(each.is_owed(hop) for each in self._tracks.values() if each.worker):
            time.sleep(0.001)
            self.inbox.deal()
        return [*self._ended, *(event for each in self._tracks.values() if (event := each.end()))]

    def push_all(
        self,
        events: Sequence[Admitted],
        arrival: float,
        *,
        newest_only: bool = False,  # noqa: ARG002 - as `Performers`; the workers see for themselves what has waited
    ) -> list[Recognition | None]:
        """Send frames to their workers, in order; their answers go to `publish` later."""
        for_worker: dict[str, list[wire.SentFrame]] = {}
        for event in events:
            if isinstance(event, Frame):
                self._route(event, arrival, for_worker)
            elif isinstance(event, Announcement):
                remember(self._announced, event.performer, event.joints, self.most)
            elif isinstance(event, NewSender):
                self._announced.pop(event.performer, None)
                self._forget(event.performer)
        for worker, frames in for_worker.items():
            self._members[worker].send(frames)
        return [None] * len(events)

    # --- performers ---

    def _route(self, frame: Frame, arrival: float, for_worker: dict[str, list[wire.SentFrame]]) -> None:
        """Add a frame to those of the worker that answers it, if there is room for its performer."""
        if (track := self._track(frame.performer, arrival)) is None:
            self._no_room += 1
            return
        sent = track.send(frame, self._announced.get(frame.performer))
        if track.worker:
            for_worker.setdefault(track.worker, []).append(sent)
        else:
            self.unsent += 1

    def _track(self, name: str, now: float) -> Track | None:
        """Give a performer who sends a frame now; None when there is no room."""
        track = self._tracks.get(name)
        if track is None:
            if len(self._tracks) >= self.most:
                # On a machine that cannot keep up answers are late: one packet of a stranger drops nobody.
                if not self._newcomers.is_steady(name, now):
                    return None
                idle = min(self._tracks, key=lambda other: self._tracks[other].heard)
                if now - self._tracks[idle].heard < _UNHEARD:
                    return None
                self._forget(idle)
                self._gone.append(idle)
            self._newcomers.forget(name)
            worker = min(load, key=load.__getitem__) if (load := self._load()) else ""
            track = self._tracks[name] = Track(now, now, Decision(self._lead), worker)
        track.newest = now
        return track

    def _forget(self, name: str) -> None:
        """Forget a performer; the end of its motion is given out with the ends of silent performers."""
        if track := self._tracks.pop(name, None):
            self._dropped += 1
            if ended := track.end():
                self._ended.append(ended)

    # --- workers ---

    @property
    def ready(self) -> list[str]:
        """The workers that recognise."""
        return [*self._members]

    def _load(self) -> dict[str, int]:
        """Count the performers of each worker."""
        counts = Counter(each.worker for each in self._tracks.values())
        return {worker: counts[worker] for worker in self._members}

    def _balance(self, now: float) -> None:
        """Give each performer without a worker to the one with the fewest, and one performer of the one with most."""
        if not (load := self._load()):
            return
        most = max(load, key=load.__getitem__)
        spared = most if load[most] > min(load.values()) + 1 else None
        for name, track in self._tracks.items():
            if track.worker in load and track.worker != spared:
                continue
            if track.worker == spared:
                spared = None
                load[most] -= 1
            track.worker = least = min(load, key=load.__getitem__)
            load[least] += 1
            seen, due = track.past(self._announced.get(name), now)
            self._send(least, Orders(due, seen))

    def _send(self, worker: str, orders: Orders) -> None:
        """Send a message that is not dropped."""
        congestion = self._zenoh.CongestionControl.BLOCK
        self._session.put(key(self.name, "to", worker), encode(orders), congestion_control=congestion)

    def _send_all(self, orders: Orders) -> None:
        for worker in self._members:
            self._send(worker, orders)

    def _see(self, worker: str, is_there: bool) -> None:  # noqa: FBT001 - a sample's kind
        """Note a worker's token, which vanishes with its process."""
        if is_there:
            self._there.add(worker)
        else:
            self._there.discard(worker)
            self._drop(worker, "is gone")

    def _drop(self, worker: str, why: str, *, is_lost: bool = True) -> None:
        """Give the performers of a worker to others; keep its counts."""
        if member := self._members.pop(worker, None):
            member.sends.undeclare()
            self._past = _summed([self._past, member.report])
            if is_lost:
                self._lost, self._last_lost = self._lost + 1, f"worker {worker} {why}"
            self._say(worker, why)
            for track in self._tracks.values():
                track.worker = "" if track.worker == worker else track.worker
            self._balance(time.monotonic())

    def _take_in(self, worker: str, message: bytes) -> None:
        """Read a worker's message."""
        try:
            back = decode(Answers, message)
        except FormatError:
            self.unread += 1
            return
        member = self._members.get(worker)
        if member is None and back.report and worker in self._there and not back.report.leaves:
            self._welcome(worker, back.report)
        elif member:
            member.newest, member.report = time.monotonic(), back.report or member.report
            member.reports += back.report is not None
        for answer in back.answers:
            self._accept(worker, answer)
        if back.report and back.report.leaves:
            self._there.discard(worker)
            self._drop(worker, "leaves", is_lost=False)

    def _accept(self, worker: str, answer: Recognition) -> None:
        """Pass on an answer, if it is its performer's worker's, and news."""
        track = self._tracks.get(answer.performer)
        if not _is_whole(answer):
            self.unread += 1
        elif track and track.worker == worker and (accepted := track.accept(answer, self.classes)):
            recognition, arrival = accepted
            self.publish(recognition, max(time.monotonic() - arrival, 0.0))
        else:
            self.outdated += 1

    def _welcome(self, worker: str, report: Report) -> None:
        congestion = self._zenoh.CongestionControl.DROP
        sends = self._session.declare_publisher(key(self.name, "to", worker), congestion_control=congestion)
        self._members[worker] = _Member(sends, report)
        self._say(worker, "works")

    def _say(self, worker: str, what: str) -> None:
        new = joined(self._session, self._joined)
        self._show(f"worker {worker} {what}; workers: {len(self.ready)}{'; joined: ' * bool(new)}{', '.join(new)}")

    @property
    def notes(self) -> list[str]:
        """Notes for a person, a line each."""
        counts = {
            "frames that no worker took": self.unsent,
            "messages of workers that cannot be read": self.unread,
            "answers of former workers or to frames answered before": self.outdated,
        }
        lost = [f"workers lost so far: {self._lost}; last: {self._last_lost}"] if self._lost else []
        places = unreached(self._session, self._connect)
        far = [f"not reached: {', '.join(places)}"] if places else []
        counted = [f"{count} {what}" for what, count in counts.items() if count]
        return [f"workers of gateway {self.name}: {len(self.ready)}", *far, *counted, *lost]

    def tend(self, now: float) -> None:
        """Read messages; drop the workers that do not report; move a performer if a worker has too many."""
        self.inbox.deal()
        if now - self._looked > _STOPPED:
            for member in self._members.values():
                member.newest = max(member.newest, now - MAX_SILENT / 2)
        self._looked = now
        for worker in [name for name, member in self._members.items() if now - member.newest > MAX_SILENT]:
            self._drop(worker, "does not report")
        self._balance(now)

    def settle(self) -> None:
        """Wait for the workers' next reports, which count all that they have answered, for a second at most."""
        before, until = {name: member.reports for name, member in self._members.items()}, time.monotonic() + 1.0
        while any(member.reports == before.get(name) for name, member in self._members.items()):
            if time.monotonic() > until:
                return
            time.sleep(0.005)
            self.inbox.deal()

    def close(self) -> None:
        """Leave Zenoh; without effect a second time."""
        self._session.close()
        self.inbox.close()


class GatewaySource:
    """The messages of all workers, as a source of the service; no frames come in here."""

    place = ""
    lag = waited = 0.0
    patience = math.inf
    tended_within = TENDING

    def __init__(self, gateway: Gateway) -> None:
        self.gateway, self.pollable = gateway, gateway.inbox

    @property
    def has_put_aside(self) -> bool:
        """Whether messages wait for which the loop was not woken; none ever does."""
        return False

    @property
    def counts(self) -> InputCounts:
        """Counts of what was dropped on the way to recognisers."""
        total = self.gateway.reported
        return InputCounts(stale=total.stale, missing=total.missing)

    @property
    def notes(self) -> list[str]:
        """Notes for a person, a line each."""
        return self.gateway.notes

    def take(self, arrival: float) -> None:  # noqa: ARG002 - as any source
        """Read the messages that have come; they hold no frames."""
        self.gateway.inbox.deal()

    def tend(self, now: float) -> Sequence[Admitted]:
        """Look after the workers."""
        self.gateway.tend(now)
        return ()

    def close(self) -> None:
        """Leave Zenoh."""
        self.gateway.close()


def _reply(query: Any, answer: bytes) -> None:  # noqa: ANN401 - Zenoh's
    with query:
        query.reply(query.key_expr, answer)


def _summed(reports: Sequence[Report]) -> Report:
    """Add up reports: the counts that the gateway does not know itself."""
    counts = PerformerCounts()
    for each in reports:
        counts.recognizers.add(each.counts.recognizers)
        counts.other_joints += each.counts.other_joints
        counts.opening += each.counts.opening
    return Report(counts, stale=sum(each.stale for each in reports), missing=sum(each.missing for each in reports))


def _is_whole(given: Recognition) -> bool:
    """Say whether an answer has a score for each class, names none but these, and its numbers are finite."""
    classes, progress, evidence, done, seen = len(given.classes), given.progress, given.evidence, given.done, given.seen
    numbers = (
        *(given.time, given.ended_at or 0.0, given.movement, given.eigenvector_score, given.share, given.gap),
        *((progress.phase, progress.scrub, progress.speed, progress.amplitude, progress.sure) if progress else ()),
        *((*evidence.distances, *evidence.leads, evidence.noise) if evidence else ()),
        *((done.start, done.duration, done.score, done.speed, done.amplitude) if done else ()),
        *((seen.score, seen.seconds) if seen else ()),
        *given.scores.tolist(),
    )
    named = all(each is None or each.class_name in given.classes for each in (progress, seen))
    named = named and (done is None or given.classes[done.index : done.index + 1] == (done.label,))
    # The only class of a library leads infinitely.
    is_known = named and not math.isnan(given.lead) and all(map(math.isfinite, numbers))
    is_known = is_known and 0 < classes == len(given.scores)
    return is_known and 0 <= (given.guess or 0) < classes and -1 <= given.so_far < classes
