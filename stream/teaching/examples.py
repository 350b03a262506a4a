"""Examples that a person teaches: their recordings, the library that they make, and how well they differ.

Rosters are values: a change gives a new roster, so that undo goes back to an old one. The windows of an example are
computed once, even if the roster changes often.
"""

import math
import operator
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinespace.library import NOTHING, Clip, MotionLibrary, WindowIndex
from kinespace.library.windows.comparer import named_and_alone
from kinespace.library.windows.courses import Courses
from kinespace.library.windows.rejection import Rejection
from kinespace.library.windows.segments import mirrored

#: Examples in a roster, at most.
MAX_EXAMPLES = 2000
#: Seconds between two windows of an example.
EVERY = 0.1
#: Share of an example's windows that another class wins: up to the first number the example is good, and from the
#: second number on the two classes do not differ.
_GOOD, _ALIKE = 0.05, 0.5
#: An unlike example is so many times as far from its class's other examples as these from each other.
_UNLIKE = 2.0
#: What makes two classes differ; and a class and `nothing`.
_CHANGE = "do one of the two with the other arm, in another direction, or larger, and teach it anew"
_CHANGE_OF_NOTHING = "undo `nothing` if this gesture is in it, or show a larger one"
#: An example of `nothing` holds a gesture whose limit it lowers to less than this share (tests/TRIED.md).
_HELD = 0.5
#: Examples from which on what is unknown is learned again only when their number has changed by more than this share.
_MANY, _FEW = 200, 0.05
#: Examples that were undone and keep their windows, at least.
_UNDONE = 8
#: Other examples of a class, and windows of an example, that a check uses, at most.
_CHECKED, _WINDOWS = 5, 60


@dataclass(frozen=True, slots=True, eq=False)
class Example:
    """One example of a class.

    Attributes
    ----------
    number
        Counted from 1 over all examples ever taught in a library; the order of the classes follows it.
    class_name
        The example's class.
    recording
        The whole recording, over the library's joints; its actor is the performer.
    begin, end
        The part of the recording that is kept, seconds from its beginning.
    """

    number: int
    class_name: str
    recording: Clip = field(repr=False)
    begin: float
    end: float

    @property
    def seconds(self) -> float:
        """Seconds of the part that is kept."""
        return self.end - self.begin

    @property
    def motion(self) -> Clip:
        """The part that is kept, as a library's motion."""
        first = max(math.floor(self.begin * self.recording.frame_rate), 0)
        last = math.ceil(self.end * self.recording.frame_rate) + 1
        return replace(
            self.recording,
            positions=self.recording.positions[first:last],
            class_name=self.class_name,
            take=f"{self.number:04d}",
            name=f"{self.class_name} {self.number}",
        )


@dataclass(frozen=True, slots=True, eq=False)
class Roster:
    """All examples, and the classes that are answered.

    Attributes
    ----------
    examples
        In the order in which they were taught.
    disabled
        Classes, taught or not, that are not answered for now.
    """

    examples: tuple[Example, ...] = ()
    disabled: frozenset[str] = frozenset()

    @property
    def classes(self) -> tuple[str, ...]:
        """Taught classes, in the order of their first examples."""
        return tuple(dict.fromkeys(each.class_name for each in sorted(self.examples, key=lambda each: each.number)))

    @property
    def next_number(self) -> int:
        """The number of the next example."""
        return max((each.number for each in self.examples), default=0) + 1

    def of(self, class_name: str) -> tuple[Example, ...]:
        """Give the examples of a class."""
        return tuple(each for each in self.examples if each.class_name == class_name)

    def with_example(self, example: Example) -> "Roster":
        """Add an example; it replaces an example of the same number."""
        others = (each for each in self.examples if each.number != example.number)
        return replace(self, examples=(*others, example))

    def renamed(self, old: str, new: str) -> "Roster":
        """Rename a class; two classes that get the same name become one."""
        examples = tuple(replace(each, class_name=new) if each.class_name == old else each for each in self.examples)
        return Roster(examples, frozenset(new if name == old else name for name in self.disabled))

    def without_class(self, class_name: str) -> "Roster":
        """Forget a class."""
        kept = tuple(each for each in self.examples if each.class_name != class_name)
        return Roster(kept, self.disabled - {class_name})

    def enabled(self, class_name: str, *, on: bool) -> "Roster":
        """Answer a class, or stop answering it."""
        return replace(self, disabled=self.disabled - {class_name} if on else self.disabled | {class_name})

    def library(self) -> MotionLibrary | None:
        """Give the examples as a library, disabled classes among them; None when there are none."""
        return MotionLibrary.of_clips([each.motion for each in self.examples]) if self.examples else None

    @classmethod
    def of_library(cls, library: MotionLibrary) -> "Roster":
        """Take a library's motions as examples, in the order of their takes' numbers if these are numbers."""
        numbered = enumerate(sorted(library.motions, key=_number), start=1)
        return cls(tuple(Example(number, each.class_name, each, 0.0, each.duration) for number, each in numbered))


