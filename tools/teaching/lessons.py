"""Lessons: the teacher among the recognisers. Commands and frames come in, notices and another library come out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from kinespace.library.clip import Clip
from kinespace.library.motion_library import NOTHING, MotionLibrary
from kinespace.library.skeleton import Skeleton
from kinespace.library.teaching.examples import Roster, TaughtWindows
from kinespace.library.windows.index import WindowIndex, opened
from kinespace.stream.teaching import Changed, Exchanged, State, Step, Teacher
from kinespace.stream.teaching.notices import Running, Saving, Sensed
from kinespace.tools.teaching.opener import Change, Checked, Failed, Opened, RosterOpener, Saved

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence
    from pathlib import Path

    from kinespace.stream.frame import Frame
    from kinespace.stream.service.recognising import Teachable
    from kinespace.stream.teaching import Command, Notice
    from kinespace.tools.teaching.opener import Result


class Lessons:
    """Passes commands and frames to the teacher, and the teacher's wishes to the recognisers.

    Parameters
    ----------
    performers
        The recognisers; they compare with `windows.index_of(teacher.roster)`, or with any library while that is None.
    teacher
        Records the examples.
    windows
        Opens rosters.
    file
        Where the roster is saved after every change.

    Attributes
    ----------
    performers
        As given.
    classes
        The classes of the answers; a class keeps its index once it was known.
    """

    def __init__(self, performers: Teachable, teacher: Teacher, windows: TaughtWindows, file: Path) -> None:
        self.performers, self._teacher = performers, teacher
        self._places = ClassPlaces(windows.base_classes)
        self.classes = self._places.of(teacher.roster)
        #: Whether there is a library to compare with, and whether answers are switched on.
        self._something, self._running = bool(windows.base_classes or teacher.roster.examples), True
        self._opener = RosterOpener(windows, file)

    @property
    def answers(self) -> bool:
        """Whether performers are answered: not without a library, and not while answers are switched off."""
        return self._something and self._running

    def described(self) -> dict[str, object]:
        """Describe the classes and the settings, for a reply: `taught` counts the examples of each taught class."""
        roster = self._teacher.roster
        return {
            "classes": list(self.classes),
            "taught": {name: len(roster.of(name)) for name in roster.classes},
            "off": sorted(roster.disabled),
            "sensitivity": self.performers.sensitivity,
            "teaches": True,
        }

    def push(self, frame: Frame, now: float) -> Iterator[Notice]:
        """Show the teacher a frame that the recognisers have got; give the notices."""
        ordered = self.performers.ordered(frame)
        return self._carried_out(self._teacher.push(ordered, now) if ordered else ())

    def command(self, command: Command, now: float) -> Iterator[Notice]:
        """Carry out a command; give the notices."""
        return self._carried_out(self._explained(notice) for notice in self._teacher.command(command, now))

    def tick(self, now: float) -> Iterator[Notice]:
        """Do the work that is due by the clock, and take what was opened; give the notices."""
        yield from self._carried_out(self._teacher.tick(now))
        for result in self._opener.results():
            yield from self._carried_out(self._taken(result))

    def close(self) -> None:
        """Save the last changes."""
        self._opener.close()

    def _explained(self, notice: Notice) -> Notice:
        """Explain to a performer why frames that cannot be used prevent teaching."""
        if isinstance(notice, State) and notice.step is Step.REFUSED:
            return replace(notice, reason=self.performers.refused.get(notice.performer, notice.reason))
        return notice

    def _carried_out(self, notices: Iterable[Notice]) -> Iterator[Notice]:
        """Do what the teacher wishes, and give the notices that are for listeners."""
        for notice in notices:
            match notice:
                case Changed(roster, number):
                    before = self._teacher.recent(number) if number else None
                    self._opener.open(Change(roster, self.performers.settings, number, before))
                case Saving():
                    self._opener.open(Change(self._teacher.roster, self.performers.settings, asked=True))
                case Running(on):
                    self._running = on
                case Sensed(share):
                    self.performers.set_sensitivity(share)
                case _:
                    yield notice

    def _taken(self, result: Result) -> Sequence[Notice]:
        match result:
            case Saved(words):
                return [State("", Step.DONE, 0.0, words)]
            case Opened(roster, index):
                return [self._exchanged(roster, index)]
            case Checked(number, check, starts):
                return self._teacher.checked(number, check, starts)
            case Failed(number, reason):
                return self._teacher.failed(number, reason) if number else [State("", Step.REFUSED, 0.0, reason)]

    def _exchanged(self, roster: Roster, index: WindowIndex | None) -> Exchanged:
        """Let the recognisers compare with the opened roster."""
        self.classes = self._places.of(roster)
        ended = self.performers.exchange(index, self.classes) if index else []
        # Without a library no start was published.
        known, self._something = self._something, index is not None
        return Exchanged(self.classes, tuple(ended) if known else ())


class ClassPlaces:
    """Keeps each class's index while a service runs: new classes come last, a renamed class keeps its index.

    Parameters
    ----------
    base
        Classes that are known without examples: the first ones.
    """

    def __init__(self, base: Sequence[str]) -> None:
        self._names = list(base)
        self._base = len(self._names)
        #: The class index of each example, by number, at the last call.
        self._examples: dict[int, int] = {}

    def of(self, roster: Roster) -> tuple[str, ...]:
        """Give all classes that were ever known, in order."""
        taught = roster.classes
        for name in taught:
            if name == NOTHING:
                continue
            numbers = [each.number for each in roster.of(name)]
            if name not in self._names:
                places = [self._examples[number] for number in numbers if number in self._examples]
                free = [place for place in places if place >= self._base and self._names[place] not in taught]
                if free:
                    self._names[free[0]] = name
                else:
                    self._names.append(name)
            self._examples.update(dict.fromkeys(numbers, self._names.index(name)))
        return tuple(self._names)


@dataclass(frozen=True, slots=True)
class Start:
    """The beginning of teaching.

    Attributes
    ----------
    file
        A library of taught motions; it may be missing.
    library
        The library that is compared beside the taught motions; None for none.
    joints
        The joints of frames, if known; used without a library.
    """

    file: Path
    library: MotionLibrary | None
    joints: tuple[str, ...] = ()

    def base(self, taught: MotionLibrary | None) -> WindowIndex | None:
        """Open the windows whose metrics compare the examples; None when the examples learn their own metrics."""
        if self.library:
            return opened(self.library.restricted_to(taught.skeleton.joints) if taught else self.library)
        builtin = MotionLibrary.builtin()
        # The numbers learned from the built-in motions make opening quick; those of other motions are left out.
        builtin = replace(builtin, learned=builtin.learned and builtin.learned.of_these_motions())
        joints = taught.skeleton.joints if taught else self.joints or builtin.skeleton.joints
        if not set(joints) <= set(builtin.skeleton.joints):
            return None
        return opened(builtin.restricted_to(joints))


def open_lessons(start: Start, performers: Callable[[WindowIndex, Sequence[str]], Teachable]) -> Lessons:
    """Open the taught library for lessons.

    Parameters
    ----------
    start
        The beginning of teaching.
    performers
        Makes the recognisers from an opened library and the order of its classes.

    Raises
    ------
    ValueError
        The file is no library, or has too few of the library's joints.
    OSError
        The file cannot be read, or its folder is missing.
    """
    file = start.file
    if not file.absolute().parent.is_dir():
        raise FileNotFoundError(f"{file}: no such folder")
    taught = MotionLibrary.load(file) if file.exists() else None
    base = start.base(taught)
    if taught and base:
        taught = taught.restricted_to(base.library.skeleton.joints)
        motions = tuple(motion.as_of(base.library.skeleton) for motion in taught.motions)
        taught = MotionLibrary(base.library.skeleton, motions)
    roster = Roster.of_library(taught) if taught else Roster()
    windows = TaughtWindows(base, beside=start.library is not None)
    index = windows.index_of(roster) or base or WindowIndex.of(_any_motion(start.joints))
    teacher = Teacher(index.library.skeleton, roster, windows.base_classes)
    order = ClassPlaces(windows.base_classes).of(roster)
    return Lessons(performers(index, order or index.classes), teacher, windows, file)


def _any_motion(joints: Sequence[str]) -> MotionLibrary:
    """Make a library of joints without taught motions: recognisers need a library, but are not asked with this one."""
    generator = np.random.default_rng(0)
    positions = np.cumsum(generator.normal(0, 0.05, (60, len(joints), 3)), axis=0)
    return MotionLibrary.of_clips([Clip(Skeleton(tuple(joints)), positions, 30.0, class_name=NOTHING)])
