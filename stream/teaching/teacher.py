"""The teacher: the lesson that goes on, the examples, and their undo.

There is no socket, clock or thread in here. Frames and commands come in with the time on our clock. Notices come out;
`Changed` asks the caller to open the roster, to exchange the recognisers' library, to check the example, and to report
by `checked`. The caller may take any time for it: lessons go on meanwhile.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import replace

from kinespace.library.clip import Clip
from kinespace.library.motion_library import NOTHING
from kinespace.library.skeleton import Skeleton
from kinespace.library.teaching.examples import MAX_EXAMPLES, Check, Example, Roster
from kinespace.library.teaching.movement import MIN_SECONDS, STILLNESS, Stretch, moved_at_all
from kinespace.stream.frame import Frame
from kinespace.stream.recognizer.recognizer import MAX_PAUSE
from kinespace.stream.teaching import commands
from kinespace.stream.teaching.commands import UNDONE, Changed, Command, Notice, State, Step, Taught, Tried
from kinespace.stream.teaching.lesson import AT_WILL, HeldLesson, Lesson, Recorded
from kinespace.stream.teaching.memory import REMEMBERED, Memory, NamedMotion, NamedMotions, Remembered

#: Seconds without a frame after which a performer counts as absent, as long as the recognisers keep a performer.
_GONE = 5.0
#: Seconds between two ticks after which we count as stopped: frames of that time wait to be read.
_STOPPED = 0.5
#: Seconds by which a recording must be longer than its kept part to count as trimmed.
_TRIMMED = 0.15
#: What is said after an example, until there is one of `nothing`.
OFFER = f"next: move as you will for {AT_WILL:g} s, without your gestures (/motion/teach <performer> nothing, or key m)"


class Teacher:
    """Records examples and keeps the roster.

    Parameters
    ----------
    skeleton
        The skeleton of the frames.
    roster
        The examples of earlier sessions.
    base_classes
        Classes that are known without examples.
    stillness
        Movement below which a performer stands still (`library.teaching.movement`).

    Attributes
    ----------
    roster
        All examples now.
    lesson
        The lesson that goes on; None while there is none.
    skeleton
        As given.
    named
        The motions that performers were said to do.
    """

    def __init__(
        self, skeleton: Skeleton, roster: Roster, base_classes: Collection[str] = (), stillness: float = STILLNESS
    ) -> None:
        self.roster = roster
        self.lesson: Lesson | HeldLesson | None = None
        self.skeleton, self._base, self._stillness = skeleton, tuple(base_classes), stillness
        self._memories: dict[str, Memory] = {}
        self.named = NamedMotions()
        self._before: list[Roster] = []
        #: The performers of the examples shown here, and when, on their clocks.
        self._shown: dict[int, tuple[str, Stretch]] = {}
        self._number = roster.next_number
        #: The last tick, and the first one after we were stopped.
        self._ticked = self._woke = -math.inf

    def push(self, frame: Frame, now: float) -> list[Notice | Changed]:
        """Take in a frame, positions in the order of the skeleton."""
        memory = self._memories.get(frame.performer)
        if memory is None:
            self._forget_absent(now)
            memory = self._memories[frame.performer] = Memory(self.skeleton)
        movement = memory.push(frame.time, frame.positions, now)
        lesson = self.lesson
        if lesson is None or lesson.performer != frame.performer:
            return []
        return self._went(lesson, lesson.push(frame.time, movement))

    def tick(self, now: float) -> list[Notice | Changed]:
        """Do the work that is due by the clock; call it some times a second."""
        if now - self._ticked > _STOPPED:
            self._woke = now
        self._ticked = now
        for performer, memory in self._memories.items():
            if motion := self.named.confirmed(performer, memory.newest):
                return self._take_judged(performer, motion)
        lesson = self.lesson
        if lesson is None:
            return []
        silent = self._silent(lesson.performer, now)
        if silent > _GONE:
            self.lesson = None
            return [State(lesson.performer, Step.REFUSED, 0.0, "the performer has left")]
        # A sender that pauses sends no stillness, which would end the recording.
        if lesson.step is Step.RECORDING and silent > MAX_PAUSE:
            return self._went(lesson, lesson.stop(by_hand=False))
        state = lesson.tick(now)
        return [state] if state else []

    def command(  # noqa: C901, PLR0911, PLR0912 - a line each
        self, command: Command, now: float
    ) -> list[Notice | Changed]:
        """Carry out a command about lessons and examples; a refusal is a notice, never an exception."""
        match command:
            case commands.Teach() | commands.Last():
                return self._begin(command, now)
            case commands.Hold(_, _, on):
                return self._begin(command, now) if on else self._released()
            case commands.Right(performer) | commands.Wrong(performer):
                return self._judged(performer, now, is_right=isinstance(command, commands.Right))
            case commands.Stop():
                return self._stopped()
            case commands.Cancel():
                return self._cancelled()
            case commands.Undo():
                return self._undo()
            case commands.Forget(""):
                return self._change(Roster((), self.roster.disabled), "all forgotten")
            case commands.Rename(name, _) | commands.Forget(name) if name not in self.roster.classes:
                return [_unknown(name)]
            case commands.Rename(_, new) if new in (*self._base, *self.roster.classes):
                return [_refused("", f"{new}: there is such a class already")]
            case commands.Rename(old, new):
                return self._change(self.roster.renamed(old, new), f"{old} is {new}")
            case commands.Forget(name):
                return self._change(self.roster.without_class(name), f"{name} forgotten")
            case commands.Enable(name, _) if name not in (*self._base, *self.roster.classes):
                return [_unknown(name)]
            case commands.Enable(name, on):
                return self._change(self.roster.enabled(name, on=on), f"{name} {'on' if on else 'off'}")
            case _:
                return []

    def checked(self, number: int, check: Check | None, tried: Tried) -> list[Notice | Changed]:
        """Report the check of an example that was opened with the library, or was undone before.

        Where there is no example of `nothing` yet, the next lesson is offered.
        """
        performer, _ = self._shown.get(number, ("", None))
        example = next((each for each in self.roster.examples if each.number == number), None)
        if example is None:
            return [_refused(performer, UNDONE)]
        words = check.words if check and example.class_name != NOTHING else "good"
        taught = Taught(example.class_name, len(self.roster.of(example.class_name)), example.seconds, words, tried)
        offer = "" if NOTHING in self.roster.classes else f"; {OFFER}"
        return [taught, State(performer, Step.DONE, example.seconds, words + offer)]

    def failed(self, number: int, reason: str) -> list[Notice | Changed]:
        """Undo an example that cannot be compared."""
        performer, _ = self._shown.get(number, ("", None))
        kept = tuple(each for each in self.roster.examples if each.number != number)
        self.roster = replace(self.roster, examples=kept)
        return [State(performer, Step.REFUSED, 0.0, reason), Changed(self.roster)]

    def recent(self, number: int) -> Remembered | None:
        """Give the performer's last minutes before an example that is being checked; None when they are not known."""
        performer, whole = self._shown.get(number, ("", Stretch(0.0, 0.0)))
        memory = self._memories.get(performer)
        gathered = memory.gathered(whole.start - REMEMBERED, whole.start) if memory else None
        names = {each.number: each.class_name for each in self.roster.examples}
        same = [of for each, of in self._shown.items() if names.get(each) == names.get(number) and of[0] == performer]
        return gathered and gathered._replace(shown=[span for _, span in same])

    def _begin(self, asked: commands.Teach | commands.Last | commands.Hold, now: float) -> list[Notice | Changed]:
        performer = self._present(asked.performer, now)
        if performer is None:
            return [_refused(asked.performer, "no such performer is there")]
        if isinstance(asked, commands.Last):
            end = self._memories[performer].newest - asked.ago
            return self._take(performer, asked.class_name, Stretch(end - asked.seconds, end))
        if self.lesson:
            return [_refused(performer, f"{self.lesson.performer} is being taught {self.lesson.class_name}")]
        if isinstance(asked, commands.Hold):
            self.lesson = HeldLesson(asked, performer, self._memories[performer].newest)
            return [State(performer, Step.RECORDING)]
        self.lesson = Lesson(asked, performer, now, self._stillness)
        return self.tick(now)

    def _take(self, performer: str, class_name: str, whole: Stretch, *, trims: bool = True) -> list[Notice | Changed]:
        """Take the movement in a remembered span as an example, or without trimming all of the span."""
        clip = self._memories[performer].between(*whole)
        if clip is None or clip.gaps:
            return [_refused(performer, f"{whole.duration:g} s have not been seen")]
        return self._add(performer, class_name, clip, whole, None if trims else Stretch(0.0, clip.duration))

    def _judged(self, asked: str, now: float, *, is_right: bool) -> list[Notice | Changed]:
        """Take the last named motion as an example of its class, or of `nothing`; once, until that is undone."""
        performer = self.named.last(asked, self._there(now))
        motion = self.named.meant(performer, self._memories[performer].newest) if performer else None
        if performer is None or motion is None:
            return [_refused(asked, "no motion was named")]
        if motion.number in {each.number for each in self.roster.examples}:
            return [_refused(performer, f"{motion.class_name} was judged already: undo it first")]
        motion.is_right = is_right
        if is_right and motion.ended is None:
            return [State(performer, Step.CHECKING, 0.0, f"{motion.class_name}: taken when it ends")]
        return self._take_judged(performer, motion)

    def _take_judged(self, performer: str, motion: NamedMotion) -> list[Notice | Changed]:
        """Take a motion that was judged as an example of its class, or with what surrounds it of `nothing`."""
        memory, number = self._memories[performer], self._number
        if motion.is_right:
            notices = self._take(performer, motion.class_name, motion.span(memory.newest))
        else:
            around = memory.unbroken(motion.around(memory.newest), motion.started)
            notices = self._take(performer, NOTHING, around, trims=False)
        motion.is_right, motion.number = False, number if self._number > number else 0
        return notices

    def _went(self, lesson: Lesson | HeldLesson, step: State | Recorded | None) -> list[Notice | Changed]:
        """Give the notices of a lesson's step."""
        if step is None:
            return []
        if isinstance(step, State):
            if step.step is Step.REFUSED:
                self.lesson = None
            return [step]
        clip = self._memories[lesson.performer].between(*step.whole)
        if not lesson.left:
            self.lesson = None
        if clip is None or clip.gaps:
            self.lesson = None
            return [_refused(lesson.performer, "frames are missing in the recording")]
        begin = max(step.kept.start - step.whole.start, 0.0)
        kept = Stretch(begin, min(step.kept.end - step.whole.start, clip.duration))
        notices = self._add(lesson.performer, lesson.class_name, clip, step.whole, kept)
        return notices if self.lesson is None else [*notices, State(lesson.performer, Step.WAITING)]

    def _add(
        self, performer: str, class_name: str, clip: Clip, whole: Stretch, kept: Stretch | None = None
    ) -> list[Notice | Changed]:
        """Add an example; all its movement is kept where nobody says which part."""
        kept = kept or moved_at_all(clip)
        if kept is None:
            whose = f"{clip.name}: " if clip.name else ""
            return [_refused(performer, f"{whose}expected {MIN_SECONDS:g} s or more of movement")]
        if len(self.roster.examples) >= MAX_EXAMPLES:
            return [_refused(performer, f"{MAX_EXAMPLES} examples are there already")]
        number, self._number = self._number, self._number + 1
        recording = replace(clip, actor=performer)
        example = Example(number, class_name, recording, kept.start, kept.end)
        # What lies before the memory is never tried again.
        oldest = whole.start - REMEMBERED
        self._shown = {each: of for each, of in self._shown.items() if of[0] != performer or of[1].end > oldest}
        self._shown[number] = performer, whole
        cut = clip.duration - example.seconds
        trimming = f"{kept.start:.2f} to {kept.end:.2f} of {clip.duration:.2f} s kept" if cut > _TRIMMED else ""
        self._remember()
        self.roster = self.roster.with_example(example)
        return [Changed(self.roster, number), State(performer, Step.CHECKING, example.seconds, trimming)]

    def _stopped(self) -> list[Notice | Changed]:
        if self.lesson is None:
            return [_refused("", "nobody is being taught")]
        lesson = self.lesson
        lesson.left = min(lesson.left, 1)
        return self._went(lesson, lesson.stop(by_hand=True))

    def _released(self) -> list[Notice | Changed]:
        """End a recording that was held; a lesson that was not is let be."""
        return self._stopped() if isinstance(self.lesson, HeldLesson) else [_refused("", "nothing was held")]

    def _cancelled(self) -> list[Notice | Changed]:
        if self.lesson is None:
            return [_refused("", "nobody is being taught")]
        performer, self.lesson = self.lesson.performer, None
        return [State(performer, Step.DONE, 0.0, "cancelled")]

    def _change(self, roster: Roster, change: str) -> list[Notice | Changed]:
        self._remember()
        self.roster = roster
        return [Changed(roster), State("", Step.DONE, 0.0, change)]

    def _remember(self) -> None:
        self._before.append(self.roster)

    def _undo(self) -> list[Notice | Changed]:
        if not self._before:
            return [_refused("", "nothing to undo")]
        self.roster = self._before.pop()
        examples, classes = len(self.roster.examples), len(self.roster.classes)
        now = f"{examples} example{'s' if examples != 1 else ''} of {classes} class{'es' if classes != 1 else ''}"
        return [Changed(self.roster), State("", Step.DONE, 0.0, now)]

    def _present(self, name: str, now: float) -> str | None:
        """Find a performer who is present; without a name the performer whose frame came last."""
        there = self._there(now)
        if name:
            return name if name in there else None
        return max(there, key=lambda each: there[each], default=None)

    def _there(self, now: float) -> dict[str, float]:
        """Give the performers who are present, and when their last frames arrived."""
        return {each: memory.arrived for each, memory in self._memories.items() if self._silent(each, now) <= _GONE}

    def _silent(self, name: str, now: float) -> float:
        """Say for how many seconds a performer has sent nothing; the time for which we were stopped does not count."""
        return now - max(self._memories[name].arrived, self._woke)

    def _forget_absent(self, now: float) -> None:
        for name in [each for each, memory in self._memories.items() if now - memory.arrived > 60.0]:
            del self._memories[name]
            self.named.forget(name)


def _refused(performer: str, reason: str) -> State:
    return State(performer, Step.REFUSED, 0.0, reason)


def _unknown(name: str) -> State:
    why = "built-in classes cannot be changed" if name == NOTHING else "not a taught class"
    return _refused("", f"{name[: commands.MAX_NAME]!a}: {why}")
