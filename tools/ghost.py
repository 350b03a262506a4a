"""Ghosts: a library's motions made visible again, from what the library keeps of them.

A class with a portrait moves as that does. Of a library without portraits the motion most like its class swings along
its leading eigenvector: rows that have this motion's signature again.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from library.embedding import embedded

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from library import MotionLibrary


def ghost(
    library: MotionLibrary, class_name: str, *, seconds: float, frame_rate: float, rate: float
) -> NDArray[np.float64]:
    """Play a class of a library.

    Parameters
    ----------
    library, class_name
        Whose ghost.
    seconds, frame_rate
        How long, and in how many frames per second.
    rate
        Cycles per second.

    Returns
    -------
    Positions, shape (frames, joints, 3), metres.

    Raises
    ------
    ValueError
        The library has no such class.
    """
    if class_name not in library.classes:
        raise ValueError(f"class_name: expected one of {', '.join(library.classes)}, got {class_name!r}")
    cycles = np.arange(round(seconds * frame_rate)) / frame_rate * rate
    if library.portraits:
        rows = library.portraits[library.classes.index(class_name)].rows(cycles)
    else:
        rows = swinging_rows(library, representative(library, class_name), cycles)
    return embedded(rows, library.skeleton)


def representative(library: MotionLibrary, class_name: str) -> int:
    """Find the motion most like all others of its class: the index of the class's medoid."""
    members = [index for index, motion in enumerate(library.motions) if motion.class_name == class_name]
    axes = library.axes[members]
    return members[int(np.abs(axes @ axes.T).sum(axis=1).argmax())]


def swinging_rows(library: MotionLibrary, motion: int, cycles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Let the distances swing along the motion's leading eigenvector around their mean.

    Parameters
    ----------
    library, motion
        Which motion of which library, by index.
    cycles
        Shape (frames,).

    Returns
    -------
    Distance rows, shape (frames, pairs), metres, with the motion's variance along its axis; never below zero.
    """
    swing = np.sqrt(2 * library.motions[motion].eigenvalue) * np.sin(2 * np.pi * cycles)
    rows: NDArray[np.float64] = np.maximum(library.means[motion] + np.outer(swing, library.axes[motion]), 0.0)
    return rows
