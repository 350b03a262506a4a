"""The teacher: the lesson that goes on, the last minutes of each performer, the examples, and their undo.

A lesson: countdown, waiting for movement, recording, stopped by stillness, trimmed; or recorded while held. A lesson of
`nothing` waits for no movement and for no stillness: the performer moves at will for some seconds.

There is no socket, clock or thread in here. Frames and commands come in with the time on our clock. Notices come out;
`Changed` asks the caller to open the roster, to exchange the recognisers' library, to check the example, and to report
by `checked`. The caller may take any time for it: lessons go on meanwhile.
"""

import math
from collections import deque
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinespace.library import NOTHING, Clip, Skeleton
from kinespace.library.recordings.formats.measures import MAX_GAP, evened
from kinespace.stream.frame import Frame
from kinespace.stream.present import MAX_PAUSE
from kinespace.stream.recognition import Event, EventKind
from kinespace.stream.teaching import commands
from kinespace.stream.teaching import movement as moving
from kinespace.stream.teaching.commands import UNDONE, Changed, Command, State, Step, Taught, Told, Tried
from kinespace.stream.teaching.examples import MAX_EXAMPLES, Check, Example, Roster
from kinespace.stream.teaching.movement import MIN_SECONDS, STILLNESS, Movement, MovementMeter, Stretch, StretchFinder

#: Seconds of a recording, and of standing still before it, at most.
MAX_RECORDING, MAX_WAITING = 15.0, 15.0
#: Seconds of movement at will that a lesson of `nothing` records.
AT_WILL = 20.0
#: Seconds at the end of a countdown that show how much the performer trembles while standing.
_STANDING = 1.0
#: Seconds between two notices of how much a performer moves who is waited for, and after which a way out is said.
_SAID_EVERY, _WAY_OUT = 1.0, 5.0
#: Frames a second that show movement, also where they come a little unevenly.
_LEAST_RATE = 8
#: Frames a second below which a camera is said to be slow; in a countdown a few frames may be late.
_GOOD_RATE = 10
#: Seconds that rounding may add to a countdown, and by which it may move a frame out of a span.
_TIE = 1e-6
#: Seconds of the recording that are kept before the movement.
BEFORE = 0.3


class Recorded(NamedTuple):
    """A lesson's recording on the sender's clock: its whole span, and the span that is kept after trimming."""

    whole: Stretch
    kept: Stretch


