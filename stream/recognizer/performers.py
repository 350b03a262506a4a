"""Several performers on one feed: a recogniser for each, made on first sight, dropped after silence."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from kinespace.library.motion_library import MIN_JOINTS
from kinespace.library.naming import hdm05
from kinespace.stream.frame import Announcement, NewSender
from kinespace.stream.recognizer.decision import usual_sensitivity
from kinespace.stream.recognizer.joints.carried import carried_by
from kinespace.stream.recognizer.joints.fewer_joints import SentJoints
from kinespace.stream.recognizer.matcher import library_of
from kinespace.stream.recognizer.recognizer import MAX_PAUSE, Recognizer, RecognizerCounts, require_order
from kinespace.stream.recognizer.settings import Settings

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

    from kinespace.library.motion_library import MotionLibrary
    from kinespace.library.skeleton import Skeleton
    from kinespace.library.windows.index import WindowIndex
    from kinespace.stream.frame import Admitted, Frame
    from kinespace.stream.recognition import Event, Recognition
    from kinespace.stream.recognizer.joints.carried import Carried
    from kinespace.stream.recognizer.joints.doubts import LongAgo
    from kinespace.stream.recognizer.joints.fewer_joints import Opener


#: The joint names of so many times the maximum number of performers are remembered.
_MAX_REMEMBERED = 4
#: Sets of joints that the library is restricted to at most: each has windows of its own, which take room and time.
_MAX_SETS = 3
#: A performer that was not answered for so many seconds makes room for a newcomer that sent so many frames in them: an
#: answer needs a quarter of a second of feed, and names without a body behind them never get one.
_STEADY_SECONDS = 1.0
_STEADY_FRAMES = 12


@dataclass(slots=True)
class PerformerCounts:
    """Counts of the frames of all performers, by their fate."""

    #: Frames of a performer for whom there was no room.
    no_room: int = 0
    #: Frames with too few of the library's joints, or with another number of joints than were named.
    other_joints: int = 0
    #: Performers dropped after silence.
    dropped: int = 0
    #: Sums over all recognisers, of dropped performers too.
    recognizers: RecognizerCounts = field(default_factory=RecognizerCounts)


@dataclass(slots=True)
class _Performer:
    recognizer: Recognizer
    #: The library that the recogniser compares with: whole, or restricted to the joints that the sender has.
    library: MotionLibrary
    heard: float
    #: The joints in the sender's frames; assumed until the sender names them.
    joints: tuple[str, ...]
    #: The index of each of the library's joints in them; None for the library's own order.
    order: NDArray[np.intp] | None = None
    #: As `order`, of all joints compared, the nearest joint for each that the sender lacks; None where none is lacking.
    filled: NDArray[np.intp] | None = None
    #: Why frames of the announced joints cannot be used; empty when they can.
    unusable: str = ""
    #: Whether the library is being restricted to the announced joints.
    is_waiting: bool = False
    #: Joints of the last frame refused for its joints; 0 when none was refused since the joints were last named.
    refused_size: int = 0
    #: When the first frame came, seconds on our clock.
    begun: float = 0.0

    def is_idle(self, now: float) -> bool:
        """Say whether this performer was never answered, or sends fewer frames a second than any feed has."""
        counts = self.recognizer.counts
        return not counts.hops or counts.frames * _STEADY_SECONDS < _STEADY_FRAMES * (now - self.begun)


class Performers:
    """One recogniser per performer.

    Parameters
    ----------
    library, settings
        Of every recogniser (`Recognizer`).
    most
        The number of performers at once; frames of a further one are counted and refused until another falls silent.
    silence
        Seconds without a frame after which a performer is dropped.
    joints
        The joints that senders are known to have; by default the library's.
    opener
        Gives each recogniser the windows of the joints that can be believed.
    classes
        The classes to answer with, in this order (`Recognizer.exchange`); by default the library's.

    Raises
    ------
    ValueError
        Fewer than one performer, no time of silence, or classes that do not fit.
    SkeletonMismatchError
        An assumed joint is missing: one of the library's joints is not among them.
    """

    def __init__(  # noqa: PLR0913 - all by keyword
        self,
        library: MotionLibrary | WindowIndex,
        settings: Settings | None = None,
        *,
        most: int = 32,
        silence: float = 5.0,
        joints: SentJoints | None = None,
        opener: Opener | None = None,
        classes: Sequence[str] = (),
    ) -> None:
        if most < 1:
            raise ValueError(f"most: expected at least 1 performer, got {most}")
        if not (math.isfinite(silence) and silence > 0):
            raise ValueError(f"silence: expected a positive number of seconds, got {silence}")
        self._compare_with(library, classes)
        self.settings = settings or Settings()
        self._opener = opener
        self.most = most
        self.silence = silence
        #: Holds for every performer that names no joints.
        skeleton, joints = self.library.skeleton, joints or SentJoints()
        self._assumed = joints.assumed or skeleton.joints
        self._assumed_order = skeleton.order_from(joints.assumed) if joints.assumed else None
        self._naming = joints.naming
        self._restricter = joints.restricter
        #: The sets of joints that the library was restricted to.
        self._sets: set[tuple[str, ...]] = set()
        #: Why frames are refused for their joints, by performer.
        self._refused: dict[str, str] = {}
        self._counts = PerformerCounts()
        self._performers: dict[str, _Performer] = {}
        #: Ends of motions of performers who were dropped to make room, not given out yet.
        self._ended: list[Event] = []
        #: Performers who were dropped, not given out yet.
        self._gone: list[str] = []
        #: Performers for whom there was no room: since when, and how many frames they have sent.
        self._waiting: dict[str, tuple[float, int]] = {}
        # A sender may announce its joints once, so announcements are kept through a silence.
        self._announced: dict[str, Announcement] = {}

    def _compare_with(self, library: MotionLibrary | WindowIndex, order: Sequence[str]) -> None:
        self._compared, self.library = library, library_of(library)
        require_order(order, library)
        self._order = tuple(order)

    @property
    def classes(self) -> tuple[str, ...]:
        """The classes that are answered; an answer's index counts in this list."""
        return self._order or self.library.classes

    def exchange(self, library: MotionLibrary | WindowIndex, order: Sequence[str] = ()) -> list[Event]:
        """Compare all performers with another library from now on (`Recognizer.exchange`).

        Returns
        -------
        The ends of the motions that go on and whose class the new library lacks.

        Raises
        ------
        SkeletonMismatchError
            The library has other joints; nothing is exchanged.
        """
        self.library.skeleton.require_same(library_of(library).skeleton)
        before = self.library
        self._compare_with(library, order)
        self._sets.clear()
        for performer in self._performers.values():
            if performer.library is before:
                self._exchange_for(performer, library)
            elif not performer.unusable:
                self._fit(performer)
        ended, self._ended = self._ended, []
        return ended

    @property
    def sensitivity(self) -> float:
        """The sensitivity of all recognisers."""
        given = self.settings.sensitivity
        return usual_sensitivity(self.library) if given is None else given

    def set_sensitivity(self, share: float) -> None:
        """Recognise all performers with another sensitivity from the next hop on; WINDOWS only."""
        self.settings = replace(self.settings, sensitivity=share)
        for performer in self._performers.values():
            performer.recognizer.set_sensitivity(share)

    def _exchange_for(self, performer: _Performer, library: MotionLibrary | WindowIndex) -> None:
        """Compare a performer with another library over the same joints."""
        performer.library = library_of(library)
        if ended := performer.recognizer.exchange(library, self._order):
            self._ended.append(ended)

    def __len__(self) -> int:
        return len(self._performers)

    @property
    def names(self) -> tuple[str, ...]:
        """The performers now followed, in the order of their first frames."""
        return tuple(self._performers)

    @property
    def counts(self) -> PerformerCounts:
        """Counts of all frames so far, by their fate; a copy."""
        total = replace(self._counts.recognizers)
        for performer in self._performers.values():
            total.add(performer.recognizer.counts)
        return replace(self._counts, recognizers=total)

    @property
    def refused(self) -> dict[str, str]:
        """Performers whose frames are refused for their joints, with the reason; also performers who have left."""
        return dict(self._refused)

    @property
    def doubted(self) -> dict[str, str]:
        """Performers with joints that cannot be believed, and the reason."""
        return {name: doubt for name, each in self._performers.items() if (doubt := each.recognizer.doubt)}

    @property
    def compared(self) -> dict[str, str]:
        """Performers with other joints than the library's: the convention of their names, and how many are compared."""
        return {name: each for name, performer in self._performers.items() if (each := self._told(performer))}

    def skeleton_of(self, name: str) -> Skeleton | None:
        """Give the joints of a performer's frames, by our names where they are known; None for a stranger.

        A joint's parent is the nearest one above it in the library's skeleton, or in HDM05's if the library has none.
        """
        performer = self._performers.get(name)
        if performer is None:
            return None
        own = self.library.skeleton if self.library.skeleton.parents else hdm05.SKELETON
        return own.linked(self._naming.met(performer.joints, self.library.skeleton.joints).joints)

    def carried(self, name: str) -> Carried | None:
        """Say which joints carry the last answer to a performer; None without an answer."""
        performer = self._performers.get(name)
        given = performer.recognizer.pair_contributions() if performer else None
        if performer is None or given is None:
            return None
        return carried_by(given, performer.library.skeleton.pairs, performer.order, len(performer.joints))

    def long_ago(self, name: str) -> LongAgo | None:
        """Give the facts for another recogniser that goes on with the last seconds of a performer's feed."""
        performer = self._performers.get(name)
        return performer.recognizer.long_ago if performer else None

    def go_on(self, name: str, known: LongAgo, arrival: float) -> None:
        """Go on with a performer where another recogniser was (`Recognizer.go_on`), if there is room."""
        if performer := self._performer(name, arrival):
            performer.recognizer.go_on(known)

    def only_follow(self, name: str, until: float, arrival: float) -> None:
        """Compare nothing of a performer before a time (`Recognizer.only_follow`), if there is room."""
        if performer := self._performer(name, arrival):
            performer.recognizer.only_follow(until)

    def keep_time_with(self, name: str, answered: float) -> None:
        """Answer the same frames of a performer as another recogniser (`Recognizer.keep_time_with`)."""
        if performer := self._performers.get(name):
            performer.recognizer.keep_time_with(answered)

    def _told(self, performer: _Performer) -> str:
        used, wanted = len(performer.library.skeleton.joints), len(self.library.skeleton.joints)
        title = self._naming.met(performer.joints, self.library.skeleton.joints).title
        if performer.is_waiting and performer.unusable:
            return f"{f'{title} names: ' if title else ''}{performer.unusable}, which takes some seconds"
        if performer.unusable or not (title or used < wanted):
            return ""
        return f"{f'{title} names: ' if title else ''}{used} of {wanted} joints"

    def announce(self, announcement: Announcement, arrival: float) -> None:
        """Take in the names of the joints in a performer's frames, in their order.

        A repeated announcement changes nothing; other joints start the performer's window anew, because the joints of
        the frames before may have been others.

        Parameters
        ----------
        announcement
            As received.
        arrival
            When, seconds on our clock.
        """
        performer = self._performer(announcement.performer, arrival)
        if performer is None:
            return
        if self._announced.get(announcement.performer) == announcement and performer.joints == announcement.joints:
            return
        if announcement.performer not in self._announced and len(self._announced) >= _MAX_REMEMBERED * self.most:
            del self._announced[next(iter(self._announced))]
        self._announced[announcement.performer] = announcement
        self._learn_joints(performer, announcement)

    def _learn_joints(self, performer: _Performer, announcement: Announcement) -> None:
        performer.refused_size = 0
        self._refused.pop(announcement.performer, None)
        if performer.joints == announcement.joints:
            return
        performer.joints = announcement.joints
        performer.recognizer.reset()
        self._fit(performer)

    def _fit(self, performer: _Performer) -> None:
        """Compare a performer by the joints that the sender and the library share, if they are enough."""
        wanted = self.library.skeleton.joints
        joints = self._naming.met(performer.joints, wanted).joints
        shared = frozenset(joints).intersection(wanted)
        as_before = shared == frozenset(performer.library.skeleton.joints)
        performer.is_waiting, performer.unusable, performer.filled = False, "", None
        try:
            compared = self._compared if len(shared) == len(wanted) else self._restricted_to(shared)
        except ValueError as error:
            performer.unusable = str(error)
            return
        if len(shared) < len(wanted):
            performer.filled = self.library.skeleton.nearest_from(joints)
        if compared is None:
            performer.is_waiting = True
            # After an exchange the old library serves until the new one is ready, unless a class of it is unknown now.
            serves = as_before and set(performer.library.classes) <= set(self.classes)
            performer.unusable = "" if serves else f"the library is being restricted to {len(shared)} of its joints"
        if performer.unusable:
            return
        compared = compared or performer.library
        library = library_of(compared)
        performer.order = None if joints == library.skeleton.joints else library.skeleton.order_from(joints)
        if performer.library is library:
            return
        if as_before:
            self._exchange_for(performer, compared)
        else:
            self._retire(performer.recognizer)
            performer.recognizer = Recognizer(compared, self.settings, self._opener, self._order)
            performer.library = library

    def _restricted_to(self, shared: frozenset[str]) -> MotionLibrary | WindowIndex | None:
        """Give the library restricted to joints, None while not ready; ValueError when they cannot be compared."""
        joints = tuple(name for name in self.library.skeleton.joints if name in shared)
        if len(joints) < MIN_JOINTS:
            compared = len(self.library.skeleton.joints)
            raise ValueError(f"{len(joints)} of them among the {compared} compared, expected {MIN_JOINTS} at least")
        if joints not in self._sets and len(self._sets) >= _MAX_SETS:
            # Sets of performers who have left, or who send other joints now, make room.
            self._sets &= {each.library.skeleton.joints for each in self._performers.values()}
        if joints not in self._sets and len(self._sets) >= _MAX_SETS:
            raise ValueError(f"{_MAX_SETS} performers send other sets of joints already")
        self._sets.add(joints)
        try:
            return self._restricter(self.library, joints)
        except ValueError as error:
            raise ValueError(f"{len(joints)} of them cannot be compared: {error}") from error

    def _retire(self, recognizer: Recognizer) -> None:
        """Keep a recogniser's counts, and the end of its motion, when the recogniser is no longer needed."""
        self._counts.recognizers.add(recognizer.counts)
        if ended := recognizer.end():
            self._ended.append(ended)

    def push_all(self, events: Sequence[Admitted], arrival: float) -> list[Recognition | None]:
        """Take in frames and announcements that came together, in their order.

        Parameters
        ----------
        events
            As received.
        arrival
            When they came, seconds on our clock, by which silence is measured.

        Returns
        -------
        For each a recognition when one is due, else None.
        """
        answers: list[Recognition | None] = []
        for event in events:
            if isinstance(event, Announcement):
                self.announce(event, arrival)
                answers.append(None)
            elif isinstance(event, NewSender):
                self._announced.pop(event.performer, None)
                self._forget(event.performer)
                answers.append(None)
            else:
                answers.append(self.push(event, arrival))
        return answers

    def push(self, frame: Frame, arrival: float) -> Recognition | None:
        """Take in one frame; give a recognition when one is due, else None.

        Parameters
        ----------
        frame
            As received.
        arrival
            When it came, seconds on our clock.
        """
        performer = self._performer(frame.performer, arrival)
        if performer is None:
            self._counts.no_room += 1
            return None
        if performer.is_waiting:
            self._fit(performer)
            if performer.is_waiting and performer.unusable:
                self._counts.other_joints += 1
                return None
        if performer.unusable or len(frame.positions) != len(performer.joints):
            self._counts.other_joints += 1
            if performer.refused_size != len(frame.positions):
                performer.refused_size = len(frame.positions)
                self._tell_refused(frame.performer, performer)
            return None
        return performer.recognizer.push(_in_order(frame, performer))

    def ordered(self, frame: Frame) -> Frame | None:
        """Give a frame that was pushed in the order of the library's joints; None for one that was refused.

        A joint that the sender lacks stands where the nearest one is, along the bones.
        """
        performer = self._performers.get(frame.performer)
        if performer is None or len(frame.positions) != len(performer.joints):
            return None
        if performer.filled is not None:
            return replace(frame, positions=frame.positions[performer.filled])
        return None if performer.unusable else _in_order(frame, performer)

    def _tell_refused(self, name: str, performer: _Performer) -> None:
        """Note the reason why a performer's frames are refused."""
        if len(self._refused) >= _MAX_REMEMBERED * self.most:
            del self._refused[next(iter(self._refused))]
        size, named = performer.refused_size, len(performer.joints)
        if name not in self._announced:
            why = f"{size} joints whose names were never sent, expected {named}"
        elif performer.unusable:
            why = f"{named} joints, {performer.unusable}"
        else:
            why = f"{size} joints, but {named} names were sent"
        self._refused[name] = why

    def _forget(self, name: str) -> None:
        """Forget a performer; the end of its motion is given out with the ends of silent performers."""
        performer = self._performers.pop(name, None)
        if performer is None:
            return
        self._retire(performer.recognizer)
        self._counts.dropped += 1

    def drop_silent(self, now: float) -> list[Event]:
        """Forget performers that sent nothing for `silence` seconds; give the ends of their motions."""
        silent = [name for name, performer in self._performers.items() if now - performer.heard > self.silence]
        for name in silent:
            self._retire(self._performers.pop(name).recognizer)
            self._gone = [*self._gone[-_MAX_REMEMBERED * self.most :], name]
            self._counts.dropped += 1
        ended, self._ended = self._ended, []
        return ended

    def end_paused(self, now: float) -> list[Event]:
        """Give the ends of the motions of performers who send nothing for now, as their next frames would tell them."""
        paused = (each for each in self._performers.values() if now - each.heard > MAX_PAUSE)
        return [event for each in paused if (event := each.recognizer.end())]

    def take_gone(self) -> list[str]:
        """Give the performers who were dropped since the last call."""
        gone, self._gone = self._gone, []
        return gone

    def end(self) -> list[Event]:
        """Give the ends of all motions going on, because nothing more will come."""
        ended, self._ended = self._ended, []
        return [*ended, *(event for each in self._performers.values() if (event := each.recognizer.end()))]

    def _make_room(self, name: str, arrival: float) -> bool:
        """Drop a performer that is idle, for a newcomer that sends steadily; say whether there is room."""
        since, frames = self._waiting.get(name, (arrival, 0))
        if arrival - since > _STEADY_SECONDS:
            since, frames = arrival, 0
        if name not in self._waiting and len(self._waiting) >= _MAX_REMEMBERED * self.most:
            del self._waiting[next(iter(self._waiting))]
        self._waiting[name] = since, frames + 1
        if frames + 1 < _STEADY_FRAMES:
            return False
        idle = (
            other
            for other, each in self._performers.items()
            if arrival - each.begun > _STEADY_SECONDS and each.is_idle(arrival)
        )
        unanswered = next(idle, None)
        if unanswered is not None:
            self._forget(unanswered)
        return unanswered is not None

    def _performer(self, name: str, arrival: float) -> _Performer | None:
        performer = self._performers.get(name)
        if performer is None:
            if len(self._performers) >= self.most:
                self._ended = self.drop_silent(arrival)
            if len(self._performers) >= self.most and not self._make_room(name, arrival):
                return None
            recognizer = Recognizer(self._compared, self.settings, self._opener, self._order)
            performer = _Performer(recognizer, self.library, arrival, self._assumed, self._assumed_order, begun=arrival)
            self._waiting.pop(name, None)
            self._performers[name] = performer
            self._gone = [each for each in self._gone if each != name]
            self._refused.pop(name, None)
            if name in self._announced:
                self._learn_joints(performer, self._announced[name])
        performer.heard = arrival
        return performer


def _in_order(frame: Frame, performer: _Performer) -> Frame:
    return frame if performer.order is None else replace(frame, positions=frame.positions[performer.order])
