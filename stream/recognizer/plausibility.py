"""Which joints of a feed can be believed: a body's segments keep their length, and no body moves at any speed.

Four things are noticed. First, the whole body jumps between two frames: another posture or another body is shown, or
its sides or its unit changed. Second, a segment stretches while the one to the same joint of the other side does not:
the two joints are exchanged; or it stretches by half a metre. Third, a joint keeps one position to the last digit while
the joints next to it move: the tracker lost it and repeats it. Fourth, the ends of a segment are as far apart as any
two joints: the joints are in another order, or these are no positions.

Lengths alone say nothing: sensors and marker sets put joints elsewhere than HDM05, and their segments stretch.

All lengths are measured in the library's metres, so the feed's unit does not matter. The steps between frames are
checked once a hop; lengths and positions are collected once a hop and judged three times a second.
"""

import math
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinespace.library.distances import pair_distances
from kinespace.library.windows.segments import Segments

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


class Step(NamedTuple):
    """Each joint's step from one frame to the next, shape (joints, 3), metres, and the seconds between them."""

    step: NDArray[np.float64]
    elapsed: float


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
        self._joints = joints
        self._jumping = min(_JUMPING_JOINTS, max(2, -(-joints // 6)))
        # If so many joints step by 1 m from the median, the squares of all steps about their mean add up to this at
        # least: the median is at most one standard deviation from the mean.
        self._least_squares = self._jumping / (1 + math.sqrt(self._jumping / joints)) ** 2
        #: The frames looked at in the span before, and in this span.
        self._looks = np.empty((2 * _MAX_LOOKS, joints, 3))
        self._ends = np.ascontiguousarray(body.ends.T)
        #: The lengths between these ends in the frames that were judged last.
        self._lengths = np.empty((0, len(body.ends)))
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
        if len(self._body.children):
            self._measure_size(self._body.lengths(positions[None])[0])

    def _measure_size(self, lengths: NDArray[np.float64]) -> None:
        measured = lengths > 0
        self._all_known = bool(measured.all())
        # Picking out takes longer than all the rest.
        known = (self._body.mean, lengths) if self._all_known else (self._body.mean[measured], lengths[measured])
        if len(known[0]):
            self._scale = _middle(np.divide(*known))

    def begin_again(self) -> None:
        """Forget the frames before a jump: a segment did not stretch between them and the frames after it."""
        self._before = self._count = 0
        self._since = math.inf

    # --- steps ---

    def jumped(self, before: Step, now: Step) -> bool:
        """Say whether a body's step is a jump of the whole body, unlike the step before it."""
        length = self._step_length(now.step) * self._scale
        if length < max(JUMP_STEP, JUMP_SPEED * now.elapsed):
            return False
        usual = self._step_length(before.step) * self._scale
        # A body that turns or leaps took as large a step before, in the same direction.
        sudden = length > SUDDEN * usual * max(1.0, now.elapsed / before.elapsed)
        return sudden or float(np.vdot(before.step, now.step)) < _BACK * np.sqrt(
            float(np.vdot(before.step, before.step)) * float(np.vdot(now.step, now.step))
        )

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

    # --- spans ---

    def look(self, time: float, positions: NDArray[np.float64]) -> bool:
        """Look at one frame (joints, 3) of a hop, lost joints NaN; say whether a span is over and `doubted` is new."""
        self._since = min(self._since, time)
        if self._count < _MAX_LOOKS:
            self._looks[self._before + self._count] = positions
            self._count += 1
        if time - self._since < SPAN or self._count < _MIN_LOOKS or not len(self._body.children):
            return False
        before, both = self._before, self._before + self._count
        self._lengths = lengths = pair_distances(self._looks[:both], self._ends)
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
        known = stretch if self._all_known else stretch[np.isfinite(stretch)]
        self.tremble = tremble = max(_middle(known) if len(known) else 0.0, _KEPT * self.tremble)
        self._disordered = self._disordered + 1 if self._in_disorder() else 0
        if self._disordered >= _IN_DISORDER:
            self.doubted = self._every_joint
            return
        self.rigid = rigid = tremble < TREMBLES
        excess = stretch - body.spread
        blamed = frozen = set[int]()
        # Nearly always neither is so, which one number says; NaN asks for a closer look.
        if not float(moved.min()) >= SAME_PLACE / self._scale:
            kept = moved < SAME_PLACE / self._scale
            changed = (stretch > max(FROZEN_STRETCH, 4 * tremble) + body.spread) | (not rigid)
            blamed = frozen = self._frozen(kept, changed) if kept.any() else frozen
        most = RIGID + PER_TREMBLE * tremble
        if not float(excess.max()) <= min(most, MAX_STRETCH):
            broken = excess > MAX_STRETCH
            # Both sides show an exchange: while one leg stands still, the other one's marker may slip on the skin.
            exchanged = crossed < STEADIER * stretch[body.crossing]
            exchanged &= excess[body.crossing] > most
            broken[body.crossing] |= exchanged & exchanged[body.partner]
            blamed = frozen | _blamed(broken, body, frozen) if broken.any() else frozen
        self._in_a_row = {joint: self._in_a_row.get(joint, 0) + 1 for joint in blamed}
        lasting = 1 if rigid else _LASTING
        self.doubted = frozenset(joint for joint, times in self._in_a_row.items() if times >= lasting)

    def _in_disorder(self) -> bool:
        """Say whether the joints of the newest frame look as if they were in another order; not of lost ones."""
        # As `shares_of_size`, by lengths that are measured already.
        place, segments = self._before + self._count - 1, len(self._body.children)
        own = self._looks[place] - np.add.reduce(self._looks[place]) / self._joints
        squares = float(np.vdot(own, own)) * 2 / (self._joints - 1)
        length = float(np.add.reduce(self._lengths[-1, :segments])) / segments
        return 0 < squares * self._body.disorder**2 <= length * length

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
