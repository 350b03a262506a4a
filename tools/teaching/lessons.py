"""Lessons: the teacher among the recognisers. Commands and frames come in, notices and another library come out."""

import math
import queue
import threading
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from kinespace.library import Clip, Skeleton, WindowIndex, opened
from kinespace.library.motion_library import MIN_JOINTS, NOTHING, MotionLibrary
from kinespace.library.windows.taught import teaches_itself
from kinespace.stream import Event, EventKind, Frame, Recognizer, Settings
from kinespace.stream.outputs.sink import Sink
from kinespace.stream.recognition import Classes
from kinespace.stream.service.loop import Recognising, tell
from kinespace.stream.teaching import Asked, Changed, Notice, Remembered, State, Step, Teacher, Told, Tried, commands
from kinespace.stream.teaching.examples import Roster, TaughtWindows, checked, held
from kinespace.stream.teaching.movement import STILLNESS
from kinespace.tools.cli.console import note
from kinespace.tools.teaching.roster_file import RosterFile

#: Seconds after a lesson in which its performer is still not answered: a motion is done some tenths after its end.
_MUTED_AFTER = 0.5


class Lessons(Sink):
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
        Saves the roster after every change.

    Attributes
    ----------
    performers
        As given.
    classes
        The classes of the answers; a class keeps its index once it was known.
    answers
        Whether performers are answered: not without a library.
    is_loud
        Whether a performer who is being taught is answered meanwhile.
    sinks
        The sinks for notices, for the classes when they change, and for the ends of motions whose class is gone.
    """

    def __init__(self, performers: Recognising, teacher: Teacher, windows: TaughtWindows, file: RosterFile) -> None:
        self.performers, self._teacher, self._clock = performers, teacher, time.monotonic
        self._places = ClassPlaces(windows.base_classes)
        self.classes: Sequence[str] = self._places.of(teacher.roster)
        self.answers = bool(windows.base_classes or {*teacher.roster.classes} - {NOTHING})
        self.sinks: Sequence[Sink] = ()
        self.is_loud = False
        #: Who is not answered during a lesson, and until when: what was shown last fires nothing behind it, either.
        self._muted = "", -math.inf
        self._file, self._opener = file, RosterOpener(windows, teacher, self._exchange)

    def publish_frame(self, frame: Frame) -> None:
        """Show the teacher a frame that the recognisers have got."""
        if ordered := self.performers.ordered(frame):
            self._publish(self._teacher.push(ordered, self._clock()))

    def publish_event(self, event: Event) -> None:
        """Tell the teacher which motion was named, so that a person may say whether that was right."""
        self._teacher.named.push(event)

    def carry_out(self, asked: Asked) -> list[State]:
        """Carry out a command, and reply if a reply is wanted; give the states that follow at once."""
        match asked.command:
            case None:
                notices: Iterable[Notice | Changed] = [State("", Step.REFUSED, 0.0, asked.refusal)]
            case commands.Reset(performer):
                notices = [State(performer, Step.DONE, 0.0, "counts from 1")]
            case commands.Save():
                self._file.save(self._teacher.roster, asked=True)
                notices = [State("", Step.CHECKING, 0.0, "saving")]
            case commands.Sensitivity(share):
                self.performers.set_sensitivity(share)
                notices = [State("", Step.DONE, 0.0, f"sensitivity {share:g}")]
            case commands.List() if asked.reply is None:
                # Whoever asks by OSC gets the answer there.
                tell(self.sinks, Classes(tuple(self.classes)))
                notices = [State("", Step.DONE, 0.0, self._listed())]
            case command:
                notices = map(self._explained, self._teacher.command(command, self._clock()))
        states = self._publish(notices)
        if asked.reply:
            asked.reply(states, self._described() if asked.command else {})
        return states

    @property
    def muted(self) -> str:
        """The performer who is not answered during a lesson and shortly after it; empty for nobody."""
        lesson, now = self._teacher.lesson, self._clock()
        if lesson and not self.is_loud:
            self._muted = lesson.performer, now + _MUTED_AFTER
        name, until = self._muted
        return name if now < until else ""

    def tend(self, now: float) -> None:
        """Do the work that is due by the clock, and take what was opened."""
        self._publish(self._teacher.tick(now))
        self._publish(self._opener.results())
        self._publish(self._file.states())

    def close(self) -> None:
        """Save the last changes first."""
        self._file.close()
        self._opener.close()
        self.tend(self._clock())

    @property
    def has_unsaved(self) -> bool:
        """Whether there are changes that are not in the file."""
        return self._file.has_unsaved

    def _described(self) -> dict[str, Any]:
        """Describe the classes and the settings, for a reply: `taught` counts the examples of each taught class."""
        roster = self._teacher.roster
        taught = {name: len(roster.of(name)) for name in roster.classes}
        known = {"classes": list(self.classes), "taught": taught, "off": sorted(roster.disabled)}
        return {**known, "sensitivity": self.performers.sensitivity, "teaches": True}

    def _listed(self) -> str:
        """Give the classes and the settings in a line."""
        known = self._described()
        taught = ", ".join(f"{name} {count}" for name, count in known["taught"].items()) or "nothing"
        off = f"; off: {', '.join(known['off'])}" if known["off"] else ""
        return f"taught: {taught}{off}; sensitivity {known['sensitivity']:g}"

    def _explained(self, notice: Notice | Changed) -> Notice | Changed:
        """Explain to a performer why frames that cannot be used prevent teaching."""
        if isinstance(notice, State) and notice.step is Step.REFUSED:
            return replace(notice, reason=self.performers.refused.get(notice.performer, notice.reason))
        return notice

    def _publish(self, notices: Iterable[Notice | Changed]) -> list[State]:
        """Pass the notices to the sinks, and open changed rosters; give the states."""
        states = []
        for each in notices:
            if isinstance(each, Changed):
                self._file.save(each.roster)
                before = self._teacher.recent(each.number) if each.number else None
                self._opener.open(Change(each.roster, self.performers.settings, each.number, before))
                continue
            states += [each] if isinstance(each, State) else []
            tell(self.sinks, each)
        return states

    def _exchange(self, roster: Roster, index: WindowIndex | None) -> Told:
        """Let the recognisers compare with the opened roster."""
        self.classes = self._places.of(roster)
        ended = self.performers.exchange(index, self.classes) if index else []
        # Without a library no start was published.
        for event in ended if self.answers else ():
            tell(self.sinks, event)
        tell(self.sinks, Classes(tuple(self.classes)))
        self.answers = index is not None
        return []


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
        # Those of a file come as `--library` gives them.
        for name in sorted(taught):
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


#: Seconds between two answers when an example is tried on the last minutes: enough to count what is said.
_TRIED_EVERY = 0.1
#: Frames after which the thread pauses for other threads.
_FRAMES_AT_ONCE = 6
#: Seconds of the pause.
_PAUSE = 0.002
#: Seconds after which a trial ends: on a busy machine five minutes of frames take longer than anybody waits for a word.
_TRIED_FOR = 20.0


class Change(NamedTuple):
    """A roster to open.

    Attributes
    ----------
    roster
        All examples now.
    settings
        The settings of the recognisers.
    number
        The number of an example to check and to try; 0 for none.
    before
        The performer's last minutes before that example, on which it is tried; None where they are not known.
    """

    roster: Roster
    settings: Settings
    number: int = 0
    before: Remembered | None = None


class RosterOpener:
    """Opens the newest roster, and checks all examples that have come since the last one; ends when it is closed.

    Parameters
    ----------
    windows
        Opens rosters.
    teacher
        Takes the checks of examples.
    exchange
        Takes an opened roster; without an index while nothing is taught and nothing else is compared.
    """

    def __init__(
        self, windows: TaughtWindows, teacher: Teacher, exchange: Callable[[Roster, WindowIndex | None], Told]
    ) -> None:
        self._windows, self._teacher, self._exchange = windows, teacher, exchange
        self._changes: queue.SimpleQueue[Change | None] = queue.SimpleQueue()
        #: What is to be done in the caller's thread; each call gives notices.
        self._results: queue.SimpleQueue[Callable[[], Told]] = queue.SimpleQueue()
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._work, name="kinespace teaching", daemon=True)
        self._thread.start()

    def open(self, change: Change) -> None:
        """Open, check and try a change soon."""
        self._changes.put(change)

    def results(self) -> Iterator[Notice | Changed]:
        """Hand over the results since the last call, in order; give the notices on them."""
        while not self._results.empty():
            yield from self._results.get()()

    def close(self) -> None:
        """End; changes that wait are not opened any more."""
        self._ending.set()
        self._changes.put(None)
        self._thread.join()

    def _work(self) -> None:
        while change := self._changes.get():
            changes = [change]
            while not self._changes.empty():
                if newer := self._changes.get():
                    changes.append(newer)
            if self._ending.is_set():
                return
            if not self._opened(changes, changes[-1].roster) and len(changes) > 1:
                # One of them cannot be compared: which one?
                failed = set[int]()
                for each in changes:
                    kept = tuple(example for example in each.roster.examples if example.number not in failed)
                    if not self._opened([each], replace(each.roster, examples=kept)):
                        failed.add(each.number)

    def _opened(self, changes: Sequence[Change], roster: Roster) -> bool:
        """Open a roster and check the examples that came with it; say whether it could be opened."""
        last, new = changes[-1], {each.number for each in changes}
        others = tuple(each for each in roster.examples if each.class_name != NOTHING or each.number not in new)
        try:
            # A new `nothing` is held against the gestures: those that came with it are opened first.
            if len(changes) > 1 and len(others) < len(roster.examples):
                self._windows.index_of(replace(roster, examples=others))
            before = self._windows.courses
            index = self._windows.index_of(roster)
            if index is not None:
                # A first recogniser prepares the windows here; between two frames there is no time for this.
                Recognizer(index, last.settings)
        except (ValueError, MemoryError) as error:
            reason = " ".join(str(error).split())
            if last.number and len(changes) == 1:
                self._results.put(partial(self._teacher.failed, last.number, reason))
            elif len(changes) == 1:
                self._results.put(lambda: [State("", Step.REFUSED, 0.0, reason)])
            return False
        self._results.put(partial(self._exchange, roster, index))
        named = {each.number: each.class_name for each in roster.examples}
        for each in changes:
            if each.number and not self._ending.is_set():
                known = index if each.number in named else None
                is_nothing = named.get(each.number) == NOTHING
                check = (held(before, known) if is_nothing else checked(known, each.number)) if known else None
                tried = self._tried(each, known) if known else Tried()
                self._results.put(partial(self._teacher.checked, each.number, check, tried))
        return True

    def _tried(self, change: Change, index: WindowIndex) -> Tried:
        """Count how often the new class would have been said in the performer's last minutes, or in their first part.

        Neither the end of the program nor another change, which somebody wants to see at once, waits for a count.
        """
        name = next((each.class_name for each in change.roster.examples if each.number == change.number), NOTHING)
        if change.before is None or name == NOTHING:
            return Tried()
        recognizer = Recognizer(index, replace(change.settings, hop=_TRIED_EVERY))
        before, begin = change.before.clip(), change.before.frames[0][0]
        started, done, until = list[float](), list[float](), time.monotonic() + _TRIED_FOR
        for place, (moment, positions) in enumerate(zip(before.times.tolist(), before.positions, strict=True)):
            if place % _FRAMES_AT_ONCE == 0 and (self._ending.wait(_PAUSE) or not self._changes.empty()):
                return Tried()
            if place >= _FRAMES_AT_ONCE and time.monotonic() > until:
                break
            recognition = recognizer.push(Frame("before", moment, positions))
            for event in recognition.events if recognition else ():
                started += [event.time] * (event.kind is EventKind.START and event.label == name)
            if recognition and recognition.done and recognition.done.label == name:
                done.append(recognition.done.start + recognition.done.duration / 2)
        own = [(each.start - begin, each.end - begin) for each in change.before.shown]
        starts, ends = (sum(not any(a <= at <= b for a, b in own) for at in times) for times in (started, done))
        return Tried(starts, ends, moment)


#: The share of a feed's joints, or of HDM05's, that both must have for HDM05's metrics to compare the examples: a hand
#: with twenty bones has neither.
_ENOUGH = 0.5


def open_lessons(
    file: Path,
    library: MotionLibrary | None,
    joints: Sequence[str],
    performers: Callable[[WindowIndex, Sequence[str]], Recognising],
    stillness: float = STILLNESS,
    *,
    either_side: bool = False,
) -> Lessons:
    """Open the taught library for lessons.

    Parameters
    ----------
    file
        A library of taught motions; it may be missing.
    library
        The library that is compared together with the taught motions; None for none.
    joints
        The joints of frames, if known; used without a library.
    performers
        Makes the recognisers from an opened library and the order of its classes.
    stillness
        Movement below which a performer stands still (`stream.teaching.movement`).
    either_side
        Whether taught motions may be done by either side.

    Raises
    ------
    ValueError
        The file is no library, has too few of the library's joints, or another program teaches there.
    OSError
        The file cannot be read, or its folder is missing.
    """
    kept = RosterFile(file)
    with ExitStack() as failing:
        failing.callback(kept.close)
        taught = kept.library
        base = _base(library, taught, joints)
        roster = _roster_of(taught, base) if taught else Roster()
        windows = TaughtWindows(base, with_base=library is not None, either_side=either_side)
        known = taught.skeleton.joints if taught else joints
        index = windows.index_of(roster) or base or WindowIndex.of(_any_motion(known))
        teacher = Teacher(index.library.skeleton, roster, windows.base_classes, stillness)
        order = ClassPlaces(windows.base_classes).of(roster)
        lessons = Lessons(performers(index, order or index.classes), teacher, windows, kept)
        failing.pop_all()
    return lessons


def open_taught(taught: MotionLibrary, without: Collection[str] = (), beside: WindowIndex | None = None) -> WindowIndex:
    """Open taught motions alone, as a file of them is opened without a library; or beside other windows.

    Parameters
    ----------
    taught
        The examples.
    without
        Persons whose motions in the built-in library teach no metric: for measuring, with motions of theirs.
    beside
        What is known, too; its metrics compare.

    Raises
    ------
    ValueError
        No motion is long enough for a window.
    """
    base = beside or _base(None, taught, (), {*without} & {*MotionLibrary.builtin().actors})
    index = TaughtWindows(base, with_base=beside is not None).index_of(_roster_of(taught, base))
    if index is None:
        raise ValueError("taught: expected a motion that is long enough for a window, got none")
    return index


def _roster_of(taught: MotionLibrary, base: WindowIndex | None) -> Roster:
    """Take a library's motions as examples, by the joints of the windows that they are compared with."""
    if base:
        skeleton = base.library.skeleton
        shared = taught.restricted_to(skeleton.joints)
        taught = MotionLibrary(skeleton, tuple(motion.as_of(skeleton) for motion in shared.motions))
    return Roster.of_library(taught)


