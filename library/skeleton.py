"""The skeleton: the joints of a posture, and the pairs of joints that are measured."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray


class SkeletonMismatchError(ValueError):
    """Two skeletons that should describe the same body differ."""


@dataclass(frozen=True, slots=True)
class Skeleton:
    """Joint names and the joint pairs whose distances describe a posture.

    Le Naour et al. (2012, section 2) count every pair of the 31 joints, 465 distances, and also say that the
    30 rigid segments carry no movement and are not retained. Here every pair is measured: a rigid segment has no
    variance, so after centring it adds nothing to any inner product, and the segments of a markerless feed do stretch.

    Attributes
    ----------
    joints
        Joint names, in the order of the position arrays.
    parents
        For each joint the index of its parent, -1 for a root; no joint is above itself. Empty when the hierarchy is
        not known.
    pairs
        Joint indices, shape (pairs, 2), first index below second, rows in lexicographic order. Read-only.

    Raises
    ------
    ValueError
        Fewer than two joints, a name twice or empty, one text in place of names, or parents that do not fit.
    """

    joints: tuple[str, ...]
    parents: tuple[int, ...] = ()
    pairs: NDArray[np.intp] = field(init=False, repr=False, compare=False)

    if TYPE_CHECKING:

        def __init__(self, joints: Sequence[str], parents: Sequence[int] = ()) -> None: ...

    def __post_init__(self) -> None:
        if isinstance(self.joints, str):
            raise ValueError(f"joints: expected several names, got the text {self.joints!r}")  # noqa: TRY004
        # A list would make the skeleton unhashable.
        object.__setattr__(self, "joints", tuple(self.joints))
        object.__setattr__(self, "parents", tuple(self.parents))
        self._check()
        first, second = np.triu_indices(len(self.joints), k=1)
        pairs = np.stack([first, second], axis=1)
        # Column by column in memory: `pairs[:, 0]` and `pairs[:, 1]` are then contiguous.
        pairs = np.asfortranarray(pairs)
        pairs.setflags(write=False)
        object.__setattr__(self, "pairs", pairs)

    def _check(self) -> None:
        count = len(self.joints)
        if count < 2:
            raise ValueError(f"joints: expected at least 2 names, got {count}")
        if not all(isinstance(name, str) and name for name in self.joints) or len(set(self.joints)) != count:
            raise ValueError(f"joints: expected distinct, non-empty names, got {self.joints}")
        if self.parents and len(self.parents) != count:
            raise ValueError(f"parents: expected one per joint ({count}), got {len(self.parents)}")
        if any(not -1 <= parent < count or parent == joint for joint, parent in enumerate(self.parents)):
            raise ValueError(f"parents: expected joint indices or -1, got {self.parents}")
        above = self.parents
        for _ in range(count.bit_length()):
            # Twice as far up as before.
            above = tuple(above[each] if each >= 0 else -1 for each in above)
        if any(each >= 0 for each in above):
            raise ValueError(f"parents: expected no joint above itself, got {self.parents}")

    def restricted_to(self, kept: Sequence[int]) -> "Skeleton":
        """Give a skeleton of some of the joints; the parent of each is the nearest kept joint above it.

        Of several joints without a kept joint above them, the first becomes the root and the parent of the others.

        Parameters
        ----------
        kept
            Indices of at least two joints, in the order they are to have.
        """
        part = self.linked([self.joints[joint] for joint in kept])
        if not self.parents:
            return Skeleton(part.joints)
        root = part.parents.index(-1)
        parents = (root if parent < 0 and place != root else parent for place, parent in enumerate(part.parents))
        return Skeleton(part.joints, tuple(parents))

    def linked(self, joints: Sequence[str]) -> "Skeleton":
        """Give a skeleton of joints in any order: the parent of each is the nearest of them above it in this skeleton.

        Parameters
        ----------
        joints
            Names; a joint that this skeleton lacks has no parent.
        """
        places = {name: place for place, name in enumerate(joints)}
        above = dict(zip(self.joints, (self.joints[each] if each >= 0 else "" for each in self.parents), strict=False))
        parents = []
        for name in joints:
            parent = above.get(name, "")
            while parent and parent not in places:
                parent = above[parent]
            parents.append(places.get(parent, -1))
        return Skeleton(tuple(joints), tuple(parents))

    def places_of(self, fewer: "Skeleton") -> NDArray[np.intp]:
        """Give the index, among these pairs, of each pair of a skeleton with some of these joints in the same order."""
        kept = [name in fewer.joints for name in self.joints]
        return np.flatnonzero(np.array(kept)[self.pairs].all(axis=1))

    def order_from(self, joints: Sequence[str]) -> NDArray[np.intp]:
        """Give the index of each of this skeleton's joints in another list of joints.

        Parameters
        ----------
        joints
            The other list, in any order; joints that this skeleton lacks are ignored.

        Returns
        -------
        Indices into `joints`, shape (len(self.joints),): `positions[order]` is in this skeleton's order.

        Raises
        ------
        SkeletonMismatchError
            A joint of this skeleton is not in the list.
        """
        place = {name: index for index, name in enumerate(joints)}
        if missing := [name for name in self.joints if name not in place]:
            raise SkeletonMismatchError(
                f"joints: expected all {len(self.joints)} of the skeleton, got {len(joints)} "
                f"without {', '.join(missing[:5])}{' ...' if len(missing) > 5 else ''}"
            )
        return np.array([place[name] for name in self.joints], dtype=np.intp)

    def nearest_from(self, joints: Sequence[str]) -> NDArray[np.intp]:
        """Do the same as `order_from`, but for a missing joint give the index of the nearest joint along the bones.

        Without parents the nearest joint is the first in the list that this skeleton has.

        Raises
        ------
        SkeletonMismatchError
            None of this skeleton's joints is in the list.
        """
        place = {name: index for index, name in enumerate(joints)}
        found = [place.get(name, -1) for name in self.joints]
        if max(found) < 0:
            raise SkeletonMismatchError(f"joints: expected some of the skeleton's, got {', '.join(joints[:5])}")
        for _ in self.parents:
            reached = found.copy()
            for joint, parent in enumerate(self.parents):
                if parent >= 0 and found[joint] < 0 <= found[parent]:
                    reached[joint] = found[parent]
                elif parent >= 0 and found[parent] < 0 <= found[joint] and reached[parent] < 0:
                    reached[parent] = found[joint]
            if reached == found:
                break
            found = reached
        first = next(index for index in found if index >= 0)
        return np.array([first if index < 0 else index for index in found], dtype=np.intp)

    def require_same(self, other: "Skeleton") -> None:
        """Refuse another skeleton than this one.

        Raises
        ------
        SkeletonMismatchError
            Joints or their order differ. Parents are not compared, because distances do not depend on them.
        """
        if self.joints != other.joints:
            own, others = (f"{len(each)} joints ({each[0]} ... {each[-1]})" for each in (self.joints, other.joints))
            raise SkeletonMismatchError(f"skeleton: expected {own}, got {others}")
