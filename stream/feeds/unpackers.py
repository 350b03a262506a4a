"""How products pack their messages: OSC, JSON or plain numbers. Each packing becomes messages that presets read.

osc       as it is
channels  OSC with one number to a message, as TouchDesigner's OSC Out CHOP sends it: `/p1/wrist_l:tx f`; three of them
          become `/p1/wrist_l x y z`, whichever of their spellings they have; numbers that did not change may lack
rokoko    Rokoko Studio's JSON, version 3: `/rokoko/<actor>/<joint> x y z`
zigsim    ZIG SIM's JSON: `/zigsim/<device>/<joint> x y z`; its OSC as it is
xsens     Xsens MVN's MXTP02: `/xsens/<character>/<segment> x y z time`
"""

import struct
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

import msgspec

from kinespace.library.recordings.formats.table_header import coordinate_of
from kinespace.stream.frame import MAX_PERFORMER_LENGTH
from kinespace.stream.osc.messages import address_part
from kinespace.stream.osc.packet import MAX_MESSAGES, Message, PacketError, decode_packet

#: Joints whose numbers are known, at most; a sender that makes up names fills the memory, and empties it.
_MAX_WAITING = 1024
#: Bundles without a joint after which its numbers count as unchanged, and after which they count as lost.
_UNCHANGED, _LOST = 4, 600
#: Xsens MVN's network stream: identifier, sample, datagram, items, time code in ms, character, body segments, props,
#: finger segments, two reserved bytes and the size of the rest.
_MXTP = struct.Struct(">6sIBBIBBBB2xH")
#: A segment's number, its position in metres and its orientation (w x y z).
_SEGMENT = struct.Struct(">i3f16x")


#: Makes messages of the packets of one port; raises PacketError for a packet that is packed otherwise.
Unpacker = Callable[[bytes], list[Message]]


class _ByAxis(msgspec.Struct):
    x: float | None
    y: float | None
    z: float | None


_Axes = tuple[float | None, float | None, float | None]
#: A place in JSON: as [x, y, z], as {x, y, z}, or none.
Place = _Axes | _ByAxis | None


def axes_of(place: Place) -> _Axes:
    """Give a place's x, y and z, None for what is lost."""
    return (place.x, place.y, place.z) if isinstance(place, _ByAxis) else place or (None, None, None)


class _RokokoJoint(msgspec.Struct):
    position: Place


class _RokokoActor(msgspec.Struct):
    name: str
    body: dict[str, _RokokoJoint] = {}


class _RokokoScene(msgspec.Struct):
    actors: list[_RokokoActor] = []


class _Rokoko(msgspec.Struct):
    scene: _RokokoScene


class _ZigSimDevice(msgspec.Struct):
    name: str = ""
    uuid: str = ""


class _ZigSimSensors(msgspec.Struct):
    body: dict[str, Place] = msgspec.field(default_factory=dict, name="bodyTracking")


class _ZigSim(msgspec.Struct):
    sensors: _ZigSimSensors = msgspec.field(name="sensordata")
    device: _ZigSimDevice = msgspec.field(default_factory=_ZigSimDevice)


_rokoko = msgspec.json.Decoder(_Rokoko).decode
_zigsim = msgspec.json.Decoder(_ZigSim).decode


def unpack_rokoko(packet: bytes) -> list[Message]:
    """Read a frame of Rokoko Studio's JSON; all actors are in it."""
    actors = _read(_rokoko, packet).scene.actors
    return _bounded(
        _message("rokoko", actor.name, joint, at.position) for actor in actors for joint, at in actor.body.items()
    )


def unpack_zigsim(packet: bytes) -> list[Message]:
    """Read a frame of ZIG SIM, as JSON or as OSC."""
    if packet[:1] != b"{":
        return decode_packet(packet)
    frame = _read(_zigsim, packet)
    device = frame.device.name or frame.device.uuid or "device"
    return _bounded(_message("zigsim", device, joint, position) for joint, position in frame.sensors.body.items())


