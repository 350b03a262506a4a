"""Answers as OSC messages.

`/motion/<performer>/class i index f score f margin`, `/motion/<performer>/guess i index`,
`/motion/<performer>/sofar i index`, `/motion/<performer>/label s` and `/motion/<performer>/scores f*K` in one bundle
for each recognition, and with them, while a motion is followed,
`/motion/<performer>/progress i index of its class f phase f speed f amplitude f sure f scrub i cycles`;
`/motion/<performer>/event s start or end s label i index f score f time` when a motion starts or ends;
`/motion/classes s*K`; `/motion/status`.

The class message holds numbers only, because TouchDesigner's OSC In CHOP reads only numbers. Its index is the named
class's, in the order of `/motion/classes`, and -1 when no class is named. The label then says why: "unknown" when the
guess is not near enough to the library, "gone" once when the performer has left. The guess is the moment's best class,
-1 when there is no guess; "sofar" is the class that the movement of the last seconds is nearest to. Score and margin
belong to the guess. No number is larger than a float, because Pure Data and many libraries know no double.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from functools import lru_cache
from urllib.parse import quote

from pythonosc.osc_packet import OscPacket, ParseError

from kinespace.stream.osc.packet import BUNDLE_START, encode_bundle, encode_message, padded
from kinespace.stream.recognition import GONE, Answer, Done, Event, Recognition
from kinespace.stream.status import Status

#: Bytes of an answer, at most. Most networks cut larger datagrams into fragments, and one lost fragment loses all.
MAX_ANSWER = 1200
_CLASS = struct.Struct(">iff")
_SIZE = struct.Struct(">i")
_EVENT = struct.Struct(">iff")
_PROGRESS = struct.Struct(">ifffffi")
_MAX_INTEGER = 2**31 - 1
#: The largest number that OSC holds as a float.
_MAX_FLOAT = (2 - 2**-23) * 2.0**127
#: Characters that OSC 1.0 reserves in addresses, and the sign by which they are written.
_RESERVED = frozenset(" #*,/?[]{}%")

#: A label's bytes: a performer's answers have the same few.
_label = lru_cache(maxsize=1024)(padded)


def encode_recognition(recognition: Recognition) -> bytes:
    """Encode an answer as one bundle of at most 1200 bytes.

    In a library of more than some 200 classes the scores do not fit and are left out; class and label always fit.
    """
    heads = _answer_heads(recognition.performer, len(recognition.scores))
    class_head, guess_head, so_far_head, label_head, scores_head, _ = heads
    messages = [
        class_head + _CLASS.pack(recognition.class_index, recognition.score, recognition.margin),
        guess_head + _SIZE.pack(recognition.guess_index),
        so_far_head + _SIZE.pack(recognition.so_far),
        label_head + _label(recognition.label),
    ]
    if recognition.progress:
        messages.append(encode_progress(recognition))
    messages.append(scores_head + recognition.scores.astype(">f4").tobytes())
    if len(BUNDLE_START) + sum(_SIZE.size + len(message) for message in messages) > MAX_ANSWER:
        messages.pop()
    return BUNDLE_START + b"".join(_SIZE.pack(len(message)) + message for message in messages)


@lru_cache(maxsize=1024)
def _answer_heads(performer: str, classes: int) -> tuple[bytes, ...]:
    """Give the bytes before the arguments of an answer's messages; all of a performer's answers share them."""
    start = f"/motion/{address_part(performer)}"
    layouts = {
        "class": ",iff",
        "guess": ",i",
        "sofar": ",i",
        "label": ",s",
        "scores": "," + "f" * classes,
        "progress": ",ifffffi",
    }
    return tuple(padded(f"{start}/{last}") + padded(types) for last, types in layouts.items())


def encode_progress(recognition: Recognition) -> bytes:
    """Encode `/motion/<performer>/progress` by itself; empty when no motion is followed."""
    progress = recognition.progress
    if progress is None:
        return b""
    head = _answer_heads(recognition.performer, len(recognition.scores))[-1]
    numbers = (progress.phase, progress.speed, progress.amplitude, progress.sure, progress.scrub)
    return head + _PROGRESS.pack(recognition.progress_index, *numbers, progress.cycles)


def encode_gone(performer: str) -> bytes:
    """Encode that a performer has left: an answer without a class, without scores."""
    start = f"/motion/{address_part(performer)}"
    return encode_bundle(
        encode_message(f"{start}/class", -1, 0.0, 0.0),
        encode_message(f"{start}/guess", -1),
        encode_message(f"{start}/sofar", -1),
        encode_message(f"{start}/label", GONE),
    )


def encode_event(event: Event, since: float = 0.0) -> bytes:
    """Encode `/motion/<performer>/event s start or end, s label, i index, f score, f time`.

    Parameters
    ----------
    event
        Start or end.
    since
        The moment from which the time is counted, seconds, on the clock of the frames. A float holds some hours to the
        millisecond, but no clock that began in 1970.
    """
    address = f"/motion/{address_part(event.performer)}/event"
    elapsed = min(max(event.time - since, -_MAX_FLOAT), _MAX_FLOAT)
    numbers = _EVENT.pack(event.index, event.score, elapsed)
    return b"".join([padded(address), b",ssiff\0\0", padded(event.kind), padded(event.label), numbers])


def encode_done(done: Done, since: float = 0.0) -> bytes:
    """Encode `/motion/<performer>/done s label i index i count f start f duration f score f speed f amplitude`.

    Parameters
    ----------
    done
        The motion.
    since
        As in `encode_event`.
    """
    start = min(max(done.start - since, -_MAX_FLOAT), _MAX_FLOAT)
    numbers = done.duration, done.score, done.speed, done.amplitude
    return encode_message(
        f"/motion/{address_part(done.performer)}/done", done.label, done.index, done.count, start, *numbers
    )


def encode_classes(classes: Sequence[str]) -> bytes:
    """Encode the class names in the order their indices count, as `/motion/classes`."""
    return encode_message("/motion/classes", *classes)


def encode_status(status: Status) -> bytes:
    """Encode `/motion/status i alive f frames per second i performers i lost`, numbers only."""
    # A sender's sequence numbers may skip more than an OSC integer holds.
    lost = min(status.lost, _MAX_INTEGER)
    return encode_message("/motion/status", 1, status.frames_per_second, len(status.performers), lost)


@lru_cache(maxsize=1024)
def address_part(performer: str) -> str:
    """Give a performer's name for use in addresses, another for each name.

    Letters of any script stay, in UTF-8; characters that OSC reserves or that do not print are written as in a URL
    (`a b` is `a%20b`).
    """
    return "".join(
        each if each.isprintable() and each not in _RESERVED else quote(each, safe="", errors="replace")
        for each in performer
    )


def decode_answer(datagram: bytes) -> Answer | None:
    """Decode a recognition's bundle, for programs that listen to the answers; None for any other packet."""
    try:
        messages = [timed.message for timed in OscPacket(datagram).messages]
        found = {message.address.rpartition("/")[2]: message for message in messages}
        index, score, margin = found["class"].params
        (label,) = found["label"].params
        performer = found["class"].address.split("/")[2]
        return Answer(performer, int(index), float(score), float(margin), str(label))
    except (ParseError, KeyError, TypeError, ValueError, IndexError, OverflowError, RecursionError):
        return None
