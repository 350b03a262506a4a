"""Motions that begin, and motions that were really done: windows that end now against the library's courses.

Ten times a second the last positions are compared, by windows of several lengths, with every whole motion and with its
first part (`library.windows.courses`). A motion begins when its first part is seen in two looks in a row, and was done
when all of it is; of one person's class one look is enough. The next motion may begin where this one ended.

A window that is longer or shorter than a motion of few people's class must cost less. The windows of the recogniser
say the same in another way. Where their evidence has been better than in nearly all everyday movement, a motion may
cost more and is seen still; where it was not, less.
"""

import math
from collections import deque
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinespace.library.signature.own_frame import AXES, HISTORY, STEP, at_steps, own_path
from kinespace.library.skeleton import Skeleton
from kinespace.library.windows.courses import MAX_WAY, POINTS, Courses, Pieces, at_equal_way, of_time, share_at, ways_of
from kinespace.stream.recognition import Seen

#: Steps from one look to the next.
_LOOKS_EVERY = 3
#: Looks in a row that must see the same class; of one person's class a whole motion must be seen once.
_LOOKS = 2
#: The share of a window's way, at either end, in which the motion has not begun yet, or is over.
_STILL_WAY = 0.02
#: Seconds of the shortest window that shows a whole motion.
_SHORTEST = 0.5
#: Seconds for which evidence for a class counts, the power of e by which a limit grows with each unit, and the least
#: growth.
_EVIDENT_FOR, _GROWTH, _LEAST_GROWTH = 1.5, 0.2, 0.7
#: The greatest growth of a limit: of one person's class; of two persons', and of several persons', whose limits are
#: wider and must not reach motions that are broken off.
_MOST_GROWTH = 1.8, 1.3, 1.1
#: Looks for which a motion that costs more than its own limit may come nearer.
_WAITS = 3
#: A course that costs so many times its limit is near.
_NEAR = 1.5
#: Tolerance, as a share of a step, because times are rounded.
_ROUNDING = 1e-3


class Found(NamedTuple):
    """A motion that was seen whole, or whose first part was seen.

    Attributes
    ----------
    class_name
        Its class.
    start, end
        Seconds, on the clock of the frames.
    score
        1 for the very motion of the library, 0.5 at the limit.
    speed, amplitude
        Relative to the nearest motion of the library: 2 is twice as fast, or twice as far.
    seconds
        How long the nearest motion of the library lasts.
    share
        Its cost, relative to the limit without evidence.
    """

    class_name: str
    start: float
    end: float
    score: float
    speed: float
    amplitude: float
    seconds: float
    share: float


class Look(NamedTuple):
    """The motion that was done, and the motion whose course was seen; None for none."""

    done: Found | None = None
    seen: Seen | None = None

    def behind(self, before: "Look | None") -> "Look":
        """Add what the look before it saw and no answer has said: a motion that was done, or begins.

        An answer says one of each: of two motions that were done between two slow hops the newer one.
        """
        if before is None:
            return self
        begins = before.seen and before.seen.begins and not (self.seen and self.seen.begins)
        return Look(self.done or before.done, before.seen if begins else self.seen)


class EndingWindows(NamedTuple):
    """Windows that end now, to be compared with the library's motions (`costs_of`).

    Attributes
    ----------
    courses
        The library's.
    points
        The windows at equal way, shape (windows, POINTS, numbers + `AXES`).
    size
        The body's size, metres.
    counts
        Steps in each window, shape (windows,).
    free
        Whether each lies behind the motion before, shape (windows,).
    growth
        How much wider each class's limits are, shape (classes,).
    limits
        Of whole motions and of first parts, for each window, shape (windows, pieces).
    """

    courses: Courses
    points: NDArray[np.float32]
    size: float
    counts: NDArray[np.intp]
    free: NDArray[np.bool_]
    growth: NDArray[np.float32]
    limits: NDArray[np.float32]


def costs_of(ending: Sequence[EndingWindows]) -> list[NDArray[np.float32]]:
    """Give each window's cost, relative to the limits, by whole motions and by first parts: shape (windows, pieces).

    Infinite where no window is near the limit, or where it is not free. The windows of several performers, of one
    library, are compared together: then the library's motions come from memory once.
    """
    courses, counts = ending[0].courses, [len(each.points) for each in ending]
    windows = Pieces.of(np.concatenate([each.points for each in ending]), courses.whitening)
    sizes = np.repeat(np.array([each.size for each in ending], dtype=np.float32), counts)
    windows = windows._replace(lengths=windows.lengths / sizes)
    limits = windows.shared(courses.pieces)
    limits *= np.concatenate([each.limits for each in ending])
    near = courses.screen.costs_at_least(windows.courses) < _NEAR * limits
    near &= windows.as_far(courses.pieces)
    near &= np.concatenate([each.free for each in ending])[:, None]
    # Flat, which is found ten times as fast.
    costs, pairs = np.full(near.shape, np.inf, dtype=np.float32), divmod(near.ravel().nonzero()[0], near.shape[1])
    some = (each.courses.take(place, axis=0) for each, place in zip((windows, courses.pieces), pairs, strict=True))
    costs[pairs] = (1 - np.einsum("pn,pn->p", *some)) / limits[pairs]
    return np.split(costs, np.cumsum(counts)[:-1])