class Lesson:
    """One performer shows examples of one class.

    Parameters
    ----------
    asked
        The command with the class to record.
    performer
        The performer's name.
    now
        Seconds on our clock.
    stillness
        Movement below which the performer stands still (`stream.teaching.movement`); a performer who trembles less
        in the countdown begins with less.

    Attributes
    ----------
    step
        The lesson's state.
    left
        Examples that are still to be recorded.
    """

    def __init__(self, asked: commands.Teach, performer: str, now: float, stillness: float = STILLNESS) -> None:
        self.class_name, self.performer = asked.class_name, performer
        self.left = asked.repetitions
        self._at_will = asked.class_name == NOTHING
        self._longest = AT_WILL if self._at_will else MAX_RECORDING
        self.step = Step.COUNTDOWN
        self._go = now + asked.countdown
        self._counted = math.inf
        self._stillness, self._finder = stillness, StretchFinder(stillness)
        #: The movement at the end of the countdown; the most since the last notice, and when that was.
        self._standing: deque[tuple[float, Movement]] = deque()
        self._most, self._said, self._came = -1.0, math.nan, 0
        self._armed = self._began = self._newest = math.nan

    def tick(self, now: float) -> State | None:
        """Count down; give the notices."""
        if self.step is not Step.COUNTDOWN:
            return None
        if now >= self._go:
            self.step = Step.WAITING
            return State(self.performer, Step.WAITING)
        seconds = max(math.ceil(self._go - now - _TIE), 1)
        if seconds == self._counted:
            return None
        self._counted = seconds
        return State(self.performer, Step.COUNTDOWN, float(seconds), self._too_slow() if seconds == 1 else "")

    def _too_slow(self) -> str:
        """Say before the lesson that frames come too rarely to show much of a movement."""
        rate = (self._came - 1) / (self._newest - self._said) if self._came > 1 else math.inf
        return f"{rate:.0f} frames a second, {_GOOD_RATE} are better: choose --size lite" if rate < _GOOD_RATE else ""

    def push(self, time: float, movement: Movement | None) -> State | Recorded | None:
        """Take in a frame's time on the sender's clock, and the movement if it was measured.

        Returns
        -------
        A change of state; the recording, when it ended; a refusal; else None.
        """
        self._newest = time
        if self.step is Step.COUNTDOWN:
            self._said, self._came = time if self._came == 0 else self._said, self._came + 1
            # A performer who is already moving is recorded from now on.
            if movement is not None:
                self._finder.push(time, movement)
                self._standing.append((time, movement))
                while time - self._standing[0][0] > _STANDING:
                    self._standing.popleft()
            return None
        if math.isnan(self._armed):
            self._arm(time)
        found = None if movement is None or self._at_will else self._finder.push(time, movement)
        if self.step is Step.WAITING:
            return self._waited(time, max(movement or (-1.0,)))
        if found:
            return self._recorded(found, by_hand=False)
        return self.stop(by_hand=True) if time - self._began >= self._longest else None

    def _arm(self, time: float) -> None:
        self._armed = self._said = time
        self._most, self._came = -1.0, 0
        still = moving.stillness_of(self._standing, self._stillness)
        if still < self._stillness:
            self._finder = StretchFinder(still)

    def _waited(self, time: float, movement: float) -> State | None:
        if self._at_will:
            self.step, self._began = Step.RECORDING, self._armed
            return State(self.performer, Step.RECORDING, 0.0, f"move as you will for {AT_WILL:g} s")
        if self._finder.began is not None:
            self.step = Step.RECORDING
            self._began = max(self._finder.began, self._armed)
            return State(self.performer, Step.RECORDING)
        if time - self._armed >= MAX_WAITING:
            return State(self.performer, Step.REFUSED, MAX_WAITING, f"stood still for {MAX_WAITING:g} s")
        self._most, self._came = max(self._most, movement), self._came + 1
        if time - self._said < _SAID_EVERY - _TIE:
            return None
        share = self._most / self._finder.needed
        reason = f"movement {share:.0%} of what is needed" if share < 1 else "enough movement: keep moving"
        if self._most < 0:
            rate = self._came / (time - self._said)
            reason = f"{rate:.0f} frames a second show no movement: send {_LEAST_RATE} or more"
        if time - self._armed >= _WAY_OUT - _TIE:
            reason += "; or show it and ask for /motion/teach/last"
        self._most, self._said, self._came = -1.0, time, 0
        return State(self.performer, Step.WAITING, 0.0, reason)

    def stop(self, *, by_hand: bool) -> State | Recorded:
        """End the recording by a command, because it has its maximal length, or because no frames come for now."""
        if self.step is not Step.RECORDING:
            return State(self.performer, Step.REFUSED, 0.0, "nothing was recorded")
        found = None if self._at_will else self._finder.end()
        return self._recorded(found or Stretch(self._began, self._newest), by_hand=by_hand)

    def _recorded(self, found: Stretch, *, by_hand: bool) -> State | Recorded:
        begin = max(found.start, self._armed)
        kept = Stretch(begin, min(found.end, self._newest, begin + self._longest))
        whole = Stretch(begin - BEFORE, min(kept.end + moving.ENDS_AFTER, self._newest))
        self._armed = math.nan
        self._finder.clear()
        self.step = Step.WAITING
        if kept.duration < MIN_SECONDS:
            reason = f"expected {MIN_SECONDS:g} s or more of movement"
            # A performer who takes up their place moves for a moment: this is no example.
            # A sender's clock that begins again gives a time below 0.
            return State(self.performer, Step.REFUSED if by_hand else Step.WAITING, max(kept.duration, 0.0), reason)
        self.left -= 1
        return Recorded(whole, kept)


