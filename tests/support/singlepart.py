"""Frames in one msgpack map, as a sender writes them who cannot send several parts."""

from collections.abc import Sequence

import msgspec
import numpy as np

from kinespace.stream import Frame


def encode(frame: Frame, seq: int, joints: Sequence[str] | None = None) -> bytes:
    """Encode a frame as one msgpack map, positions as float32; with the joint names when they are given."""
    positions = np.ascontiguousarray(frame.positions, dtype="<f4")
    described: dict[str, object] = {
        "v": 1,
        "performer": frame.performer,
        "seq": seq,
        "t": frame.time,
        "shape": list(positions.shape),
        "dtype": "<f4",
        "data": positions.tobytes(),
    }
    if joints is not None:
        described["joints"] = list(joints)
    return msgspec.msgpack.encode(described)
