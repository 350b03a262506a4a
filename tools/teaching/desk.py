"""The desk: performers who are recognised and taught at once.

The service hands its frames to the desk as it would to `Performers`. The recognisers get them first. A worker does the
slow part: it opens the enlarged library, saves it, checks the new example and tries it on the performer's last minutes.
Between two frames the desk takes the worker's results and exchanges the library.
"""

from __future__ import annotations

import queue
import sys
import threading
import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from kinespace.library.clip import Clip
from kinespace.library.motion_library import NOTHING, MotionLibrary
from kinespace.library.skeleton import Skeleton
from kinespace.library.teaching.examples import Roster, TaughtWindows, checked
from kinespace.library.windows.index import WindowIndex, opened
from kinespace.stream.frame import Frame
from kinespace.stream.recognition import EventKind
from kinespace.stream.recognizer import Recognizer, Settings
from kinespace.stream.teaching import Changed, State, Step, Teacher, commands
from kinespace.stream.teaching.notices import Running, Saving, Sensed
from kinespace.tools.teaching.commanded import describe_recording, recorded

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from kinespace.library.teaching.examples import Check
    from kinespace.stream.frame import Admitted
    from kinespace.stream.inputs.recording.session import RecordingSession
    from kinespace.stream.outputs.sink import Sink
    from kinespace.stream.recognition import Event, Recognition
    from kinespace.stream.recognizer.joints.carried import Carried
    from kinespace.stream.recognizer.joints.fewer_joints import Restricter
    from kinespace.stream.recognizer.performers import PerformerCounts
    from kinespace.stream.service.recognising import Teachable
    from kinespace.stream.teaching import Command, Notice
    from kinespace.stream.teaching.memory import Remembered

#: Seconds for which a thread may keep Python's lock while a frame waits.
_SWITCH_INTERVAL = 0.0005
#: Seconds between two answers when an example is tried on the last minutes: enough to count starts.
_TRIED_EVERY = 0.1
#: Frames after which the worker pauses for other threads, and the pause in seconds.
_FRAMES_AT_ONCE, _PAUSE = 6, 0.002


@dataclass(frozen=True, slots=True, eq=False)
class _Job:
    """A roster to open and save, an example to check, and the performer's last minutes before it."""

    roster: Roster
    number: int = 0
    before: Remembered | None = None
    #: Whether a command asked for the file, and waits for the notice that it is written.
    tells: bool = False


@dataclass(frozen=True, slots=True)
class _Saved:
    told: str


@dataclass(frozen=True, slots=True, eq=False)
class _Opened:
    job: _Job
    index: WindowIndex | None


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    number: int
    check: Check | None
    starts: int


@dataclass(frozen=True, slots=True)
class _Failed:
    number: int
    reason: str


