"""Packets of our own protocols that are wrong, by the counter in which each must show: one table for all tests."""

import json
import pickle
from collections.abc import Sequence

import msgpack
import numpy as np
from golden import bundle, message

from kinespace.stream import Frame
from kinespace.stream.osc.packet import MAX_MESSAGES, MAX_VALUES
from kinespace.stream.zeromq import MAX_MESSAGE
from kinespace.stream.zeromq.messages import MAX_HEADER

_RANDOM = np.random.default_rng(17)
#: The positions of a body of 31 joints, as a row of numbers.
POSE = _RANDOM.normal(size=93).tolist()
_NAN, _INFINITY = float("nan"), float("inf")


def osc_frame(numbers: list[float] = POSE, performer: str = "p", time: float = 11.0) -> bytes:
    """Write a frame's message."""
    return message("/motion/frame", "sd" + "f" * len(numbers), performer, time, *numbers)


def zmq_frame(numbers: list[float] = POSE, performer: str = "p", **changes: object) -> list[bytes]:
    """Write a frame's three parts, some fields of the header changed; `...` leaves a field out."""
    header = {"v": 1, "t": 11.0, "shape": [len(numbers) // 3, 3], "dtype": "<f4"} | changes
    encoded = json.dumps({name: value for name, value in header.items() if value is not ...}).encode()
    return [f"frame/{performer}/".encode(), encoded, np.array(numbers, "<f4").tobytes()]


def msgpack_frame(**changes: object) -> list[bytes]:
    """Write a frame in one part, some fields changed."""
    data = np.array(POSE, "<f4").tobytes()
    fields = {"v": 1, "performer": "p", "t": 11.0, "shape": [31, 3], "dtype": "<f4", "data": data}
    return [msgpack.packb(fields | changes)]


def _skeleton(tags: str, *arguments: object) -> bytes:
    return message("/motion/skeleton", tags, *arguments)


def _frame(tags: str, *arguments: object) -> bytes:
    return message("/motion/frame", tags, *arguments)


_HALVES = [0.5] * 6
_DEEP = b"[" * 15_000 + b"]" * 15_000
#: Each alone in its packet is malformed.
MALFORMED_OSC: dict[str, bytes] = {
    "empty": b"",
    "text": b"no osc at all",
    "random bytes": _RANDOM.bytes(300),
    "random bytes of 64 kB": _RANDOM.bytes(65_507),
    "a message of 64 kB": b"/motion/frame\0\0\0,sd" + b"f" * 65_488,
    "arrays in arrays": b"/motion/skeleton\0\0\0\0," + _DEEP + b"\0\0\0",
    "60000 values": b"/a\0\0," + b"T" * 59_999 + bytes(4),
    "a value too many": b"/a\0\0," + b"T" * (MAX_VALUES + 1) + bytes(4),
    "bundles in bundles": b"#bundle\0\0\0\0\0\0\0\0\1\0\0\0\x10" * 100,
    "empty bundles": bundle(*[bundle()] * 3000),
    "too many messages": bundle(*[b"/a\0\0"] * (MAX_MESSAGES + 1)),
    "cut off": osc_frame()[:-3],
    "a float too many": osc_frame([*POSE, 1.0]),
    "nothing": _frame(""),
    "time first": _frame("ds" + "f" * 6, 1.0, "p", *_HALVES),
    "time is a word": _frame("ss" + "f" * 6, "p", "now", *_HALVES),
    "time is NaN": osc_frame(time=_NAN),
    "time is infinite": osc_frame(time=-_INFINITY),
    "a word for a number": _frame("sdfffffs", "p", 1.0, *_HALVES[1:], "half"),
    "nothing for a number": _frame("sdfffffN", "p", 1.0, *_HALVES[1:]),
    "no performer": osc_frame(performer=""),
    "a performer's name too long": osc_frame(performer="p" * 65),
    "a performer of no text": osc_frame().replace(b"p\0\0\0", b"\xff\0\0\0"),
    "true for a performer": _frame("Td" + "f" * 6, 1.0, *_HALVES),
    "a float for a performer": _frame("fd" + "f" * 6, 1.0, 1.0, *_HALVES),
    "NaN": osc_frame([_NAN] * 93),
    "both infinities": osc_frame([_INFINITY, -_INFINITY, *POSE[2:]]),
    "beyond any stage": osc_frame([3e38] * 93),
    "no names": _skeleton(""),
    "names of no joint": _skeleton("s", "p"),
    "a joint twice": _skeleton("sss", "p", "head", "head"),
    "a joint without a name": _skeleton("sss", "p", "hip", ""),
}
#: Each alone in its packet is somebody else's.
FOREIGN_OSC: dict[str, bytes] = {
    address: message(address, "sd" + "f" * 6, "p", 1.0, *_HALVES)
    for address in ("/", "/motion", "/motion/frames", "/motion/frame/p", "/Motion/frame", "/VMC/Ext/T")
}

#: Values that a header's fields must not have.
_WRONG: dict[str, list[object]] = {
    "v": [..., None, 2, "1"],
    "shape": [..., None, "31x3", [93], [31, 3, 1], [93, 1], [0, 3], [-31, 3], [True, 3], [31.0, 3], ["31", 3]],
    "dtype": [..., None, 4, "f4", "float32", ">f4", "<f2", "<i4", "<c8", "O", "V4", "<f8", ["<f4"], [["x", "<f4"]]],
    "t": ["noon", True, None, [1], _NAN, _INFINITY, -_INFINITY, 10**400],
    "seq": [-1, 1.5, "7", True, 2**63, 10**300],
    "joints": ["abc", [], ["a", "a", "b"], ["a", ""], ["a", 1], {"a": 1}],
}
_WRONG["shape"] += [[30, 3], [32, 3], [4097, 3], [2**32, 3], [2**62, 3], [10**30, 3], {"0": 3, "1": 3}]


def _fits_msgpack(value: object) -> bool:
    """Say whether msgpack holds a value: it has integers of 64 bits."""
    if isinstance(value, list):
        return all(map(_fits_msgpack, value))
    return value is not ... and not (isinstance(value, int) and abs(value) >= 2**63)


_GOOD = zmq_frame()
_NINES = b"9" * 4300
_HEADERS = [
    *(b"", b"{", b"[]", b"1", b"null", b'"v"', b"\xff\xfe", b"{'v': 1}", b"[" * 60_000, b'{"x":' + b"[" * 60_000),
    *(b'{"v":1,"joints":' + b"[" * 60_000, b'{"v":' + b"1" * 10_000 + b"}", _GOOD[1][:-1], _GOOD[1] + b"x"),
    *(_GOOD[1] + b" " * MAX_HEADER, pickle.dumps({"v": 1}), _RANDOM.bytes(300)),
    *(_GOOD[1].replace(b"11.0", number) for number in (_NINES, b"1e400", b"NaN", b"Infinity")),
    *(_GOOD[1].replace(b"31, 3", shape) for shape in (_NINES + b",3", b"4294967296,3")),
]
_TOPICS = [b"frame/", b"frame//", b"frame/p", b"frame/\xff/", b"frame/" + b"p" * 65 + b"/"]
_BUFFERS = [
    *(b"", b"\0", _GOOD[2][:-1], _GOOD[2] + b"\0", _GOOD[2] * 2, bytes(1_000_000), pickle.dumps(POSE)),
    *(np.full(93, number, "<f4").tobytes() for number in (_NAN, _INFINITY, -_INFINITY, 3e38)),
]
#: Each is a malformed message.
MALFORMED_ZMQ: dict[str, list[bytes]] = {
    **{f"{key} {value!r:.20}": zmq_frame(**{key: value}) for key, values in _WRONG.items() for value in values},
    **{f"header {place}": [_GOOD[0], header, _GOOD[2]] for place, header in enumerate(_HEADERS)},
    **{f"topic {topic[:12]!r}": [topic, *_GOOD[1:]] for topic in _TOPICS},
    **{f"buffer {place}": [*_GOOD[:2], buffer] for place, buffer in enumerate(_BUFFERS)},
    "doubles beyond any stage": [_GOOD[0], zmq_frame(dtype="<f8")[1], np.full(93, 1e200).tobytes()],
    "a topic alone": _GOOD[:1],
    "two parts": _GOOD[:2],
    "four parts": [*_GOOD, b""],
    **{
        f"one part, {key} {value!r:.20}": msgpack_frame(**{key: value})
        for key, values in _WRONG.items()
        for value in values
        if _fits_msgpack(value) and (key, value) != ("t", None)
    },
    **{f"one part, performer {value!r:.9}": msgpack_frame(performer=value) for value in (7, "", "x" * 65)},
    **{f"one part, data {value!r}": msgpack_frame(data=value) for value in ("text", b"short")},
    "one part, a map of nothing of ours": [msgpack.packb({"v": 1})],
    "one part, a million lists": [msgpack.packb({"v": 1, "x": [[]] * (MAX_MESSAGE - 64)})],
    "one part, deep lists": [b"\x81\xa1x" + b"\x91" * (MAX_MESSAGE - 64) + b"\x90"],
}
#: Each is somebody else's message.
FOREIGN_ZMQ: dict[str, list[bytes]] = {
    "an empty part": [b""],
    "random bytes": [_RANDOM.bytes(300)],
    "an answer": [b"class/p/", b"{}"],
    "another topic": [b"mocap/p/", *_GOOD[1:]],
    "no topic": [b"/p/", *_GOOD[1:]],
    "a part of a topic": [b"frame", *_GOOD[1:]],
    "somebody else's OSC": [message("/elsewhere")],
}


# --- frames in one msgpack map, as a sender writes them who cannot send several parts ---------------------------------


def in_one_part(frame: Frame, seq: int, joints: Sequence[str] | None = None) -> bytes:
    """Encode a frame as one msgpack map, positions as float32; with the joint names when they are given."""
    named = {} if joints is None else {"joints": [*joints]}
    shape, data = [*frame.positions.shape], frame.positions.astype("<f4").tobytes()
    return msgpack_frame(performer=frame.performer, seq=seq, t=frame.time, shape=shape, data=data, **named)[0]
