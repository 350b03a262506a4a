"""Forward kinematics: positions of joints that are given by positions and rotations relative to their parents."""

import math
from collections.abc import Mapping
from typing import Annotated

import msgspec

#: A number that is neither infinite nor NaN.
_Number = Annotated[float, msgspec.Meta(ge=-1e9, le=1e9)]
Vector = tuple[float, float, float]
#: x, y, z, w.
Quaternion = tuple[float, float, float, float]

_UPRIGHT: Quaternion = (0.0, 0.0, 0.0, 1.0)
#: A position nearer to its parent than this was not given: many senders have rotations only and send zeros.
_NOT_GIVEN = 1e-6


class Bone(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A bone of a hierarchy.

    Attributes
    ----------
    parent
        The parent's name; empty for no parent.
    offset
        The bone's beginning relative to its parent, in the parent's axes and the sender's unit, if the sender sends
        none.
    """

    parent: str = ""
    offset: tuple[_Number, _Number, _Number] = (0.0, 0.0, 0.0)


def world_positions(
    bones: Mapping[str, Bone], poses: Mapping[str, tuple[Vector | None, Quaternion | None]]
) -> dict[str, Vector]:
    """Place every bone in the world.

    At each bone p = p_parent + q_parent · offset and q = q_parent · q_own, as in any scene graph.

    Parameters
    ----------
    bones
        By name, parents before their children.
    poses
        Each sent bone's position relative to its parent, and its rotation. Without a position, or with zeros, the bone
        has its own offset; without a rotation, or with zeros, and for bones that are not sent, there is no rotation.

    Returns
    -------
    Positions by bone, in the sender's unit and axes.
    """
    placed = dict[str, Vector]()
    turned = dict[str, Quaternion]()
    for name, bone in bones.items():
        position, rotation = poses.get(name, (None, None))
        if position is None or max(map(abs, position)) < _NOT_GIVEN:
            position = bone.offset
        own = _unit(rotation)
        if bone.parent:
            above = turned[bone.parent]
            position = _moved(placed[bone.parent], above, position)
            own = _product(above, own)
        placed[name] = position
        turned[name] = own
    return placed


def _unit(rotation: Quaternion | None) -> Quaternion:
    length = math.hypot(*rotation or ())
    # Numbers smaller or larger than this have no direction: they are a sender's mistake.
    if rotation is None or not 1e-9 < length < 1e9:
        return _UPRIGHT
    x, y, z, w = rotation
    return x / length, y / length, z / length, w / length


def _moved(place: Vector, rotation: Quaternion, vector: Vector) -> Vector:
    """Add a vector that is rotated to a place."""
    (i, j, k), (a, b, c), (x, y, z, w) = place, vector, rotation
    # v + w t + q × t with t = 2 q × v
    p, q, r = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
    return i + (a + w * p + y * r - z * q), j + (b + w * q + z * p - x * r), k + (c + w * r + x * q - y * p)


def _product(first: Quaternion, second: Quaternion) -> Quaternion:
    a, b, c, d = first
    x, y, z, w = second
    return (
        d * x + a * w + b * z - c * y,
        d * y - a * z + b * w + c * x,
        d * z + a * y - b * x + c * w,
        d * w - a * x - b * y - c * z,
    )
