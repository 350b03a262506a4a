"""Several performers on one feed: a recogniser for each, made on first sight, dropped after silence."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING

from kinespace.library.skeleton import SkeletonMismatchError
from kinespace.stream.frame import Announcement
from kinespace.stream.recognizer.matcher import library_of
from kinespace.stream.recognizer.recognizer import Recognizer, RecognizerCounts
from kinespace.stream.recognizer.settings import Settings

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

    from kinespace.library.motion_library import MotionLibrary
    from kinespace.library.windows.index import WindowIndex
    from kinespace.stream.frame import Frame
    from kinespace.stream.recognition import Event, Recognition


#: How many times as many performers' joint names are remembered as there may be performers.
_REMEMBERED = 4
#: Joints that are named where some are lacking.
_NAMED = 5


@dataclass(slots=True)
class PerformerCounts:
    """What became of the frames of all performers."""

    #: Frames of a performer for whom there was no room.
    no_room: int = 0
    #: Frames whose joints do not cover the library's skeleton.
    other_joints: int = 0
    #: Performers dropped after silence.
    dropped: int = 0
    #: Sums over all recognisers, of dropped performers too.
    recognizers: RecognizerCounts = field(default_factory=RecognizerCounts)


@dataclass(slots=True)
class _Performer:
    recognizer: Recognizer
    heard: float
    #: What the sender's frames hold: what is assumed until it says otherwise.
    joints: tuple[str, ...]
    #: Where the skeleton's joints stand in them; None for the skeleton's own order.
    order: NDArray[np.intp] | None = None
    #: Whether the announced joints cover the skeleton's.
    known_joints: bool = True
    #: Joints of the last frame that was refused for its joints; 0 when none was since the joints were last named.
    refused_size: int = 0


class Performers:
    """One recogniser per performer.

    Parameters
    ----------
    library, settings
        Of every recogniser (`Recognizer`).
    most
        How many performers at once; frames of a further one are counted and refused until another falls silent.
    silence
        Seconds without a frame after which a performer is dropped.
    joints
        What frames hold whose sender has not said so, in their order; the library's joints when not given.
    classes
        The classes to answer with, in this order (`Recognizer.exchange`); as the library has them when not given.

    Raises
    ------
    ValueError
        Fewer than one performer, or no time of silence.
    SkeletonMismatchError
        A joint of the library is not among `joints`.
    """

    def __init__(  # noqa: PLR0913 - all but two by keyword
        self,
        library: MotionLibrary | WindowIndex,
        settings: Settings | None = None,
        *,
        most: int = 32,
        silence: float = 5.0,
        joints: Sequence[str] = (),
        classes: Sequence[str] = (),
    ) -> None:
        if most < 1:
            raise ValueError(f"most: expected at least 1 performer, got {most}")
        if not (math.isfinite(silence) and silence > 0):
            raise ValueError(f"silence: expected a positive number of seconds, got {silence}")
        self._compare_with(library, classes)
        self.settings = settings or Settings()
        self.most = most
        self.silence = silence
        #: Said of every performer who has said nothing else.
        skeleton = self.library.skeleton
        self._assumed = tuple(joints) or skeleton.joints
        self._assumed_order = skeleton.order_from(joints) if joints else None
        #: Why frames are refused for their joints, by performer.
        self._refused: dict[str, str] = {}
        self._counts = PerformerCounts()
        self._performers: dict[str, _Performer] = {}
        #: Ends of what performers did who were dropped to make room, not yet given to anybody.
        self._ended: list[Event] = []
        # Said once and then only on change, so it outlives a silence.
        self._announced: dict[str, Announcement] = {}

    def _compare_with(self, library: MotionLibrary | WindowIndex, order: Sequence[str]) -> None:
        self._compared, self.library = library, library_of(library)
        self._order = tuple(order)

    @property
    def classes(self) -> tuple[str, ...]:
        """The classes that are answered; an answer's index counts in them."""
        return self._order or self.library.classes

    def exchange(self, library: MotionLibrary | WindowIndex, order: Sequence[str] = ()) -> list[Event]:
        """Compare all performers with another library from now on (`Recognizer.exchange`).

        Returns
        -------
        The ends of what performers were doing whose class the new library has not.

        Raises
        ------
        SkeletonMismatchError
            The library has other joints; nothing is exchanged.
        """
        self.library.skeleton.require_same(library_of(library).skeleton)
        self._compare_with(library, order)
        return [event for each in self._performers.values() if (event := each.recognizer.exchange(library, order))]

    def __len__(self) -> int:
        return len(self._performers)

    @property
    def names(self) -> tuple[str, ...]:
        """The performers now followed, in the order of their first frames."""
        return tuple(self._performers)

    @property
    def counts(self) -> PerformerCounts:
        """What became of all frames so far; a copy."""
        total = replace(self._counts.recognizers)
        for performer in self._performers.values():
            _add(total, performer.recognizer.counts)
        return replace(self._counts, recognizers=total)

    @property
    def refused(self) -> dict[str, str]:
        """Performers whose frames are refused for their joints, and why; of those who left, the last time."""
        return dict(self._refused)

    def announce(self, announcement: Announcement, arrival: float) -> None:
        """Take in which joints a performer's frames hold, in which order.

        A repeated announcement costs a comparison; one with other joints starts the performer's window anew, because
        the frames before it may have meant something else.

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
        if announcement.performer not in self._announced and len(self._announced) >= _REMEMBERED * self.most:
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
        try:
            performer.order = self.library.skeleton.order_from(announcement.joints)
        except SkeletonMismatchError:
            performer.known_joints = False
        else:
            performer.known_joints = True
            if announcement.joints == self.library.skeleton.joints:
                performer.order = None

    def push_all(self, events: Sequence[Frame | Announcement], arrival: float) -> list[Recognition | None]:
        """Take in frames and announcements that came together, in their order.

        Parameters
        ----------
        events
            As received.
        arrival
            When they came, seconds on our clock: what silence is measured by.

        Returns
        -------
        For each a recognition when one is due, else None.
        """
        answers: list[Recognition | None] = []
        for event in events:
            if isinstance(event, Announcement):
                self.announce(event, arrival)
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
        if not performer.known_joints or len(frame.positions) != len(performer.joints):
            self._counts.other_joints += 1
            if performer.refused_size != len(frame.positions):
                performer.refused_size = len(frame.positions)
                self._tell_refused(frame.performer, performer)
            return None
        return performer.recognizer.push(_in_order(frame, performer))

    def ordered(self, frame: Frame) -> Frame | None:
        """Give a frame that was pushed in the order of the library's joints; None for one that was refused."""
        performer = self._performers.get(frame.performer)
        if performer is None or not performer.known_joints or len(frame.positions) != len(performer.joints):
            return None
        return _in_order(frame, performer)

    def _tell_refused(self, name: str, performer: _Performer) -> None:
        """Note why a performer's frames are refused."""
        if len(self._refused) >= _REMEMBERED * self.most:
            del self._refused[next(iter(self._refused))]
        size, wanted = performer.refused_size, self.library.skeleton.joints
        lacking = [joint for joint in wanted if joint not in performer.joints]
        if name not in self._announced:
            why = f"{size} joints whose names were never sent, expected {len(performer.joints)}"
        elif lacking:
            named = ", ".join(lacking[:_NAMED]) + (" ..." if len(lacking) > _NAMED else "")
            why = f"{len(performer.joints)} joints without {named} of the {len(wanted)} compared"
        else:
            why = f"{size} joints, but {len(performer.joints)} names were sent"
        self._refused[name] = why

    def drop_silent(self, now: float) -> list[Event]:
        """Forget performers of whom nothing came for `silence` seconds; give the ends of what they were doing."""
        silent = [name for name, performer in self._performers.items() if now - performer.heard > self.silence]
        gone = [self._performers.pop(name).recognizer for name in silent]
        for recognizer in gone:
            _add(self._counts.recognizers, recognizer.counts)
            self._counts.dropped += 1
        ended = [*self._ended, *(event for recognizer in gone if (event := recognizer.end()))]
        self._ended = []
        return ended

    def end(self) -> list[Event]:
        """Give the ends of all motions going on, because nothing more will come."""
        ended, self._ended = self._ended, []
        return [*ended, *(event for each in self._performers.values() if (event := each.recognizer.end()))]

    def _performer(self, name: str, arrival: float) -> _Performer | None:
        performer = self._performers.get(name)
        if performer is None:
            if len(self._performers) >= self.most:
                self._ended = self.drop_silent(arrival)
            if len(self._performers) >= self.most:
                return None
            recognizer = Recognizer(self._compared, self.settings, self._order)
            performer = self._performers[name] = _Performer(recognizer, arrival, self._assumed, self._assumed_order)
            self._refused.pop(name, None)
            if name in self._announced:
                self._learn_joints(performer, self._announced[name])
        performer.heard = arrival
        return performer


def _in_order(frame: Frame, performer: _Performer) -> Frame:
    return frame if performer.order is None else replace(frame, positions=frame.positions[performer.order])


def _add(total: RecognizerCounts, counts: RecognizerCounts) -> None:
    for each in fields(RecognizerCounts):
        setattr(total, each.name, getattr(total, each.name) + getattr(counts, each.name))
