"""A body made of a camera's landmarks: the trunk's joints are computed, and all bones have an adult's length.

A network that guesses a body from one picture gives no joints inside of the trunk, and bones whose lengths change by
centimetres from picture to picture. Their directions are better than their lengths. So each joint is put at a fixed
distance from the joint above it, in the direction in which the camera shows it; the distances are the mean of HDM05's
bodies, from whose motions the built-in library is made (`tests/library/signature/test_signature.py` measures them).
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

#: Joints of the trunk that no landmark shows: where they lie on the way from the middle of the hips to the middle of
#: the shoulders, in shares of it.
TRUNK = {"root": 0.147, "lowerback": 0.416, "upperback": 0.68, "lowerneck": 1.111}
#: Metres from the middle of the hips to that of the shoulders, and between the two hips and the two shoulders.
LENGTH = 0.524
WIDTHS = {"hipjoint": 0.166, "clavicle": 0.469}
#: The joint above each joint of a limb, and metres between the two; a limb's joints follow each other.
LIMBS = {
    "femur": ("hipjoint", 0.410),
    "tibia": ("femur", 0.436),
    "toes": ("tibia", 0.209),
    "humerus": ("clavicle", 0.280),
    "radius": ("humerus", 0.186),
    "thumb": ("radius", 0.160),
    "fingers": ("radius", 0.207),
}
#: Metres from the middle of the shoulders to the head.
HEAD = 0.241
_SIDES = ("l", "r")
#: Metres by which a limb may be off: files keep whole millimetres, and bodies between two pictures are on lines. Limbs
#: by which a body is told from others, at least.
_OFF, _MIN_LIMBS = 0.01, 6
#: The joints that a body has, in the order of its positions.
JOINTS = (*TRUNK, "head", *(side + name for side in _SIDES for name in (*WIDTHS, *LIMBS)))


def body_of(joints: Sequence[str], landmarks: NDArray[np.floating]) -> NDArray[np.float64]:
    """Make a body of landmarks.

    Parameters
    ----------
    joints
        The names of the landmarks: HDM05's for the same joints; further ones are left out.
    landmarks
        Shape (landmarks, 3), metres or any other unit, y up; NaN where none is seen.

    Returns
    -------
    Positions of `JOINTS`, shape (joints, 3), metres from the middle of the hips. A joint that is not seen, or has a
    joint above it that is not, is NaN.
    """
    seen = {name: place.astype(np.float64) for name, place in zip(joints, landmarks, strict=True)}
    nowhere = np.full(3, math.nan)
    left, right = ([seen.get(side + name, nowhere) for name in WIDTHS] for side in _SIDES)
    hips, shoulders = ((first + second) / 2 for first, second in zip(left, right, strict=True))
    along = LENGTH * _direction(shoulders - hips)
    placed = {name: share * along for name, share in TRUNK.items()}
    placed["head"] = along + HEAD * _direction(seen.get("head", nowhere) - shoulders)
    for place, (name, width) in enumerate(WIDTHS.items()):
        across = width / 2 * _direction(left[place] - right[place])
        middle = along if place else np.zeros(3)
        placed["l" + name], placed["r" + name] = middle + across, middle - across
    for side in _SIDES:
        for name, (above, length) in LIMBS.items():
            way = seen.get(side + name, nowhere) - seen.get(side + above, nowhere)
            placed[side + name] = placed[side + above] + length * _direction(way)
    return np.array([placed[name] for name in JOINTS])


def are_of_landmarks(joints: Sequence[str], positions: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Say of each body whether `body_of` made it: by the lengths of its limbs, which no measured body has.

    Parameters
    ----------
    joints
        HDM05's names.
    positions
        Shape (bodies, joints, 3), metres; NaN where none is seen.
    """
    places = {name: place for place, name in enumerate(joints)}
    limbs = [(side + name, side + above, length) for side in _SIDES for name, (above, length) in LIMBS.items()]
    there = [(places[one], places[above], length) for one, above, length in limbs if {one, above} <= places.keys()]
    if len(there) < _MIN_LIMBS:
        return np.zeros(len(positions), dtype=bool)
    ends, lengths = np.array([each[:2] for each in there]), np.array([each[2] for each in there])
    along = positions[:, ends[:, 0]] - positions[:, ends[:, 1]]
    off = np.abs(np.sqrt(np.einsum("fsc,fsc->fs", along, along)) - lengths)
    found: NDArray[np.bool_] = (np.isfinite(off).sum(axis=1) >= _MIN_LIMBS) & ~(off > _OFF).any(axis=1)
    return found


def _direction(way: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give a way's direction; NaN for no way."""
    length = math.sqrt(float(way @ way))
    return way / length if length > 0 else np.full(3, math.nan)
