"""`Router` takes the place of `Performers`: it sends frames to workers, and takes their answers back."""

from __future__ import annotations

import itertools
import math
from abc import abstractmethod
from collections import Counter, deque
from dataclasses import replace
from typing import TYPE_CHECKING, cast

import msgspec

from kinespace.library.motion_library import MIN_JOINTS
from kinespace.library.naming import hdm05
from kinespace.library.windows.index import WindowIndex
from kinespace.stream.frame import Announcement, Frame, NewSender
from kinespace.stream.recognizer.decision import Decision
from kinespace.stream.recognizer.following import Following
from kinespace.stream.recognizer.limits import needed_lead, usual_sensitivity
from kinespace.stream.recognizer.performers import PerformerCounts
from kinespace.stream.workers.track import Move, Track
from kinespace.stream.workers.wire import Orders, Report

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from kinespace.library.motion_library import MotionLibrary
    from kinespace.library.skeleton import Skeleton
    from kinespace.stream.frame import Admitted
    from kinespace.stream.recognition import Event, Recognition
    from kinespace.stream.recognizer import Settings
    from kinespace.stream.recognizer.joints.carried import Carried
    from kinespace.stream.workers.terms import Terms
    from kinespace.stream.workers.wire import Answered, Answers, SentFrame

#: Frames that a worker gets at once of a performer who moves to it while the former worker answers, at least: a few
#: milliseconds, for which its other performers wait.
_PIECE = 16