class HeldLesson(Lesson):
    """One performer is recorded for as long as somebody holds a key, whatever moves.

    Parameters
    ----------
    asked
        The command with the class to record.
    performer
        The performer's name.
    newest
        The time of the performer's last frame, seconds on the sender's clock.
    """

    def __init__(self, asked: commands.Hold, performer: str, newest: float) -> None:
        super().__init__(commands.Teach(performer, asked.class_name), performer, 0.0)
        self.step, self._at_will, self._longest = Step.RECORDING, True, MAX_RECORDING
        self._armed = self._began = self._newest = newest

    def _recorded(self, found: Stretch, *, by_hand: bool) -> State | Recorded:  # noqa: ARG002 - as a lesson
        if not found.duration >= MIN_SECONDS:
            # A sender's clock that begins again gives a time below 0.
            seconds, reason = max(found.duration, 0.0), f"expected it to be held for {MIN_SECONDS:g} s or more"
            return State(self.performer, Step.REFUSED, seconds, reason)
        self.left = 0
        return Recorded(found, found)


#: Seconds that are remembered, and frames per second.
REMEMBERED = 300.0
FRAME_RATE = 30.0
#: Frames per second below which an example has too few for a window: straight lines give it more.
_TOO_FEW = 9.5
#: Share of a frame's time by which a frame may come early and still be kept.
_EARLY = 0.2
#: Seconds by which a frame may be older than the one before; an older one is of a sender that began again.
_BACKWARDS = 1.0


class Remembered(NamedTuple):
    """Some remembered frames; quick to gather, and made a clip where nobody waits.

    Attributes
    ----------
    frames
        Times in seconds on the sender's clock, and positions (joints, 3), metres.
    skeleton
        The skeleton of the positions.
    shown
        When examples of the class that is to be tried on them were shown, on the same clock.
    """

    frames: Sequence[tuple[float, NDArray[np.float32]]]
    skeleton: Skeleton
    shown: Sequence[Stretch] = ()

    def clip(self) -> Clip:
        """Give the frames at even times."""
        times = np.array([time for time, _ in self.frames])
        positions = np.array([positions for _, positions in self.frames], dtype=np.float64)
        often = (len(times) - 1) / (times[-1] - times[0])
        # A slower feed keeps its rate; a faster one was thinned unevenly and is resampled at even times.
        rate = None if _TOO_FEW <= often <= 0.9 * FRAME_RATE else FRAME_RATE
        return evened(times, positions, rate=rate).clip(self.skeleton)


class RecentFrames:
    """Remembers a performer's frames, thinned, and measures their movement.

    Parameters
    ----------
    skeleton
        The skeleton of the positions.

    Attributes
    ----------
    arrived
        When the last frame arrived, seconds on our clock.
    newest
        The last frame's own time, seconds on the sender's.
    """

    def __init__(self, skeleton: Skeleton) -> None:
        self._skeleton = skeleton
        self._clear()
        self.arrived = self.newest = -np.inf

    def _clear(self) -> None:
        self._frames: deque[tuple[float, NDArray[np.float32]]] = deque(maxlen=round(REMEMBERED * FRAME_RATE))
        self._due = -np.inf
        self._meter = MovementMeter(self._skeleton)

    def push(self, time: float, positions: NDArray[np.floating], now: float) -> Movement | None:
        """Take in a frame; give the movement when it is measured, else None (`stream.teaching.movement`)."""
        self.arrived = now
        if time <= self.newest:
            if self.newest - time < _BACKWARDS:
                return None
            self._clear()
        self.newest = time
        if time < self._due - _EARLY / FRAME_RATE:
            return None
        # After a pause the next frame is due from now on.
        self._due = (max(self._due, time) if self._due >= time - 1 / FRAME_RATE else time) + 1 / FRAME_RATE
        self._frames.append((time, positions.astype(np.float32)))
        while self._frames[0][0] < time - REMEMBERED:
            self._frames.popleft()
        return self._meter.push(time, positions)

    def between(self, begin: float, end: float) -> Clip | None:
        """Give the frames between two moments on the sender's clock; None for less than three frames."""
        return gathered.clip() if (gathered := self.gathered(begin, end)) else None

    def unbroken(self, span: Stretch, moment: float) -> Stretch:
        """Narrow a span to the part around a moment in which no frame is missing for long."""
        for before, after in pairwise(time for time, _ in self._frames if span.start <= time <= span.end):
            if after - before > MAX_GAP and before >= moment:
                return Stretch(span.start, before)
            if after - before > MAX_GAP:
                span = Stretch(after, span.end)
        return span

    def gathered(self, begin: float, end: float) -> Remembered | None:
        """Gather what `between` makes a clip of, which takes its time."""
        frames = [each for each in self._frames if begin - _TIE <= each[0] <= end + _TIE]
        return Remembered(frames, self._skeleton) if len(frames) > 2 else None


