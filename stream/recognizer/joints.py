"""The joints of a feed: mended where that can be done, and left out where it cannot.

A joint that is lost (NaN, or 0, 0, 0 while its position was elsewhere) keeps its place relative to its parent for a
fifth of a second. A joint that is wrong, or lost for longer, is left out. After a jump of a rigid body to another
posture the windows begin again; the tracker of a body that trembles jumps by nature. While nearly all movement is
jumps no class is named.

A body's segments keep their length, and no body moves at any speed, so four things are noticed. First, the whole body
jumps between two frames: another posture or another body is shown, or its sides or its unit changed. Second, a segment
stretches while the one to the same joint of the other side does not: the two joints are exchanged; or it stretches by
half a metre. Third, a joint keeps one position to the last digit while the joints next to it move: the tracker lost it
and repeats it. Fourth, the ends of a segment are as far apart as any two joints: the joints are in another order, or
these are no positions.

Lengths alone say nothing: sensors and marker sets put joints elsewhere than HDM05, and their segments stretch.

All lengths are measured in the library's metres, so the feed's unit does not matter. The steps between frames are
checked once a hop; lengths and positions are collected once a hop and judged three times a second.
"""

import math
from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from kinespace.library.distances import pair_distances
from kinespace.library.motion_library import MIN_JOINTS
from kinespace.library.windows.segments import Segments, in_disorder, shares_of_size

# --- which joints can be believed -------------------------------------------------------------------------------------

#: A body may have jumped when a sixth of its joints step farther than these metres between two frames, and faster than
#: `JUMP_SPEED`.
JUMP_STEP = 0.12
#: Metres per second; 99.9 % of the steps of CMU's takes are a quarter slower.
JUMP_SPEED = 7.0
_JUMPING_JOINTS = 6
#: A jump is so many times as far and as fast as the step before.
SUDDEN = 3.0
#: Or it goes back where that step came from: the cosine between them is below this.
_BACK = -0.5
#: Seconds over which lengths and positions are judged: one span and the span before it together.
SPAN = 1 / 3
#: Metres by which a rigid segment may change.
RIGID = 0.03
#: Further metres for each metre of the feed's own tremble: a depth sensor stretches limbs by decimetres.
PER_TREMBLE = 25.0
#: Metres by which no segment of any feed changes.
MAX_STRETCH = 0.5
#: Of two joints that are exchanged, each segment changes its length by less than this share of what it seems to change.
STEADIER = 0.5
#: The number of judgements in a row after which joints in disorder are doubted.
_IN_DISORDER = 2
#: Metres within which a position stays the same.
SAME_PLACE = 2e-5
#: Metres by which a frozen joint's segment changes at least on a rigid body.
FROZEN_STRETCH = 0.002
#: From this tremble on, metres (the median change of segments in two spans), a body is not rigid: then a joint that
#: does not tremble is frozen.
TREMBLES = 0.004
#: The number of judgements in a row in which a segment of such a body must be wrong, because a hand that a sensor does
#: not see strays for a moment.
_LASTING = 3
#: The share of the tremble that each judgement keeps.
_KEPT = 0.98
#: Frames of a span that are looked at, at least; a slow feed has longer spans.
_MIN_LOOKS = 6
#: Frames of a span that are looked at, at most.
_MAX_LOOKS = 16


