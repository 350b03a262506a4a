"""`Router` takes the place of `Performers`: it sends frames to workers, and takes their answers back."""

from __future__ import annotations

import itertools
from abc import abstractmethod
from collections import deque
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, cast

from kinespace.library.motion_library import MIN_JOINTS
from kinespace.library.naming import hdm05
from kinespace.library.windows.index import WindowIndex
from kinespace.stream.frame import Announcement, Frame, NewSender
from kinespace.stream.recognizer.following import Following
from kinespace.stream.recognizer.limits import usual_sensitivity
from kinespace.stream.recognizer.performers import PerformerCounts
from kinespace.stream.recognizer.recognizer import RecognizerCounts
from kinespace.stream.workers.partition import owners, partition_of
from kinespace.stream.workers.track import Track
from kinespace.stream.workers.wire import ASK, FRAMES, GO_ON, MAX_TOGETHER, TAKE_OVER, encode
from kinespace.stream.zeromq.frames import FormatError

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from kinespace.library.motion_library import MotionLibrary
    from kinespace.library.skeleton import Skeleton
    from kinespace.stream.frame import Admitted
    from kinespace.stream.recognition import Recognition
    from kinespace.stream.recognizer import SentJoints, Settings
    from kinespace.stream.recognizer.joints.carried import Carried
    from kinespace.stream.workers.wire import Answers, Report, SentFrame

#: Frames that a worker gets at once of performers who move to it while their former worker answers, at least: a few
#: milliseconds, for which its other performers wait.
_PIECE = 16


@dataclass(slots=True)
class _Move:
    """A partition that moves to its new owner, while its former worker answers.

    The owner gets the last seconds first, piece by piece. Then new frames wait until the former worker has answered
    those before, and the owner goes on with them.

    Attributes
    ----------
    former
        The former worker.
    begun
        Whether the owner knows of the performers.
    waiting
        The frames that the owner has not been sent.
    came
        How many of them came since the last piece.
    question
        The number of the question after the last piece, to the owner; 0 before the first piece.
    is_last
        Whether the former worker gets no more frames, and the question was to it.
    """

    former: str
    begun: bool = False
    waiting: deque[SentFrame] = field(default_factory=deque)
    came: int = 0
    question: int = 0
    is_last: bool = False


