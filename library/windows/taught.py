"""What a library's motions teach: the basis, the metrics, and what helps to name the classes that taught.

A library's file may keep basis and metrics, so that opening the library need not learn them from its motions.
"""

import zlib
from collections import Counter
from dataclasses import replace
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from kinespace.library.distances import distance_rows
from kinespace.library.library_file import TAUGHT, Learned
from kinespace.library.motion_library import MotionLibrary
from kinespace.library.signature.basis import MAX_DIRECTIONS, Basis
from kinespace.library.signature.body import Body
from kinespace.library.signature.parts import Kind
from kinespace.library.windows.comparer import Head
from kinespace.library.windows.comparison import (
    ACROSS_LABORATORIES,
    MAX_AXES,
    WITHIN_LABORATORY,
    Comparison,
    Metric,
    Weighing,
)
from kinespace.library.windows.cutting import EVERY_SEVERAL, Cut, Measured, cut_windows, thinned

#: Raised when basis or metrics are learned in another way: numbers of another version are learned again.
_VERSION = 1
#: The weighings whose metrics are kept, by the beginning of their arrays' names.
WEIGHINGS = {"across": ACROSS_LABORATORIES, "within": WITHIN_LABORATORY}
#: The name of the array that identifies the motions that taught.
_BY = f"{TAUGHT}by"
#: The beginning of the names of the basis's arrays.
_BASIS = f"{TAUGHT}basis "


#: Frames per second at which the basis is learned.
_BASIS_AT = 10.0
#: Windows from which metrics are learned, at most.
_MAX_LESSONS = 10_000
#: Windows behind other motions that teach a head, at most: they take some tenths of a second.
_MAX_BEHIND = 1000
#: Motions of each class that teach a head, at least: by six, lying down and getting up were told apart 70 % of the time
#: in place of 80.
_LEAST_OF_CLASS = 8
#: Persons needed to learn metrics: with fewer, metrics are learned from the built-in library's persons.
_TEACHERS = 3


def taught_by(
    teacher: MotionLibrary, weighing: Weighing, *, names: bool = False
) -> tuple[Basis, Comparison, Head | None, Cut | None]:
    """Give what a library teaches: as its file keeps it, or learned from its motions.

    Parameters
    ----------
    teacher, weighing
        The motions, and the groups of parts that are compared.
    names
        Whether the motions are named by what they taught, so that a head may help.

    Returns
    -------
    How windows are computed and compared; what helps to name the classes that taught it, None where too few motions
    did; and the windows that taught. The last two are None where basis and metrics are read from the library's file.
    """
    if kept := kept_of(teacher, weighing):
        return *kept, None, None
    basis = learned_basis(teacher, weighted=not weighing.as_in_paper)
    lessons = Measured.of(teacher, EVERY_SEVERAL, weighing.first).thinned(_MAX_LESSONS)
    cut = cut_windows(lessons.clips, lessons.ends, Body.of(teacher.skeleton), basis, weighing)
    comparison = Comparison.learned(weighing, cut[0], _whose(teacher)[lessons.motions])
    # Only where all parts have one metric is the library's laboratory that of the feed.
    if names and _has_head(teacher) and None not in comparison.groups:
        return basis, comparison, _learned_head(teacher, basis, comparison, lessons, cut), cut
    return basis, comparison, None, cut


def usual_weighing(library: MotionLibrary) -> Weighing:
    """Choose the weighing: between laboratories for numbers learned from another laboratory, else within one."""
    return ACROSS_LABORATORIES if library.judged_by_strangers else WITHIN_LABORATORY


def teacher_of(library: MotionLibrary) -> MotionLibrary:
    """Choose the library from whose persons the metrics are learned.

    A library teaches itself when three or more of its persons share classes. Otherwise the built-in library teaches, if
    it has all joints; if it lacks some, the library teaches itself as well as it can.
    """
    if teaches_itself(library):
        return library
    builtin = MotionLibrary.builtin()
    if set(library.skeleton.joints) <= set(builtin.skeleton.joints):
        taught, skeleton = builtin.restricted_to(library.skeleton.joints), library.skeleton
        if taught.skeleton.joints == skeleton.joints:
            return taught
        motions = tuple(clip.as_of(skeleton) for clip in taught.motions)
        return replace(taught, skeleton=skeleton, motions=motions)
    return library


def teaches_itself(library: MotionLibrary) -> bool:
    """Whether so many persons of a library share classes that its metrics are learned from them."""
    performed = {(clip.class_name, clip.actor) for clip in library.motions if clip.actor}
    people = {actor for _, actor in performed}
    return len(people) >= _TEACHERS and len(performed) > len({class_name for class_name, _ in performed})


def learned_basis(library: MotionLibrary, *, weighted: bool = True) -> Basis:
    """Learn the basis from a library's motions."""
    by_class = groupby(library.motions, key=lambda clip: clip.class_name)
    rows = ((thinned(clip, _BASIS_AT) for clip in clips) for _, clips in by_class)
    measured = ((distance_rows(clip.positions, clip.skeleton) for clip in clips) for clips in rows)
    return Basis.learned(measured, Body.of(library.skeleton), weighted=weighted)


