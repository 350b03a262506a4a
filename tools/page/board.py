"""The board: all that pages show, made of the recogniser's messages.

There is no socket and no clock in here. Messages come in with the time on our clock. Every entry has a number that
grows with each message, so that a page that has seen everything up to a number gets the newer entries alone: of bodies
and answers the newest, of motions and notices all of the last minute.
"""

from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count
from typing import Any

import msgspec

from kinespace.library.naming.hdm05 import title_of
from kinespace.stream.recognition import GONE, Answer, EventKind
from kinespace.stream.status import Status
from kinespace.stream.teaching.commands import UNDONE, Step
from kinespace.stream.zeromq.messages import BodyHeader, decode_body
from kinespace.tools.cli.live_table import counted, promise, said_of

#: Performers that are shown, at most; further ones are counted.
MAX_SHOWN = 8
#: Seconds that are shown.
SHOWN = 60.0
#: Seconds after which a performer without messages is forgotten.
_SILENT = 10.0
#: Seconds for which entries are kept: longer than they are shown, so that they leave by the edge.
_KEPT = SHOWN + 5.0
_MAX_NOTICES, _MAX_DONE, _MAX_CHECKED = 32, 64, 16


class _Event(msgspec.Struct, rename={"label": "class"}):
    performer: str
    event: str
    label: str
    t: float = 0.0


class _Done(msgspec.Struct, rename={"label": "class"}):
    performer: str
    label: str
    count: int
    duration: float


class _Classes(msgspec.Struct):
    classes: list[str]


class _Notice(msgspec.Struct):
    performer: str = ""
    state: str = ""
    seconds: float = 0.0
    reason: str = ""
    taught: str = ""
    check: str = ""
    tried: str = ""
    examples: int = 0


_KINDS = {"class": Answer, "event": _Event, "done": _Done, "classes": _Classes, "status": Status, "teach": _Notice}
_decoders: dict[str, msgspec.json.Decoder[Any]] = {name: msgspec.json.Decoder(kind) for name, kind in _KINDS.items()}
_encode = msgspec.json.Encoder().encode


@dataclass(slots=True)
class _Noted:
    """What a page shows, and the number of the message that it came with."""

    shown: Any = None
    number: int = 0


@dataclass(slots=True)
class _Motion:
    """A bar of the timeline: a motion that was named, or an example; seconds on our clock, no end while it goes on."""

    key: int
    class_name: str
    begin: float
    end: float | None
    number: int
    mark: str = ""
    #: When it started, seconds on the sender's clock.
    started: float = 0.0


@dataclass(slots=True)
class _ShownPerformer:
    arrived: float
    body: _Noted = field(default_factory=_Noted)
    skeleton: _Noted = field(default_factory=_Noted)
    carried: _Noted = field(default_factory=_Noted)
    answer: _Noted = field(default_factory=_Noted)
    motions: deque[_Motion] = field(default_factory=deque)
    #: Motions that were done: the number of the message, the class, its count, begin and end in seconds on our clock.
    done: deque[tuple[int, str, int, float, float]] = field(default_factory=lambda: deque(maxlen=_MAX_DONE))
    #: The beginnings of the guesses: seconds, the class or None.
    guesses: deque[tuple[int, float, str | None]] = field(default_factory=deque)
    #: Where the example begins that is being recorded, or is to be taken out of the past.
    example: float | None = None

    def close(self, ended: float, now: float, number: int) -> None:
        """End the motion that goes on, as long as the sender's clock says: an end is told late when a feed pauses."""
        for motion in self.motions:
            if motion.end is None:
                motion.end, motion.number = min(motion.begin + max(ended - motion.started, 0.0), now), number