def _base(
    library: MotionLibrary | None, taught: MotionLibrary | None, joints: Sequence[str], without: Collection[str] = ()
) -> WindowIndex | None:
    """Open the windows whose metrics compare the examples, by the joints taught or, else, known.

    Without a library the built-in one's metrics compare, by the joints that both have, without some persons. None where
    these are few, or where many persons were taught by other joints: then the examples learn their own metrics.
    """
    joints = taught.skeleton.joints if taught else joints
    if library:
        return opened(library.restricted_to(joints) if taught else library)
    builtin = MotionLibrary.builtin()
    wanted = builtin.skeleton.joints
    joints = joints or wanted
    left_out = [name for name in joints if name not in wanted]
    shared = len(joints) - len(left_out)
    few = shared < max(MIN_JOINTS, _ENOUGH * min(len(joints), len(wanted)))
    if few or (left_out and taught and teaches_itself(taught)):
        return None
    if left_out:
        note(f"taught motions are compared by {shared} of {len(joints)} joints, without {', '.join(left_out)}")
    # One motion is no teacher of its own: as in a library's file, the built-in persons' metrics compare, by all axes.
    one = replace(builtin, motions=builtin.motions[:1], learned={}).restricted_to(joints)
    return WindowIndex.of(one, builtin.without(actors=without).restricted_to(joints)) if without else opened(one)


def _any_motion(joints: Sequence[str]) -> MotionLibrary:
    """Make a library of joints without taught motions: recognisers need a library, but are not asked with this one."""
    generator = np.random.default_rng(0)
    positions = np.cumsum(generator.normal(0, 0.05, (60, len(joints), 3)), axis=0)
    return MotionLibrary.of_clips([Clip(Skeleton(tuple(joints)), positions, 30.0, class_name=NOTHING)])
