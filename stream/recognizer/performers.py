"""Several performers on one feed: a recogniser for each, made on first sight, dropped after silence."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from kinespace.library import MotionLibrary, Skeleton, WindowIndex, by_joints
from kinespace.library.motion_library import MIN_JOINTS
from kinespace.library.naming import Naming, conventions, hdm05, unknown_names
from kinespace.stream.frame import Admitted, Announcement, Frame, NewSender
from kinespace.stream.packet import remember
from kinespace.stream.present import MAX_REMEMBERED, STEADY_FRAMES, STEADY_SECONDS, Present
from kinespace.stream.recognition import Event, Recognition
from kinespace.stream.recognizer.carried import Carried, carried_by
from kinespace.stream.recognizer.recognizer import Due, Recognizer, Views, answers_to, refuse_copies, require_order
from kinespace.stream.recognizer.settings import Settings, index_for, sensitivity_for
from kinespace.stream.status import PerformerCounts, RecognizerCounts


@dataclass(frozen=True, slots=True)
class SentJoints:
    """The joints that senders have, as far as we know them.

    Attributes
    ----------
    assumed
        The joints of frames whose sender has named none, in the frames' order, by the library's names; empty for the
        library's joints.
    naming
        How announced joint names are read: as HDM05's names, found by their convention unless one is given.
    """

    assumed: tuple[str, ...] = ()
    naming: Naming = field(default_factory=Naming)


#: Sets of joints that the library is restricted to at most: each has windows of its own, which take room and time.
_MAX_SETS = 3
#: Performers that are answered together, at most: what they need then fits into the processor's cache.
_TOGETHER = 8
#: Performers at once that may be asked for.
MAX_PERFORMERS = 10_000


@dataclass(slots=True)
class _Performer:
    recognizer: Recognizer
    #: The windows that the recogniser compares with: of all joints, or of those that the sender has.
    index: WindowIndex
    #: When the newest frame came, and the first, seconds on our clock.
    newest: float
    begun: float
    #: The joints in the sender's frames; assumed until the sender names them.
    joints: tuple[str, ...]
    #: The index of each of the library's joints in them; None for the library's own order.
    order: NDArray[np.intp] | None = None
    #: As `order`, of all joints compared, the nearest joint for each that the sender lacks; None where none is lacking.
    filled: NDArray[np.intp] | None = None
    #: Why frames of the announced joints cannot be used; empty when they can.
    unusable: str = ""
    #: Whether the windows of the announced joints are being opened.
    is_waiting: bool = False
    #: Joints of the last frame refused for its joints; 0 when none was refused since the joints were last named.
    refused_size: int = 0

    def end(self) -> Event | None:
        """End the motion that goes on."""
        return self.recognizer.end()

    def is_idle(self, now: float) -> bool:
        """Say whether it was never answered, or sends fewer frames a second than any feed has."""
        seconds, counts = now - self.begun, self.recognizer.counts
        return seconds > STEADY_SECONDS and (
            not counts.hops or counts.frames * STEADY_SECONDS < STEADY_FRAMES * seconds
        )


class Performers(Present[_Performer]):
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
    views
        Gives the windows of the joints that a sender has, and of those that can be believed (`Recognizer`). By default
        they are opened at once, which takes up to a second where nothing is remembered; with
        `stream.BackgroundViews` no call waits, and a performer is among `opening` until they are open.
    classes
        The classes to answer with, in this order (`Recognizer.exchange`); by default the library's.

    Raises
    ------
    ValueError
        Fewer than one performer, too many, no time of silence, or classes that do not fit.
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
        views: Views = by_joints,
        classes: Sequence[str] = (),
    ) -> None:
        if not 1 <= most <= MAX_PERFORMERS:
            raise ValueError(f"most: expected 1 to {MAX_PERFORMERS} performers, got {most}")
        if not (math.isfinite(silence) and silence > 0):
            raise ValueError(f"silence: expected a positive number of seconds, got {silence}")
        super().__init__(most, silence)
        # A sender may announce its joints once, so announcements are kept through a silence.
        self._announced: dict[str, Announcement] = {}
        self.settings = settings or Settings()
        self._compare_with(index_for(library, self.settings), classes)
        self._views = views
        #: Holds for every performer that names no joints.
        skeleton, joints = self.library.skeleton, joints or SentJoints()
        self._assumed = joints.assumed or skeleton.joints
        # Read now: no announcement is to wait for the files of names.
        conventions()
        self._assumed_order = skeleton.order_from(joints.assumed) if joints.assumed else None
        self._naming = joints.naming
        #: The sets of joints whose windows were asked for.
        self._sets: set[tuple[str, ...]] = set()
        #: Why frames are refused for their joints, by performer.
        self._refused: dict[str, str] = {}

    def _compare_with(self, index: WindowIndex, order: Sequence[str]) -> None:
        require_order(order, index.library)
        self._index, self._order = index, tuple(order)

    @property
    def library(self) -> MotionLibrary:
        """The motions that are compared."""
        return self._index.library

    @property
    def classes(self) -> tuple[str, ...]:
        """The classes that are answered; an answer's index counts in this list."""
        return self._order or self.library.classes

    @property
    def opening(self) -> tuple[str, ...]:
        """The performers whose joints' windows are not open yet; by default none is ever."""
        return tuple(name for name, performer in self._here.items() if performer.is_waiting)

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
        index, before = index_for(library, self.settings), self._index
        self.library.skeleton.require_same(index.library.skeleton)
        self._compare_with(index, order)
        self._sets.clear()
        for performer in self._here.values():
            if performer.index is before:
                self._exchange_for(performer, index)
            elif not performer.unusable:
                self._fit(performer)
        return self._take_ended()

    @property
    def sensitivity(self) -> float:
        """The sensitivity of all recognisers."""
        return sensitivity_for(self.library, self.settings)

    @property
    def promise(self) -> tuple[float, float | None]:
        """False alarms an hour that `done` promises, and the share of the library's motions missed (`Status`)."""
        promised = self.settings.promised
        missed = self._index.courses.missed_at(promised) if promised else math.nan
        return promised, None if math.isnan(missed) else missed

    def set_sensitivity(self, share: float) -> None:
        """Recognise all performers with another sensitivity from the next hop on; WINDOWS only."""
        self.settings = replace(self.settings, sensitivity=share)
        for performer in self._here.values():
            performer.recognizer.set_sensitivity(share)

    __reduce__ = refuse_copies

    def _exchange_for(self, performer: _Performer, index: WindowIndex) -> None:
        """Compare a performer with another library over the same joints."""
        performer.index = index
        if ended := performer.recognizer.exchange(index, self._order):
            self._ended.append(ended)

    @property
    def counts(self) -> PerformerCounts:
        """Counts of all frames so far, by their fate."""
        here = sum((each.recognizer.counts for each in self._here.values()), start=RecognizerCounts())
        return self._counts + PerformerCounts(recognizers=here)

    @property
    def refused(self) -> dict[str, str]:
        """Performers, also some who have left, whose frames are refused for their joints or times; with the reason."""
        untimely = {name: why for name, each in self._here.items() if (why := each.recognizer.untimely)}
        return {**self._refused, **untimely}

    @property
    def doubted(self) -> dict[str, str]:
        """Performers with joints that cannot be believed, and the reason."""
        return {name: doubt for name, each in self._here.items() if (doubt := each.recognizer.doubt)}

    @property
    def compared(self) -> dict[str, str]:
        """Performers with other joints than the library's: the convention of their names, and how many are compared.

        Also performers of another kind of feed than the library's, or whose joints move unlike the library's, or in a
        plane.
        """
        notes = {name: (self._described(each), each.recognizer.fitting.note) for name, each in self._here.items()}
        return {name: "; ".join(filter(None, each)) for name, each in notes.items() if any(each)}

    def skeleton_of(self, name: str) -> Skeleton | None:
        """Give the joints of a performer's frames, by our names where they are known; None for a stranger.

        A joint's parent is the nearest one above it in the library's skeleton, or in HDM05's if the library has none.
        """
        performer = self._here.get(name)
        if performer is None:
            return None
        own = self.library.skeleton if self.library.skeleton.parents else hdm05.SKELETON
        return own.linked(self._naming.met(performer.joints, self.library.skeleton.joints).joints)

    def carried(self, name: str) -> Carried | None:
        """Say which joints carry the last answer to a performer; None without an answer."""
        performer = self._here.get(name)
        given = performer.recognizer.pair_contributions() if performer else None
        if performer is None or given is None:
            return None
        return carried_by(given, performer.index.library.skeleton.pairs, performer.order, len(performer.joints))

    def _described(self, performer: _Performer) -> str:
        used, wanted = len(performer.index.library.skeleton.joints), len(self.library.skeleton.joints)
        title = self._naming.met(performer.joints, self.library.skeleton.joints).title
        if performer.is_waiting and performer.unusable:
            return f"{f'{title} names: ' if title else ''}{performer.unusable}, which takes some seconds"
        if performer.unusable or not (title or used < wanted):
            return ""
        return f"{f'{title} names: ' if title else ''}{used} of {wanted} joints"

    def announce(self, announcement: Announcement, arrival: float) -> None:
        """Take in the names of the joints in a performer's frames, in their order.

        A repeated announcement changes nothing; other joints start the performer's window again, because the joints of
        the frames before may have been others.

        Parameters
        ----------
        announcement
            As received.
        arrival
            When, seconds on our clock.
        """
        performer = self._come(announcement.performer, arrival)
        if performer is None:
            return
        if self._announced.get(announcement.performer) == announcement and performer.joints == announcement.joints:
            return
        remember(self._announced, announcement.performer, announcement, MAX_REMEMBERED * self.most)
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
        as_before = shared == frozenset(performer.index.library.skeleton.joints)
        performer.is_waiting, performer.unusable, performer.filled = False, "", None
        try:
            index = self._index if len(shared) == len(wanted) else self._viewed_by(shared)
        except ValueError as error:
            performer.unusable = str(error)
            return
        if len(shared) < len(wanted):
            performer.filled = self.library.skeleton.nearest_from(joints)
        if index is None:
            performer.is_waiting = True
            # After an exchange the old windows serve until the new ones are open, unless a class is unknown now.
            serves = as_before and set(performer.index.library.classes) <= set(self.classes)
            performer.unusable = "" if serves else f"the library is being restricted to {len(shared)} of its joints"
        if performer.unusable:
            return
        index = index or performer.index
        skeleton = index.library.skeleton
        performer.order = None if joints == skeleton.joints else skeleton.order_from(joints)
        if performer.index is index:
            return
        if as_before:
            self._exchange_for(performer, index)
        else:
            self._retire(performer)
            performer.recognizer = Recognizer(index, self.settings, self._views, self._order)
            performer.index = index

    def _viewed_by(self, shared: frozenset[str]) -> WindowIndex | None:
        """Give the windows of some joints, None while not open; ValueError when they cannot be compared."""
        joints = tuple(name for name in self.library.skeleton.joints if name in shared)
        if len(joints) < MIN_JOINTS:
            compared = len(self.library.skeleton.joints)
            raise ValueError(f"{len(joints)} of them among the {compared} compared, expected {MIN_JOINTS} at least")
        if joints not in self._sets and len(self._sets) >= _MAX_SETS:
            # Sets of performers who have left, or who send other joints now, make room.
            self._sets &= {each.index.library.skeleton.joints for each in self._here.values()}
        if joints not in self._sets and len(self._sets) >= _MAX_SETS:
            raise ValueError(f"{_MAX_SETS} performers send other sets of joints already")
        self._sets.add(joints)
        try:
            return self._views(self._index, joints)
        except ValueError as error:
            raise ValueError(f"{len(joints)} of them cannot be compared: {error}") from error

    def push_all(
        self, events: Sequence[Admitted], arrival: float, *, newest_only: bool = False
    ) -> list[Recognition | None]:
        """Take in frames and announcements that came together, in their order.

        Parameters
        ----------
        events
            As received.
        arrival
            When they came, seconds on our clock, by which silence is measured.
        newest_only
            Answer only the newest frame of each performer; the frames before fill the windows.

        Returns
        -------
        For each a recognition when one is due, else None.
        """
        newest = {each.performer: each.time for each in events if isinstance(each, Frame)} if newest_only else {}
        answers: list[Recognition | None] = [None] * len(events)
        #: The places of the frames that are answered together.
        waiting = dict[str, tuple[int, Due]]()
        for place, event in enumerate(events):
            # Nothing else happens to a performer before it is answered, and whoever begins may make another one leave.
            name = event.performer
            if len(waiting) >= _TOGETHER or (waiting and (name in waiting or name not in self._here)):
                _answer(waiting, answers)
            if isinstance(event, Announcement):
                self.announce(event, arrival)
            elif isinstance(event, NewSender):
                self._announced.pop(event.performer, None)
                self._forget(event.performer)
            elif isinstance(event, Frame):
                if newest and (performer := self._here.get(event.performer)):
                    performer.recognizer.only_follow(newest[event.performer])
                if due := self._take(event, arrival):
                    waiting[event.performer] = place, due
        _answer(waiting, answers)
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
        return self.push_all([frame], arrival)[0]

    def _take(self, frame: Frame, arrival: float) -> Due | None:
        performer = self._come(frame.performer, arrival)
        if performer is None:
            self._counts.no_room += 1
            return None
        if performer.is_waiting:
            self._fit(performer)
            if performer.is_waiting and performer.unusable:
                self._counts.opening += 1
                return None
        if performer.unusable or len(frame.positions) != len(performer.joints):
            self._counts.other_joints += 1
            if performer.refused_size != len(frame.positions):
                performer.refused_size = len(frame.positions)
                self._note_refused(frame.performer, performer)
            return None
        return performer.recognizer.take(_in_order(frame, performer))

    def ordered(self, frame: Frame) -> Frame | None:
        """Give a frame that was pushed in the order of the library's joints; None for one that was refused.

        A joint that the sender lacks stands where the nearest one is, along the bones.
        """
        performer = self._here.get(frame.performer)
        if performer is None or len(frame.positions) != len(performer.joints):
            return None
        if performer.filled is not None:
            return replace(frame, positions=frame.positions[performer.filled])
        return None if performer.unusable else _in_order(frame, performer)

    def _note_refused(self, name: str, performer: _Performer) -> None:
        """Note the reason why a performer's frames are refused."""
        size, named = performer.refused_size, len(performer.joints)
        if name not in self._announced:
            why = f"{size} joints whose names were never sent, expected {named}: let the sender send them, or --joints"
        elif size != named:
            why = f"{size} joints, but {named} names were sent"
        else:
            why = f"{named} joints, {performer.unusable}"
            if unknown := unknown_names(performer.joints, self.library.skeleton.joints):
                why += f"; {unknown}"
        remember(self._refused, name, why, MAX_REMEMBERED * self.most)

    def _retire(self, followed: _Performer) -> None:
        """Keep a recogniser's counts, and the end of its motion, when the recogniser is no longer needed."""
        self._counts.recognizers += followed.recognizer.counts
        super()._retire(followed)

    def _begin(self, name: str, now: float) -> _Performer:
        recognizer = Recognizer(self._index, self.settings, self._views, self._order)
        performer = _Performer(recognizer, self._index, now, now, self._assumed, self._assumed_order)
        self._refused.pop(name, None)
        if name in self._announced:
            self._learn_joints(performer, self._announced[name])
        return performer


def _answer(waiting: dict[str, tuple[int, Due]], answers: list[Recognition | None]) -> None:
    """Put the answers that wait in their places."""
    for (place, _), answer in zip(waiting.values(), answers_to([due for _, due in waiting.values()]), strict=True):
        answers[place] = answer
    waiting.clear()


def _in_order(frame: Frame, performer: _Performer) -> Frame:
    return frame if performer.order is None else replace(frame, positions=frame.positions[performer.order])