class Router(Following[Track]):
    """Spreads performers over workers; a subclass knows how to reach them.

    Parameters
    ----------
    library
        Motions to compare with.
    terms
        For the recognisers.

    Attributes
    ----------
    terms
        The terms now.
    outdated
        Answers that were not passed on: from a former worker, a few after each move, or to a performer who has left.
    unread
        Workers' messages that could not be read.
    unsent
        Frames that were dropped because there was no worker.
    """

    def __init__(self, library: MotionLibrary | WindowIndex, terms: Terms) -> None:
        super().__init__(terms.most, terms.silence)
        self.terms = terms
        self.outdated = self.unread = self.unsent = 0
        self._joints = terms.joints
        self._know(library)
        #: The number of the last frame. None is used twice: who comes again is not taken for the former performer.
        self._number = 0
        self._questions = itertools.count(1)
        self._reports: dict[str, Report] = {}
        #: The number of the last question that each worker has dealt with.
        self._last: dict[str, int] = {}
        #: The workers that may get performers.
        self._ready: Collection[str] = ()
        #: The counts of workers that have ended.
        self._past = Report(PerformerCounts())

    def _know(self, library: MotionLibrary | WindowIndex) -> None:
        motions = library.library if isinstance(library, WindowIndex) else library
        self._skeleton = motions.skeleton
        self._usual_sensitivity, self._lead = usual_sensitivity(motions), needed_lead(motions, self.settings)
        self._classes = self.terms.classes or motions.classes

    @property
    def classes(self) -> tuple[str, ...]:
        """The classes that are answered; an answer's index counts in this list."""
        return self._classes

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

    def exchange(self, library: MotionLibrary | WindowIndex, order: Sequence[str] = ()) -> list[Event]:
        """Compare all performers with another library from now on; end the motions whose class it lacks."""
        self.terms = msgspec.structs.replace(self.terms, classes=tuple(order))
        self._know(library)
        tracks = self._performers.values()
        return [event for each in tracks if (event := each.exchange(self.classes, self._lead))]

    @property
    def counts(self) -> PerformerCounts:
        """Counts of what happened to all frames so far, as far as workers have reported it.

        While a performer moves, two workers count its frames.
        """
        counts = _summed([self._past, *self._reports.values()]).counts
        counts.no_room, counts.dropped = self._no_room, self._dropped
        return counts

    @property
    def refused(self) -> dict[str, str]:
        """Performers whose frames are refused for their joints, with the reason."""
        return {name: why for report in self._reports.values() for name, why in report.refused.items()}

    @property
    def doubted(self) -> dict[str, str]:
        """Performers with joints that cannot be believed, and the reason."""
        return {name: why for report in self._reports.values() for name, why in report.doubted.items()}

    @property
    def compared(self) -> dict[str, str]:
        """The joints by which performers are compared, if these are not all."""
        return {name: text for report in self._reports.values() for name, text in report.compared.items()}

    @property
    def notes(self) -> list[str]:
        """Notes for a person, a line each."""
        counts = {
            "frames that no worker took": self.unsent,
            "frames dropped because workers were busy": _summed([self._past, *self._reports.values()]).dropped,
            "messages of workers that cannot be read": self.unread,
            "answers of former workers or to frames answered before": self.outdated,
        }
        return [f"{count} {what}" for what, count in counts.items() if count]

    def push_all(
        self,
        events: Sequence[Admitted],
        arrival: float,
        *,
        newest_only: bool = False,  # noqa: ARG002 - as `Performers`; the workers see for themselves what has waited
    ) -> list[Recognition | None]:
        """Send frames to their workers, in order; give the recognitions that came back among the events."""
        answers: list[Recognition | None] = [None] * len(events)
        for_worker: dict[str, list[SentFrame]] = {}
        for place, event in enumerate(events):
            match event:
                case Frame():
                    self._route(event, arrival, for_worker)
                case Announcement():
                    self._remember(self._announced, event.performer, event)
                case NewSender():
                    self._announced.pop(event.performer, None)
                    self._forget(event.performer)
                case _:
                    # An answer, which `accept` has given to the service as if it were a frame.
                    answers[place] = cast("Recognition", event)
        for worker, frames in for_worker.items():
            self._send_frames(worker, frames)
        return answers

    def _route(self, frame: Frame, arrival: float, for_worker: dict[str, list[SentFrame]]) -> None:
        """Add a frame to those of the worker that answers it, if there is room for its performer."""
        if (track := self._performer(frame.performer, arrival)) is None:
            self._no_room += 1
            return
        self._number += 1
        sent = track.send(frame, self._number, arrival, self._announced_by(frame.performer))
        move = track.move
        if move and move.waiting is not None:
            move.waiting.append(sent)
            move.came += 1
        if move and move.is_last:
            self._go_on(track, move)
        elif track.worker:
            for_worker.setdefault(track.worker, []).append(sent)
        else:
            self.unsent += 1

    def _begin(self, name: str, now: float) -> Track:  # noqa: ARG002 - all performers begin alike
        track = Track(now, now, self._number, Decision(self._lead), hop=self.settings.hop)
        if self._ready:
            load = self._load()
            track.worker = min(self._ready, key=lambda worker: load[worker])
        return track

    def _load(self) -> Counter[str]:
        """Count the performers that each worker has, or will have soon."""
        return Counter(each.move.to if each.move else each.worker for each in self._performers.values())

    def _announced_by(self, name: str) -> tuple[str, ...] | None:
        announced = self._announced.get(name)
        return announced.joints if announced else None

    @abstractmethod
    def _send_frames(self, worker: str, frames: list[SentFrame]) -> None:
        """Send frames to a worker; they may be dropped if it does not take them."""

    @abstractmethod
    def _send(self, worker: str, orders: Orders) -> None:
        """Send a message that must arrive."""

    def skeleton_of(self, name: str) -> Skeleton | None:
        """Give the joints of a performer's frames, by our names where we know them; None for an unknown performer."""
        if name not in self._performers:
            return None
        own = self._skeleton if self._skeleton.parents else hdm05.SKELETON
        return own.linked(self._joints_of(name))

    def carried(self, name: str) -> Carried | None:
        """Say which joints carried the last answer that was asked about; ask about the next answer."""
        if (track := self._performers.get(name)) is None:
            return None
        track.asks = True
        return track.carried

    def _joints_of(self, name: str) -> tuple[str, ...]:
        wanted = self._skeleton.joints
        return self._joints.naming.met(self._announced_by(name) or self._joints.assumed or wanted, wanted).joints

    def ordered(self, frame: Frame) -> Frame | None:
        """Give a frame in the order of the library's joints; None if it has too few joints."""
        wanted, joints = self._skeleton.joints, self._joints_of(frame.performer)
        if len(frame.positions) != len(joints) or len(set(joints).intersection(wanted)) < MIN_JOINTS:
            return None
        if joints == wanted:
            return frame
        return replace(frame, positions=frame.positions[self._skeleton.nearest_from(joints)])

    def accept(self, worker: str, answers: Answers) -> list[tuple[Recognition, float]]:
        """Give a worker's new answers, each with the arrival of its frame; keep its report."""
        news = []
        for answer in answers.answered:
            recognition = answer.recognition
            if not _is_whole(answer):
                self.unread += 1
                continue
            track = self._performers.get(recognition.performer)
            events = track.accept(answer, self.classes) if track and track.worker == worker else None
            if events is None:
                self.outdated += 1
            else:
                same = events == recognition.events
                news.append((recognition if same else replace(recognition, events=events), answer.at))
        if answers.report:
            self._reports[worker] = answers.report
        if answers.question:
            self._last[worker] = answers.question
            self._go_on_with_moves()
        return news

    def _ask(self, worker: str) -> int:
        """Ask a worker to say when it has dealt with everything so far; give the question's number."""
        question = next(self._questions)
        self._send(worker, Orders(question=question))
        return question

    def _send_all(self, worker: str, frames: Sequence[SentFrame]) -> None:
        if frames:
            self._send(worker, Orders(frames=list(frames)))

    def _balance(self, ready: Collection[str], alive: Collection[str]) -> None:
        """Give each performer a worker that is ready, and no worker two performers more than another.

        A former worker that is alive answers until the new one has caught up.
        """
        self._ready = ready
        for track in self._performers.values():
            if track.move and (track.move.to not in ready or track.worker not in alive):
                self._stay(track, track.move, alive)
            if track.worker not in alive:
                track.worker = ""
        load = self._load()
        for name, track in self._performers.items() if ready else ():
            least = min(ready, key=lambda worker: load[worker])
            owner = track.move.to if track.move else track.worker
            if owner not in ready or load[owner] > load[least] + 1:
                if track.move:
                    self._stay(track, track.move, alive)
                load.subtract([owner])
                load.update([least])
                self._move(name, track, least)
        self._go_on_with_moves()

    def _stay(self, track: Track, move: Move, alive: Collection[str]) -> None:
        """Forget a move; the former worker gets the frames that wait for its last answers, and goes on."""
        track.move = None
        if track.worker == move.to:
            track.worker = ""  # the former one is done, and the new one has not begun
        elif move.is_last and track.worker in alive:
            self._send_all(track.worker, [*(move.waiting or ())])

    def _move(self, name: str, track: Track, worker: str) -> None:
        """Begin to give a performer to a worker; at once if no other one answers."""
        if track.worker == worker:
            return
        track.move = move = Move(worker)
        if not track.worker:
            done, due = track.recent(self._announced_by(name))
            self._send_all(worker, done)
            track.worker, move.waiting, move.is_last = worker, deque(due), True
            self._go_on(track, move)

    def _go_on_with_moves(self) -> None:
        """Take the next step of the moves whose question is answered, and begin with others.

        Each worker takes in one performer after the other, so that its other performers wait for one piece only.
        """
        moves = [(name, each, each.move) for name, each in self._performers.items() if each.move]
        for name, track, move in moves:
            if move.question and self._last.get(move.asked, 0) >= move.question:
                self._step(name, track, move)
        busy = {move.to for _, track, move in moves if move.question and track.worker != move.to}
        for name, track, move in moves:
            if not move.question and move.to not in busy and track.worker != move.to:
                busy.add(move.to)
                self._step(name, track, move)

    def _step(self, name: str, track: Track, move: Move) -> None:
        """Send the next piece of the last seconds, and ask who has to deal with frames before the next step."""
        if move.is_last:
            track.worker = move.to
            self._go_on(track, move)
            return
        if move.waiting is None:
            done, due = track.recent(self._announced_by(name))
            move.waiting = deque([*done, *due])
        # More than have come meanwhile, so that the new worker catches up with any feed.
        piece = min(max(_PIECE, 2 * move.came), len(move.waiting))
        self._send_all(move.to, [move.waiting.popleft() for _ in range(piece)])
        move.came, move.is_last = 0, not move.waiting
        move.asked = track.worker if move.is_last else move.to
        move.question = self._ask(move.asked)

    def _go_on(self, track: Track, move: Move) -> None:
        """Let the new worker answer the frames that wait, as soon as there is one, if the former one is done."""
        if move.waiting and track.worker == move.to:
            move.waiting[0] = msgspec.structs.replace(move.waiting[0], go_on=track.past)
            self._send_all(move.to, [*move.waiting])
            track.move = None

    def _remove(self, worker: str, ready: Collection[str], alive: Collection[str]) -> None:
        """Give the performers of a worker that has ended to the others; keep its counts."""
        self._last.pop(worker, None)
        if report := self._reports.pop(worker, None):
            self._past = _summed([self._past, report])
        self._balance(ready, alive)


