"""The motion library: motions of one skeleton, by class and person. Everything that a comparison needs is computed."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from importlib import resources
from pathlib import Path

import numpy as np

from kinespace.library import library_file
from kinespace.library.clip import Clip
from kinespace.library.distances import distance_rows
from kinespace.library.library_file import Learned, for_other_motions
from kinespace.library.naming import Naming, hdm05
from kinespace.library.skeleton import Skeleton, SkeletonMismatchError

#: The class of motions that compete like any other class and are answered "unknown".
NOTHING = "nothing"
#: With fewer joints postures can hardly be distinguished.
MIN_JOINTS = 5
#: Frames per second of a motion, at least.
MIN_FRAME_RATE = 1.0
#: Frames per second of a motion, at most.
MAX_FRAME_RATE = 75.0
#: Metres by which rounding positions to whole millimetres changes a distance, at most: this is no movement.
_ROUNDING = 0.0035


@dataclass(frozen=True, slots=True, eq=False)
class MotionLibrary:
    """Motions of one skeleton, sorted by class and, within a class, by person; otherwise in the given order.

    Attributes
    ----------
    skeleton
        The skeleton of all motions; with parents where the recordings name them.
    motions
        Positions in metres, rounded to whole millimetres; 1 to 75 frames per second.
    learned
        Numbers learned from people for comparing motions, by name; empty when nothing was learned.

    Raises
    ------
    ValueError
        There is no motion; or a motion has no class name, fewer than two frames, or another frame rate.
    SkeletonMismatchError
        Fewer than five joints, or a motion with other joints.
    """

    skeleton: Skeleton
    motions: tuple[Clip, ...] = field(repr=False)
    learned: Learned = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        if not self.motions:
            raise ValueError("motions: expected at least one, got none")
        if len(self.skeleton.joints) < MIN_JOINTS:
            raise SkeletonMismatchError(f"joints: expected at least {MIN_JOINTS}, got {len(self.skeleton.joints)}")
        for clip in self.motions:
            self._check(clip)
        object.__setattr__(self, "motions", tuple(sorted(self.motions, key=lambda each: (each.class_name, each.actor))))

    def _check(self, motion: Clip) -> None:
        if motion.skeleton is not self.skeleton:
            self.skeleton.require_same(motion.skeleton)
        if not motion.class_name:
            raise ValueError(f"class_name: expected a class name for clip {motion.name!r}, got none")
        if motion.frames < 2:
            raise ValueError(f"clip {motion.name!r}: expected at least 2 frames, got {motion.frames}")
        if not MIN_FRAME_RATE <= motion.frame_rate <= MAX_FRAME_RATE:
            rates = f"{MIN_FRAME_RATE:g} to {MAX_FRAME_RATE:g} frames per second, got {motion.frame_rate:g}"
            raise ValueError(f"clip {motion.name!r}: expected {rates}")

    @classmethod
    def of_clips(cls, clips: Iterable[Clip]) -> MotionLibrary:
        """Make a library of clips; each becomes one motion.

        Joints get the first clip's order, or HDM05's order if they are HDM05's joints. Of clips with more than 75
        frames per second every second, third ... frame is kept, so that at most 75 remain: of 120 remain 60.

        Parameters
        ----------
        clips
            Clips with the same joints, in any order.

        Raises
        ------
        ValueError
            There is no clip, something else than clips is given, or a clip has no class name, too few frames, no
            movement, or joints more than a kilometre away.
        SkeletonMismatchError
            The clips differ in their joints, or have fewer than five.
        """
        given = _clips(clips)
        if not given:
            raise ValueError("clips: expected at least one, got none")
        skeleton = _in_canonical_order(given[0].skeleton)
        return cls(skeleton, tuple(_as_motion(clip, skeleton) for clip in given))

    @classmethod
    @cache
    def builtin(cls) -> MotionLibrary:
        """Load the library of 288 HDM05 motions that comes with kinespace (CC BY-SA 3.0); always the same object."""
        with resources.as_file(resources.files("kinespace.library") / "hdm05.npz") as path:
            return cls.load(path)

    @classmethod
    def load(cls, path: Path | str) -> MotionLibrary:
        """Read a library's file.

        Raises
        ------
        LibraryFileError
            The file is cut short, foreign, of another version, inconsistent or absurdly large.
        OSError
            The file cannot be opened.
        """
        contents = library_file.read(Path(path))
        try:
            return cls(*contents)
        except ValueError as error:
            raise library_file.LibraryFileError(f"{path}: not a usable motion library ({error})") from error

    def save(self, path: Path | str, *, compressed: bool = True) -> None:
        """Write one file, atomically.

        Parameters
        ----------
        path
            The file; replaced when it exists.
        compressed
            Whether the file is small. A file that is not has the same bytes on every machine, and is written at once.

        Raises
        ------
        ValueError
            The library is larger than a file may be, or another program teaches there.
        OSError
            The folder cannot be written.
        """
        with library_file.locked(Path(path)):
            library_file.write(Path(path), self.contents, compressed=compressed)
            library_file.beside(Path(path), "new").unlink(missing_ok=True)

    @property
    def contents(self) -> library_file.Contents:
        """What its file holds."""
        return self.skeleton, self.motions, self.learned

    def __len__(self) -> int:
        return len(self.motions)

    @property
    def classes(self) -> tuple[str, ...]:
        """Class names, sorted, without `NOTHING`; empty in a library that holds only that class."""
        return tuple(sorted({motion.class_name for motion in self.motions} - {NOTHING}))

    @property
    def actors(self) -> tuple[str, ...]:
        """Names of the persons, sorted; empty where the recordings do not say who performs."""
        return tuple(sorted({motion.actor for motion in self.motions} - {""}))

    @property
    def judged_by_strangers(self) -> bool:
        """Whether numbers learned from other people's motions distinguish unknown motion from known."""
        return bool(for_other_motions(self.learned))

    @property
    def licence(self) -> str:
        """Terms under which the motions may be passed on, each once; empty where none are known."""
        return _joined(motion.licence for motion in self.motions)

    @property
    def attribution(self) -> str:
        """The authors to name with the motions, each once; empty where none are known."""
        return _joined(motion.attribution for motion in self.motions)

    def with_motions(self, clips: Iterable[Clip]) -> MotionLibrary:
        """Add clips, each as one motion; `learned` stays.

        Raises
        ------
        ValueError
            A clip has no class name, too few frames, no movement, or joints more than a kilometre away.
        SkeletonMismatchError
            A clip has other joints than the library.
        """
        added = (_as_motion(clip, self.skeleton) for clip in _clips(clips))
        return self._of(self.skeleton, (*self.motions, *added))

    def without(
        self, *, classes: Collection[str] = (), actors: Collection[str] = (), motions: Collection[Clip] = ()
    ) -> MotionLibrary:
        """Leave out some classes, some persons and some of `motions` themselves.

        Raises
        ------
        ValueError
            A class, a person or a motion is not in this library, a parameter is one text, or no motion would be left.
        """
        held = {motion.class_name for motion in self.motions}
        _require_known(classes, held, "classes")
        _require_known(actors, self.actors, "actors")
        if any(motion not in self.motions for motion in motions):
            raise ValueError("motions: expected some of this library's own, got another")
        left = tuple(
            motion
            for motion in self.motions
            if not (motion.class_name in classes or motion.actor in actors or motion in motions)
        )
        return self._of(self.skeleton, left)

    def renamed(self, names: Mapping[str, str]) -> MotionLibrary:
        """Rename classes; two classes that get the same name become one.

        Raises
        ------
        ValueError
            A class is not in this library, or its new name is empty.
        """
        _require_known(names, {motion.class_name for motion in self.motions}, "classes")
        changed = (replace(each, class_name=names.get(each.class_name, each.class_name)) for each in self.motions)
        return self._of(self.skeleton, tuple(changed))

    def in_our_names(self, naming: Naming) -> MotionLibrary:
        """Give the same motions with our names for the joints, where a convention fits."""
        named = naming.read(self.skeleton.joints).joints
        if named == self.skeleton.joints:
            return self
        skeleton = _in_canonical_order(replace(self.skeleton, joints=named))
        renamed = (replace(clip, skeleton=replace(clip.skeleton, joints=named)) for clip in self.motions)
        return self._of(skeleton, _over(skeleton, renamed))

    def restricted_to(self, joints: Collection[str]) -> MotionLibrary:
        """Give the same motions as a body with fewer joints shows them.

        Parameters
        ----------
        joints
            Names of the joints that a body has; names that this library lacks are ignored.

        Returns
        -------
        A library over the shared joints, in this library's order; this library itself when it has no other joints.

        Raises
        ------
        SkeletonMismatchError
            Fewer than five joints are shared.
        """
        names = self.skeleton.joints
        kept = [index for index, name in enumerate(names) if name in joints]
        if len(kept) < MIN_JOINTS:
            given = f"{len(names)} ({names[0]} ... {names[-1]}), got {len(kept)}"
            raise SkeletonMismatchError(f"joints: expected at least {MIN_JOINTS} of the library's {given}")
        if len(kept) == len(names):
            return self
        skeleton = self.skeleton.restricted_to(kept)
        return self._of(skeleton, _over(skeleton, self.motions))

    def merged_with(self, other: MotionLibrary) -> MotionLibrary:
        """Put the motions of two libraries together, over the joints that both have, in this library's order.

        A motion that both have, number for number, is kept once. Where both have learned numbers, this library's are
        kept.

        Raises
        ------
        SkeletonMismatchError
            The libraries share fewer than five joints.
        """
        first = self.restricted_to(other.skeleton.joints)
        second = other.restricted_to(first.skeleton.joints)
        skeleton = first.skeleton
        if not skeleton.parents and second.skeleton.parents:
            skeleton = _reordered(second.skeleton, skeleton.joints)
        motions = _over(skeleton, first.motions)
        known = {_identity(motion) for motion in motions}
        new = (motion for motion in _over(skeleton, second.motions) if _identity(motion) not in known)
        return MotionLibrary(skeleton, (*motions, *new), for_other_motions(self.learned or other.learned))

    def _of(self, skeleton: Skeleton, motions: tuple[Clip, ...]) -> MotionLibrary:
        """Give a library of other motions, with the numbers that hold for them too."""
        return MotionLibrary(skeleton, motions, for_other_motions(self.learned))


