"""The beginning of teaching: the file of taught motions, opened with a library or alone."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np

from kinespace.library.clip import Clip
from kinespace.library.motion_library import MIN_JOINTS, NOTHING, MotionLibrary
from kinespace.library.skeleton import Skeleton
from kinespace.library.teaching.examples import Roster, TaughtWindows
from kinespace.library.teaching.movement import STILLNESS
from kinespace.library.windows.index import WindowIndex, opened, teaches_itself
from kinespace.stream.recognizer import Performers
from kinespace.stream.teaching import Teacher
from kinespace.tools.teaching.lessons import ClassPlaces, Lessons
from kinespace.tools.teaching.roster_file import RosterFile
from kinespace.tools.terminal.console import say

#: The share of a feed's joints, or of HDM05's, that both must have for HDM05's metrics to compare the examples: a hand
#: with twenty bones has neither.
_ENOUGH = 0.5


def open_lessons(
    file: Path,
    library: MotionLibrary | None,
    joints: Sequence[str],
    performers: Callable[[WindowIndex, Sequence[str]], Performers],
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
        Movement below which a performer stands still (`library.teaching.movement`).
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
        index = windows.index_of(roster) or base or WindowIndex.of(_any_motion(joints))
        teacher = Teacher(index.library.skeleton, roster, windows.base_classes, stillness)
        order = ClassPlaces(windows.base_classes).of(roster)
        lessons = Lessons(performers(index, order or index.classes), teacher, windows, kept)
        failing.pop_all()
    return lessons


def open_taught(taught: MotionLibrary, without: Collection[str] = ()) -> WindowIndex:
    """Open taught motions alone, as a file of them is opened without a library.

    Parameters
    ----------
    taught
        The examples.
    without
        Persons of the built-in library whose motions teach no metric: for measuring, with motions of theirs.

    Raises
    ------
    ValueError
        No motion is long enough for a window.
    """
    base = _base(None, taught, (), without)
    index = TaughtWindows(base, with_base=False).index_of(_roster_of(taught, base))
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
        say(f"taught motions are compared by {shared} of {len(joints)} joints, without {', '.join(left_out)}")
    # One motion is no teacher of its own: as in a library's file, the built-in persons' metrics compare, by all axes.
    one = replace(builtin, motions=builtin.motions[:1], learned=None).restricted_to(joints)
    return WindowIndex.of(one, builtin.without(actors=without).restricted_to(joints)) if without else opened(one)


def _any_motion(joints: Sequence[str]) -> MotionLibrary:
    """Make a library of joints without taught motions: recognisers need a library, but are not asked with this one."""
    generator = np.random.default_rng(0)
    positions = np.cumsum(generator.normal(0, 0.05, (60, len(joints), 3)), axis=0)
    return MotionLibrary.of_clips([Clip(Skeleton(tuple(joints)), positions, 30.0, class_name=NOTHING)])
