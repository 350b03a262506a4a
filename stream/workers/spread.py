"""`Spread` takes the place of `Performers`: it sends frames to workers, and a source brings their answers back."""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from collections import deque
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, cast

from kinespace.library.motion_library import MIN_JOINTS
from kinespace.library.naming import hdm05
from kinespace.stream.frame import Announcement, Frame, NewSender
from kinespace.stream.recognizer.decision import usual_sensitivity
from kinespace.stream.recognizer.performers import PerformerCounts
from kinespace.stream.recognizer.recognizer import RecognizerCounts
from kinespace.stream.workers.partition import owners, partition_of
from kinespace.stream.workers.wire import (
    ASK,
    FRAMES,
    MAX_TOGETHER,
    SENSE,
    TAKE_OVER,
    encode_entries,
    encode_frames,
    encode_number,
    encode_share,
)
from kinespace.stream.zeromq.frames import FormatError

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from kinespace.library.motion_library import MotionLibrary
    from kinespace.library.skeleton import Skeleton
    from kinespace.stream.frame import Admitted
    from kinespace.stream.recognition import Event, Recognition
    from kinespace.stream.recognizer import Settings
    from kinespace.stream.recognizer.joints.carried import Carried
    from kinespace.stream.recognizer.joints.fewer_joints import SentJoints
    from kinespace.stream.workers.ledger import Ledger
    from kinespace.stream.workers.wire import Answers, Report, SentFrame


#: Frames that a worker gets at once of performers who move to it while their former worker answers, at least: a few
#: milliseconds, for which its other performers wait.
_PIECE = 16


@dataclass(slots=True)
class _Move:
    """A partition that moves to its new owner, which gets the last seconds first, piece by piece.

    Attributes
    ----------
    former
        The worker that answers meanwhile.
    begun
        Whether the owner was told of the performers.
    waiting
        The frames that the owner has not been sent.
    came
        How many of them came since the last piece.
    question
        The number of the question after the last piece; 0 before the first piece.
    caught_up
        Whether the owner gets new frames, too.
    """

    former: str
    begun: bool = False
    waiting: deque[SentFrame] = field(default_factory=deque)
    came: int = 0
    question: int = 0
    caught_up: bool = False


