"""Joints that cannot be believed: the recogniser mends them if it can, and leaves them out if it cannot.

Exchanged sides and a changed unit are corrected from the next frame on. A joint that is lost (NaN, or 0, 0, 0 while its
position was elsewhere) is held beside its parent for a fifth of a second. A joint that is wrong, or lost for longer, is
left out: windows of the other joints are compared with the library as a body of those joints shows it, from the next
hop on, the last two seconds included. After a jump to another posture the windows begin anew. While a body goes on
jumping, or most of its joints cannot be believed, no class is named.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kinespace.library.motion_library import MIN_JOINTS
from kinespace.stream.recognition import Outcome
from kinespace.stream.recognizer.joints.fewer_joints import opened_restricted
from kinespace.stream.recognizer.joints.plausibility import Change, Jump, Plausibility, Step, expected_body, steps_of
from kinespace.stream.recognizer.matcher import WindowMatcher
from kinespace.stream.recognizer.windows.sliding_window import MAX_PENDING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from kinespace.library.motion_library import MotionLibrary
    from kinespace.library.windows.index import WindowIndex
    from kinespace.stream.recognizer.joints.fewer_joints import Opener
    from kinespace.stream.recognizer.matcher import Matcher, Reading

#: Seconds for which a lost joint is held beside its parent.
HELD = 0.2
#: Seconds after which a joint is believed again: longer than the longest window.
BELIEVED_AFTER = 3.0
#: Two jumps within so many seconds: no class is named until as many seconds have passed without a jump.
JUMPING = 2.0
#: Seconds for which the note on a jump is shown.
_TOLD = 5.0
#: Share of the joints that must be left for a class to be named.
_MIN_LEFT = 0.5
#: Metres: zeros are a lost joint only if the joint was farther than this from the origin.
_ELSEWHERE = 0.05
#: Seconds between two sets of joints that are opened, so that a body that falls apart does not open one at every step.
_ASKED_AGAIN = 0.5


class LongAgo(NamedTuple):
    """A recogniser's knowledge of its feed that the last seconds of the feed need not show.

    Attributes
    ----------
    mirrored, factor
        Whether left and right are exchanged, and the factor on the unit that puts it right.
    last_jump, jumping_until
        When the whole body last jumped, and until when no class is named therefore, seconds on the feed's clock; None
        for never.
    """

    mirrored: bool = False
    factor: float = 1.0
    last_jump: float | None = None
    jumping_until: float | None = None

    @property
    def of_the_body(self) -> LongAgo:
        """The same without jumps, for frames that still contain the jumps."""
        return self._replace(last_jump=None, jumping_until=None)


#: Nothing that has to be known.
_NOTHING = LongAgo()


class Doubts:
    """Keeps watch over one performer's frames, and reads windows of the joints that can be believed.

    Parameters
    ----------
    library
        The library whose joints the frames have, in its order.
    matcher
        Compares all joints; the windows of fewer joints are filled from its windows.
    opener
        Gives the windows of fewer joints; `opened_restricted` when not given.
    """

    def __init__(
        self,
        library: MotionLibrary,
        matcher: Matcher,
        opener: Opener | None = None,
    ) -> None:
        self._library, self._matcher = library, matcher
        self._opener = opener or opened_restricted
        joints = len(library.skeleton.joints)
        self._body = expected_body(library)
        self._plausibility = Plausibility(self._body, joints)
        #: The last step of the hop before, and the steps of this hop.
        self._steps = np.empty((1 + MAX_PENDING, joints, 3))
        self._mirrored = False
        self._factor = 1.0
        self.clear()

    def clear(self) -> None:
        """Forget the frames, as when the feed begins."""
        self._plausibility.clear()
        self._last: NDArray[np.float64] | None = None
        self._last_time = math.nan
        joints = len(self._library.skeleton.joints)
        #: For each joint the time until which it is not believed, and the time since which it is lost, seconds; NaN if
        #: it is not lost.
        self._doubted_until = np.full(joints, -math.inf)
        self._lost_since = np.full(joints, math.nan)
        self._lost, self._any_lost = np.zeros(joints, dtype=np.bool_), False
        self._last_jump = self._jumping_until = -math.inf
        self._fewer: _Fewer | None = None
        self._wanted: tuple[int, ...] = ()
        self._asked_for: tuple[int, ...] = ()
        self._asked = -math.inf
        self._jump: Jump | None = None

    def exchange(self, library: MotionLibrary) -> None:
        """Leave out the same joints in another library of the same skeleton from now on."""
        self._library, self._fewer, self._asked_for = library, None, ()

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints that are not believed now."""
        if not self._wanted:
            return ()
        names = self._library.skeleton.joints
        return tuple(names[joint] for joint in self._wanted)

    @property
    def told(self) -> str:
        """The note in words: joints that are not believed now, else a jump a moment ago, else nothing."""
        count = len(self._wanted)
        if self._too_few:
            every = len(self._doubted_until)
            return f"joints: {count} of {every} where no body has them: in another order, or angles for positions?"
        if count:
            return f"joints: done without {', '.join(self.joints)}"
        if self._jump is None or self._last_time - self._last_jump > _TOLD:
            return ""
        return f"joints: {self._jump.change} at {self._last_jump:.2f} s"

    @property
    def long_ago(self) -> LongAgo | None:
        """Facts for another recogniser that goes on with the last seconds of this feed; None for none."""
        jumps = (each if math.isfinite(each) else None for each in (self._last_jump, self._jumping_until))
        known = LongAgo(self._mirrored, self._factor, *jumps)
        return None if known == _NOTHING else known

    def go_on(self, known: LongAgo) -> None:
        """Go on where another recogniser was."""
        self._mirrored, self._factor = known.mirrored, known.factor
        self._last_jump = -math.inf if known.last_jump is None else known.last_jump
        self._jumping_until = -math.inf if known.jumping_until is None else known.jumping_until

    # --- frames ---

    def mend(self, times: Sequence[float], positions: NDArray[np.float64]) -> int | None:
        """Look at the frames of a hop and mend them in place.

        Parameters
        ----------
        times
            Seconds, each later than the one before.
        positions
            Shape (frames, joints, 3); a NaN joint is lost.

        Returns
        -------
        After a jump the index of the first frame with which windows begin anew; else None.
        """
        if self._mirrored and self._body.mirrored is not None:
            positions[...] = positions[:, self._body.mirrored]
        if self._factor != 1.0:
            positions *= self._factor
        count = len(times)
        if self._last is None:
            self._last, self._last_time = self._found(times[0], positions[0].copy(), None), times[0]
            self._plausibility.begin(self._last)
            self._steps[0], self._elapsed = 0.0, math.inf
        steps = self._steps[1 : count + 1]
        squares = steps_of(positions, self._last, steps)
        usual = (times[-1] - self._last_time) / count
        begun = None
        if self._any_lost or self._plausibility.may_jump(squares, usual):
            begun = self._follow(times, positions, usual)
        self._steps[0], self._elapsed = steps[-1], usual or math.inf
        self._last[...], self._last_time = positions[-1], times[-1]
        # A position that we made up says nothing about the body.
        seen = np.where(self._lost[:, None], math.nan, positions[-1]) if self._any_lost else positions[-1]
        if self._plausibility.look(times[-1], seen):
            for joint in self._plausibility.doubted:
                self._doubted_until[joint] = times[-1] + BELIEVED_AFTER
        if self._wanted or self._any_lost or self._plausibility.doubted:
            self._settle(times[-1])
        return begun

    def _follow(self, times: Sequence[float], positions: NDArray[np.float64], usual: float) -> int | None:
        """Go from frame to frame, because one of them may be wrong."""
        begun, before, last = None, self._last, self._last_time
        assert before is not None  # noqa: S101
        step = Step(self._steps[0].copy(), self._elapsed)
        for index, time in enumerate(times):
            frame = self._found(time, positions[index], before)
            step, previous = Step(frame - before, max(time - last, usual)), step
            last = time
            if self._plausibility.jumped(previous, step):
                jump = self._plausibility.explained(before, frame)
                self._jump, since = jump, time - self._last_jump
                self._last_jump = time
                if jump.change is not Change.POSTURE:
                    self._correct(jump.change, jump.factor, positions[index:])
                elif self._begins_anew(time, since):
                    begun = index
                    self._begin_again()
                step = Step(positions[index] - before, step.elapsed)
            self._steps[1 + index] = step.step
            before = positions[index]
        return begun

    def _correct(self, change: Change, factor: float, positions: NDArray[np.float64]) -> None:
        if change is Change.EXCHANGED and self._body.mirrored is not None:
            self._mirrored = not self._mirrored
            positions[...] = positions[:, self._body.mirrored]
        else:
            self._factor *= factor
            positions *= factor

    def _begins_anew(self, time: float, since: float) -> bool:
        """Say whether windows begin anew after a jump, `since` seconds after the last; not while a body keeps on."""
        if since < JUMPING:
            self._jumping_until = time + JUMPING
        return time >= self._jumping_until

    def _found(
        self, time: float, frame: NDArray[np.float64], before: NDArray[np.float64] | None
    ) -> NDArray[np.float64]:
        """Put lost joints of a frame (joints, 3), in place, where they were beside their parents; give the frame."""
        lost = np.asarray(np.isnan(frame).any(axis=1))
        zeros = ~frame.any(axis=1)
        if zeros.any():
            lost |= zeros & (np.abs(frame if before is None else before).max(axis=1) > _ELSEWHERE)
        self._lost, self._any_lost = lost, bool(lost.any())
        self._lost_since[~lost] = math.nan
        if not self._any_lost:
            return frame
        self._lost_since[lost & np.isnan(self._lost_since)] = time
        late = lost & (time - self._lost_since >= HELD)
        self._doubted_until[late] = np.maximum(self._doubted_until[late], time + BELIEVED_AFTER)
        known = ~lost
        middle = frame[known].mean(axis=0) if known.any() else np.zeros(3)
        for joint in self._from_the_root():
            if not lost[joint]:
                continue
            parent = self._parent(joint)
            at = frame[parent] if parent >= 0 else middle
            if before is None:
                frame[joint] = at
            else:
                frame[joint] = before[joint] + (frame[parent] - before[parent] if parent >= 0 else 0.0)
        return frame

    def _parent(self, joint: int) -> int:
        return int(self._body.parents[joint]) if len(self._body.parents) else -1

    def _from_the_root(self) -> list[int]:
        """Give the joints, each after its parent."""

        def depth(joint: int) -> int:
            parent = self._parent(joint)
            return 0 if parent < 0 else 1 + depth(parent)

        return sorted(range(len(self._library.skeleton.joints)), key=depth)

    # --- windows ---

    def _settle(self, now: float) -> None:
        """Find the joints that are left out now."""
        wanted = tuple(np.flatnonzero(self._doubted_until > now).tolist())
        if wanted == self._wanted:
            if self._fewer is None and wanted:
                self._open(now)
            return
        self._wanted, self._fewer = wanted, None
        self._open(now)

    def _open(self, now: float) -> None:
        """Open the windows of the other joints: at once for the first set, and not too often for further sets."""
        if not self._wanted or self._too_few or not isinstance(self._matcher, WindowMatcher):
            return
        if self._wanted != self._asked_for:
            if now - self._asked < _ASKED_AGAIN:
                return
            self._asked_for, self._asked = self._wanted, now
        names = self._library.skeleton.joints
        kept = tuple(name for joint, name in enumerate(names) if joint not in self._wanted)
        try:
            index = self._opener(self._library, kept)
        except ValueError:
            index = None  # these joints cannot be compared
        if index is not None:
            self._fewer = _Fewer(self._matcher.over(index), self._library, index)
            self._fewer.fill(self._matcher)

    @property
    def _too_few(self) -> bool:
        count = len(self._library.skeleton.joints)
        return count - len(self._wanted) < max(MIN_JOINTS, _MIN_LEFT * count)

    def push(self, times: Sequence[float], rows: NDArray[np.float64]) -> None:
        """Take in the distance rows (frames, pairs) of the hop, of all joints."""
        if self._fewer:
            self._fewer.push(times, rows)

    def _begin_again(self) -> None:
        """Forget the frames before a jump."""
        self._plausibility.begin_again()
        if self._fewer:
            self._fewer.clear()

    def read(self, time: float, noise: float = 0.0) -> Reading | None:
        """Read the windows of the joints that are believed; `noise` as in `Matcher.read`."""
        reading = self._fewer.read(noise) if self._fewer else self._matcher.read(noise)
        if reading is None or not (time < self._jumping_until or (self._wanted and not self._fewer)):
            return reading
        return reading._replace(outcome=Outcome.IMPLAUSIBLE)


class _Fewer:
    """A matcher of fewer joints, fed with the rows of all."""

    def __init__(self, matcher: WindowMatcher, library: MotionLibrary, index: WindowIndex) -> None:
        self._places = library.skeleton.places_of(index.library.skeleton)
        self._matcher = matcher

    def fill(self, whole: WindowMatcher) -> None:
        """Take in the rows that are still in the windows of a matcher of all joints."""
        times, rows = whole.recent()
        for begin in range(0, len(times), MAX_PENDING):
            some = slice(begin, begin + MAX_PENDING)
            self.push(times[some].tolist(), rows[some])

    def push(self, times: Sequence[float], rows: NDArray[np.float64]) -> None:
        self._matcher.push(times, rows[:, self._places])

    def clear(self) -> None:
        self._matcher.clear()

    def read(self, noise: float) -> Reading | None:
        return self._matcher.read(noise)