def _clips(given: Iterable[Clip]) -> list[Clip]:
    clips = [] if isinstance(given, Clip) else list(given)
    if isinstance(given, Clip) or not all(isinstance(each, Clip) for each in clips):
        raise ValueError(f"clips: expected several Clips, got {type(given).__name__}")
    return clips


def _over(skeleton: Skeleton, motions: Iterable[Clip]) -> tuple[Clip, ...]:
    """Give motions over a skeleton of some of their joints, in the skeleton's order."""
    return tuple(motion.over(skeleton) for motion in motions)


def _in_canonical_order(skeleton: Skeleton) -> Skeleton:
    """Give a skeleton over all pairs, with its joints in HDM05's order if they are HDM05's joints."""
    usual = hdm05.SKELETON.joints
    return _reordered(skeleton, usual if set(skeleton.joints) == set(usual) else skeleton.joints)


def _reordered(skeleton: Skeleton, joints: tuple[str, ...]) -> Skeleton:
    return skeleton.linked(joints) if skeleton.parents else Skeleton(joints)


def _as_motion(clip: Clip, skeleton: Skeleton) -> Clip:
    """Convert a clip to the skeleton, the frame rate and the precision of a library's motions."""
    every = max(1, math.ceil(clip.frame_rate / MAX_FRAME_RATE))
    if clip.frames <= every:
        raise ValueError(f"clip {clip.name!r}: expected at least {every + 1} frames, got {clip.frames}")
    positions = library_file.rounded(clip.as_of(skeleton).positions[::every])
    if (farthest := np.abs(positions).max()) > (most := library_file.MAX_METRES):
        got = f"{farthest:.3g}: millimetres? Divide them by 1000"
        raise ValueError(f"clip {clip.name!r}: expected joints within {most:g} m of the origin, got {got}")
    if np.ptp(distance_rows(positions, skeleton), axis=0).max() <= _ROUNDING:
        raise ValueError(f"clip {clip.name!r}: expected a motion, got a body that does not move")
    positions.setflags(write=False)
    return replace(
        clip,
        skeleton=skeleton,
        positions=positions,
        frame_rate=clip.frame_rate / every,
        # The recording's notes on its frames and times do not apply to the motion cut from it.
        rotations=np.zeros((0, 0)),
        filled=0,
        gaps=(),
    )


def _identity(motion: Clip) -> tuple[object, ...]:
    return motion.class_name, motion.actor, motion.take, motion.frame_rate, motion.positions.tobytes()


def _require_known(names: Iterable[str], known: Collection[str], parameter: str) -> None:
    if isinstance(names, str):
        raise ValueError(f"{parameter}: expected several names, got the text {names!r}")  # noqa: TRY004
    for name in names:
        if name not in known:
            raise ValueError(f"{parameter}: expected some of {', '.join(sorted(known)) or 'none'}, got {name!r}")


def _joined(texts: Iterable[str]) -> str:
    return " / ".join(dict.fromkeys(part for text in texts if text for part in text.split(" / ")))
