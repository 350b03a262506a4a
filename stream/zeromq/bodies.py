"""Bodies as ZeroMQ messages, for programs that draw them: a topic, a JSON object, and the positions.

`[b"body/<performer>/"][JSON][raw little-endian float32, (joints, 3), metres]`. The JSON holds `v` (1), `t` seconds and
the number of `joints`. Once a second it also holds the joints' `names` and `parents`, and some times a second what
carries the decision (`stream.recognizer.joints.carried`): the share of each joint (`carried`), and the foremost joint
`pairs`.
"""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from kinespace.library.skeleton import Skeleton
from kinespace.stream.frame import Frame
from kinespace.stream.recognizer.joints.carried import Carried
from kinespace.stream.zeromq.frames import VERSION

#: Joints of a body that is drawn, at most.
MAX_JOINTS = 4096


class BodyHeader(msgspec.Struct, omit_defaults=True):
    """The fields that describe a body; None for a field that is as it was in the message before."""

    v: int
    t: float
    joints: int
    names: tuple[str, ...] | None = None
    parents: tuple[int, ...] | None = None
    carried: tuple[float, ...] | None = None
    pairs: tuple[tuple[int, int], ...] | None = None


_encode = msgspec.json.Encoder().encode
_read = msgspec.json.Decoder(BodyHeader).decode


def encode_body(frame: Frame, skeleton: Skeleton | None = None, carried: Carried | None = None) -> list[bytes]:
    """Encode a frame's positions, and perhaps its skeleton and the joints that carry the decision."""
    header = BodyHeader(VERSION, float(frame.time), len(frame.positions))
    if skeleton and len(skeleton.joints) == header.joints:
        header.names, header.parents = skeleton.joints, skeleton.parents
    if carried and len(carried.joints) == header.joints:
        header.carried, header.pairs = carried.joints, carried.pairs
    positions = frame.positions.astype("<f4")
    return [f"body/{frame.performer}/".encode(), _encode(header), positions.tobytes()]


def decode_body(parts: Sequence[bytes]) -> tuple[str, BodyHeader, bytes] | None:
    """Decode a body: the performer, the header, the positions' bytes; None for any other message."""
    try:
        topic, encoded, positions = parts
        header = _read(encoded)
        kind, _, performer = topic.decode().partition("/")
    except (ValueError, RecursionError):
        return None
    if kind != "body" or not 0 < header.joints <= MAX_JOINTS or len(positions) != 12 * header.joints:
        return None
    described = (header.names, header.parents, header.carried)
    if any(each is not None and len(each) != header.joints for each in described):
        return None
    ends = [*(header.parents or ()), *(joint for pair in header.pairs or () for joint in pair)]
    if any(not -1 <= joint < header.joints for joint in ends):
        return None
    return performer.removesuffix("/"), header, positions
