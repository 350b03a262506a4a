"""Answers in the layouts that other programs understand, as OSC packets.

native         as `stream.osc.answers` has it: class, label, scores and events
touchdesigner  numbers only, because the OSC In CHOP takes nothing else
max            as native, but nothing larger than a float
wekinator      `/wek/outputs`, a number for each performer, and `/output_<n>` when a motion starts
vmc-thru       `/VMC/Thru/motion/class s i`, which VMC programs pass on
vrchat         avatar parameters `Motion` and `MotionScore`

Where 0 has to mean "nothing", as in Wekinator and in VRChat's parameters, classes count from 1.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

from kinespace.stream.osc import answers
from kinespace.stream.osc.packet import encode_bundle, encode_message
from kinespace.stream.recognition import EventKind
from kinespace.stream.teaching import wire

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.stream.recognition import Event, Recognition
    from kinespace.stream.status import Status
    from kinespace.stream.teaching.notices import Notice

_Last = TypeVar("_Last", int, float)
#: VRChat's whole-number parameters end here.
_MAX_PARAMETER = 255
#: Performers whose last class is remembered.
_MAX_PERFORMERS = 256


class Layout:
    """What one kind of program is told; None where it is not told at all, which is everywhere unless overridden."""

    #: The layout's name on the command line.
    name: str
    #: The port on which such a program usually listens.
    port: int

    def recognition(self, recognition: Recognition) -> bytes | None:
        """Encode one recognition."""

    def event(self, event: Event) -> bytes | None:
        """Encode that a motion started or ended."""

    def classes(self, classes: Sequence[str]) -> bytes | None:
        """Encode which classes there are."""

    def status(self, status: Status) -> bytes | None:
        """Encode the service's counters."""

    def notice(self, notice: Notice) -> bytes | None:
        """Encode what teaching tells."""


class NativeLayout(Layout):
    """Our own messages."""

    name = "native"
    port = 9311

    def recognition(self, recognition: Recognition) -> bytes | None:
        """Class, label and scores in one bundle."""
        return answers.encode_recognition(recognition)

    def event(self, event: Event) -> bytes | None:
        """`/motion/<performer>/event s s i f d`."""
        return answers.encode_event(event)

    def classes(self, classes: Sequence[str]) -> bytes | None:
        """`/motion/classes s*K`."""
        return answers.encode_classes(classes)

    def status(self, status: Status) -> bytes | None:
        """`/motion/status i f i i`."""
        return answers.encode_status(status)

    def notice(self, notice: Notice) -> bytes | None:
        """`/motion/teach/state s s f s` and `/motion/teach/taught s i f s i`."""
        return wire.encode(notice)


class MaxLayout(NativeLayout):
    """As native; Max has no double, so an event comes without its time."""

    name = "max"
    port = 7400

    def event(self, event: Event) -> bytes | None:
        """`/motion/<performer>/event s start or end, s label, i index, f score`."""
        address = f"/motion/{answers.address_part(event.performer)}/event"
        return encode_message(address, str(event.kind), event.label, event.index, event.score)


class TouchDesignerLayout(NativeLayout):
    """Numbers only, each performer's on addresses of its own: they become channels."""

    name = "touchdesigner"
    port = 10000

    def __init__(self) -> None:
        self._last: dict[str, int] = {}

    def recognition(self, recognition: Recognition) -> bytes | None:
        """`/motion/<performer>/class i index f score f margin i changed` and `/motion/<performer>/scores f*K`.

        The index is that of the named class, -1 for none; changed is 1 in the one message in which it is another.
        """
        changed = self._last.get(recognition.performer, -1) != recognition.class_index
        _remember(self._last, recognition.performer, recognition.class_index)
        start = f"/motion/{answers.address_part(recognition.performer)}"
        told = encode_message(
            f"{start}/class", recognition.class_index, recognition.score, recognition.margin, int(changed)
        )
        whole = encode_bundle(told, encode_message(f"{start}/scores", *map(float, recognition.scores)))
        return whole if len(whole) <= answers.MAX_ANSWER else told

    def event(self, event: Event) -> bytes | None:
        """`/motion/<performer>/going i index`, -1 when a motion ended."""
        index = event.index if event.kind is EventKind.START else -1
        return encode_message(f"/motion/{answers.address_part(event.performer)}/going", index)

    def classes(self, classes: Sequence[str]) -> bytes | None:
        """Nothing: names are no numbers."""


class WekinatorLayout(Layout):
    """What Wekinator itself would send to the program that listens to it."""

    name = "wekinator"
    port = 12000

    def __init__(self) -> None:
        self._last: dict[str, float] = {}

    def recognition(self, recognition: Recognition) -> bytes | None:
        """`/wek/outputs f*performers`, class counted from 1, 0 for none, performers in the order they came."""
        _remember(self._last, recognition.performer, float(recognition.class_index + 1))
        return encode_message("/wek/outputs", *self._last.values())

    def event(self, event: Event) -> bytes | None:
        """`/output_<class from 1>` when a motion starts, as gestures are told."""
        return encode_message(f"/output_{event.index + 1}") if event.kind is EventKind.START else None

    def status(self, status: Status) -> bytes | None:
        """Nothing; but forget performers who have left."""
        self._last = {name: last for name, last in self._last.items() if name in status.performers}
        return None


class VmcThruLayout(Layout):
    """A message of their own for programs that speak VMC, which pass on what they do not know."""

    name = "vmc-thru"
    port = 39539

    def recognition(self, recognition: Recognition) -> bytes | None:
        """`/VMC/Thru/motion/class s label i index`, -1 for none."""
        return encode_message("/VMC/Thru/motion/class", recognition.label, recognition.class_index)

    def event(self, event: Event) -> bytes | None:
        """`/VMC/Thru/motion/start s label i index`, or `end`."""
        return encode_message(f"/VMC/Thru/motion/{event.kind}", event.label, event.index)


class VrchatLayout(Layout):
    """Parameters of an avatar; they keep their value, so that events need no message."""

    name = "vrchat"
    port = 9000

    def recognition(self, recognition: Recognition) -> bytes | None:
        """`/avatar/parameters/Motion i` counted from 1, 0 for none, and `/avatar/parameters/MotionScore f`."""
        number = min(recognition.class_index + 1, _MAX_PARAMETER)
        return encode_bundle(
            encode_message("/avatar/parameters/Motion", number),
            encode_message("/avatar/parameters/MotionScore", recognition.score),
        )


#: Layouts by the name they are asked for.
LAYOUTS: dict[str, type[Layout]] = {
    layout.name: layout
    for layout in (NativeLayout, TouchDesignerLayout, MaxLayout, WekinatorLayout, VmcThruLayout, VrchatLayout)
}


def _remember(known: dict[str, _Last], performer: str, last: _Last) -> None:
    """Remember a performer's last class; only a sender that invents names fills the memory, and empties it."""
    if len(known) >= _MAX_PERFORMERS:
        known.clear()
    known[performer] = last
