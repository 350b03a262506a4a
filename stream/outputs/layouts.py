"""Answers in the layouts that other programs understand, as OSC packets, and the sinks that send them.

native         the messages of `stream.osc.messages`: class, guess, label, scores and events
max, puredata, supercollider
               the same on the ports on which these usually listen
touchdesigner  numbers only, because the OSC In CHOP takes nothing else
wekinator      `/wek/outputs`, a number for each performer, and `/output_<n>` when a motion starts; with progress also
               `/wek/progress`, three numbers for each
vmc-thru       `/VMC/Thru/motion/class s i`, which VMC programs pass on
vrchat         avatar parameters `Motion` and `MotionScore`

Where 0 has to mean "nothing", as in Wekinator and in VRChat's parameters, classes count from 1. All layouts send "no
class" when no class is named, and once when a performer has left.
"""

import math
import re
import string
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Annotated, Literal

import msgspec
from pythonosc.osc_message_builder import BuildError

from kinespace.library.naming.checked_toml import Text, read_toml, text_of
from kinespace.library.naming.hdm05 import title_of
from kinespace.stream.inputs.admission import Admission
from kinespace.stream.osc import OscReceiver, OscSender, address_part, messages
from kinespace.stream.osc.packet import encode_bundle, encode_message
from kinespace.stream.outputs.sink import Message, Sink
from kinespace.stream.packet import remember
from kinespace.stream.recognition import GONE, Classes, Done, Event, EventKind, Gone, Recognition
from kinespace.stream.status import Status
from kinespace.stream.teaching import commands

#: The largest whole number of a VRChat parameter.
_MAX_PARAMETER = 255
#: Phase, speed and amplitude of a performer in no motion, where Wekinator's programs expect numbers.
_NOT_FOLLOWED = (0.0, 0.0, 0.0)
#: Performers whose last class is remembered, at most.
_MAX_PERFORMERS = 256


class Layout:
    """The messages for one kind of program; nothing is sent of a message for whose class it has no method."""

    #: The layout's name on the command line.
    name: str
    #: The port on which such a program usually listens.
    port: int
    #: Notes for a person, a line each.
    notes: Sequence[str] = ()

    def encode(self, message: Message) -> bytes | None:
        """Encode whatever a service has to say, by the method that has the name of its class, like `event`."""
        encode = getattr(self, type(message).__name__.lower(), None)
        return encode(message) if encode else None


class NativeLayout(Layout):
    """Our own messages, perhaps for a program that listens on another port."""

    name = "native"
    port = 9311

    def __init__(self, name: str = "", port: int = 0) -> None:
        self.name, self.port = name or self.name, port or self.port
        #: The time of each performer's first answer: events carry the seconds since then.
        self._since: dict[str, float] = {}

    def recognition(self, recognition: Recognition) -> bytes | None:
        """Class, guess, label and scores in one bundle."""
        # After a sender's clock has begun again, its times count from its new beginning: none is below 0.
        if recognition.time < self._since.get(recognition.performer, math.inf):
            remember(self._since, recognition.performer, recognition.time, _MAX_PERFORMERS)
        return messages.encode_recognition(recognition)

    def event(self, event: Event) -> bytes | None:
        """`/motion/<performer>/event s s i f f`, the time in seconds since the performer's first answer."""
        return messages.encode_event(event, self._since.get(event.performer, event.time))

    def done(self, done: Done) -> bytes | None:
        """`/motion/<performer>/done s i i f f f f f`, the start in seconds since the performer's first answer."""
        return messages.encode_done(done, self._since.get(done.performer, done.start))

    def gone(self, gone: Gone) -> bytes:
        """Class -1, guess -1 and label "gone"."""
        self._since.pop(gone.performer, None)
        return messages.encode_gone(gone.performer)

    def classes(self, classes: Classes) -> bytes:
        """`/motion/classes s*K`."""
        return messages.encode_classes(classes.names)

    def status(self, status: Status) -> bytes | None:
        """`/motion/status i f i i`."""
        return messages.encode_status(status)

    def state(self, notice: commands.Notice) -> bytes:
        """`/motion/teach/state s s f s` and `/motion/teach/taught s i f s i i f`."""
        return commands.encode(notice)

    taught = state