class Spread(ABC):
    """Spreads performers over workers; a subclass knows how to reach them.

    Parameters
    ----------
    library, classes, settings, joints
        The library and its classes, the settings of the recognisers, and the joints that senders have.
    ledger
        Keeps the notes on each performer.

    Attributes
    ----------
    former
        Answers that were not passed on, because they came from a former owner, a few after each move, or because their
        performer has left.
    unread
        Workers' messages that could not be read.
    unsent
        Frames that were dropped because no worker took them in time.
    """

    def __init__(
        self, library: MotionLibrary, classes: Sequence[str], settings: Settings, joints: SentJoints, ledger: Ledger
    ) -> None:
        self.settings = settings
        self.former = self.unread = self.unsent = 0
        self._skeleton, self._joints, self._ledger = library.skeleton, joints, ledger
        self._usual_sensitivity = usual_sensitivity(library)
        #: The lists of classes so far; an answer names the number of its own.
        self._books = [tuple(classes)]
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
        return self._books[-1]

    @property
    def silence(self) -> float:
        """Seconds without a frame after which a performer is dropped."""
        return self._ledger.silence

    @property
    def names(self) -> tuple[str, ...]:
        """The performers now followed, in the order of their first frames."""
        return self._ledger.names

    @property
    def counts(self) -> PerformerCounts:
        """Counts of what happened to all frames so far, as far as workers have reported it.

        While a performer moves, two workers count its frames.
        """
        total, other_joints = replace(self._past), self._past_joints
        for report in self._reports.values():
            total.add(report.counts.recognizers)
            other_joints += report.counts.other_joints
        return PerformerCounts(self._ledger.no_room, other_joints, self._ledger.dropped, total)

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
        return {name: told for report in self._reports.values() for name, told in report.compared.items()}

    @property
    def notes(self) -> list[str]:
        """Notes for a person, a line each."""
        told = {
            "frames that no worker took": self.unsent,
            "frames dropped because workers were busy": self._past_dropped + self._dropped(),
            "messages of workers that cannot be read": self.unread,
        }
        return [f"{count} {what}" for what, count in told.items() if count]

    def _dropped(self) -> int:
        return sum(report.dropped for report in self._reports.values())

    def push_all(self, events: Sequence[Admitted], arrival: float) -> list[Recognition | None]:
        """Send frames to their workers, in order; give the recognitions that came back among the events."""
        answers: list[Recognition | None] = [None] * len(events)
        frames: dict[int, list[SentFrame]] = {}
        for place, event in enumerate(events):
            match event:
                case Frame():
                    if numbered := self._ledger.send(event, arrival):
                        partition, sent = numbered
                        frames.setdefault(partition, []).append(sent)
                case Announcement():
                    self._ledger.announce(event)
                case NewSender():
                    self._ledger.change_sender(event.performer)
                case _:
                    # An answer, which `take_back` has given to the service as if it were a frame.
                    answers[place] = cast("Recognition", event)
        if frames:
            self._send(frames)
        return answers

    def _send(self, frames: dict[int, list[SentFrame]]) -> None:
        """Send frames, by partition, to the workers that own the partitions."""
        for_worker: dict[str, list[SentFrame]] = {}
        for partition, each in frames.items():
            takers = self._takers(partition)
            if (move := self._moves.get(partition)) and move.begun and not move.caught_up:
                move.waiting.extend(each)
                move.came += len(each)
            for taker in takers:
                for_worker.setdefault(taker, []).extend(each)
            self.unsent += 0 if takers else len(each)
        for worker, each in for_worker.items():
            self._give(worker, each)

    def _takers(self, partition: int) -> set[str]:
        """Give the workers that get a partition's new frames."""
        move = self._moves.get(partition)
        takers = {move.former} if move else set[str]()
        if self._owners and (move is None or move.caught_up):
            takers.add(self._owners[partition])
        return takers

    @abstractmethod
    def _give(self, worker: str, frames: list[SentFrame]) -> None:
        """Send frames to a worker; they may be dropped if it does not take them."""

    @property
    def sensitivity(self) -> float:
        """The sensitivity of all recognisers."""
        return self._usual_sensitivity if self.settings.sensitivity is None else self.settings.sensitivity

    def set_sensitivity(self, share: float) -> None:
        """Recognise all performers with another sensitivity from the next hop on."""
        self.settings = replace(self.settings, sensitivity=share)
        for worker in self._hearing:
            self._tell(worker, SENSE + encode_share(share))

    @property
    def _hearing(self) -> Collection[str]:
        """The workers that must know the settings."""
        return set(self._owners)

    def skeleton_of(self, name: str) -> Skeleton | None:
        """Give the joints of a performer's frames, by our names where we know them; None for an unknown performer."""
        if name not in self.names:
            return None
        own = self._skeleton if self._skeleton.parents else hdm05.SKELETON
        return own.linked(self._joints_of(name))

    def carried(self, name: str) -> Carried | None:
        """Say which joints carried the last answer that was asked about; ask about the next answer."""
        return self._ledger.carried(name)

    def _joints_of(self, name: str) -> tuple[str, ...]:
        wanted = self._skeleton.joints
        announced = self._ledger.joints_of(name) or self._joints.assumed or wanted
        return self._joints.naming.met(announced, wanted).joints

    def ordered(self, frame: Frame) -> Frame | None:
        """Give a frame in the order of the library's joints; None if it has too few joints."""
        wanted, joints = self._skeleton.joints, self._joints_of(frame.performer)
        if len(frame.positions) != len(joints) or len(set(joints).intersection(wanted)) < MIN_JOINTS:
            return None
        if joints == wanted:
            return frame
        return replace(frame, positions=frame.positions[self._skeleton.nearest_from(joints)])

    def drop_silent(self, now: float) -> list[Event]:
        """Forget performers that sent nothing for `silence` seconds; give the ends of their motions."""
        return self._ledger.drop_silent(now)

    def end_paused(self, now: float) -> list[Event]:
        """Give the ends of the motions of performers who send nothing for now."""
        return self._ledger.end_paused(now)

    def take_gone(self) -> list[str]:
        """Give the performers who were dropped since the last call."""
        return self._ledger.take_gone()

    def end(self) -> list[Event]:
        """Give the ends of all motions going on, because no more frames will come."""
        return self._ledger.end()

    def take_back(self, worker: str, answers: Answers) -> list[tuple[Recognition, float]]:
        """Give a worker's new answers, each with the arrival of its frame; keep its report."""
        news = []
        for answer in answers.answered:
            try:
                classes = self._books[answer.book] if 0 <= answer.book < len(self._books) else ()
                recognition = answer.recognition(classes)
            except FormatError:
                self.unread += 1
                continue
            events = self._ledger.note(answer, self.classes)
            if events is None:
                # While two workers answer, the second answer to a frame is no fault.
                self.former += partition_of(answer.performer) not in self._moves
            else:
                as_told = recognition if events == recognition.events else replace(recognition, events=events)
                news.append((as_told, answer.at))
        if answers.report:
            self._reports[worker] = answers.report
        if answers.last:
            self._last[worker] = answers.last
            self._go_on(worker, answers.last)
        return news

    @abstractmethod
    def _tell(self, worker: str, message: bytes) -> None:
        """Send a message that must arrive."""

    def _assign(self, ready: Collection[str], leaving: Collection[str] = ()) -> None:
        """Give each partition to its owner among the workers that are ready; hand over the partitions that move.

        The former owner answers until the new one has caught up, if it is ready or leaving.
        """
        before, self._owners = self._owners, owners(ready)
        busy = {partition_of(name) for name in self.names}
        at_once: dict[str, list[int]] = {}
        for partition, new in enumerate(self._owners):
            if before and before[partition] == new:
                continue
            move = self._moves.get(partition)
            old = before[partition] if before and before[partition] in {*ready, *leaving} else None
            answers = move.former if move else old
            if answers and partition in busy:
                # If the partition comes back to the worker that answers, nothing moves: it has missed no frame.
                if answers != new:
                    self._moves[partition] = _Move(answers)
                elif move:
                    self._end_move(partition)
            else:
                self._moves.pop(partition, None)
                at_once.setdefault(new, []).append(partition)
        for worker, partitions in at_once.items():
            self._tell(worker, TAKE_OVER + encode_entries(self._ledger.entries(partitions)))
            self._tell_frames(worker, self._ledger.recent(partitions))
        for worker in set(self._owners):
            self._go_on(worker, 0)

    def _end_move(self, partition: int) -> _Move:
        """Let one worker answer alone again."""
        self._ledger.settle(partition)
        return self._moves.pop(partition)

    def _go_on(self, worker: str, answered: int) -> None:
        """Go on with the moves to a worker that has dealt with all questions up to one."""
        for partition, move in [*self._moves.items()]:
            if not self._owners or self._owners[partition] != worker:
                continue
            if move.caught_up and answered >= move.question:
                # The former worker gets no more frames.
                self._end_move(partition)
            elif not move.caught_up:
                if answered >= move.question:
                    self._hand_over(partition, move)
                # One partition after the other, so that the worker's other performers wait for one piece only.
                return

    def _hand_over(self, partition: int, move: _Move) -> None:
        """Send a partition's owner the next piece of the last seconds, and ask it to say when it has dealt with it."""
        worker = self._owners[partition]
        if not move.begun:
            move.begun = True
            self._tell(worker, TAKE_OVER + encode_entries(self._ledger.entries([partition])))
            move.waiting.extend(sorted(self._ledger.recent([partition]), key=lambda frame: frame.seq or 0))
        # More than have come meanwhile, so that the owner catches up with any feed.
        piece = max(_PIECE, 2 * move.came)
        self._tell_frames(worker, [move.waiting.popleft() for _ in range(min(piece, len(move.waiting)))])
        move.came, move.caught_up = 0, not move.waiting
        move.question = next(questions)
        self._tell(worker, ASK + encode_number(move.question))

    def _tell_frames(self, worker: str, frames: Sequence[SentFrame]) -> None:
        for each in together(frames):
            self._tell(worker, FRAMES + encode_frames(each))

    def _lose(self, worker: str, ready: Collection[str]) -> None:
        """Give the partitions of an ended worker to the other workers; keep its counts."""
        self._last.pop(worker, None)
        if report := self._reports.pop(worker, None):
            self._past.add(report.counts.recognizers)
            self._past_joints += report.counts.other_joints
            self._past_dropped += report.dropped
        for partition in [each for each, move in self._moves.items() if move.former == worker]:
            move = self._end_move(partition)
            if not move.caught_up and self._owners:
                if not move.begun:
                    self._hand_over(partition, move)
                self._tell_frames(self._owners[partition], list(move.waiting))
        self._assign(ready)


questions = itertools.count(1)


def together(frames: Sequence[SentFrame]) -> list[list[SentFrame]]:
    """Divide frames into messages."""
    return [list(frames[first : first + MAX_TOGETHER]) for first in range(0, len(frames), MAX_TOGETHER)]
