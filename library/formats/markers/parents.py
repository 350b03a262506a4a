"""How markers hang together, when no file says it: by the pairs whose distance changes least."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from kinespace.library.distances import distance_rows
from kinespace.library.skeleton import Skeleton

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.library.clip import Clip

#: Added to each pair's relative deviation, because a weight of 0 would be no edge.
_RIGID = 1e-9


def most_rigid_parents(clips: Sequence[Clip]) -> tuple[int, ...]:
    """Hang each joint on another so that the segments keep their length as well as they can.

    The tree of least total weight over all pairs, a pair's weight being its distance's standard deviation relative to
    its mean, averaged over the clips: two markers on one bone hardly move apart (after Silaghi et al., "Local and
    global skeleton fitting techniques for optical motion capture", 1998). The first joint is the root.

    Parameters
    ----------
    clips
        Of one skeleton, whose parents do not matter.

    Returns
    -------
    Parents as `Skeleton` takes them.
    """
    # Slow to load, and a live feed does without.
    from scipy.sparse import csr_array  # noqa: PLC0415
    from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree  # noqa: PLC0415

    skeleton = clips[0].skeleton
    weights = np.zeros(len(skeleton.pairs))
    for clip in clips:
        rows = distance_rows(clip.positions, skeleton)
        mean = rows.mean(axis=0)
        weights += np.divide(rows.std(axis=0), mean, out=np.zeros_like(mean), where=mean > 0)
    count = len(skeleton.joints)
    # Sparse, because in a dense graph a small weight is taken for none.
    graph: csr_array[np.float64] = csr_array((weights / len(clips) + _RIGID, skeleton.pairs.T), shape=(count, count))
    _, parents = breadth_first_order(minimum_spanning_tree(graph), 0, directed=False)
    return tuple(int(parent) if parent >= 0 else -1 for parent in parents)


def with_parents(clips: Sequence[Clip]) -> list[Clip]:
    """Give clips of one skeleton its parents, learned from them all where the files do not say them."""
    skeleton = clips[0].skeleton
    if skeleton.parents:
        return list(clips)
    known = Skeleton(skeleton.joints, most_rigid_parents([clip.as_of(skeleton) for clip in clips]))
    return [replace(clip.as_of(skeleton), skeleton=known) for clip in clips]
