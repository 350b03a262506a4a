"""What hears the answer: recognitions in the layouts that other programs understand, and sinks that send them.

native         as `stream.osc` has it: class, label, scores and events
touchdesigner  numbers only, because the OSC In CHOP takes nothing else
max            as native, but nothing larger than a float
wekinator      `/wek/outputs`, a number for each performer, and `/output_<n>` when a motion starts
vmc-thru       `/VMC/Thru/motion/class s i`, which VMC programs pass on
vrchat         avatar parameters `Motion` and `MotionScore`

Where 0 has to mean "nothing", as in Wekinator and in VRChat's parameters, classes count from 1.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
from pythonosc.osc_message_builder import OscMessageBuilder

from kinespace.stream import osc
from kinespace.stream.recognition import EventKind

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from kinespace.stream.recognition import Event, Recognition
    from kinespace.stream.status import Status

#: VRChat's whole-number parameters end here.
_LARGEST_PARAMETER = 255
#: Performers whose last class is remembered.
_MOST_PERFORMERS = 256


class Layout(Protocol):
    """How one kind of program wants to be told; None where it is not told at all."""

    #: Where such a program usually listens.
    port: int

    def recognition(self, recognition: Recognition) -> bytes | None:
        """Encode one recognition."""

    def event(self, event: Event) -> bytes | None:
        """Encode that a motion started or ended."""

    def classes(self, classes: Sequence[str]) -> bytes | None:
        """Encode which classes there are."""

    def status(self, status: Status) -> bytes | None:
        """Encode how the service does."""


class NativeLayout:
    """Our own messages."""

    port = 9311

    def recognition(self, recognition: Recognition) -> bytes | None:
        """Class, label and scores in one bundle."""
        return osc.encode_recognition(recognition)

    def event(self, event: Event) -> bytes | None:
        """`/motion/<performer>/event s s i f d`."""
        return osc.encode_event(event)

    def classes(self, classes: Sequence[str]) -> bytes | None:
        """`/motion/classes s*K`."""
        return osc.encode_classes(classes)

    def status(self, status: Status) -> bytes | None:
        """`/motion/status i f i i`."""
        return osc.encode_status(status)


class MaxLayout(NativeLayout):
    """As native; Max has no double, so an event comes without its time."""

    port = 7400

    def event(self, event: Event) -> bytes | None:
        """`/motion/<performer>/event s start or end, s label, i index, f score`."""
        address = f"/motion/{osc.address_part(event.performer)}/event"
        return _bundle((address, str(event.kind), event.label, event.index, event.score))


class TouchDesignerLayout(NativeLayout):
    """Numbers only, each performer's on addresses of its own: they become channels."""

    port = 10000

    def __init__(self) -> None:
        self._last: dict[str, int] = {}

    def recognition(self, recognition: Recognition) -> bytes | None:
        """`/motion/<performer>/class i index f score f margin i changed` and `/motion/<performer>/scores f*K`.

        The index is that of the named class, -1 for none; changed is 1 in the one message in which it is another.
        """
        changed = self._last.get(recognition.performer, -1) != recognition.class_index
        if len(self._last) >= _MOST_PERFORMERS:
            self._last.clear()
        self._last[recognition.performer] = recognition.class_index
        start = f"/motion/{osc.address_part(recognition.performer)}"
        told = (f"{start}/class", recognition.class_index, recognition.score, recognition.margin, int(changed))
        whole = _bundle(told, (f"{start}/scores", *map(float, recognition.scores)))
        return whole if len(whole) <= osc.LARGEST_ANSWER else _bundle(told)

    def event(self, event: Event) -> bytes | None:
        """`/motion/<performer>/going i index`, -1 when a motion ended."""
        index = event.index if event.kind is EventKind.START else -1
        return _bundle((f"/motion/{osc.address_part(event.performer)}/going", index))

    def classes(self, classes: Sequence[str]) -> bytes | None:  # noqa: ARG002 - names are no numbers
        """Nothing: names are no numbers."""
        return None


class WekinatorLayout:
    """What Wekinator itself would send to the program that listens to it."""

    port = 12000

    def __init__(self) -> None:
        self._last: dict[str, float] = {}

    def recognition(self, recognition: Recognition) -> bytes | None:
        """`/wek/outputs f*performers`, class counted from 1, 0 for none, performers in the order they came."""
        if len(self._last) >= _MOST_PERFORMERS:
            self._last.clear()
        self._last[recognition.performer] = float(recognition.class_index + 1)
        return _bundle(("/wek/outputs", *self._last.values()))

    def event(self, event: Event) -> bytes | None:
        """`/output_<class from 1>` when a motion starts, as gestures are told."""
        return _bundle((f"/output_{event.index + 1}",)) if event.kind is EventKind.START else None

    def classes(self, classes: Sequence[str]) -> bytes | None:  # noqa: ARG002 - Wekinator has no such message
        """Nothing."""
        return None

    def status(self, status: Status) -> bytes | None:
        """Nothing; but forget performers who have left."""
        self._last = {name: last for name, last in self._last.items() if name in status.performers}
        return None