#: Seconds from a motion's first movement to its start event, at most: what lies before is another motion.
_BEFORE = 0.8
#: Seconds that a person needs to see a start event: what is said sooner is said about the motion before.
_REACTION = 0.4
#: Seconds before and after a motion that was named wrongly, which must not be named, either.
_AROUND = 1.5


@dataclass(slots=True)
class NamedMotion:
    """A motion that was named.

    Attributes
    ----------
    class_name
        Its class.
    started, ended
        The times of its events, seconds on the sender's clock; inf while it goes on.
    after, until
        The end of the motion before, and the beginning of the next one.
    number
        The number of the example that it became; 0 for none.
    is_right
        Whether it was right, while it is to be taken when it has ended.
    """

    class_name: str
    started: float
    ended: float = math.inf
    after: float = -math.inf
    until: float = math.inf
    number: int = 0
    is_right: bool = False

    def span(self, newest: float) -> Stretch:
        """Give the time in which it was performed, `MAX_LAST` seconds at most; `newest` is the time of the last frame.

        A motion is named when a part of it was seen, so it began before. Stillness in the span is still to be trimmed.
        """
        end = self.ended if self.ended < math.inf else newest
        return Stretch(max(self.started - _BEFORE, self.after, end - commands.MAX_LAST), end)

    def around(self, newest: float) -> Stretch:
        """Give the time of a motion that nobody did, as far as it was seen, and what surrounds it; as `span`."""
        end = min(newest, self.until, self.ended + _AROUND)
        return Stretch(max(self.started - _AROUND, self.after, end - commands.MAX_LAST), end)


class NamedMotions:
    """Keeps the last two named motions of each performer."""

    def __init__(self) -> None:
        self._motions: dict[str, list[NamedMotion]] = {}

    def push(self, event: Event) -> None:
        """Take in the start or the end of a motion."""
        # The performer whose motion was named last comes last.
        motions = self._motions.pop(event.performer, [])
        self._motions[event.performer] = motions
        if event.kind is EventKind.START:
            begun = NamedMotion(event.label, event.time)
            for before in motions[-1:]:
                over = before.ended < math.inf
                before.until = max(event.time - _BEFORE, before.ended if over else before.started)
                begun.after = before.ended if over else -math.inf
            # A sender's clock that begins again knows no motion before.
            self._motions[event.performer] = [*motions[-1:], begun]
        elif motions and motions[-1].class_name == event.label:
            motions[-1].ended = event.time

    def last(self, performer: str, present: Collection[str]) -> str | None:
        """Give the performer who is meant: without a name the one, of those present, whose motion was named last."""
        if performer:
            return performer if performer in present else None
        return next((name for name in reversed(self._motions) if name in present), None)

    def meant(self, performer: str, newest: float) -> NamedMotion | None:
        """Give the motion of a performer that a person speaks of now; None where none was named."""
        motions = self._motions.get(performer, [])
        if len(motions) > 1 and newest - motions[-1].started < _REACTION:
            return motions[-2]
        return motions[-1] if motions else None

    def confirmed(self, performer: str, newest: float) -> NamedMotion | None:
        """Give a motion that was right and is over, or has gone on for as long as an example may last."""
        right = (each for each in self._motions.get(performer, ()) if each.is_right)
        over = (each for each in right if each.ended < math.inf or newest - each.started >= commands.MAX_LAST)
        return next(over, None)

    def forget(self, performer: str) -> None:
        """Forget a performer."""
        self._motions.pop(performer, None)