@lru_cache(maxsize=4)
def _limits_of(courses: Courses, share: float) -> NDArray[np.float32]:
    """Give a share of the limits, of whole motions and of first parts, for windows of each length: (counts, pieces)."""
    lasting = of_time(np.array(courses.counts) * STEP, courses.seconds, courses.by_people[courses.of_class])
    whole, begun = share * courses.limits
    return np.concatenate([whole * lasting, np.tile(begun, (len(lasting), 1))], axis=1, dtype=np.float32)


#: No class, seen in no look.
_UNSEEN = "", 0


def _in_a_row(before: tuple[str, int], name: str) -> tuple[str, int]:
    """Give the class that a look sees, empty for none, and the looks in a row that have seen it, as `before` them."""
    return name, before[1] + 1 if name and name == before[0] else 1


class DoneFollower:
    """Finds the motions that one performer begins, and has done.

    Parameters
    ----------
    courses
        The library's courses.
    skeleton
        The joints of the positions.
    false_alarms
        Motions an hour that may be found though they were not done.

    Attributes
    ----------
    time
        The time of the newest step, seconds; NaN before the first.
    """

    def __init__(self, courses: Courses, skeleton: Skeleton, false_alarms: float) -> None:
        self._skeleton, self._courses = skeleton, courses
        self._longest = courses.counts[-1] + 1 if courses.counts else 0
        self._counts = np.array(courses.counts, dtype=np.intp)
        self._limits = _limits_of(courses, share_at(false_alarms))
        self._persons = dict(zip(courses.classes, courses.persons.tolist(), strict=True))
        learned = zip(self._persons.items(), courses.by_people.tolist(), strict=True)
        self._most_growth = {name: _MOST_GROWTH[2 if by else min(count, 2) - 1] for (name, count), by in learned}
        #: The class of each whole motion, and of each first part.
        self._of_piece = np.tile(courses.of_class, 2)
        lengths = courses.pieces.lengths
        self._least = float(lengths.min()) / MAX_WAY if len(lengths) else 0.0
        self._most = float(lengths.max()) * MAX_WAY if len(lengths) else 0.0
        self.clear()

    def clear(self) -> None:
        """Forget the body's past."""
        self.time, self._over = math.nan, -math.inf
        #: The last points of the path, and the way up to each.
        self._points = np.zeros((0, self._courses.pieces.ways.shape[1] + AXES), dtype=np.float32)
        self._ways = np.zeros(0)
        self._times: list[NDArray[np.float64]] = []
        self._positions: list[NDArray[np.float64]] = []
        self._body, self._size = np.zeros((0, len(self._skeleton.joints), 3)), 1.0
        #: When, for which class, and by how much there was evidence.
        self._evident = deque[tuple[float, str, float]]()
        #: The class that whole motions and that first parts show, and for how many looks in a row.
        self._whole, self._begun = _UNSEEN, _UNSEEN
        #: A motion that is seen and comes nearer, and for how many looks.
        self._waiting: Found | None = None
        self._waited = 0
        #: When each class was last seen to begin, seconds.
        self._said: dict[str, float] = {}

    def know(self, time: float, class_name: str, evidence: float) -> None:
        """Take in the evidence of the windows that end at a time, for a class, above what everyday movement has."""
        evident = self._evident
        evident.append((time, class_name, evidence))
        while evident[0][0] < time - _EVIDENT_FOR:
            evident.popleft()

    def _growth(self) -> NDArray[np.float32]:
        """Say how much wider each class's limits are by the evidence of the last moments, shape (classes,)."""
        since = self.time - _EVIDENT_FOR
        best = dict(sorted((name, each) for time, name, each in self._evident if time >= since))
        growth = np.full(len(self._most_growth), _LEAST_GROWTH if best else 1.0, dtype=np.float32)
        for place, (name, most) in enumerate(self._most_growth.items()):
            if name in best:
                growth[place] = min(max(math.exp(_GROWTH * best[name]), _LEAST_GROWTH), most)
        return growth

    def push(self, times: list[float], positions: NDArray[np.float64]) -> EndingWindows | None:
        """Take in the body's positions, (frames, joints, 3), metres, at times in seconds.

        Returns
        -------
        When a look is due the windows whose costs `look` takes in, before the next push; else None.
        """
        if not self._longest:
            return None
        self._times.append(np.array(times))
        self._positions.append(positions.copy())
        if times[-1] - self.time < (_LOOKS_EVERY - _ROUNDING) * STEP:
            return None
        self._follow()
        return self._ending()

    def _follow(self) -> None:
        """Put the positions that came on the path, `STEP` after `STEP`."""
        times, positions = np.concatenate(self._times), np.concatenate(self._positions)
        self._times, self._positions = [times[-1:]], [positions[-1:]]
        if math.isnan(self.time):
            # The body stood before it was seen first.
            self.time = float(times[0])
            body = positions[:1]
        else:
            body = np.zeros((0, *positions.shape[1:]))
        steps = int((times[-1] - self.time) / STEP + _ROUNDING)
        if steps and len(times) > 1:
            body = np.concatenate([body, at_steps(times, positions, self.time + STEP * np.arange(1, steps + 1))])
            self.time += steps * STEP
        self._body = np.concatenate([self._body[-HISTORY:], body])
        points, self._size = own_path(self._body, self._skeleton, len(body))
        self._extend(points)

    def _extend(self, points: NDArray[np.float64]) -> None:
        """Keep some more points, and the way up to each."""
        last, new = self._points[-1:], points[-self._longest :].astype(np.float32)
        ways = ways_of(np.concatenate([last, new]))
        ways += self._ways[-1] if len(self._ways) else 0.0
        self._points = np.concatenate([self._points, new])[-self._longest :]
        self._ways = np.concatenate([self._ways[:-1], ways])[-self._longest :]

    def _ending(self) -> EndingWindows:
        """Give the windows that end now."""
        ways = self._ways
        last = len(ways) - 1
        counts = self._counts[self._counts <= last]
        gone = (ways[last] - ways[last - counts]) / self._size
        kept = np.flatnonzero((gone > max(self._least, 0.0)) & (gone < self._most))
        counts = counts[kept]
        points = np.zeros((0, POINTS, self._points.shape[1]), dtype=np.float32)
        if len(counts):
            ends = np.full(len(counts), ways[last])
            points = at_equal_way(self._points, ways, ways[last - counts], ends)
        # A window must lie behind the motion before.
        free, growth = self.time - counts * STEP >= self._over - _ROUNDING, self._growth()
        limits = self._limits[kept] * growth[self._of_piece]
        return EndingWindows(self._courses, points, self._size, counts, free, growth, limits)

    def look(self, ending: EndingWindows, costs: NDArray[np.float32]) -> Look:
        """Say what the windows that were asked for show by their costs (`costs_of`)."""
        motions, begins = len(self._courses.seconds), len(self._ways) - 1 - ending.counts
        costs[ending.counts * STEP < _SHORTEST, :motions] = np.inf
        return self._sees(
            self._nearest(costs[:, :motions], begins, ending.growth, whole=True),
            self._nearest(costs[:, motions:], begins, ending.growth, whole=False),
        )

    def _nearest(
        self, costs: NDArray[np.float32], begins: NDArray[np.intp], growth: NDArray[np.float32], *, whole: bool
    ) -> Found | None:
        """Give the motion of which a window shows the whole, or the first part; None where no window does."""
        courses = self._courses
        if not costs.size or not (least := float(costs.min())) < _NEAR:
            return None
        window, motion = divmod(int(costs.argmin()), costs.shape[1])
        ways, begin = self._ways, int(begins[window])
        gone = float(ways[-1] - ways[begin])
        moves = ways[begin] + gone * np.array([_STILL_WAY, 1 - _STILL_WAY])
        first, last = np.searchsorted(ways[begin:], moves).tolist()
        start, end = (self.time - (len(ways) - 1 - begin - place) * STEP for place in (max(first - 1, 0), last))
        place = self._of_piece.item(motion)
        lengths = (courses.whole if whole else courses.begun).lengths
        seconds, amplitude = float(courses.seconds[motion]), float(gone / self._size / lengths[motion])
        speed = seconds / max(end - start, STEP)
        share = least * growth.item(place)
        return Found(courses.classes[place], start, end, 1 - least / 2, speed, amplitude, seconds, share)

    def _nearest_of(self, whole: Found | None) -> Found | None:
        """Wait while a motion that is seen comes nearer, look by look, and give it then; None while it waits."""
        best = self._waiting
        if whole and whole.share > 1 and self._waited < _WAITS and (best is None or whole.score > best.score):
            self._waiting, self._waited = whole, self._waited + 1
            return None
        self._waiting, self._waited = None, 0
        return max(filter(None, (best, whole)), key=lambda each: each.score, default=None)

    def _sees(self, whole: Found | None, begun: Found | None) -> Look:
        """Say what has been seen in enough looks in a row."""
        near = max((each for each in (whole, begun) if each), key=lambda each: each.score, default=None)
        whole, begun = (each if each and each.score > 0.5 else None for each in (whole, begun))
        name = whole.class_name if whole else ""
        looks = _LOOKS if self._persons.get(name, 1) > 1 else 1
        self._whole = _in_a_row(self._whole, name)
        self._begun = _in_a_row(self._begun, begun.class_name if begun else "")
        done = self._nearest_of(whole if self._whole[1] >= looks else None)
        starts = begun if self._begun[1] >= _LOOKS else None
        if done:
            self._over, self._whole, self._begun = self.time, _UNSEEN, _UNSEEN
        found = starts or done
        if found is None:
            return Look(seen=near and Seen(near.class_name, near.score, near.seconds, begins=False))
        # What was moving when a class was said to begin is the same motion still.
        begins = found.start >= self._said.get(found.class_name, -math.inf)
        if begins:
            self._said[found.class_name] = self.time
        return Look(done, Seen(found.class_name, found.score, found.seconds, begins))