def unpack_xsens(packet: bytes) -> list[Message]:
    """Read a datagram of Xsens MVN's positions and quaternions; other kinds of datagrams hold no message for us."""
    if len(packet) < _MXTP.size or not packet.startswith(b"MXTP"):
        raise PacketError(f"packet: expected an MXTP datagram of Xsens MVN, got {packet[:6]!r}")
    kind, _, _, items, time, character, body, _, _, size = _MXTP.unpack_from(packet)
    if kind != b"MXTP02":
        return []
    if len(packet) < _MXTP.size + items * _SEGMENT.size or size < items * _SEGMENT.size:
        raise PacketError(f"packet: expected {items} segments of {_SEGMENT.size} bytes, got {len(packet)} bytes")
    places = range(_MXTP.size, _MXTP.size + min(items, body or items) * _SEGMENT.size, _SEGMENT.size)
    segments = (_SEGMENT.unpack_from(packet, place) for place in places)
    return _bounded(Message(f"/xsens/{character}/{number}", [x, y, z, float(time)]) for number, x, y, z in segments)


@dataclass(slots=True)
class _Channels:
    """A joint's numbers by their axes, the axes that came since they were given, and the bundle of the last one."""

    numbers: dict[str, object] = field(default_factory=dict)
    new: set[str] = field(default_factory=set)
    bundle: int = 0


class ChannelUnpacker:
    """Puts the three numbers of a joint together that come in three messages, in one packet or in several.

    Some senders leave out numbers that did not change. A joint of which some came in a bundle keeps the others; one
    that does not come at all keeps all of them while its performer's other joints go on.
    """

    def __init__(self) -> None:
        self._waiting: dict[str, _Channels] = {}
        self._bundles = 0

    def __call__(self, packet: bytes) -> list[Message]:
        """Give a message for each joint whose numbers are in the packet or did not change; give others unchanged."""
        given = list[Message]()
        self._bundles += packet[:1] == b"#"
        for message in decode_packet(packet):
            named = coordinate_of(message.address) if len(message.arguments) == 1 else None
            if named is None:
                given.append(message)
                continue
            joint, axis = named
            if joint not in self._waiting and len(self._waiting) >= _MAX_WAITING:
                self._waiting.clear()
            known = self._waiting.setdefault(joint, _Channels())
            if axis in known.new:
                given += _whole(joint, known)
            known.numbers[axis], known.bundle = message.arguments[0], self._bundles
            known.new.add(axis)
            if len(known.new) == len("xyz"):
                given += _whole(joint, known)
        return given + self._unchanged() if packet[:1] == b"#" else given

    def _unchanged(self) -> list[Message]:
        """Give the joints that wait at a bundle's end for numbers that did not change."""
        here = {joint.rpartition("/")[0] for joint, known in self._waiting.items() if known.bundle == self._bundles}
        given = list[Message]()
        for joint, known in self._waiting.items():
            since = self._bundles - known.bundle
            if known.new or (joint.rpartition("/")[0] in here and _UNCHANGED < since <= _LOST):
                given += _whole(joint, known)
        return given


def _whole(joint: str, known: _Channels) -> list[Message]:
    """Give a joint as a message, if each of its numbers came once."""
    if len(known.numbers) < len("xyz"):
        return []
    known.new.clear()
    return [Message(joint, [known.numbers[axis] for axis in "xyz"])]


#: Packings whose packets may hold a part of a frame.
LOOSE = ("osc", "channels")
#: The unpackers for one port, by the name of their packing.
UNPACKERS: Mapping[str, Callable[[], Unpacker]] = {
    "osc": lambda: decode_packet,
    "channels": ChannelUnpacker,
    "rokoko": lambda: unpack_rokoko,
    "zigsim": lambda: unpack_zigsim,
    "xsens": lambda: unpack_xsens,
}


def _read(read: Callable[[bytes], Any], packet: bytes) -> Any:  # noqa: ANN401 - each decoder's own type
    try:
        return read(packet)
    except (ValueError, RecursionError) as error:
        raise PacketError(f"packet: expected this product's JSON ({error})") from error


def _message(kind: str, performer: str, joint: str, place: Place) -> Message:
    named = address_part(performer[:MAX_PERFORMER_LENGTH] or "performer")
    return Message(f"/{kind}/{named}/{address_part(joint)}", [*axes_of(place)])


def _bounded(messages: Iterable[Message]) -> list[Message]:
    """Refuse more messages than an OSC packet may have."""
    taken = list(islice(messages, MAX_MESSAGES + 1))
    if len(taken) > MAX_MESSAGES:
        raise PacketError(f"packet: expected at most {MAX_MESSAGES} joints")
    return taken