class TouchDesignerLayout(Layout):
    """Numbers only, each performer's at addresses of its own: they become channels."""

    name = "touchdesigner"
    port = 10000

    def __init__(self) -> None:
        self._last: dict[str, int] = {}

    def recognition(self, recognition: Recognition) -> bytes | None:
        """`/motion/<performer>/class i index f score f margin i changed`, `.../scores f*K`, `.../progress`.

        The index is the named class's, -1 when no class is named; changed is 1 in the first message with another index.
        """
        name, index = recognition.performer, recognition.class_index
        changed = self._last.get(name, -1) != index
        remember(self._last, name, index, _MAX_PERFORMERS)
        named = messages.encode_numbers(name, "class", "iffi", index, recognition.score, recognition.margin, changed)
        followed = [messages.encode_progress(recognition)] if recognition.progress else []
        return messages.with_scores([named, *followed], recognition)

    def event(self, event: Event) -> bytes | None:
        """`/motion/<performer>/going i index`, -1 when a motion ended."""
        index = event.index if event.kind is EventKind.START else -1
        return messages.encode_numbers(event.performer, "going", "i", index)

    def done(self, done: Done) -> bytes | None:
        """`/motion/<performer>/done i index i count f duration f score f speed f amplitude`."""
        numbers = done.index, done.count, done.duration, done.score, done.speed, done.amplitude
        return messages.encode_numbers(done.performer, "done", "iiffff", *numbers)

    def gone(self, gone: Gone) -> bytes:
        """Class -1, and -1 going on."""
        changed = self._last.pop(gone.performer, -1) != -1
        none = messages.encode_numbers(gone.performer, "class", "iffi", -1, 0.0, 0.0, changed)
        return encode_bundle(none, messages.encode_numbers(gone.performer, "going", "i", -1))

    def status(self, status: Status) -> bytes:
        """`/motion/status i f i i`."""
        return messages.encode_status(status)


class WekinatorLayout(Layout):
    """The messages that Wekinator itself would send to the program that listens to it."""

    name = "wekinator"
    port = 12000

    def __init__(self) -> None:
        #: The performer in each place, empty for one who has left, whose place the next newcomer takes; the last class
        #: from 1, or 0; and phase, speed and amplitude, or zeros.
        self._places: list[tuple[str, float, Sequence[float]]] = []
        #: Whether a motion was ever followed: then phase, speed and amplitude are sent, too.
        self._follows = False

    def recognition(self, recognition: Recognition) -> bytes | None:
        """`/wek/outputs f*performers`, class counted from 1, 0 for none; each performer keeps a place.

        With progress also `/wek/progress f*3*performers`: phase, speed and amplitude, as continuous outputs.
        """
        self._follows = self._follows or recognition.progress is not None
        performer, number = recognition.performer, float(recognition.class_index + 1)
        self._places[self._place_of(performer)] = performer, number, recognition.followed
        return self._outputs()

    def _outputs(self) -> bytes:
        classes = encode_message("/wek/outputs", *(number for _, number, _ in self._places))
        if not self._follows:
            return classes
        followed = chain.from_iterable(followed for _, _, followed in self._places)
        return encode_bundle(classes, encode_message("/wek/progress", *followed))

    def _place_of(self, performer: str) -> int:
        names = [name for name, _, _ in self._places]
        for wanted in (performer, ""):
            if wanted in names:
                return names.index(wanted)
        if len(names) >= _MAX_PERFORMERS:
            self._places.clear()
        self._places.append(("", 0.0, _NOT_FOLLOWED))
        return len(self._places) - 1

    def event(self, event: Event) -> bytes | None:
        """`/output_<class from 1>` when a motion starts, as Wekinator reports gestures."""
        return encode_message(f"/output_{event.index + 1}") if event.kind is EventKind.START else None

    def gone(self, gone: Gone) -> bytes | None:
        """`/wek/outputs` with 0 in the performer's place; the others keep theirs."""
        here = [name == gone.performer for name, _, _ in self._places]
        if not any(here):
            return None
        self._places[here.index(True)] = "", 0.0, _NOT_FOLLOWED
        return self._outputs()


class VmcThruLayout(Layout):
    """A message of our own for programs that speak VMC, which pass on messages they do not know."""

    name = "vmc-thru"
    port = 39539

    def recognition(self, recognition: Recognition) -> bytes | None:
        """`/VMC/Thru/motion/class s label i index`, -1 for none."""
        return encode_message("/VMC/Thru/motion/class", recognition.label, recognition.class_index)

    def event(self, event: Event) -> bytes | None:
        """`/VMC/Thru/motion/start s label i index`, or `end`."""
        return encode_message(f"/VMC/Thru/motion/{event.kind}", event.label, event.index)

    def gone(self, _: Gone) -> bytes:
        """Label "gone" and index -1."""
        return encode_message("/VMC/Thru/motion/class", GONE, -1)