#: Seconds without a frame after which a performer counts as absent, as long as the recognisers keep a performer.
_GONE = 5.0
#: Seconds between two ticks after which we count as stopped: frames of that time wait to be read.
_STOPPED = 0.5
#: Performers who are named to somebody who asks for another.
_TOLD = 3
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
        Movement below which a performer stands still (`stream.teaching.movement`).

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
        self.lesson: Lesson | None = None
        self.skeleton, self._base, self._stillness = skeleton, tuple(base_classes), stillness
        self._recent: dict[str, RecentFrames] = {}
        self.named = NamedMotions()
        #: The rosters before each change, and what it changed.
        self._before: list[tuple[Roster, str]] = []
        #: The performers of the examples shown here, and when, on their clocks.
        self._shown: dict[int, tuple[str, Stretch]] = {}
        self._number = roster.next_number
        #: The numbers of examples of what was named wrongly.
        self._wrong = set[int]()
        #: The last tick, and the first one after we were stopped.
        self._ticked = self._woke = -math.inf

    def push(self, frame: Frame, now: float) -> Told:
        """Take in a frame, positions in the order of the skeleton."""
        recent = self._recent.get(frame.performer)
        if recent is None:
            self._forget_absent(now)
            recent = self._recent[frame.performer] = RecentFrames(self.skeleton)
        before, movement = recent.newest, recent.push(frame.time, frame.positions, now)
        if recent.newest < before:
            # The sender has begun again: what was named or shown before was at times of another clock.
            self.named.forget(frame.performer)
            shown, long_ago = self._shown.items(), Stretch(-math.inf, -math.inf)
            self._shown = {each: (of[0], long_ago) if of[0] == frame.performer else of for each, of in shown}
        lesson = self.lesson
        if lesson is None or lesson.performer != frame.performer:
            return []
        return self._went(lesson, lesson.push(frame.time, movement))

    def tick(self, now: float) -> Told:
        """Do the work that is due by the clock; call it some times a second."""
        if now - self._ticked > _STOPPED:
            self._woke = now
        self._ticked = now
        for performer, recent in self._recent.items():
            if motion := self.named.confirmed(performer, recent.newest):
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

    def command(self, command: Command, now: float) -> Told:  # noqa: C901, PLR0911, PLR0912 - a line each
        """Carry out a command about lessons and examples; a refusal is a notice, never an exception."""
        match command:
            case commands.Hold(on=False) if not isinstance(self.lesson, HeldLesson):
                return [_refused("", "nothing was held")]
            case commands.Stop() | commands.Cancel() | commands.Hold(on=False):
                return self._ended(cancelled=isinstance(command, commands.Cancel))
            case commands.Teach() | commands.Last() | commands.Hold():
                return self._begin(command, now)
            case commands.Right(performer) | commands.Wrong(performer):
                return self._judged(performer, now, is_right=isinstance(command, commands.Right))
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

    def checked(self, number: int, check: Check | None, tried: Tried) -> Told:
        """Report the check of an example that was opened with the library, or was undone before.

        Where there is no example of `nothing` yet, the next lesson is offered.
        """
        performer, _ = self._shown.get(number, ("", None))
        example = next((each for each in self.roster.examples if each.number == number), None)
        if example is None:
            return [_refused(performer, UNDONE)]
        # What was named wrongly is like a gesture.
        words = check.words if check and number not in self._wrong else "good"
        taught = Taught(example.class_name, len(self.roster.of(example.class_name)), example.seconds, words, tried)
        offer = "" if NOTHING in self.roster.classes else f"; {OFFER}"
        return [taught, State(performer, Step.DONE, example.seconds, words + offer)]

    def failed(self, number: int, reason: str) -> Told:
        """Undo an example that cannot be compared."""
        performer, _ = self._shown.get(number, ("", None))
        kept = tuple(each for each in self.roster.examples if each.number != number)
        self.roster = replace(self.roster, examples=kept)
        return [State(performer, Step.REFUSED, 0.0, reason), Changed(self.roster)]

    def recent(self, number: int) -> Remembered | None:
        """Give the performer's last minutes before an example that is being checked; None when they are not known."""
        performer, whole = self._shown.get(number, ("", Stretch(0.0, 0.0)))
        recent = self._recent.get(performer)
        gathered = recent.gathered(whole.start - REMEMBERED, whole.start) if recent else None
        names = {each.number: each.class_name for each in self.roster.examples}
        same = [of for each, of in self._shown.items() if names.get(each) == names.get(number) and of[0] == performer]
        return gathered and gathered._replace(shown=[span for _, span in same])

    def _begin(self, asked: commands.Teach | commands.Last | commands.Hold, now: float) -> Told:
        performer = self._present(asked.performer, now)
        if performer is None:
            there = ", ".join([*self._there(now)][:_TOLD])
            why = f"no such performer is there, but {there}" if there else "nobody is there: no frames come"
            return [_refused(asked.performer, why)]
        if isinstance(asked, commands.Last):
            end = self._recent[performer].newest - asked.ago
            return self._take(performer, asked.class_name, Stretch(end - asked.seconds, end))
        if self.lesson:
            return [_refused(performer, f"{self.lesson.performer} is being taught {self.lesson.class_name}")]
        if isinstance(asked, commands.Hold):
            self.lesson = HeldLesson(asked, performer, self._recent[performer].newest)
            return [State(performer, Step.RECORDING)]
        self.lesson = Lesson(asked, performer, now, self._stillness)
        return self.tick(now)

    def _take(self, performer: str, class_name: str, whole: Stretch, *, trims: bool = True) -> Told:
        """Take the movement in a remembered span as an example, or without trimming all of the span."""
        clip = self._recent[performer].between(*whole)
        if clip is None or clip.gaps:
            return [_refused(performer, f"{whole.duration:g} s have not been seen")]
        return self._add(performer, class_name, clip, whole, None if trims else Stretch(0.0, clip.duration))

    def _judged(self, asked: str, now: float, *, is_right: bool) -> Told:
        """Take the last named motion as an example of its class, or of `nothing`; once, until that is undone."""
        performer = self.named.last(asked, self._there(now))
        motion = self.named.meant(performer, self._recent[performer].newest) if performer else None
        there = {each.number for each in self.roster.examples}
        shown = [of.start for number, (name, of) in self._shown.items() if number in there and name == performer]
        # Behind an example nobody means what was named before it.
        if performer is None or motion is None or max(shown, default=-math.inf) > motion.started:
            return [_refused(asked, "no motion was named")]
        if motion.number in there:
            return [_refused(performer, f"{motion.class_name} was judged already: undo it first")]
        motion.is_right = is_right
        if is_right and motion.ended == math.inf:
            return [State(performer, Step.CHECKING, 0.0, f"{motion.class_name}: taken when it ends")]
        return self._take_judged(performer, motion)

    def _take_judged(self, performer: str, motion: NamedMotion) -> Told:
        """Take a motion that was judged as an example of its class, or with what surrounds it of `nothing`."""
        recent, number = self._recent[performer], self._number
        if motion.is_right:
            notices = self._take(performer, motion.class_name, motion.span(recent.newest))
        else:
            around = recent.unbroken(motion.around(recent.newest), motion.started)
            notices = self._take(performer, NOTHING, around, trims=False)
            if self._number > number:
                self._wrong.add(number)
                seconds = self.roster.examples[-1].seconds
                notices[-1] = State(performer, Step.CHECKING, seconds, f"{motion.class_name} was wrong")
        motion.is_right, motion.number = False, number if self._number > number else 0
        return notices

    def _went(self, lesson: Lesson, step: State | Recorded | None) -> Told:
        """Give the notices of a lesson's step."""
        if step is None:
            return []
        if isinstance(step, State):
            if step.step is Step.REFUSED:
                self.lesson = None
            return [step]
        clip = self._recent[lesson.performer].between(*step.whole)
        if not lesson.left:
            self.lesson = None
        if clip is None or clip.gaps:
            self.lesson = None
            return [_refused(lesson.performer, "frames are missing in the recording")]
        begin = max(step.kept.start - step.whole.start, 0.0)
        kept = Stretch(begin, min(step.kept.end - step.whole.start, clip.duration))
        notices = self._add(lesson.performer, lesson.class_name, clip, step.whole, kept)
        return notices if self.lesson is None else [*notices, State(lesson.performer, Step.WAITING)]

    def _add(self, performer: str, class_name: str, clip: Clip, whole: Stretch, kept: Stretch | None = None) -> Told:
        """Add an example; all its movement is kept where nobody says which part."""
        kept = kept or moving.moved_at_all(clip)
        if kept is None:
            whose = f"{clip.name}: " if clip.name else ""
            return [_refused(performer, f"{whose}expected {MIN_SECONDS:g} s or more of movement")]
        if len(self.roster.examples) >= MAX_EXAMPLES:
            return [_refused(performer, f"{MAX_EXAMPLES} examples are there already")]
        number, self._number = self._number, self._number + 1
        example = Example(number, class_name, replace(clip, actor=performer), kept.start, kept.end)
        # What lies before the recent is never tried again.
        oldest = whole.start - REMEMBERED
        self._shown = {each: of for each, of in self._shown.items() if of[0] != performer or of[1].end > oldest}
        self._shown[number] = performer, whole
        cut = clip.duration - example.seconds
        trimming = f"{kept.start:.2f} to {kept.end:.2f} of {clip.duration:.2f} s kept" if cut > _TRIMMED else ""
        self._before.append((self.roster, f"an example of {class_name}"))
        self.roster = self.roster.with_example(example)
        return [Changed(self.roster, number), State(performer, Step.CHECKING, example.seconds, trimming)]

    def _ended(self, *, cancelled: bool) -> Told:
        """End the lesson that goes on by hand, with an example or without one."""
        lesson = self.lesson
        if lesson is None:
            return [_refused("", "nobody is being taught")]
        if cancelled:
            self.lesson = None
            return [State(lesson.performer, Step.DONE, 0.0, "cancelled")]
        lesson.left = min(lesson.left, 1)
        return self._went(lesson, lesson.stop(by_hand=True))

    def _change(self, roster: Roster, change: str) -> Told:
        self._before.append((self.roster, change))
        self.roster = roster
        return [Changed(roster), State("", Step.DONE, 0.0, change)]

    def _undo(self) -> Told:
        if not self._before:
            return [_refused("", "nothing to undo")]
        self.roster, change = self._before.pop()
        examples, classes = len(self.roster.examples), len(self.roster.classes)
        left = f"{examples} example{'s' if examples != 1 else ''} of {classes} class{'es' if classes != 1 else ''}"
        return [Changed(self.roster), State("", Step.DONE, 0.0, f"undone: {change}; {left}")]

    def _present(self, name: str, now: float) -> str | None:
        """Find a performer who is present; without a name the performer whose frame came last."""
        there = self._there(now)
        if name:
            return name if name in there else None
        return max(there, key=there.__getitem__, default=None)

    def _there(self, now: float) -> dict[str, float]:
        """Give the performers who are present, and when their last frames arrived."""
        return {each: recent.arrived for each, recent in self._recent.items() if self._silent(each, now) <= _GONE}

    def _silent(self, name: str, now: float) -> float:
        """Say for how many seconds a performer has sent nothing; the time for which we were stopped does not count."""
        return now - max(self._recent[name].arrived, self._woke)

    def _forget_absent(self, now: float) -> None:
        for name in [each for each, recent in self._recent.items() if now - recent.arrived > 60.0]:
            del self._recent[name]
            self.named.forget(name)


def _refused(performer: str, reason: str) -> State:
    return State(performer, Step.REFUSED, 0.0, reason)


def _unknown(name: str) -> State:
    why = "built-in classes cannot be changed" if name == NOTHING else "not a taught class"
    return _refused("", f"{name[: commands.MAX_NAME]!a}: {why}")