def _number(motion: Clip) -> float:
    return float(motion.take) if motion.take.isdecimal() else math.inf


class TaughtWindows:
    """Opens rosters for recognition; the windows of each example are computed once.

    Parameters
    ----------
    base
        Windows in whose metrics examples are compared. None: the examples learn their own metrics, each time.
    with_base
        Whether the base's own motions take part in comparisons.
    either_side
        Whether each example counts as done by the other side, too.
    """

    def __init__(self, base: WindowIndex | None, *, with_base: bool, either_side: bool = False) -> None:
        self._base, self._with_base, self._either_side = base, with_base, either_side
        self._everything = base
        self._known: dict[tuple[str, float, float, int], tuple[Clip, ...]] = {}
        #: What is unknown, as so many examples taught it.
        self._judged: tuple[int, Rejection | None] = 0, None
        #: The motions of the last courses, those called `nothing`, and the courses.
        self._cut: tuple[Sequence[Clip], Sequence[Clip], Courses | None] = (), (), None

    @property
    def base_classes(self) -> tuple[str, ...]:
        """Classes that are known without examples."""
        return self._base.library.classes if self._base and self._with_base else ()

    @property
    def courses(self) -> Courses | None:
        """The courses of the roster that was opened last; None where examples learn their own metrics."""
        return self._cut[2]

    def index_of(self, roster: Roster) -> WindowIndex | None:
        """Open a roster; None when there is no motion to compare with, or none but `nothing`."""
        enabled = [each for each in roster.examples if each.class_name not in roster.disabled]
        if not self.base_classes and all(each.class_name == NOTHING for each in enabled):
            return None
        if self._base is None:
            motions = self._shown([each.motion for each in enabled])
            return WindowIndex.of(MotionLibrary.of_clips(motions)) if motions else None
        if len(self._known) > 2 * len(enabled) + _UNDONE:
            # Examples that were undone take room; the others are computed again.
            self._known.clear()
            self._everything = self._base
        new = [each for each in enabled if _key(each) not in self._known]
        if new and self._everything is not None:
            # One person is enough: all performers' examples of a class count as one person's.
            motions = self._shown([replace(each.motion, actor="") for each in new])
            before = {id(motion) for motion in self._everything.library.motions}
            self._everything = self._everything.with_motions(motions, every=EVERY)
            added = [each for each in self._everything.library.motions if id(each) not in before]
            for each in new:
                own = each.class_name, each.motion.take
                self._known[_key(each)] = tuple(one for one in added if (one.class_name, _taught_as(one)) == own)
        return self._selected(roster, enabled)

    def _shown(self, motions: Sequence[Clip]) -> list[Clip]:
        """Give motions, and where they may be done by either side their mirrored copies."""
        return [*motions, *map(mirrored, motions)] if self._either_side else [*motions]

    def _selected(self, roster: Roster, enabled: Sequence[Example]) -> WindowIndex | None:
        assert self._everything is not None and self._base is not None  # noqa: S101, PT018 - for mypy
        wanted = {id(motion) for each in enabled for motion in self._known[_key(each)]}
        if self._with_base:
            wanted |= {id(motion) for motion in self._base.library.motions if motion.class_name not in roster.disabled}
        places = [place for place, motion in enumerate(self._everything.library.motions) if id(motion) in wanted]
        if not np.isin(self._everything.motions, places).any():
            return None
        index = self._everything.of_some(places)
        # What is unknown was learned from the base's strangers; without its motions it is learned from the examples.
        index.rejection = self._base.rejection if self._with_base else self._learned(index, len(enabled))
        index.courses = self._courses(index)
        return index.prepared()

    def _courses(self, index: WindowIndex) -> Courses:
        """Give an index's courses; further examples of `nothing` lower limits and change no more, which is quick."""
        compared = index.library.motions
        motions = [compared[place] for place in np.unique(index.motions).tolist()]
        named = [each for each in motions if each.class_name != NOTHING]
        unwanted = [each for each in motions if each.class_name == NOTHING]
        before, known, courses = self._cut
        is_same = len(before) == len(named) and all(map(operator.is_, before, named))
        new = [each for each in unwanted if not any(each is other for other in known)]
        if courses is None or not is_same or len(unwanted) - len(new) < len(known):
            courses = index.courses
        elif new:
            courses = courses.lowered(new)
        self._cut = named, unwanted, courses
        return courses

    def _learned(self, index: WindowIndex, examples: int) -> Rejection:
        """Learn what is unknown from so many examples; learning is slow, and among many a few more do not matter."""
        count, rejection = self._judged
        if rejection is None or examples < _MANY or abs(examples - count) > _FEW * examples:
            rejection = index.rejection
            self._judged = examples, rejection
        return rejection


def _taught_as(motion: Clip) -> str:
    """Give the take of the example that a motion is, or whose mirrored copy it is."""
    return motion.take.partition(" ")[0]


def _key(example: Example) -> tuple[str, float, float, int]:
    return example.class_name, example.begin, example.end, example.number