class VrchatLayout(Layout):
    """Parameters of an avatar; they keep their value, so that events need no message."""

    name = "vrchat"
    port = 9000

    def recognition(self, recognition: Recognition) -> bytes | None:
        """`/avatar/parameters/Motion i` counted from 1, 0 for none, and `/avatar/parameters/MotionScore f`."""
        return _parameters(min(recognition.class_index + 1, _MAX_PARAMETER), recognition.score)

    def gone(self, _: Gone) -> bytes:
        """No motion, and no score."""
        return _parameters(0, 0.0)


def _parameters(motion: int, score: float) -> bytes:
    of_score = encode_message("/avatar/parameters/MotionScore", score)
    return encode_bundle(encode_message("/avatar/parameters/Motion", motion), of_score)


#: Programs that read our own messages, and the ports on which they usually listen.
_NATIVE = {"max": 7400, "puredata": 9312, "supercollider": 57120}
#: What makes each layout, by the name it is asked for.
LAYOUTS: dict[str, Callable[[], Layout]] = {
    **{each.name: each for each in (NativeLayout, TouchDesignerLayout, WekinatorLayout, VmcThruLayout, VrchatLayout)},
    **{name: partial(NativeLayout, name, port) for name, port in _NATIVE.items()},
}


class LayoutSink(Sink):
    """Sends answers in some program's layout to one place.

    Parameters
    ----------
    layout
        The messages that the program understands.
    sender
        Where to send them; closed by `close`.
    """

    def __init__(self, layout: Layout, sender: OscSender) -> None:
        self.layout, self.sender = layout, sender

    def __str__(self) -> str:
        return f"{self.layout.name} {self.sender}"

    @property
    def failed(self) -> int:  # type: ignore[override]  # the sender counts
        """Answers that the system would not send."""
        return self.sender.failed

    def send(self, message: Message) -> None:
        """Send a message, if the layout has one."""
        about = message.performer if isinstance(message, Recognition | Event | Done | Gone) else None
        self._send(self.layout.encode(message), about)
        self.notes = self.layout.notes

    def _send(self, packet: bytes | None, performer: str | None = None) -> None:  # noqa: ARG002 - all get all
        if packet is not None:
            self.sender.send(packet)

    def close(self) -> None:
        """Close the socket."""
        self.sender.close()


class ReplySink(LayoutSink):
    """Sends each performer's answers to the performer's own sender, from the port it sent to.

    Messages that concern all performers go to all senders.

    Parameters
    ----------
    layout
        The messages that the senders understand.
    receiver
        The port on which frames come in; not closed here.
    port
        The port on the sender's host; 0 for the port it sent from.
    senders
        Knows the sender of each performer.
    """

    #: Answers that the system would not send.
    failed = 0

    def __init__(self, layout: Layout, receiver: OscReceiver, port: int, senders: Admission) -> None:
        self.layout, self.port = layout, port
        self._receiver, self._senders = receiver, senders

    def __str__(self) -> str:
        return f"{self.layout.name} the sender{f':{self.port}' if self.port else ''}"

    def send(self, message: Message) -> None:
        """Send a message, but none to a sender that has gone, or that need not teach."""
        if not isinstance(message, Gone | commands.Notice):
            super().send(message)

    def _send(self, packet: bytes | None, performer: str | None = None) -> None:
        if packet is None:
            return
        targets = self._senders.senders(performer)
        for host, port in dict.fromkeys((host, self.port or port) for host, port in targets):
            self.failed += not self._receiver.send_to(packet, (host, port))

    def close(self) -> None:
        """Leave the receiver open."""


#: The facts of an answer, by the names that stand in braces.
Facts = Mapping[str, str | int | float]

When = Literal["answer", "start", "end", "done", "gone"]
#: The names that may stand in braces; `number` is the class's index from 1, 0 for none.
_NAMED = ("performer", "class", "title", "index", "number", "score")
FACTS: dict[When, tuple[str, ...]] = {
    "answer": (*_NAMED, "margin", "phase", "speed", "amplitude"),
    "start": _NAMED,
    "end": _NAMED,
    "done": (*_NAMED, "count", "duration", "speed", "amplitude"),
    "gone": ("performer",),
}

#: What may stand behind a name and a colon: how wide it is written at least, and with how many places. Other programs'
#: formats may take all memory, or fail at a value that has not come before.
_FORMAT = re.compile(r"[<>^]?0?\d{0,2}(\.\d)?[dfg%]?")
_MAX_MESSAGES = 256

#: Facts that are no fractions, by which a file is tried before a performer comes.
_EXAMPLES: Facts = {"performer": "ann", "class": "bow", "title": "bow", "index": 0, "number": 1, "count": 1}