class Board:
    """The page's knowledge of the performers, the classes and the recogniser.

    Attributes
    ----------
    number
        The number of the newest entry.
    unread
        Messages that could not be read.
    """

    def __init__(self) -> None:
        self.number = self.unread = 0
        self._performers: dict[str, _ShownPerformer] = {}
        self._further: dict[str, float] = {}
        self._here = _Noted([])
        self._classes, self._status, self._control = _Noted([]), _Noted(), _Noted()
        self._notices: deque[tuple[int, dict[str, object]]] = deque(maxlen=_MAX_NOTICES)
        self._keys = count(1)
        #: The examples that are being checked: the performer, begin and end in seconds on our clock.
        self._checking: deque[tuple[str, float, float]] = deque(maxlen=_MAX_CHECKED)

    def take(self, parts: Sequence[bytes], now: float) -> None:  # noqa: C901 - a line each
        """Take in one message of the recogniser; count a message that cannot be read."""
        kind = parts[0].partition(b"/")[0].decode(errors="replace") if parts else ""
        try:
            message = decode_body(parts) if kind == "body" else _decoders[kind].decode(parts[1])
        except (KeyError, IndexError, ValueError, RecursionError):
            message = None
        if message is None:
            self.unread += 1
            return
        self.number += 1
        match message:
            case name, BodyHeader() as header, positions if performer := self._performer(name, now):
                self._take_body(performer, header, positions)
            case Answer() if message.outcome == GONE:
                self._forget(message.performer)
            case Answer() if performer := self._performer(message.performer, now):
                self._take_answer(performer, message, now)
            case _Event() if performer := self._performer(message.performer, now):
                self._take_event(performer, message, now)
            case _Done(who, name, times, duration) if performer := self._performer(who, now):
                performer.done.append((self.number, name, times, now - duration, now))
            case _Classes():
                if message.classes != self._classes.shown:
                    self._classes = _Noted(message.classes, self.number)
            case Status():
                self._take_status(message, now)
            case _Notice():
                self._take_notice(message, now)

    def _performer(self, name: str, now: float) -> _ShownPerformer | None:
        performer = self._performers.get(name)
        if performer is None:
            if len(self._performers) >= MAX_SHOWN:
                self._further[name] = now
                return None
            performer = self._performers[name] = _ShownPerformer(now)
            self._here = _Noted([*self._performers], self.number)
        performer.arrived = now
        return performer

    def _take_body(self, performer: _ShownPerformer, header: BodyHeader, positions: bytes) -> None:
        performer.body = _Noted((header.joints, positions), self.number)
        if header.names:
            skeleton = {"names": header.names, "parents": header.parents or ()}
            if skeleton != performer.skeleton.shown:
                performer.skeleton = _Noted(skeleton, self.number)
        if header.carried:
            performer.carried = _Noted({"joints": header.carried, "pairs": header.pairs}, self.number)

    def _take_answer(self, performer: _ShownPerformer, answer: Answer, now: float) -> None:
        known = dict.fromkeys([*self._classes.shown, *answer.scores])
        if len(known) > len(self._classes.shown):
            self._classes = _Noted([*known], self.number)
        scores = [answer.scores.get(name) for name in known]
        named = {"label": answer.label, "named": answer.class_name is not None}
        shown = {**named, "scores": scores, "at": now}
        performer.answer = _Noted(msgspec.to_builtins(answer) | shown, self.number)
        if not performer.guesses or performer.guesses[-1][2] != answer.guess:
            performer.guesses.append((self.number, now, answer.guess))
        while len(performer.guesses) > 1 and performer.guesses[1][1] < now - _KEPT:
            performer.guesses.popleft()

    def _take_event(self, performer: _ShownPerformer, event: _Event, now: float) -> None:
        performer.close(event.t, now, self.number)
        if event.event == EventKind.START:
            motion = _Motion(next(self._keys), event.label, now, None, self.number, started=event.t)
            performer.motions.append(motion)
        while performer.motions and (performer.motions[0].end or now) < now - _KEPT:
            performer.motions.popleft()

    def _take_status(self, status: Status, now: float) -> None:
        for name in [name for name, each in self._performers.items() if each.arrived < now - _SILENT]:
            self._forget(name)
        self._further = {name: arrived for name, arrived in self._further.items() if arrived >= now - _SILENT}
        shown = {
            "at": now,
            "counters": list(counted(status)),
            "frames": status.frames_per_second,
            "promise": promise(status.promised, status.missed),
            "hop": [status.hop_p50, status.hop_p99],
            "notes": [*said_of(status), *status.notes],
            "further": len(self._further),
            "listening": status.listening,
        }
        self._status = _Noted(shown, self.number)

    def _take_notice(self, notice: _Notice, now: float) -> None:
        self._notices.append((self.number, {"at": now, **msgspec.to_builtins(notice)}))
        performer = self._performers.get(notice.performer)
        # One that is to be taken later has no seconds yet.
        if performer and notice.state == Step.CHECKING and notice.seconds > 0:
            begin = now - notice.seconds if performer.example is None else performer.example
            self._checking.append((notice.performer, begin, begin + notice.seconds))
        elif notice.taught and self._checking:
            name, begin, end = self._checking.popleft()
            if taught := self._performers.get(name):
                taught.motions.append(_Motion(next(self._keys), notice.taught, begin, end, self.number, "taught"))
        elif notice.state == Step.REFUSED and self._checking and (notice.reason == UNDONE or len(self._checking) == 1):
            # Checks end in the order of their examples.
            self._checking.popleft()
        if performer:
            performer.example = now if notice.state == Step.RECORDING else None

    def _forget(self, name: str) -> None:
        if self._performers.pop(name, None):
            self._here = _Noted([*self._performers], self.number)

    def take_command(self, command: Mapping[str, object], now: float) -> None:
        """Take in a page's command: a span of the past that becomes an example has its bar there."""
        performer = self._performers.get(str(command.get("performer")))
        match command:
            case {"do": "last", "seconds": float() | int() as seconds, "ago": float() | int() as ago} if performer:
                performer.example = now - ago - seconds

    def take_reply(self, control: dict[str, object]) -> None:
        """Take in the control socket's description of the classes and the settings."""
        if control != self._control.shown:
            self.number += 1
            self._control = _Noted(control, self.number)

    def news(self, seen: int, now: float, replies: Iterable[object] = ()) -> bytes:
        """Encode all that is newer than a number: bytes of JSON (u32), the JSON, spaces up to a multiple of 4, bodies.

        Parameters
        ----------
        seen
            The number up to which a page has seen everything.
        now
            Seconds on our clock.
        replies
            Replies to the page's commands.
        """
        shown: dict[str, object] = {"number": self.number, "now": now, "replies": [*replies]}
        for name in ("here", "classes", "status", "control"):
            noted: _Noted = getattr(self, f"_{name}")
            if noted.number > seen:
                shown[name] = noted.shown
        if "classes" in shown:
            titles = {name: title for name in self._classes.shown if (title := title_of(name)) != name}
            shown |= {"titles": titles} if titles else {}
        performers = self._performers.items()

        def newer(what: str) -> dict[str, Any]:
            return {name: noted.shown for name, each in performers if (noted := getattr(each, what)).number > seen}

        shown |= {what: found for what in ("skeleton", "carried", "answer") if (found := newer(what))}
        shown["motions"] = list(self._motions(seen))
        for what in ("guesses", "done"):
            by_name = {name: getattr(each, what) for name, each in performers}
            shown[what] = [(name, *each[1:]) for name, own in by_name.items() for each in own if each[0] > seen]
        shown["notices"] = [notice for number, notice in self._notices if number > seen]
        bodies = newer("body")
        shown["bodies"] = [(name, joints) for name, (joints, _) in bodies.items()]
        # That nobody is here any more is news; no other empty list is.
        encoded = _encode({name: each for name, each in shown.items() if each != [] or name == "here"})
        encoded += b" " * (-len(encoded) % 4)
        return b"".join([len(encoded).to_bytes(4, "little"), encoded, *(each for _, each in bodies.values())])

    def _motions(self, seen: int) -> Iterator[tuple[object, ...]]:
        for name, each in self._performers.items():
            for motion in each.motions:
                if motion.number > seen:
                    yield name, motion.key, motion.class_name, motion.begin, motion.end, motion.mark