class Desk:
    """Takes the place of `Performers` in the service.

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
    clock
        Seconds.

    Attributes
    ----------
    sinks
        The sinks for notices, and for the classes when they change.
    recording
        Begins and ends recordings; None without a folder for them.
    """

    def __init__(
        self,
        performers: Teachable,
        teacher: Teacher,
        windows: TaughtWindows,
        file: Path,
        *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.sinks: Sequence[Sink] = ()
        self.recording: RecordingSession | None = None
        self._performers, self._teacher, self._windows, self._file = performers, teacher, windows, file
        self._clock = clock
        self._places = ClassPlaces(windows.base_classes)
        self._order = self._places.of(teacher.roster)
        #: Whether performers are answered: not without a library, and not while answers are switched off.
        self._something = bool(windows.base_classes or teacher.roster.examples)
        self._running = True
        self._jobs: queue.SimpleQueue[_Job | None] = queue.SimpleQueue()
        self._results: queue.SimpleQueue[_Opened | _Found | _Failed | _Saved] = queue.SimpleQueue()
        self._asked: queue.SimpleQueue[Command] = queue.SimpleQueue()
        self._ending = threading.Event()
        self._worker = threading.Thread(target=self._work, name="kinespace teaching", daemon=True)
        sys.setswitchinterval(_SWITCH_INTERVAL)
        self._worker.start()

    @property
    def settings(self) -> Settings:
        """The settings of all recognisers."""
        return self._performers.settings

    @property
    def classes(self) -> tuple[str, ...]:
        """The classes of the answers; a class keeps its index once it was known."""
        return self._order

    @property
    def names(self) -> tuple[str, ...]:
        """The performers that are followed now."""
        return self._performers.names

    @property
    def counts(self) -> PerformerCounts:
        """Counts of all frames so far, by their fate."""
        return self._performers.counts

    @property
    def refused(self) -> dict[str, str]:
        """Performers whose frames are refused for their joints, with the reason."""
        return self._performers.refused

    @property
    def compared(self) -> dict[str, str]:
        """The joints by which performers are compared, if these are not all."""
        return self._performers.compared

    @property
    def doubted(self) -> dict[str, str]:
        """Performers with joints that cannot be believed, and the reason."""
        return self._performers.doubted

    def skeleton_of(self, name: str) -> Skeleton | None:
        """Give the joints of a performer's frames."""
        return self._performers.skeleton_of(name)

    def carried(self, name: str) -> Carried | None:
        """Say which joints carry the last answer to a performer."""
        return self._performers.carried(name)

    @property
    def silence(self) -> float:
        """Seconds without a frame after which a performer is dropped."""
        return self._performers.silence

    def take_gone(self) -> list[str]:
        """Give the performers who were dropped since the last call."""
        return self._performers.take_gone()

    def push_all(self, events: Sequence[Admitted], arrival: float) -> list[Recognition | None]:
        """Recognise frames, and show them to the teacher."""
        answers = self._performers.push_all(events, arrival)
        for event in events:
            if not isinstance(event, Frame):
                continue
            if (frame := self._performers.ordered(event)) is not None:
                self._deal_with(self._teacher.push(frame, arrival))
        if not (self._running and self._something):
            return [None] * len(answers)
        return answers

    def drop_silent(self, now: float) -> list[Event]:
        """Forget silent performers."""
        return self._ends_told(self._performers.drop_silent(now))

    def end_paused(self, now: float) -> list[Event]:
        """Give the ends of the motions of performers who send nothing for now."""
        return self._ends_told(self._performers.end_paused(now))

    def end(self) -> list[Event]:
        """Give the ends of all motions that go on."""
        return self._ends_told(self._performers.end())

    def _ends_told(self, ended: list[Event]) -> list[Event]:
        """Leave out all ends if no starts were told, because there was no library."""
        return ended if self._something else []

    def command(self, command: Command) -> list[Notice]:
        """Carry out a command; give its notices."""
        if isinstance(command, commands.Record):
            notices: list[Notice] = [recorded(self.recording, on=command.on)]
        else:
            notices = self._teacher.command(command, self._clock())
        notices = [self._explained(notice) for notice in notices]
        self._deal_with(notices)
        return [notice for notice in notices if isinstance(notice, State)]

    def _explained(self, notice: Notice) -> Notice:
        """Explain to a performer why frames that cannot be used prevent teaching."""
        if isinstance(notice, State) and notice.step is Step.REFUSED:
            return replace(notice, reason=self._performers.refused.get(notice.performer, notice.reason))
        return notice

    def described(self) -> dict[str, object]:
        """Describe the classes and the settings, for a reply: `taught` counts the examples of each taught class."""
        roster = self._teacher.roster
        return {
            "classes": list(self.classes),
            "taught": {name: len(roster.of(name)) for name in roster.classes},
            "off": sorted(roster.disabled),
            "sensitivity": self._performers.sensitivity,
            "teaches": True,
            **describe_recording(self.recording),
        }

    def ask(self, command: Command) -> None:
        """Carry out, at the next turn, a command from another thread."""
        self._asked.put(command)

    def refuse(self, reason: str) -> State:
        """Give a notice that a command could not be read."""
        told = State("", Step.REFUSED, 0.0, reason)
        self._deal_with([told])
        return told

    def tend(self, now: float) -> None:
        """Do the work that is due by the clock, and take the worker's results."""
        self._deal_with(self._teacher.tick(now))
        while not self._asked.empty():
            self.command(self._asked.get())
        while not self._results.empty():
            self._take(self._results.get())

    def close(self) -> None:
        """Let the worker save the last changes, and end."""
        self._ending.set()
        if self.recording:
            self.recording.stop()
        self._jobs.put(None)
        self._worker.join()
        self.tend(self._clock())

    def _deal_with(self, notices: Sequence[Notice]) -> None:
        for notice in notices:
            match notice:
                case Changed(roster, number):
                    self._jobs.put(_Job(roster, number, self._teacher.recent(number) if number else None))
                case Saving():
                    self._jobs.put(_Job(self._teacher.roster, tells=True))
                case Running(on):
                    self._running = on
                case Sensed(share):
                    self._performers.set_sensitivity(share)
                case _:
                    for sink in self.sinks:
                        sink.publish_notice(notice)

    def _take(self, result: _Opened | _Found | _Failed | _Saved) -> None:
        match result:
            case _Saved(told):
                self._deal_with([State("", Step.DONE, 0.0, told)])
            case _Opened(job, index):
                self._exchange(job.roster, index)
            case _Found(number, check, starts):
                self._deal_with(self._teacher.checked(number, check, starts))
            case _Failed(number, reason):
                self._deal_with(self._teacher.failed(number, reason) if number else [_told(reason)])

    def _exchange(self, roster: Roster, index: WindowIndex | None) -> None:
        self._order = self._places.of(roster)
        # Without a library no start was told.
        told, self._something = self._something, index is not None
        if index is not None:
            for ended in self._performers.exchange(index, self._order):
                for sink in self.sinks if told else ():
                    sink.publish_event(ended)
        for sink in self.sinks:
            sink.publish_classes(self._order)

    def _work(self) -> None:
        """Open, save, check and try, one change after the other, until the end."""
        unsaved: Roster | None = None
        while (job := self._jobs.get()) is not None:
            index, unsaved = self._opened(job, unsaved)
            if job.number and index is not None:
                self._results.put(_Found(job.number, checked(index, job.number), self._starts(job, index)))
        if unsaved is not None:
            self._save(unsaved)

    def _opened(self, job: _Job, unsaved: Roster | None) -> tuple[WindowIndex | None, Roster | None]:
        """Open a job's roster and save it, unless another waits; give its index, and the roster not saved yet."""
        try:
            index = self._windows.index_of(job.roster)
            if index is not None:
                # A first recogniser prepares the windows here; between two frames there is no time for this.
                Recognizer(index, self.settings)
        except (ValueError, MemoryError) as error:
            self._results.put(_Failed(job.number, " ".join(str(error).split())))
            return None, unsaved
        self._results.put(_Opened(job, index))
        if not (job.tells or self._jobs.empty()):
            return index, job.roster
        self._save(job.roster, tells=job.tells)
        return index, None

    def _save(self, roster: Roster, *, tells: bool = False) -> None:
        try:
            library = roster.library()
            if library is None:
                self._file.unlink(missing_ok=True)
            else:
                library.save(self._file)
            if tells:
                count = len(roster.examples)
                self._results.put(_Saved(f"{self._file.name} saved, examples: {count}" if count else "nothing to save"))
        except (OSError, ValueError) as error:
            told = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
            self._results.put(
                _Failed(0, f"{self._file.name} was not saved: {told}; the taught motions are still in memory")
            )

    def _starts(self, job: _Job, index: WindowIndex) -> int:
        """Count how often the new class would have started in the performer's last minutes."""
        if job.before is None:
            return 0
        name = next((each.class_name for each in job.roster.examples if each.number == job.number), NOTHING)
        recognizer = Recognizer(index, replace(self.settings, hop=_TRIED_EVERY))
        starts = 0
        before = job.before.clip()
        for place, (moment, positions) in enumerate(zip(before.times.tolist(), before.positions, strict=True)):
            # The end of the program does not wait for a count.
            if place % _FRAMES_AT_ONCE == 0 and self._ending.wait(_PAUSE):
                break
            recognition = recognizer.push(Frame("before", moment, positions))
            for event in recognition.events if recognition else ():
                starts += event.kind is EventKind.START and event.label == name
        return starts


class ClassPlaces:
    """Keeps each class's index while the desk exists: new classes come last, a renamed class keeps its index.

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


def open_desk(start: Start, performers: Callable[[WindowIndex, Sequence[str], Restricter], Teachable]) -> Desk:
    """Open the taught library and make the desk.

    Parameters
    ----------
    start
        The beginning of teaching.
    performers
        Makes the recognisers from an opened library, the order of its classes, and a function that restricts taught
        libraries to a body's joints, at once, for one thread at a time.

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
    return Desk(performers(index, order or index.classes, windows.of_fewer), teacher, windows, file)


def _any_motion(joints: Sequence[str]) -> MotionLibrary:
    """Make a library of joints without taught motions: recognisers need a library, but are not asked with this one."""
    generator = np.random.default_rng(0)
    positions = np.cumsum(generator.normal(0, 0.05, (60, len(joints), 3)), axis=0)
    return MotionLibrary.of_clips([Clip(Skeleton(tuple(joints)), positions, 30.0, class_name="motion")])


def _told(reason: str) -> State:
    return State("", Step.REFUSED, 0.0, reason)
