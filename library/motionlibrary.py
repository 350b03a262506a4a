"""The motion library: the signatures of many motions, matched by one product."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field, replace
from importlib import resources
from typing import TYPE_CHECKING

import numpy as np

from library import libraryfile, windowfile
from library.aligned import aligned
from library.distances import distance_rows
from library.portrait import Portrait, portraits_of
from library.shortlist import FEWEST_MOTIONS, Shortlist
from library.signature import Moments, Signature, signature_of, similarity
from library.skeleton import Skeleton, SkeletonMismatchError
from library.windowtable import WindowTable

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from library.clip import Clip
    from library.comparison import Comparison


_ARRAYS = ("means", "axes", "deviations")
_PORTRAIT = ("mean", "axes", "harmonics", "phases")
#: Movement relative to the body's size below which an axis is made of rounding errors.
_NO_MOVEMENT = 1e-6


@dataclass(frozen=True, slots=True)
class Motion:
    """One motion of a library: what its source says of it, and its signature's numbers.

    Raises
    ------
    ValueError
        The class name is empty, or a number is not positive and finite.
    """

    class_name: str
    actor: str
    take: str
    frames: int
    frame_rate: float
    eigenvalue: float
    share: float

    def __post_init__(self) -> None:
        if not (isinstance(self.class_name, str) and self.class_name):
            raise ValueError(f"class_name: expected a name, got {self.class_name!r}")
        for name in ("actor", "take"):
            if not isinstance(getattr(self, name), str):
                raise ValueError(f"{name}: expected text, got {getattr(self, name)!r}")  # noqa: TRY004 - a wrong value
        for name in ("frames", "frame_rate", "eigenvalue", "share"):
            number = getattr(self, name)
            if isinstance(number, bool) or not isinstance(number, (int, float)) or not 0 < number < math.inf:
                raise ValueError(f"{name}: expected a positive number, got {number!r}")

    @property
    def duration(self) -> float:
        """Seconds."""
        return self.frames / self.frame_rate


@dataclass(frozen=True, slots=True, eq=False)
class Match:
    """How one window compares with a library.

    Attributes
    ----------
    motion_scores
        Similarity with each motion, shape (motions,).
    class_scores
        Best of each class's motions, shape (classes,), in the order of `MotionLibrary.classes`.
    """

    motion_scores: NDArray[np.floating] = field(repr=False)
    class_scores: NDArray[np.floating] = field(repr=False)


@dataclass(frozen=True, slots=True, eq=False)
class MotionLibrary:
    """Signatures of many motions of one skeleton, grouped by class.

    Motions stand in the order of their classes, and in a class of their actors, so that the best of each is one
    reduction.

    Attributes
    ----------
    skeleton
        Whose pairs the signatures measure.
    classes
        Class names, sorted.
    motions
        One entry per motion, by class and actor, in the given order within those.
    means
        Mean distance rows, shape (motions, pairs), metres, float32.
    axes
        Leading eigenvectors, unit length, shape (motions, pairs), float32.
    deviations
        Standard deviation of each distance, shape (motions, pairs), metres, float32.
    windows
        Windows cut from the motions, for live recognition; None in a library that only keeps whole motions.
    portraits
        For each class what it looks like, or none at all.
    licence, attribution
        Under what terms the numbers may be passed on, and whom to name.

    Raises
    ------
    ValueError
        No motion at all, or arrays or windows that do not fit the motions and pairs.
    """

    skeleton: Skeleton
    motions: tuple[Motion, ...]
    means: NDArray[np.float32] = field(repr=False)
    axes: NDArray[np.float32] = field(repr=False)
    deviations: NDArray[np.float32] = field(repr=False)
    windows: WindowTable | None = field(default=None, repr=False)
    portraits: tuple[Portrait, ...] = field(default=(), repr=False)
    licence: str = ""
    attribution: str = ""
    classes: tuple[str, ...] = field(init=False)
    _class_starts: NDArray[np.intp] = field(init=False, repr=False, compare=False)
    _shortlist: Shortlist | None = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        self._check()
        order = _in_order(self.motions)
        if not np.array_equal(order, np.arange(len(order))):
            self._sort(order)
        classes, starts = np.unique([motion.class_name for motion in self.motions], return_index=True)
        pairs = len(self.skeleton.pairs)
        if self.portraits and [len(each.mean) for each in self.portraits] != [pairs] * len(classes):
            raise ValueError(f"portraits: expected one of {pairs} pairs for each of {len(classes)} classes")
        object.__setattr__(self, "classes", tuple(classes.tolist()))
        object.__setattr__(self, "_class_starts", starts)
        large = len(self) >= FEWEST_MOTIONS
        if not large:
            # Every answer of the eigenvector's reads all of them.
            object.__setattr__(self, "axes", aligned(self.axes))
        object.__setattr__(self, "_shortlist", Shortlist(self.axes, starts) if large else None)

    def _check(self) -> None:
        if not self.motions:
            raise ValueError("motions: expected at least one, got none")
        if not (isinstance(self.licence, str) and isinstance(self.attribution, str)):
            raise ValueError("licence, attribution: expected text")  # noqa: TRY004 - a wrong value
        expected = (len(self.motions), len(self.skeleton.pairs))
        for name in _ARRAYS:
            array: NDArray[np.float32] = getattr(self, name)
            if array.shape != expected:
                raise ValueError(f"{name}: expected shape {expected}, got {array.shape}")
            if not np.isfinite(array).all():
                raise ValueError(f"{name}: expected finite numbers, got NaN or infinity")
        if self.windows is not None and (len(self.windows.classes), self.windows.comparison.pairs) != expected:
            raise ValueError(f"windows: expected those of {expected[0]} motions and {expected[1]} pairs")
        if self.windows is not None and self.windows.comparison.body.parents != self.skeleton.parents:
            raise ValueError(f"windows: expected those of a body with parents {self.skeleton.parents}")

    def _sort(self, order: NDArray[np.intp]) -> None:
        object.__setattr__(self, "motions", tuple(self.motions[index] for index in order))
        for name in _ARRAYS:
            object.__setattr__(self, name, getattr(self, name)[order])

    @classmethod
    def of_clips(
        cls,
        clips: Iterable[Clip],
        *,
        comparison: Comparison | None = None,
        licence: str = "",
        attribution: str = "",
    ) -> MotionLibrary:
        """Build a library from clips; each becomes one motion.

        Parameters
        ----------
        clips
            Of one skeleton.
        comparison
            How windows of the motions are measured and compared; without it none are kept.
        licence, attribution
            Of the numbers.

        Raises
        ------
        ValueError
            There is no clip, or a clip has fewer than two frames, no class name or no movement.
        SkeletonMismatchError
            The clips are not all of one skeleton.
        """
        skeleton: Skeleton | None = None
        motions, signatures = list[Motion](), list[Signature]()
        ordered = sorted(clips, key=lambda clip: (clip.class_name, clip.actor))
        for clip in ordered:
            skeleton = skeleton or clip.skeleton
            skeleton.require_same(clip.skeleton)
            if not clip.class_name:
                raise ValueError(f"clip {clip.name!r}: expected a class name, got none")
            if clip.frames < 2:
                raise ValueError(f"clip {clip.name!r}: expected at least 2 frames, got {clip.frames}")
            signature = signature_of(Moments.of_rows(distance_rows(clip.positions, skeleton)))
            if signature.movement < _NO_MOVEMENT:
                raise ValueError(f"clip {clip.name!r}: expected a motion, got a body that does not move")
            signatures.append(signature)
            motions.append(
                Motion(
                    class_name=clip.class_name,
                    actor=clip.actor,
                    take=clip.take,
                    frames=clip.frames,
                    frame_rate=clip.frame_rate,
                    eigenvalue=signature.axis.value,
                    share=signature.axis.share,
                )
            )
        if skeleton is None:
            raise ValueError("clips: expected at least one, got none")
        windows = WindowTable.of_clips(ordered, comparison) if comparison else None
        return cls(
            # Joints hang together as in the body that windows are measured by, whatever the recordings say.
            skeleton=Skeleton(skeleton.joints, comparison.body.parents) if comparison else skeleton,
            motions=tuple(motions),
            means=np.array([signature.mean for signature in signatures], dtype=np.float32),
            axes=np.array([signature.axis.vector for signature in signatures], dtype=np.float32),
            deviations=np.array([signature.deviation for signature in signatures], dtype=np.float32),
            windows=windows,
            licence=licence,
            attribution=attribution,
        )

    def portrayed(self, clips: Sequence[Clip]) -> MotionLibrary:
        """Add a portrait of each class, by the clips that the library was built from; none without windows."""
        return replace(self, portraits=portraits_of(clips, self.windows) if self.windows else ())

    @classmethod
    def builtin(cls) -> MotionLibrary:
        """Load the library of 288 HDM05 motions that comes with kinespace (CC BY-SA 3.0)."""
        with resources.as_file(resources.files("library") / "hdm05.npz") as path:
            return cls.load(path)

    @classmethod
    def load(cls, path: Path) -> MotionLibrary:
        """Read a library file.

        Raises
        ------
        LibraryFileError
            The file is cut short, foreign, of another version, tampered with or inconsistent.
        OSError
            The file cannot be opened.
        """
        header, arrays = libraryfile.read(path)
        try:
            skeleton = header["skeleton"]
            body = Skeleton(tuple(skeleton["joints"]), tuple(skeleton["parents"]), skeleton["with_segments"])
            motions = tuple(Motion(**motion) for motion in header["motions"])
            return cls(
                skeleton=body,
                motions=motions,
                windows=_restored_windows(header.get("windows"), arrays, body, motions),
                portraits=_restored_portraits(arrays),
                licence=header["licence"],
                attribution=header["attribution"],
                **{name: arrays[name] for name in _ARRAYS},
            )
        except (KeyError, OverflowError, TypeError, ValueError) as error:
            raise libraryfile.LibraryFileError(f"{path}: not a usable motion library ({error})") from error

    def save(self, path: Path) -> None:
        """Write one file, atomically; raises OSError when the folder cannot be written."""
        skeleton = self.skeleton
        header = {
            "skeleton": {
                "joints": skeleton.joints,
                "parents": skeleton.parents,
                "with_segments": skeleton.with_segments,
            },
            "motions": [asdict(motion) for motion in self.motions],
            "licence": self.licence,
            "attribution": self.attribution,
        }
        arrays = {name: getattr(self, name) for name in _ARRAYS}
        if self.windows:
            header["windows"] = windowfile.described(self.windows)
            arrays |= windowfile.arrays_of(self.windows)
        if self.portraits:
            arrays |= {
                f"portrait_{name}": np.array([getattr(each, name) for each in self.portraits], dtype=np.float16)
                for name in _PORTRAIT
            }
        libraryfile.write(path, header, arrays)

    def __len__(self) -> int:
        return len(self.motions)

    @property
    def class_indices(self) -> NDArray[np.intp]:
        """For each motion the index of its class, shape (motions,)."""
        return np.searchsorted(self.classes, [motion.class_name for motion in self.motions])

    def match(self, signature: Signature) -> Match:
        """Compare a window with every motion in one product.

        Parameters
        ----------
        signature
            Of a window over this library's skeleton.

        Raises
        ------
        SkeletonMismatchError
            The signature has another number of pairs than this library's skeleton.
        """
        if len(signature.mean) != len(self.skeleton.pairs):
            raise SkeletonMismatchError(
                f"signature: expected {len(self.skeleton.pairs)} pairs, got {len(signature.mean)}"
            )
        scores = similarity(self.axes, signature.axis.vector.astype(np.float32))
        return Match(scores, np.maximum.reduceat(scores, self._class_starts))

    def class_scores(self, axes: NDArray[np.floating]) -> NDArray[np.float32]:
        """Give the best score of each class alone; a large library need not be compared with in full for that.

        Parameters
        ----------
        axes
            Leading eigenvector of a window over this library's skeleton, unit length, shape (pairs,), or of several
            performers' windows, (hops, pairs): together they cost less than one by one.

        Returns
        -------
        What `match` gives as `class_scores`, shape (classes,) or (hops, classes).
        """
        single = np.atleast_2d(axes).astype(np.float32)
        if self._shortlist:
            best = self._shortlist.class_scores(single)
        else:
            best = np.maximum.reduceat(similarity(single, self.axes.T), self._class_starts, axis=1)
        return best if axes.ndim > 1 else best[0]

    def restricted_to(self, joints: Collection[str]) -> MotionLibrary:
        """Give the same motions as a body with fewer joints would show them.

        What is kept are the pairs of joints that both have. An axis is cut to them and made a unit vector again: near
        to the leading eigenvector of the fewer distances, but not the same. Windows stay what they are: a live window's
        vectors are estimated from the fewer distances. Whether it is known is judged by what those show of the library.

        Parameters
        ----------
        joints
            Names of the joints there are; those this library does not know are passed over.

        Returns
        -------
        A library over the shared joints, in this library's order; this library itself when it has no others. It has no
        windows when this library was restricted before.

        Raises
        ------
        SkeletonMismatchError
            Fewer than two joints are shared, or a motion does not show in them.
        """
        kept = self._shared(joints)
        if len(kept) == len(self.skeleton.joints):
            return self
        skeleton = self.skeleton.restricted_to(kept)
        pairs = self.skeleton.places_of(skeleton)
        lengths = np.linalg.norm(self.axes[:, pairs], axis=1)
        if not (lengths > _NO_MOVEMENT).all():
            raise SkeletonMismatchError(f"joints: expected all motions to show in {', '.join(skeleton.joints)}")
        variances = np.square(self.deviations[:, pairs]).sum(axis=1)
        eigenvalues = np.array([motion.eigenvalue for motion in self.motions]) * lengths**2
        motions = tuple(
            replace(motion, eigenvalue=kept, share=min(1.0, kept / variance) if variance > 0 else motion.share)
            for motion, kept, variance in zip(self.motions, eigenvalues.tolist(), variances.tolist(), strict=True)
        )
        return MotionLibrary(
            skeleton=skeleton,
            motions=motions,
            means=self.means[:, pairs],
            axes=(self.axes[:, pairs] / lengths[:, None]).astype(np.float32),
            deviations=self.deviations[:, pairs],
            windows=self._restricted_windows(skeleton, pairs),
            portraits=tuple(portrait.restricted_to(pairs) for portrait in self.portraits),
            licence=self.licence,
            attribution=self.attribution,
        )

    def comparison_for(self, skeleton: Skeleton) -> Comparison | None:
        """Say how windows of a skeleton are compared as this library's are; None when they cannot be.

        Its joints must be this library's or some of them, in this library's order.
        """
        if not set(skeleton.joints) <= set(self.skeleton.joints) or len(skeleton.joints) < 2:
            return None
        fewer = self.restricted_to(skeleton.joints)
        return fewer.windows.comparison if fewer.windows and fewer.skeleton.joints == skeleton.joints else None

    def _shared(self, joints: Collection[str]) -> list[int]:
        names = self.skeleton.joints
        kept = [index for index, name in enumerate(names) if name in joints]
        if len(kept) < 2:
            raise SkeletonMismatchError(
                f"joints: expected at least 2 of the library's {len(names)} ({names[0]} ... {names[-1]}), "
                f"got {len(kept)}"
            )
        return kept

    def _restricted_windows(self, skeleton: Skeleton, pairs: NDArray[np.intp]) -> WindowTable | None:
        if self.windows is None or not self.windows.comparison.can_be_restricted:
            return None
        return self.windows.restricted_to(skeleton, pairs, self.means.astype(np.float64))

    def merged_with(self, other: MotionLibrary) -> MotionLibrary:
        """Join two libraries of one skeleton; a motion both have, number for number, is kept once.

        Raises
        ------
        SkeletonMismatchError
            The skeletons differ.
        ValueError
            One keeps windows and the other does not, or they are measured differently: both must then be built anew
            from their recordings.
        """
        self.skeleton.require_same(other.skeleton)
        known = {(motion, axis.tobytes()) for motion, axis in zip(self.motions, self.axes, strict=True)}
        new = [
            index
            for index, (motion, axis) in enumerate(zip(other.motions, other.axes, strict=True))
            if (motion, axis.tobytes()) not in known
        ]
        return MotionLibrary(
            skeleton=self.skeleton,
            motions=(*self.motions, *(other.motions[index] for index in new)),
            means=np.concatenate([self.means, other.means[new]]),
            axes=np.concatenate([self.axes, other.axes[new]]),
            deviations=np.concatenate([self.deviations, other.deviations[new]]),
            windows=self._merged_windows(other, new),
            portraits=self._merged_portraits(other),
            licence=_joined(self.licence, other.licence),
            attribution=_joined(self.attribution, other.attribution),
        )

    def _merged_portraits(self, other: MotionLibrary) -> tuple[Portrait, ...]:
        """Take each class's portrait from where there is one, this library's first."""
        if not (self.portraits and other.portraits):
            return ()
        theirs = dict(zip(other.classes, other.portraits, strict=True))
        by_class = theirs | dict(zip(self.classes, self.portraits, strict=True))
        return tuple(by_class[class_name] for class_name in sorted(by_class))

    def _merged_windows(self, other: MotionLibrary, new: Sequence[int]) -> WindowTable | None:
        if self.windows is None and other.windows is None:
            return None
        if self.windows is None or other.windows is None:
            raise ValueError(
                "windows: expected them in both libraries or in neither; build one anew from its recordings"
            )
        motions = [*self.motions, *(other.motions[index] for index in new)]
        order = _in_order(motions)
        _, classes = np.unique([motions[index].class_name for index in order], return_inverse=True)
        return self.windows.merged_with(other.windows, new, np.argsort(order), classes)


def _in_order(motions: Sequence[Motion]) -> NDArray[np.intp]:
    """Sort by class and actor; equals stay as they stand."""
    return np.lexsort(([motion.actor for motion in motions], [motion.class_name for motion in motions]))


def _restored_windows(
    header: object, arrays: Mapping[str, NDArray[np.floating]], skeleton: Skeleton, motions: Sequence[Motion]
) -> WindowTable | None:
    if header is None:
        return None
    if not isinstance(header, dict):
        raise TypeError(f"windows: expected what they are, got {header!r}")
    _, classes = np.unique([motion.class_name for motion in motions], return_inverse=True)
    return windowfile.restored(header, arrays, skeleton, classes, np.array([motion.actor for motion in motions]))


def _restored_portraits(arrays: Mapping[str, NDArray[np.floating]]) -> tuple[Portrait, ...]:
    kept = [arrays[f"portrait_{name}"].astype(np.float32) for name in _PORTRAIT if f"portrait_{name}" in arrays]
    return tuple(Portrait(*parts) for parts in zip(*kept, strict=True))


def _joined(first: str, second: str) -> str:
    return " / ".join(dict.fromkeys(part for text in (first, second) if text for part in text.split(" / ")))