class Router(Following[Track]):
    """Spreads performers over workers; a subclass knows how to reach them.

    Parameters
    ----------
    library, settings, most, silence, joints, classes
        The same as for `Performers`.

    Attributes
    ----------
    outdated
        Answers that were not passed on, because they came from a former owner, a few after each move, or because their
        performer has left.
    unread
        Workers' messages that could not be read.
    unsent
        Frames that were dropped because there was no worker.
    """

    def __init__(  # noqa: PLR0913 - all by keyword
        self,
        library: MotionLibrary | WindowIndex,
        settings: Settings,
        *,
        most: int,
        silence: float,
        joints: SentJoints,
        classes: Sequence[str] = (),
    ) -> None:
        super().__init__(most, silence)
        motions = library.library if isinstance(library, WindowIndex) else library
        self.settings = settings
        self.outdated = self.unread = self.unsent = 0
        self._skeleton, self._joints = motions.skeleton, joints
        self._usual_sensitivity = usual_sensitivity(motions)
        #: The classes of all terms so far; an answer names the number of its terms.
        self._class_lists = [tuple(classes) or motions.classes]
        #: Numbers are never used twice, so that a performer who comes again is not taken for the former one.
        self._numbers, self._questions = itertools.count(1), itertools.count(1)
        #: The owner of each partition; empty without workers.
        self._owners: tuple[str, ...] = ()
        #: The partitions that move while their former worker answers; of the moves to one worker the first goes on.
        self._moves: dict[int, _Move] = {}
        self._reports: dict[str, Report] = {}
        #: The number of the last question that each worker has dealt with.
        self._last: dict[str, int] = {}
        #: The counts of workers that have ended.
        self._past = RecognizerCounts()
        self._past_joints = self._past_dropped = 0

    @property
    def classes(self) -> tuple[str, ...]:
        """The classes that are answered; an answer's index counts in this list."""
        return self._class_lists[-1]

    @property
    def sensitivity(self) -> float:
        """The sensitivity of all recognisers."""
        return self._usual_sensitivity if self.settings.sensitivity is None else self.settings.sensitivity

    @property
    def counts(self) -> PerformerCounts:
        """Counts of what happened to all frames so far, as far as workers have reported it.

        While a performer moves, two workers count its frames.
        """
        total, other_joints = replace(self._past), self._past_joints
        for report in self._reports.values():
            total.add(report.counts.recognizers)
            other_joints += report.counts.other_joints
        return PerformerCounts(self._no_room, other_joints, self._dropped, total)

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
        dropped = self._past_dropped + sum(report.dropped for report in self._reports.values())
        counts = {
            "frames that no worker took": self.unsent,
            "frames dropped because workers were busy": dropped,
            "messages of workers that cannot be read": self.unread,
            "answers of former owners or to frames answered before": self.outdated,
        }
        return [f"{count} {what}" for what, count in counts.items() if count]

    def push_all(self, events: Sequence[Admitted], arrival: float) -> list[Recognition | None]:
        """Send frames to their workers, in order; give the recognitions that came back among the events."""
        answers: list[Recognition | None] = [None] * len(events)
        frames: dict[int, list[SentFrame]] = {}
        for place, event in enumerate(events):
            match event:
                case Frame():
                    self._number(event, arrival, frames)
                case Announcement():
                    self._remember(self._announced, event.performer, event)
                case NewSender():
                    self._announced.pop(event.performer, None)
                    self._forget(event.performer)
                case _:
                    # An answer, which `accept` has given to the service as if it were a frame.
                    answers[place] = cast("Recognition", event)
        if frames:
            self._route(frames)
        return answers

    def _number(self, frame: Frame, arrival: float, frames: dict[int, list[SentFrame]]) -> None:
        """Add a frame to those of its partition, if there is room for its performer."""
        if (track := self._performer(frame.performer, arrival)) is None:
            self._no_room += 1
            return
        sent = track.send(frame, next(self._numbers), arrival, self._announced_by(frame.performer))
        frames.setdefault(track.partition, []).append(sent)

    def _begin(self, name: str, now: float) -> Track:
        return Track(now, now, partition_of(name))

    def _announced_by(self, name: str) -> tuple[str, ...] | None:
        announced = self._announced.get(name)
        return announced.joints if announced else None

    def _route(self, frames: dict[int, list[SentFrame]]) -> None:
        """Send frames, by partition, to the workers that answer them."""
        for_worker: dict[str, list[SentFrame]] = {}
        for partition, each in frames.items():
            move = self._moves.get(partition)
            if move and move.begun:
                move.waiting.extend(each)
                move.came += len(each)
            if move is None or not move.is_last:
                worker = self._answering(partition)
                self.unsent += 0 if worker else len(each)
                for_worker.setdefault(worker, []).extend(each)
        for_worker.pop("", None)
        for worker, each in for_worker.items():
            self._send_frames(worker, each)

    def _answering(self, partition: int) -> str:
        """Give the worker that answers a partition's performers; empty without workers."""
        if move := self._moves.get(partition):
            return move.former
        return self._owners[partition] if self._owners else ""

    @abstractmethod
    def _send_frames(self, worker: str, frames: list[SentFrame]) -> None:
        """Send frames to a worker; they may be dropped if it does not take them."""

    @abstractmethod
    def _send(self, worker: str, message: bytes) -> None:
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
            try:
                known = 0 <= answer.terms < len(self._class_lists)
                recognition = answer.recognition(self._class_lists[answer.terms] if known else ())
            except FormatError:
                self.unread += 1
                continue
            track = self._performers.get(answer.performer)
            is_ours = track and self._answering(track.partition) == worker
            events = track.accept(answer, self.classes) if track and is_ours else None
            if events is None:
                self.outdated += 1
            else:
                same = events == recognition.events
                news.append((recognition if same else replace(recognition, events=events), answer.at))
        if answers.report:
            self._reports[worker] = answers.report
        if answers.last:
            self._last[worker] = answers.last
            self._go_on(worker, answers.last)
        return news

    def _ask(self, worker: str) -> int:
        """Ask a worker to say when it has dealt with everything so far."""
        question = next(self._questions)
        self._send(worker, ASK + encode(question))
        return question

    def _of(self, partitions: Collection[int]) -> dict[str, Track]:
        return {name: each for name, each in self._performers.items() if each.partition in partitions}

    def _assign(self, ready: Collection[str], alive: Collection[str]) -> None:
        """Give each partition to its owner among the workers that are ready; hand over the partitions that move.

        A former owner that is alive answers until the new one has caught up.
        """
        before, self._owners = self._owners, owners(ready)
        busy = {each.partition for each in self._performers.values()}
        at_once: dict[str, list[int]] = {}
        for partition, move in [*self._moves.items()] if not self._owners else ():
            self._end_move(partition, move.former in alive)
            if move.former in alive:
                self._moves[partition] = _Move(move.former)
        for partition, new in enumerate(self._owners):
            going_on = self._moves.get(partition)
            if before and before[partition] == new and (going_on is None or going_on.former in alive):
                continue
            former = going_on.former if going_on else before[partition] if before else ""
            self._end_move(partition, former in alive)
            if former not in alive or partition not in busy:
                at_once.setdefault(new, []).append(partition)
            elif former != new:
                self._moves[partition] = _Move(former)
        for worker, partitions in at_once.items():
            done, due = self._send_entries(worker, partitions, TAKE_OVER)
            self._send_recent(worker, done)
            self._send_entries(worker, partitions, GO_ON)
            self._send_recent(worker, due)
        for worker in {*self._owners}:
            self._go_on(worker, 0)

    def _end_move(self, partition: int, former_goes_on: bool) -> None:  # noqa: FBT001 - one caller
        """Forget a move; the former worker gets the frames that wait for its last answers, and goes on."""
        move = self._moves.pop(partition, None)
        if move and move.is_last and former_goes_on:
            self._send_recent(move.former, list(move.waiting))

    def _send_entries(
        self, worker: str, partitions: Collection[int], kind: bytes
    ) -> tuple[list[SentFrame], list[SentFrame]]:
        """Let a worker know performers; give their last frames, without and with need of an answer."""
        tracks = {name: each for name, each in self._performers.items() if each.partition in partitions}
        entries = [each.entry(name, self._announced_by(name)) for name, each in tracks.items()]
        self._send(worker, kind + encode(entries))
        recent = [each.recent() for each in tracks.values()]
        return [frame for done, _ in recent for frame in done], [frame for _, due in recent for frame in due]

    def _send_recent(self, worker: str, frames: Sequence[SentFrame]) -> None:
        for each in together(frames):
            self._send(worker, FRAMES + encode(each))

    def _go_on(self, worker: str, answered: int) -> None:
        """Go on with the moves from and to a worker that has dealt with all questions up to one."""
        for partition, move in [*self._moves.items()]:
            if move.is_last and move.former == worker and answered >= move.question:
                del self._moves[partition]
                owner = self._owners[partition]
                self._send_entries(owner, [partition], GO_ON)
                self._send_recent(owner, list(move.waiting))
                self._go_on(owner, self._last.get(owner, 0))
        to_worker = (each for each, move in self._moves.items() if self._owners and self._owners[each] == worker)
        # One partition after the other, so that the worker's other performers wait for one piece only.
        first = next(to_worker, None)
        if first is not None and answered >= self._moves[first].question:
            self._hand_over(first, self._moves[first])

    def _hand_over(self, partition: int, move: _Move) -> None:
        """Send a partition's owner the next piece of the last seconds, and ask who has to deal with frames before."""
        if move.is_last:
            return
        worker = self._owners[partition]
        if not move.begun:
            move.begun = True
            done, due = self._send_entries(worker, [partition], TAKE_OVER)
            move.waiting.extend(sorted([*done, *due], key=lambda frame: frame.seq or 0))
        # More than have come meanwhile, so that the owner catches up with any feed.
        piece = max(_PIECE, 2 * move.came)
        self._send_recent(worker, [move.waiting.popleft() for _ in range(min(piece, len(move.waiting)))])
        move.came, move.is_last = 0, not move.waiting
        move.question = self._ask(move.former if move.is_last else worker)

    def _remove(self, worker: str, ready: Collection[str], alive: Collection[str]) -> None:
        """Give the partitions of a worker that has ended to the other workers; keep its counts."""
        self._last.pop(worker, None)
        if report := self._reports.pop(worker, None):
            self._past.add(report.counts.recognizers)
            self._past_joints += report.counts.other_joints
            self._past_dropped += report.dropped
        self._assign(ready, alive)


def together(frames: Sequence[SentFrame]) -> list[list[SentFrame]]:
    """Divide frames into messages."""
    return [list(frames[first : first + MAX_TOGETHER]) for first in range(0, len(frames), MAX_TOGETHER)]
