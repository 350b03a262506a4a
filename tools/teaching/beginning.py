"""The beginning of teaching: the file of taught motions, opened with a library or alone."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from kinespace.library.clip import Clip
from kinespace.library.motion_library import NOTHING, MotionLibrary
from kinespace.library.skeleton import Skeleton
from kinespace.library.teaching.examples import Roster, TaughtWindows
from kinespace.library.teaching.movement import STILLNESS
from kinespace.library.windows.index import WindowIndex, opened
from kinespace.stream.teaching import Teacher
from kinespace.tools.teaching.lessons import ClassPlaces, Lessons
from kinespace.tools.teaching.roster_file import RosterFile

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from kinespace.stream.workers.gateway import Recognising


def open_lessons(
    file: Path,
    library: MotionLibrary | None,
    joints: Sequence[str],
    performers: Callable[[WindowIndex, Sequence[str]], Recognising],
    stillness: float = STILLNESS,
    *,
    recordings: Path | None = None,
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
    recordings
        The folder of recordings that examples may be taken from; None for none.
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
    try:
        return _opened(kept, library, joints, performers, stillness, recordings=recordings, either_side=either_side)
    except BaseException:
        kept.close()
        raise


def _opened(
    file: RosterFile,
    library: MotionLibrary | None,
    joints: Sequence[str],
    performers: Callable[[WindowIndex, Sequence[str]], Recognising],
    stillness: float,
    *,
    recordings: Path | None,
    either_side: bool,
) -> Lessons:
    taught = file.library
    base = _base(library, taught.skeleton.joints if taught else (), joints)
    if taught and base:
        taught = taught.restricted_to(base.library.skeleton.joints)
        motions = tuple(motion.as_of(base.library.skeleton) for motion in taught.motions)
        taught = MotionLibrary(base.library.skeleton, motions)
    roster = Roster.of_library(taught) if taught else Roster()
    windows = TaughtWindows(base, with_base=library is not None, either_side=either_side)
    index = windows.index_of(roster) or base or WindowIndex.of(_any_motion(joints))
    teacher = Teacher(index.library.skeleton, roster, windows.base_classes, stillness)
    order = ClassPlaces(windows.base_classes).of(roster)
    return Lessons(performers(index, order or index.classes), teacher, windows, file, recordings=recordings)


def _base(library: MotionLibrary | None, taught: Sequence[str], joints: Sequence[str]) -> WindowIndex | None:
    """Open the windows whose metrics compare the examples, by the joints taught or, else, known.

    None when the examples learn their own metrics.
    """
    if library:
        return opened(library.restricted_to(taught) if taught else library)
    builtin = MotionLibrary.builtin()
    # The numbers learned from the built-in motions make opening quick; those of other motions are left out.
    builtin = replace(builtin, learned=builtin.learned and builtin.learned.of_these_motions())
    joints = taught or joints or builtin.skeleton.joints
    return opened(builtin.restricted_to(joints)) if set(joints) <= set(builtin.skeleton.joints) else None


def _any_motion(joints: Sequence[str]) -> MotionLibrary:
    """Make a library of joints without taught motions: recognisers need a library, but are not asked with this one."""
    generator = np.random.default_rng(0)
    positions = np.cumsum(generator.normal(0, 0.05, (60, len(joints), 3)), axis=0)
    return MotionLibrary.of_clips([Clip(Skeleton(tuple(joints)), positions, 30.0, class_name=NOTHING)])
