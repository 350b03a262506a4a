"""The joints of a feed: mended where that can be done, and left out where it cannot.

A joint that is lost (NaN, or 0, 0, 0 while its position was elsewhere) keeps its place relative to its parent for a
fifth of a second. A joint that is wrong, or lost for longer, is left out. After a jump of a rigid body to another
posture the windows begin again; the tracker of a body that trembles jumps by nature. While nearly all movement is
jumps no class is named.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from kinespace.library.motion_library import MIN_JOINTS
from kinespace.library.windows.segments import Segments, in_disorder
from kinespace.stream.recognizer.plausibility import Plausibility, Step, steps_of

#: Seconds for which a lost joint keeps its place relative to its parent.
HELD = 0.2
#: Seconds after which a joint is believed again: longer than the longest window.
BELIEVED_AFTER = 3.0
#: Seconds for which a jump stays in the windows; they do not begin again twice within them.
_IN_WINDOWS = 2.0
#: No class is named while the joints' way by jumps is so many times their other way.
ONLY_JUMPS = 3.0
#: Seconds over which both ways are added up.
_WAY = 1.0
#: Seconds for which the note on a jump is shown.
_SHOWN = 5.0
#: Share of the joints that must be left for a class to be named.
_MIN_LEFT = 0.5
#: Metres: zeros are a lost joint only if the joint was farther than this from the origin.
_ELSEWHERE = 0.05


class Joints:
    """Keeps watch over the joints of one performer's frames.

    Parameters
    ----------
    body
        The segments of the library's bodies.
    names
        The names of the joints.
    positions
        Where the frames of a hop lie, shape (frames, joints, 3), metres.
    is_watched
        Whether joints are doubted; if not, lost joints alone are held, for as long as they are lost.

    Attributes
    ----------
    left_out
        Indices of the joints that are not believed now, ascending.
    """

    def __init__(
        self, body: Segments, names: Sequence[str], positions: NDArray[np.float64], *, is_watched: bool
    ) -> None:
        self._body, self._names, self._positions, self._is_watched = body, tuple(names), positions, is_watched
        count = len(self._names)
        self._parents: list[int] = body.parents.tolist() or [-1] * count
        self._plausibility = Plausibility(body, count)
        self._last, self._step = np.zeros((count, 3)), np.zeros((count, 3))
        self.clear()

    def clear(self) -> None:
        """Forget the frames, as when the feed begins."""
        self._plausibility.clear()
        self._last_time = math.nan
        count = len(self._names)
        #: For each joint the time until which it is not believed, and the time since which it is lost, seconds; NaN if
        #: it is not lost.
        self._doubted_until = np.full(count, -math.inf)
        self._lost_since = np.full(count, math.nan)
        self._lost, self._any_lost = np.zeros(count, dtype=np.bool_), False
        self._last_jump = -math.inf
        #: The mean way of the joints lately, metres: by jumps that are in the windows, and without jumps.
        self._jumped = self._moved = 0.0
        self.left_out: tuple[int, ...] = ()

    @property
    def doubted(self) -> tuple[str, ...]:
        """Names of the joints that are left out."""
        return tuple(self._names[joint] for joint in self.left_out) if self.left_out else ()

    @property
    def newest(self) -> NDArray[np.float64] | None:
        """The newest frame as it was mended, (joints, 3); None while a joint is lost or left out."""
        return None if self._any_lost or self.left_out else self._last

    @property
    def believed(self) -> tuple[str, ...]:
        """Names of the joints that are left; none where too few are left to name a class."""
        count = len(self._names) - len(self.left_out)
        if count < max(MIN_JOINTS, _MIN_LEFT * len(self._names)):
            return ()
        return tuple(name for joint, name in enumerate(self._names) if joint not in self.left_out)

    @property
    def note(self) -> str:
        """A note in words: joints that are not believed now, else a jump a moment ago, else nothing."""
        if not self.believed:
            return in_disorder(len(self.left_out), len(self._names))
        if self.left_out:
            return f"joints: done without {', '.join(self.doubted)}"
        if self._last_time - self._last_jump <= _SHOWN:
            return f"joints: the whole body jumped at {self._last_jump:.2f} s"
        return ""

    def only_jumps(self, time: float) -> bool:
        """Say whether nearly all movement in the windows that end now is jumps of the whole body."""
        return time - self._last_jump < _IN_WINDOWS and self._jumped > ONLY_JUMPS * self._moved

    # --- frames ---

    def mend(self, times: Sequence[float]) -> int | None:
        """Look at the frames of a hop and mend them in place.

        Parameters
        ----------
        times
            Seconds of the first frames, each later than the one before; a NaN joint is lost.

        Returns
        -------
        After a jump the index of the first frame with which windows begin again; else None.
        """
        positions = self._positions[: len(times)]
        if not self._is_watched:
            self._hold(times, positions)
            return None
        count = len(times)
        if math.isnan(self._last_time):
            self._last[...], self._last_time = self._found(times[0], positions[0].copy(), None), times[0]
            self._plausibility.begin(self._last)
            self._step[...], self._elapsed = 0.0, math.inf
        steps, squares = steps_of(self._last, positions)
        usual = (times[-1] - self._last_time) / count
        fading = math.exp((self._last_time - times[-1]) / _WAY)
        self._jumped *= fading
        self._moved *= fading
        begun = None
        if self._any_lost or self._plausibility.may_jump(squares, usual):
            begun = self._follow(times, positions, steps, usual)
        else:
            self._moved += count * math.sqrt(squares / len(self._last))
        self._step[...], self._elapsed = steps[-1], usual or math.inf
        self._last[...], self._last_time = positions[-1], times[-1]
        # A position that we made up says nothing about the body.
        seen = np.where(self._lost[:, None], math.nan, positions[-1]) if self._any_lost else positions[-1]
        if self._plausibility.look(times[-1], seen):
            for joint in self._plausibility.doubted:
                self._doubted_until[joint] = times[-1] + BELIEVED_AFTER
        if self.left_out or self._any_lost or self._plausibility.doubted:
            self.left_out = tuple(np.flatnonzero(self._doubted_until > times[-1]).tolist())
        return begun

    def _hold(self, times: Sequence[float], positions: NDArray[np.float64]) -> None:
        """Put lost joints where they were relative to their parents, and doubt none."""
        if self._any_lost or np.isnan(positions).any():
            before = None if math.isnan(self._last_time) else self._last
            for time, frame in zip(times, positions, strict=True):
                before = self._found(time, frame, before)
        self._last[...], self._last_time = positions[-1], times[-1]

    def _follow(
        self, times: Sequence[float], positions: NDArray[np.float64], steps: NDArray[np.float64], usual: float
    ) -> int | None:
        """Go from frame to frame, because one of them may be wrong; find lost joints, and correct their steps."""
        begun, before, last = None, self._last, self._last_time
        step = Step(self._step.copy(), self._elapsed)
        for index, time in enumerate(times):
            frame = self._found(time, positions[index], before)
            step, previous = Step(frame - before, max(time - last, usual)), step
            last = time
            if self._plausibility.jumped(previous, step):
                if self._plausibility.rigid and time - self._last_jump >= _IN_WINDOWS:
                    begun = index
                    self._jumped = self._moved = 0.0
                    self._plausibility.begin_again()
                    # Another body, or the same in another unit.
                    self._plausibility.begin(frame)
                else:
                    self._jumped += _way(step.step)
                self._last_jump = time
            else:
                self._moved += _way(step.step)
            steps[index] = step.step
            before = positions[index]
        return begun

    def _found(
        self, time: float, frame: NDArray[np.float64], before: NDArray[np.float64] | None
    ) -> NDArray[np.float64]:
        """Put lost joints of a frame (joints, 3) where they were relative to their parents; give the same frame."""
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
        # Each after its parent.
        for joint in sorted(np.flatnonzero(lost).tolist(), key=self._depth):
            parent = self._parents[joint]
            if before is None:
                frame[joint] = frame[parent] if parent >= 0 else middle
            else:
                frame[joint] = before[joint] + (frame[parent] - before[parent] if parent >= 0 else 0.0)
        return frame

    def _depth(self, joint: int) -> int:
        """Count the joints above a joint."""
        return 1 + self._depth(self._parents[joint]) if self._parents[joint] >= 0 else 0


def _way(step: NDArray[np.float64]) -> float:
    """Give the root mean square of the joints' own steps (joints, 3), metres."""
    own = step - step.mean(axis=0)
    return math.sqrt(float(np.vdot(own, own)) / len(own))