def _summed(reports: Sequence[Report]) -> Report:
    """Add up reports: the counts that the gateway does not know itself."""
    counts = PerformerCounts()
    for each in reports:
        counts.recognizers.add(each.counts.recognizers)
        counts.other_joints += each.counts.other_joints
        counts.opening += each.counts.opening
    return Report(counts, dropped=sum(each.dropped for each in reports))


def _is_whole(answer: Answered) -> bool:
    """Say whether an answer has a score for each class, names none but these, and its numbers are finite."""
    given, known = answer.recognition, answer.long_ago
    classes, progress, evidence, done = len(given.classes), given.progress, given.evidence, given.done
    seen = given.seen
    numbers = (
        *(given.time, given.ended_at or 0.0, given.movement, given.eigenvector_score, given.share, given.gap),
        *((known.factor, known.tremble, known.last_jump or 0.0) if known else ()),
        *((progress.phase, progress.scrub, progress.speed, progress.amplitude, progress.sure) if progress else ()),
        *((*evidence.distances, *evidence.leads, evidence.noise) if evidence else ()),
        *((done.start, done.duration, done.score, done.speed, done.amplitude) if done else ()),
        *((seen.score, seen.seconds) if seen else ()),
        *(answer.carried.joints if answer.carried else ()),
        *given.scores.tolist(),
    )
    named = progress is None or progress.class_name in given.classes
    named = named and (seen is None or seen.class_name in given.classes)
    named = named and (done is None or given.classes[done.index : done.index + 1] == (done.label,))
    # The only class of a library leads infinitely.
    is_known = named and not math.isnan(given.lead) and all(map(math.isfinite, numbers))
    return is_known and 0 < classes == len(given.scores) and 0 <= (given.guess or 0) < classes
