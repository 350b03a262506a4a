"""Answers as ZeroMQ messages: a topic and a JSON object.

`[b"class/<performer>/"][JSON]`, `[b"event/<performer>/"][JSON]`, `[b"done/<performer>/"][JSON]`,
`[b"classes/"][JSON]`, `[b"status/"][JSON]`. NaN and infinity are null, because JSON has neither.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

import msgspec

from kinespace.library.skeleton import Skeleton
from kinespace.stream.frame import Frame
from kinespace.stream.recognition import GONE, Answer, Done, Event, Progress, Recognition
from kinespace.stream.recognizer.carried import Carried
from kinespace.stream.status import Status
from kinespace.stream.zeromq.frames import VERSION

#: Digits of a class's score.
_SCORE_DIGITS = 6
_encode = msgspec.json.Encoder().encode


class _Received(msgspec.Struct, rename={"label": "class"}):
    """The fields of an answer that a listener reads."""

    performer: str
    label: str | None
    index: int
    outcome: str
    score: float
    margin: float


_read = msgspec.json.Decoder(_Received).decode


def encode_recognition(recognition: Recognition) -> list[bytes]:
    """Encode an answer: its class, its scores, and the leading eigenvector's numbers.

    `class` is the named class or null and `index` its index or -1, `guess` the best guess or null and `guess_index` its
    index or -1; `so_far` the class that the last seconds are nearest to.
    """
    scores = [round(score, _SCORE_DIGITS) for score in recognition.scores.tolist()]
    names, second = (*recognition.classes, None), recognition.second_index
    answer = {
        "v": VERSION,
        "performer": recognition.performer,
        "t": float(recognition.time),
        "class": names[recognition.class_index],
        "guess": names[recognition.guess_index],
        "index": recognition.class_index,
        "guess_index": recognition.guess_index,
        "so_far": names[recognition.so_far],
        "outcome": recognition.outcome.value,
        "score": recognition.score,
        "runner_up": names[second],
        "margin": recognition.margin,
        "scores": dict(zip(recognition.classes, scores, strict=True)),
        "movement": float(recognition.movement),
        "share": float(recognition.share),
        "gap": float(recognition.gap),
        "eigenvector_class": recognition.eigenvector_class,
        "eigenvector_score": float(recognition.eigenvector_score),
        "doubted": recognition.doubted,
        "progress": recognition.progress and _described(recognition.progress, class_name="class"),
    }
    return [f"class/{recognition.performer}/".encode(), _encode(answer)]


def encode_gone(performer: str) -> list[bytes]:
    """Encode that a performer has left: an answer without a class."""
    answer = {
        "v": VERSION,
        "performer": performer,
        "class": None,
        "guess": None,
        "index": -1,
        "guess_index": -1,
        "so_far": None,
        "outcome": GONE,
        "score": 0.0,
        "margin": 0.0,
    }
    return [f"class/{performer}/".encode(), _encode(answer)]


def _described(answer: Progress | Event | Done, **renamed: str) -> dict[str, object]:
    """Give the fields of an answer, some by the names that they have on the wire."""
    return {renamed.get(name, name): value for name, value in asdict(answer).items()}


def encode_event(event: Event) -> list[bytes]:
    """Encode that a motion started or ended."""
    described = _described(event, kind="event", label="class", time="t")
    return [f"event/{event.performer}/".encode(), _encode({"v": VERSION, **described})]


def encode_done(done: Done) -> list[bytes]:
    """Encode that a motion was done."""
    return [f"done/{done.performer}/".encode(), _encode({"v": VERSION, **_described(done, label="class")})]


def decode_answer(parts: Sequence[bytes]) -> Answer | None:
    """Decode a recognition, for programs that listen to the answers; None for any other message."""
    try:
        topic, encoded = parts
        if not topic.startswith(b"class/"):
            return None
        answer = _read(encoded)
    except (ValueError, RecursionError):
        return None
    return Answer(answer.performer, answer.index, answer.score, answer.margin, answer.label or answer.outcome)


def encode_classes(classes: Sequence[str]) -> list[bytes]:
    """Encode the class names in the order their indices count."""
    return [b"classes/", _encode({"v": VERSION, "classes": list(classes)})]


def encode_status(status: Status, *, named: bool = True) -> list[bytes]:
    """Encode every counter; with the names of performers and senders only if the listeners may know them."""
    described = {"v": VERSION, "alive": True, **asdict(status), "followed": len(status.performers)}
    if not named:
        described |= {"performers": {}, "refused": {}, "doubted": {}, "compared": {}, "notes": [], "listening": []}
    described |= {"frames_per_second": status.frames_per_second, "lost": status.lost, "health": status.health}
    return [b"status/", _encode(described)]


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


_encode_header = msgspec.json.Encoder().encode
_read_body = msgspec.json.Decoder(BodyHeader).decode


def encode_body(frame: Frame, skeleton: Skeleton | None = None, carried: Carried | None = None) -> list[bytes]:
    """Encode a frame's positions, and perhaps its skeleton and the joints that carry the decision."""
    header = BodyHeader(VERSION, float(frame.time), len(frame.positions))
    if skeleton and len(skeleton.joints) == header.joints:
        header.names, header.parents = skeleton.joints, skeleton.parents
    if carried and len(carried.joints) == header.joints:
        header.carried, header.pairs = carried.joints, carried.pairs
    positions = frame.positions.astype("<f4")
    return [f"body/{frame.performer}/".encode(), _encode_header(header), positions.tobytes()]


def decode_body(parts: Sequence[bytes]) -> tuple[str, BodyHeader, bytes] | None:
    """Decode a body: the performer, the header, the positions' bytes; None for any other message."""
    try:
        topic, encoded, positions = parts
        header = _read_body(encoded)
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