class LayoutFileError(ValueError):
    """A layout's file cannot be read; the message says where, what was expected and what was got."""


class WrittenMessage(msgspec.Struct, frozen=True, forbid_unknown_fields=True, rename={"of_class": "class"}):
    """One message: when it is sent, of which class (any where it is empty), where to, and what it holds."""

    when: When
    address: Annotated[str, msgspec.Meta(pattern="^/")]
    arguments: tuple[int | float | str, ...] = ()
    of_class: str = ""

    def __post_init__(self) -> None:
        known = FACTS[self.when]
        for text in (self.address, *(each for each in self.arguments if isinstance(each, str))):
            try:
                fields = [each[1:] for each in string.Formatter().parse(text) if each[1] is not None]
            except ValueError as error:
                raise ValueError(f"address or arguments: expected names in braces, got {text!r} ({error})") from error
            for name, form, conversion in fields:
                if name not in known:
                    raise ValueError(f"{{{name}}}: expected one of {', '.join(known)} when {self.when}, got {text!r}")
                if conversion or not _FORMAT.fullmatch(form or ""):
                    raise ValueError(f"{{{name}}}: expected a format like :.2f or :>8, got {text!r}")
        try:
            self.encoded({name: _EXAMPLES.get(name, 0.5) for name in known})
        except (ValueError, OverflowError, BuildError) as error:
            raise ValueError(f"arguments: expected numbers and texts of OSC, got {self.arguments} ({error})") from error

    def encoded(self, facts: Facts) -> bytes:
        """Encode the message; names in braces give way to facts."""
        parts = {name: address_part(fact) if isinstance(fact, str) else fact for name, fact in facts.items()}
        address = self.address.format_map(parts)
        return encode_message(address, *(_filled(each, facts) for each in self.arguments))


class _File(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    message: Annotated[tuple[WrittenMessage, ...], msgspec.Meta(min_length=1, max_length=_MAX_MESSAGES)]
    title: Text = "layout"
    port: Annotated[int, msgspec.Meta(ge=1, le=65535)] = 9000


class WrittenLayout(Layout):
    """The messages of a file.

    Raises
    ------
    LayoutFileError
        The file is no such layout.
    OSError
        It cannot be read.
    """

    def __init__(self, path: Path) -> None:
        read = read_toml(text_of(path, LayoutFileError), path.name, _File, LayoutFileError)
        self.name, self.port, self._messages = read.title, read.port, read.message

    def recognition(self, recognition: Recognition) -> bytes | None:
        """Encode the messages of an answer."""
        named = _class_facts(recognition.performer, recognition.label, recognition.class_index, recognition.score)
        phase, speed, amplitude = recognition.followed
        further = {"margin": recognition.margin, "phase": phase, "speed": speed, "amplitude": amplitude}
        return self._encoded("answer", {**named, **further})

    def event(self, event: Event | Done) -> bytes | None:
        """Encode the messages of a start, an end, or a motion that was done."""
        when: When = "done" if isinstance(event, Done) else event.kind.value
        named = _class_facts(event.performer, event.label, event.index, event.score)
        return self._encoded(when, {each: getattr(event, each) for each in FACTS[when] if each not in named} | named)

    done = event

    def classes(self, classes: Classes) -> None:
        """Send nothing; note the titles that a message asks for in place of classes."""
        asked = {each.of_class for each in self._messages} - {*classes.names}
        meant = {title: [each for each in classes.names if title_of(each) == title] for title in sorted(asked)}
        note = "{}: no class is called {!r}, which is a title: {} is meant".format
        self.notes = [note(self.name, title, " or ".join(names)) for title, names in meant.items() if names]

    def gone(self, gone: Gone) -> bytes | None:
        """Encode the messages of a performer who has left."""
        return self._encoded("gone", {"performer": gone.performer})

    def _encoded(self, when: When, facts: Facts) -> bytes | None:
        fitting = "", facts.get("class", "")
        chosen = [each.encoded(facts) for each in self._messages if each.when == when and each.of_class in fitting]
        return encode_bundle(*chosen) if chosen else None


def _class_facts(performer: str, class_name: str, index: int, score: float) -> dict[str, str | int | float]:
    named = {"performer": performer, "class": class_name, "title": title_of(class_name)}
    return {**named, "index": index, "number": index + 1, "score": score}


def _filled(argument: float | str, facts: Facts) -> int | float | str:
    """Give an argument; a text that is one name in braces is that fact itself, a number where it is one."""
    if not isinstance(argument, str):
        return argument
    name = argument[1:-1]
    return facts[name] if argument == f"{{{name}}}" and name in facts else argument.format_map(facts)
