"""Answers as ZeroMQ messages: a topic and a JSON object.

`[b"class/<performer>/"][JSON]`, `[b"event/<performer>/"][JSON]`, `[b"done/<performer>/"][JSON]`,
`[b"classes/"][JSON]`, `[b"status/"][JSON]`. NaN and infinity are null, because JSON has neither.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

import msgspec

from kinespace.stream.recognition import GONE, Answer, Done, Event, Progress, Recognition
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