class VmcThruLayout:
    """Messages that VMC programs pass on."""

    port = 39539

    def recognition(self, recognition: Recognition) -> bytes | None:
        """`/VMC/Thru/motion/class s label i index`, -1 for none."""
        return _bundle(("/VMC/Thru/motion/class", recognition.label, recognition.class_index))

    def event(self, event: Event) -> bytes | None:
        """`/VMC/Thru/motion/start s label i index`, or `end`."""
        return _bundle((f"/VMC/Thru/motion/{event.kind}", event.label, event.index))

    def classes(self, classes: Sequence[str]) -> bytes | None:  # noqa: ARG002 - one text and one number is all
        """Nothing."""
        return None

    def status(self, status: Status) -> bytes | None:  # noqa: ARG002 - as above
        """Nothing."""
        return None


class VrchatLayout:
    """Parameters of an avatar."""

    port = 9000

    def recognition(self, recognition: Recognition) -> bytes | None:
        """`/avatar/parameters/Motion i` counted from 1, 0 for none, and `/avatar/parameters/MotionScore f`."""
        number = min(recognition.class_index + 1, _LARGEST_PARAMETER)
        return _bundle(
            ("/avatar/parameters/Motion", number), ("/avatar/parameters/MotionScore", float(recognition.score))
        )

    def event(self, event: Event) -> bytes | None:  # noqa: ARG002 - a parameter is what it is
        """Nothing: a parameter keeps its value."""
        return None

    def classes(self, classes: Sequence[str]) -> bytes | None:  # noqa: ARG002 - parameters are numbers
        """Nothing."""
        return None

    def status(self, status: Status) -> bytes | None:  # noqa: ARG002 - as above
        """Nothing."""
        return None


#: Layouts by the name they are asked for.
LAYOUTS: dict[str, Callable[[], Layout]] = {
    "native": NativeLayout,
    "touchdesigner": TouchDesignerLayout,
    "max": MaxLayout,
    "wekinator": WekinatorLayout,
    "vmc-thru": VmcThruLayout,
    "vrchat": VrchatLayout,
}


def _bundle(*messages: tuple[object, ...]) -> bytes:
    """Encode one message alone, several as a bundle to be dealt with immediately."""
    built = []
    for address, *arguments in messages:
        builder = OscMessageBuilder(str(address))
        for argument in arguments:
            builder.add_arg(argument, {float: "f", int: "i", str: "s"}[type(argument)])  # type: ignore[arg-type]  # one of the three
        built.append(builder.build())
    if len(built) == 1:
        alone: bytes = built[0].dgram
        return alone
    bundle = OscBundleBuilder(IMMEDIATELY)
    for message in built:
        bundle.add_content(message)
    encoded: bytes = bundle.build().dgram
    return encoded


class AnswerSender(Protocol):
    """Where datagrams go."""

    failed: int

    def send(self, datagram: bytes) -> None:
        """Send one; a failure is counted, never raised."""

    def close(self) -> None:
        """Give sockets back."""


class ReplySender:
    """Sends to whoever sent last, from the port it sent to.

    Parameters
    ----------
    receiver
        The port frames come in on; not closed here.
    port
        Where on the sender's host; 0 for the port it sent from.
    """

    def __init__(self, receiver: osc.OscReceiver, port: int) -> None:
        self._receiver = receiver
        self._port = port
        self.failed = 0

    def __str__(self) -> str:
        return f"the sender{f':{self._port}' if self._port else ''}"

    def send(self, datagram: bytes) -> None:
        """Send one datagram; nobody is there to be told before anything came."""
        if self._receiver.sender is None:
            return
        host, port = self._receiver.sender
        self.failed += not self._receiver.send_to(datagram, (host, self._port or port))

    def close(self) -> None:
        """Nothing to close: the socket is the receiver's."""


class LayoutSink:
    """Answers in some program's layout to one place.

    Parameters
    ----------
    name
        What the layout is called.
    layout
        How the program wants to be told.
    sender
        Where to.
    """

    def __init__(self, name: str, layout: Layout, sender: AnswerSender) -> None:
        self.name = name
        self.layout = layout
        self.sender = sender

    def __str__(self) -> str:
        if isinstance(self.sender, osc.OscSender):
            host, port = self.sender.target[:2]
            return f"{self.name} {host}:{port}"
        return f"{self.name} {self.sender}"

    @property
    def failed(self) -> int:
        """Answers the system would not take."""
        return self.sender.failed

    def publish(self, recognition: Recognition) -> None:
        """Send one recognition."""
        self._send(self.layout.recognition(recognition))

    def publish_event(self, event: Event) -> None:
        """Send one event."""
        self._send(self.layout.event(event))

    def publish_classes(self, classes: Sequence[str]) -> None:
        """Send the class names."""
        self._send(self.layout.classes(classes))

    def publish_status(self, status: Status) -> None:
        """Send the status."""
        self._send(self.layout.status(status))

    def _send(self, packet: bytes | None) -> None:
        if packet is not None:
            self.sender.send(packet)

    def close(self) -> None:
        """Close the socket."""
        self.sender.close()