class Check(NamedTuple):
    """How well an example differs from other classes, and how like its own class it is.

    Attributes
    ----------
    share_at_risk
        Share of its windows that another class wins, with the example itself left out.
    nearest
        The class that wins most of these windows, else the nearest class; empty when there is no other.
    to_own
        Its distance to its class's other examples, relative to theirs from each other; NaN when there are none.
    is_first
        Whether its class has no other example: then nothing but other classes can win.
    is_held
        Whether it is an example of `nothing` that holds the nearest class.
    """

    share_at_risk: float
    nearest: str
    to_own: float
    is_first: bool = False
    is_held: bool = False

    @property
    def words(self) -> str:
        """The result in words."""
        if self.is_held:
            return f"{self.nearest} is in it: undo it, and move without your gestures"
        is_near, is_alike = (bool(self.nearest) and self.share_at_risk > share for share in (_GOOD, _ALIKE))
        change = f": {_CHANGE_OF_NOTHING if self.nearest == NOTHING else _CHANGE}" if is_alike else ""
        if self.is_first:
            near = f"; the nearest class is {self.nearest}{change}" if is_near else ""
            return f"good so far: show it again to be sure{near}"
        if is_near:
            return f"cannot be told from {self.nearest}{change}" if is_alike else f"close to {self.nearest}"
        if self.to_own > _UNLIKE:
            return "unlike your other examples: show it as you will do it, or undo it"
        return "good"


def checked(index: WindowIndex, number: int) -> Check | None:
    """Let an example's windows ask the other motions.

    A window is at risk when another class is nearer than the class's other examples. If there are none, it is at risk
    when another class is as near as two people in the same motion are to each other.

    Parameters
    ----------
    index
        An opened roster (`TaughtWindows`).
    number
        The example's number.

    Returns
    -------
    The check; None when the example is not among the motions of the index.
    """
    motions = index.library.motions
    numbered = (place for place, each in enumerate(motions) if each.take == f"{number:04d}")
    place = next((each for each in numbered if motions[each].name == f"{motions[each].class_name} {number}"), None)
    if place is None or place not in index.motions:
        return None
    own = index.classes.index(motions[place].class_name)
    distances = _left_out(index, place)
    others = distances.copy()
    others[:, own] = np.inf
    nearest = others.argmin(axis=1)
    alone = not np.isfinite(distances[:, own]).any()
    typical = float(index.rejection.typical[: len(index.comparison.weighing.groups)].mean())
    limit = np.full(len(distances), typical) if alone else distances[:, own]
    risky = others.min(axis=1) < limit
    votes = np.bincount(nearest[risky] if risky.any() else nearest, minlength=len(index.classes))
    known = np.isfinite(others.min(axis=1)).any()
    return Check(
        share_at_risk=float(risky.mean()),
        nearest=index.classes[int(votes.argmax())] if known else "",
        to_own=math.nan if alone else _likeness(index, place, own, distances[:, own]),
        is_first=alone,
    )


def held(before: Courses | None, index: WindowIndex) -> Check | None:
    """Find a gesture that a new example of `nothing` holds, by the courses before it; None where there is none."""
    now = index.courses
    if before is None or (before.classes, before.limits.shape) != (now.classes, now.limits.shape):
        return None
    fallen = np.flatnonzero(now.limits[0] < _HELD * before.limits[0])
    if not len(fallen):
        return None
    place = int(now.starts.searchsorted(fallen[0], side="right")) - 1
    return Check(share_at_risk=1.0, nearest=now.classes[place], to_own=math.nan, is_held=True)


def _likeness(index: WindowIndex, place: int, own: int, distances: NDArray[np.float64]) -> float:
    """Compare an example's distance to its class with the distance of the class's other examples."""
    motions = index.library.motions
    name = motions[place].class_name
    copies = _copies(index, place)
    same = [each for each in np.unique(index.motions).tolist() if motions[each].class_name == name]
    others = [each for each in same if each not in copies]
    usual = [float(np.median(_left_out(index, each)[:, own])) for each in others[-_CHECKED:]]
    finite = [each for each in usual if math.isfinite(each)]
    if len(finite) < 2:
        return math.nan
    # Logarithms of squared distances.
    return math.exp((float(np.median(distances)) - float(np.median(finite))) / 2)


def _copies(index: WindowIndex, place: int) -> list[int]:
    """Give the places of a motion and of its mirrored copy, which is no other example."""
    of = [(each.class_name, each.actor, _taught_as(each)) for each in index.library.motions]
    return [number for number, each in enumerate(of) if each == of[place]]


def _left_out(index: WindowIndex, place: int) -> NDArray[np.float64]:
    """Give the log distances of each class to some windows of a motion that is left out, shape (windows, classes)."""
    mine, asking = np.isin(index.motions, _copies(index, place)), index.motions == place
    windows = np.flatnonzero(asking)
    windows = windows[:: max(-(-len(windows) // _WINDOWS), 1)]
    logs, weighing = (index.asked_by(window, mine) for window in windows.tolist()), index.comparison.weighing
    return np.array([named_and_alone(each, weighing)[0] for each in logs])