class Plausibility:
    """Watches one performer's frames.

    Parameters
    ----------
    body
        The library's bodies.
    joints
        The number of joints in a frame.

    Attributes
    ----------
    doubted
        Joints that the last span shows to be wrong.
    rigid, tremble
        Whether segments keep their length, False until a span has shown it; and by how much they change, metres.
    """

    def __init__(self, body: Segments, joints: int) -> None:
        self._body = body
        self._jumping = min(_JUMPING_JOINTS, max(2, -(-joints // 6)))
        # If so many joints step by 1 m from the median, the squares of all steps about their mean add up to this at
        # least: the median is at most one standard deviation from the mean.
        self._least_squares = self._jumping / (1 + math.sqrt(self._jumping / joints)) ** 2
        #: The frames looked at in the span before, and in this span.
        self._looks = np.empty((2 * _MAX_LOOKS, joints, 3))
        self._ends = np.ascontiguousarray(body.ends.T)
        self._every_joint = frozenset(range(joints))
        self.clear()

    def clear(self) -> None:
        """Forget all frames."""
        self.doubted: frozenset[int] = frozenset()
        self._scale = 1.0
        self.tremble = 0.0
        self.rigid = False
        #: For each joint that was blamed in the last judgement, in how many judgements in a row.
        self._in_a_row: dict[int, int] = {}
        self._disordered = 0
        self.begin_again()

    def begin(self, positions: NDArray[np.float64]) -> None:
        """Take the size of the body from its first frame (joints, 3)."""
        self._measure_size(self._body.lengths(positions[None])[0])

    def _measure_size(self, lengths: NDArray[np.float64]) -> None:
        measured = lengths > 0
        if measured.any():
            self._scale = _middle(self._body.mean[measured] / lengths[measured])

    def begin_again(self) -> None:
        """Forget the frames before a jump: a segment did not stretch between them and the frames after it."""
        self._before = self._count = 0
        self._since = math.inf

    def jumped(self, steps: tuple[NDArray[np.float64], NDArray[np.float64]], elapsed: tuple[float, float]) -> bool:
        """Say whether the second of two steps is a jump of the whole body, unlike the first.

        Steps are from frame to frame, each (joints, 3), metres, with the seconds that each took.
        """
        before, now = steps
        length = self._step_length(now) * self._scale
        if length < max(JUMP_STEP, JUMP_SPEED * elapsed[1]):
            return False
        usual = self._step_length(before) * self._scale
        # A body that turns or leaps took as large a step before, in the same direction.
        sudden = length > SUDDEN * usual * max(1.0, elapsed[1] / elapsed[0])
        lengths = np.sqrt(float(np.vdot(before, before)) * float(np.vdot(now, now)))
        return sudden or float(np.vdot(before, now)) < _BACK * lengths

    def may_jump(self, squares: float, elapsed: float) -> bool:
        """Say quickly, by `steps_of`, whether a jump or a lost joint may be among some steps."""
        least = max(JUMP_STEP, JUMP_SPEED * elapsed) / self._scale
        # NaN means a lost joint.
        return not squares < self._least_squares * least * least

    def _step_length(self, step: NDArray[np.float64]) -> float:
        """Give how far a sixth of the joints step, metres, relative to the step of the body as a whole."""
        own = step - _middle_of(step)
        lengths = np.sqrt(np.einsum("jc,jc->j", own, own))
        return float(np.partition(lengths, -self._jumping)[-self._jumping])

    def look(self, time: float, positions: NDArray[np.float64]) -> bool:
        """Look at one frame (joints, 3) of a hop, lost joints NaN; say whether a span is over and `doubted` is new."""
        self._since = min(self._since, time)
        if self._count < _MAX_LOOKS:
            self._looks[self._before + self._count] = positions
            self._count += 1
        if time - self._since < SPAN or self._count < _MIN_LOOKS or not len(self._body.children):
            return False
        before, both = self._before, self._before + self._count
        lengths = pair_distances(self._looks[:both], self._ends)
        # NaN counts only where there is nothing else.
        least, greatest = np.fmin.reduce(lengths), np.fmax.reduce(lengths)
        near, far = np.fmin.reduce(self._looks[:both]), np.fmax.reduce(self._looks[:both])
        self._judge((least + greatest) / 2, greatest - least, (far - near).max(axis=1))
        self._looks[: self._count] = self._looks[before:both]
        self._before, self._count, self._since = self._count, 0, time
        return True

    def _judge(self, mean: NDArray[np.float64], stretch: NDArray[np.float64], moved: NDArray[np.float64]) -> None:
        """Judge by the segments' lengths and changes, and by how far joints moved; all in the feed's metres."""
        body, count = self._body, len(self._body.children)
        self._measure_size(mean[:count])
        stretch *= self._scale
        crossed, stretch = stretch[count:], stretch[:count]
        known = stretch[np.isfinite(stretch)]
        self.tremble = tremble = max(_middle(known) if len(known) else 0.0, _KEPT * self.tremble)
        newest = self._looks[self._before + self._count - 1]
        in_disorder = shares_of_size(newest[None], body.segments).item() >= body.disorder
        self._disordered = self._disordered + 1 if in_disorder else 0
        if self._disordered >= _IN_DISORDER:
            self.doubted = self._every_joint
            return
        self.rigid = rigid = tremble < TREMBLES
        kept = moved < SAME_PLACE / self._scale
        changed = (stretch > max(FROZEN_STRETCH, 4 * tremble) + body.tolerance) | (not rigid)
        frozen = self._frozen(kept, changed) if kept.any() else set[int]()
        excess = stretch - body.tolerance
        broken = excess > MAX_STRETCH
        # Both sides show an exchange: while one leg stands still, the other one's marker may slip on the skin.
        exchanged = crossed < STEADIER * stretch[body.crossing]
        exchanged &= excess[body.crossing] > RIGID + PER_TREMBLE * tremble
        broken[body.crossing] |= exchanged & exchanged[body.partner]
        blamed = frozen | _blamed(broken, body, frozen)
        self._in_a_row = {joint: self._in_a_row.get(joint, 0) + 1 for joint in blamed}
        lasting = 1 if rigid else _LASTING
        self.doubted = frozenset(joint for joint, times in self._in_a_row.items() if times >= lasting)

    def _frozen(self, kept: NDArray[np.bool_], changed: NDArray[np.bool_]) -> set[int]:
        """Give the joints that keep their position though a segment between them and the moving body changes."""
        body = self._body
        if kept.all():
            return set()
        above = body.parents[body.children]
        border = changed & (kept[body.children] != kept[above])
        ends = zip(body.children[border].tolist(), above[border].tolist(), strict=True)
        frozen = {child if kept[child] else parent for child, parent in ends}
        # Joints below a frozen joint that keep their position are frozen with it.
        inner = kept[body.children] & kept[above]
        segments = list(zip(body.children[inner].tolist(), above[inner].tolist(), strict=True))
        while more := {end for segment in segments if frozen & {*segment} for end in segment} - frozen:
            frozen |= more
        return frozen


def _middle_of(step: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the median step, (3,), of the joints; numpy's own takes ten times as long for a few numbers."""
    ordered, half = np.sort(step, axis=0), len(step) // 2
    middle: NDArray[np.float64] = (ordered[half] + ordered[-1 - half]) / 2
    return middle


def _middle(numbers: NDArray[np.float64]) -> float:
    """Give the upper median; numpy's own median is slow for a few numbers."""
    place = len(numbers) // 2
    return float(np.partition(numbers, place)[place])


def _blamed(broken: NDArray[np.bool_], body: Segments, known: set[int]) -> set[int]:
    """Give the fewest joints that explain all broken segments that the known wrong joints do not explain.

    A joint at the end of several broken segments is wrong itself. A single broken segment separates the body into two
    parts, and the smaller part is wrong.
    """
    left = [(int(child), int(body.parents[child])) for child in body.children[broken]]
    left = [segment for segment in left if not known & {*segment}]
    blamed: set[int] = set()
    while left:
        ends = [end for segment in left for end in segment]
        worst = max(set(ends), key=lambda joint: (ends.count(joint), joint))
        if ends.count(worst) > 1:
            blamed.add(worst)
            left = [segment for segment in left if worst not in segment]
        else:
            blamed |= _smaller_side(left.pop()[0], body)
    return blamed


def _smaller_side(child: int, body: Segments) -> set[int]:
    """Give the joints below a segment, or all other joints when they are fewer."""
    below = {child}
    while more := {joint for joint in body.children.tolist() if body.parents[joint] in below} - below:
        below |= more
    others = set(range(len(body.parents))) - below
    return below if len(below) <= len(others) else others


def steps_of(last: NDArray[np.float64], positions: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Give the steps of joints (joints, 3) to the first of some frames (frames, joints, 3), and on from frame to frame.

    Returns
    -------
    The steps, shape (frames, joints, 3), and of the frames the largest sum of squares of the steps about their mean;
    NaN where a joint is lost.
    """
    steps = np.empty_like(positions)
    np.subtract(positions[0], last, out=steps[0])
    np.subtract(positions[1:], positions[:-1], out=steps[1:])
    flat = steps.reshape(len(steps), -1)
    # A product with ones takes a tenth of a sum over so few numbers side by side.
    sums = flat @ _summing(len(last))
    about_mean = np.einsum("fk,fk->f", flat, flat) - np.einsum("fc,fc->f", sums, sums) / len(last)
    # NaN stays NaN.
    return steps, max(float(about_mean.max()), 0.0)


@cache
def _summing(joints: int) -> NDArray[np.float64]:
    """Give the matrix by which coordinates side by side, (3 × joints), are summed, shape (3 × joints, 3)."""
    return np.tile(np.eye(3), (joints, 1))


# --- mending ----------------------------------------------------------------------------------------------------------

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
    left_out, doubted
        Indices of the joints that are not believed now, ascending, and their names.
    only_jumps
        Whether nearly all movement of the last seconds is jumps of the whole body.
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
        self.doubted: tuple[str, ...] = ()
        self.only_jumps = False

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
            lost, count = int(np.count_nonzero(self._lost)), len(self._names)
            return f"joints: {lost} of {count} are not seen" if lost else in_disorder(len(self.left_out), count)
        if self.left_out:
            return f"joints: done without {', '.join(self.doubted)}"
        if self._last_time - self._last_jump <= _SHOWN:
            return f"joints: the whole body jumped at {self._last_jump:.2f} s"
        return ""

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
            self.doubted = tuple(self._names[joint] for joint in self.left_out)
        self.only_jumps = times[-1] - self._last_jump < _IN_WINDOWS and self._jumped > ONLY_JUMPS * self._moved
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
        step, elapsed = self._step.copy(), self._elapsed
        for index, time in enumerate(times):
            frame = self._found(time, positions[index], before)
            (past, step), (passed, elapsed) = (step, frame - before), (elapsed, max(time - last, usual))
            last, steps[index] = time, step
            if self._plausibility.jumped((past, step), (passed, elapsed)):
                if self._plausibility.rigid and time - self._last_jump >= _IN_WINDOWS:
                    begun = index
                    self._jumped = self._moved = 0.0
                    self._plausibility.begin_again()
                    # Another body, or the same in another unit.
                    self._plausibility.begin(frame)
                else:
                    self._jumped += _way(step)
                self._last_jump = time
            else:
                self._moved += _way(step)
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