def _whose(library: MotionLibrary) -> NDArray[np.intp]:
    """Give each motion's class and person, as numbers, shape (motions, 2)."""
    named = zip(*((clip.class_name, clip.actor) for clip in library.motions), strict=True)
    return np.array([np.unique(each, return_inverse=True)[1] for each in named]).T


def _has_head(library: MotionLibrary) -> bool:
    """Say whether a library of several persons has motions enough for a head: it knows a few by heart, and errs."""
    classes = Counter(motion.class_name for motion in library.motions)
    return teaches_itself(library) and min(classes.values()) >= _LEAST_OF_CLASS


def _learned_head(library: MotionLibrary, basis: Basis, comparison: Comparison, lessons: Measured, cut: Cut) -> Head:
    """Learn a head from the windows that taught the metrics, and from the same behind other motions."""
    behind = lessons.behind_others().thinned(_MAX_BEHIND)
    windows = (cut, *behind.cut(comparison.weighing, Body.of(library.skeleton), basis))
    vectors = [np.concatenate([*comparison.placed(numbers).values()], axis=1) for numbers, _ in windows]
    motions = np.concatenate([lessons.motions, behind.motions]).tolist()
    return Head.learned(np.concatenate(vectors), [library.motions[place].class_name for place in motions])


# --- in a library's file ----------------------------------------------------------------------------------------------


def kept_of(teacher: MotionLibrary, weighing: Weighing) -> tuple[Basis, Comparison] | None:
    """Give the basis and metrics in a library's file; None if it has none for this weighing and these motions.

    Raises
    ------
    ValueError
        The file keeps an array of another shape, or more directions or axes than are ever learned.
    """
    learned = teacher.learned
    name = next((name for name, each in WEIGHINGS.items() if each == weighing), None)
    if name is None or _BY not in learned or not np.array_equal(learned[_BY], _taught_by(teacher)):
        return None
    pairs = len(teacher.skeleton.pairs)
    directions = _array(learned, f"{_BASIS}directions", pairs, MAX_DIRECTIONS)
    weights, share = _array(learned, f"{_BASIS}weights", pairs), _array(learned, f"{_BASIS}share", 1)
    count = directions.shape[1]
    parts = {
        part: _metric(learned, f"{name} {part.name}", count * (count + 1) // 2 if part.kind is Kind.EIGEN else pairs)
        for part in weighing.measured
    }
    groups = tuple(
        _metric(learned, f"{name} group {place}", sum(parts[part].axes.shape[1] for part in group))
        if len(group) > 1
        else None
        for place, group in enumerate(weighing.groups)
    )
    return Basis.of(directions, weights, float(share[0])), Comparison(weighing, parts, groups)


def keeping_lessons(library: MotionLibrary) -> MotionLibrary:
    """Give a library that keeps the basis and the metrics that its own motions teach, so that it opens sooner."""
    learned = dict(library.learned)
    for name, weighing in WEIGHINGS.items():
        basis, comparison, *_ = taught_by(library, weighing)
        numbers = {"directions": basis.directions, "weights": basis.weights, "share": np.array([basis.share])}
        # Both weighings have one basis.
        learned |= {f"{_BASIS}{name}": array.astype(np.float32) for name, array in numbers.items()}
        metrics = {f"{name} {part.name}": metric for part, metric in comparison.parts.items()}
        metrics |= {f"{name} group {place}": each for place, each in enumerate(comparison.groups) if each}
        for each, metric in metrics.items():
            learned |= {f"{TAUGHT}{each} origin": metric.origin, f"{TAUGHT}{each} axes": metric.axes}
    return replace(library, learned=learned | {_BY: _taught_by(library)})


def _metric(learned: Learned, name: str, numbers: int) -> Metric:
    begin = f"{TAUGHT}{name}"
    return Metric(_array(learned, f"{begin} origin", numbers), _array(learned, f"{begin} axes", numbers, MAX_AXES))


def _array(learned: Learned, name: str, rows: int, most: int | None = None) -> NDArray[np.float32]:
    """Give an array of shape (rows,), or with up to so many columns."""
    array = learned.get(name)
    shape = () if array is None else array.shape
    fits = shape == (rows,) if most is None else len(shape) == 2 and shape[0] == rows and 1 <= shape[1] <= most
    if array is None or not fits:
        expected = f"({rows},)" if most is None else f"({rows}, at most {most})"
        raise ValueError(f"{name}: expected {expected} numbers, got {shape or 'none'}")
    return array


def _taught_by(library: MotionLibrary) -> NDArray[np.float32]:
    """Identify the motions that taught, by numbers that single precision holds exactly."""
    described = [library.skeleton.joints, *((each.class_name, each.actor, each.frame_rate) for each in library.motions)]
    checksum = zlib.crc32(repr(described).encode())
    for motion in library.motions:
        # A file holds millimetres.
        checksum = zlib.crc32(np.round(motion.positions.astype(np.float64), 3).tobytes(), checksum)
    return np.array([_VERSION, len(library.motions), checksum >> 16, checksum & 0xFFFF], dtype=np.float32)
