"""What is odd about a recording's body: nothing for an honest one."""

from collections.abc import Iterator

import numpy as np

from kinespace.library.clip import Clip
from kinespace.library.motion_library import MIN_JOINTS
from kinespace.library.naming import hdm05, unknown_names
from kinespace.library.windows.segments import DISORDER, FLAT, in_disorder, is_flat, shares_of_size

#: Metres across a body, at least and at most.
_SMALLEST, _LARGEST = 0.3, 4.0
#: Frames a second, at least: with fewer `live` lets a performer make room for another.
_MIN_RATE = 12.0
#: Frames of a recording that are looked at.
_LOOKS = 64


def remarks(clip: Clip) -> Iterator[str]:
    """List a recording's oddities, a line each, whose kind stands before a colon; nothing for an honest body."""
    joints = clip.skeleton.joints
    looks = body = clip.positions[:: -(-clip.frames // _LOOKS)]
    known = [place for place, name in enumerate(hdm05.SKELETON.joints) if name in joints]
    if len(known) < MIN_JOINTS:
        yield unknown_names(joints, hdm05.SKELETON.joints) or f"joints: {len(joints)}, expected {MIN_JOINTS} at least"
    else:
        skeleton = hdm05.SKELETON.restricted_to(known)
        ends = np.array([(child, parent) for child, parent in enumerate(skeleton.parents) if parent >= 0])
        body = looks[:, skeleton.order_from(joints)]
        if np.median(shares_of_size(body, ends)) >= DISORDER:
            yield in_disorder(len(known), len(joints))
    if is_flat(looks):
        yield FLAT
    least, most = looks.min(axis=(0, 1)), looks.max(axis=(0, 1))
    if (least[:2] >= 0).all() and (most[:2] <= 1).all() and most[2] - least[2] < most[1] - least[1] > _SMALLEST:
        yield "positions: x and y from 0 to 1: places in a picture? Their distances are no body's: world places are"
    across = float(np.median(np.linalg.norm(np.ptp(body, axis=1), axis=1)))
    if not _SMALLEST <= across <= _LARGEST:
        yield f"size: {across:.3g} m across: no whole body, or another unit"
    if clip.frame_rate < _MIN_RATE:
        yield f"frame rate: {clip.frame_rate:g} frames a second, expected {_MIN_RATE:g} at least"
