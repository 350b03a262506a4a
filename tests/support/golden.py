"""Packets of other products, put together byte by byte from their published layouts; our encoders are not used.

Positions come in as HDM05's joints in metres, x right, y up, z towards the viewer. Each function turns them into one
product's units, axes, names and messages, and gives the datagrams of one frame in the order in which the product sends
them.
"""

import json
import re
import struct
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from kinespace.library.naming.hdm05 import SKELETON
from kinespace.stream.feeds import builtin_preset

Places = Mapping[str, NDArray[np.floating]]
#: Gives the datagrams of a frame.
Layout = Callable[["Moment"], list[bytes]]

#: The time tag that means "immediately".
IMMEDIATELY = struct.pack(">Q", 1)
#: The quaternion of a joint that is not turned.
_NO_TURN = (0.0, 0.0, 0.0, 1.0)


class Moment(NamedTuple):
    """One frame as a product's sender sees it."""

    places: Places
    time: float
    number: int


def text(value: str) -> bytes:
    """Give an OSC string: zero-terminated, filled up to a multiple of four."""
    raw = value.encode() + b"\0"
    return raw + b"\0" * (-len(raw) % 4)


def message(address: str, tags: str = "", *arguments: object) -> bytes:
    """Give an OSC message of arguments i, h, f, d and s; T, N, [ and ] stand for themselves."""
    packed = b""
    for tag, argument in zip(re.sub(r"[TN\[\]]", "", tags), arguments, strict=True):
        packed += text(str(argument)) if tag == "s" else struct.pack(">" + tag.replace("h", "q"), argument)
    return text(address) + text("," + tags) + packed


def bundle(*elements: bytes, tag: bytes = IMMEDIATELY) -> bytes:
    """Give an OSC bundle of messages and bundles."""
    return text("#bundle") + tag + b"".join(struct.pack(">i", len(each)) + each for each in elements)


def named(preset: str, places: Places) -> dict[str, NDArray[np.floating]]:
    """Name joints as a product does; joints of the product that HDM05 lacks are left out."""
    joint_map = builtin_preset(preset).joint_map or {name: name for name in places}
    return {name: places[target] for name, target in joint_map.items() if target}


def by_joint(preset: str, made: Callable[[str, Any, Moment], bytes]) -> Layout:
    """Make a layout of one message for each joint: of its name as the product calls it, its place and the moment."""
    return lambda moment: [made(name, place, moment) for name, place in named(preset, moment.places).items()]


def bundled(layout: Layout) -> Layout:
    """Put all messages of a frame into one bundle."""
    return lambda moment: [bundle(*layout(moment))]


def native(moment: Moment) -> list[bytes]:
    """One message of x y z of the 31 joints in order, after a message that names them."""
    joints = list(moment.places)
    numbers = np.concatenate([moment.places[joint] for joint in joints]).tolist()
    return [
        message("/motion/skeleton", "s" * (1 + len(joints)), "jan", *joints),
        message("/motion/frame", "sd" + "f" * len(numbers), "jan", moment.time, *numbers),
    ]


def _shares(place: Any) -> Any:  # noqa: ANN401 - three numbers
    """Give OSCeleton's numbers: x and y as a share of 2.56 and 1.92 metres running backwards, z by 1.28."""
    return (np.array([1.28, 0.96, 0]) - place * (1, 1, -1)) / (2.56, 1.92, 1.28)


def _osceleton2(name: str, place: Any, now: Moment) -> bytes:  # noqa: ANN401 - three numbers
    """Centimetres, confidence, and milliseconds as a double."""
    return message("/osceleton2/joint", "siiffffd", name, 0, 1, *100 * place, 1.0, 1000 * now.time)


def _kinectv2(name: str, place: Any, _: Moment) -> bytes:  # noqa: ANN401 - three numbers
    """Bodies have numbers of 64 bits."""
    return message(f"/bodies/72057594037928017/joints/{name}", "fffs", *place, "Tracked")


def nimate_omni(moment: Moment) -> list[bytes]:
    """All coordinates in the order of NI mate's list."""
    joints = named("nimate-omni", moment.places)
    numbers = [number for name in builtin_preset("nimate-omni").order for number in joints[name].tolist()]
    return [message("/skeleton", "f" * len(numbers), *numbers)]


def _vrchat(name: str, place: Any, _: Moment) -> bytes:  # noqa: ANN401 - three numbers
    """Numbered trackers and the head, Unity's axes: z the other way."""
    numbers = {each: str(index) for index, each in enumerate(builtin_preset("vrchat").order, start=1)}
    return message(f"/tracking/trackers/{numbers.get(name, name)}/position", "fff", *place * (1, 1, -1))


def qtm(moment: Moment) -> list[bytes]:
    """One bundle: /qtm/data with a time of 64 bits in microseconds, then the segments in millimetres, z up."""
    joints, microseconds = named("qtm", moment.places), round(moment.time * 1e6)
    low = microseconds & 0xFFFFFFFF
    head = message("/qtm/data", "iiiiiii", microseconds >> 32, low - (low >> 31 << 32), 0, moment.number, 0, 0, 1)
    segments = [
        message(f"/qtm/skeleton/Jan/{name}", "i" + "f" * 7, index, 1000 * x, -1000 * z, 1000 * y, *_NO_TURN)
        for index, (name, (x, y, z)) in enumerate(joints.items())
    ]
    return [bundle(head, *segments)]


def natnet2osc(moment: Moment) -> list[bytes]:
    """Hierarchy on: one bundle of a message for each joint, with rigid bodies beside them."""

    def bone(name: str, place: Any, _: Moment) -> bytes:  # noqa: ANN401 - three numbers
        return message(f"/skeleton/Jan/{name}", "sfffffffifff", name, *place, *_NO_TURN, 1, 0.0, 0.1, 0.0)

    hat = message("/rigidBody/Hat", "is" + "f" * 7 + "i", 1, "Hat", *[0.5] * 7, 1)
    return [bundle(hat, *by_joint("natnet2osc", bone)(moment))]


def _flat(tags: str, *after: float) -> Layout:
    """Make the layout with hierarchy off: all joints in one message, each with its turn and what comes after it."""

    def made(moment: Moment) -> list[bytes]:
        joints = named("natnet2osc", moment.places)
        arguments = [value for name, place in joints.items() for value in (name, *place, *_NO_TURN, *after)]
        return [bundle(message("/skeleton", "si" + ("sfffffff" + tags) * len(joints), "Jan", 3, *arguments))]

    return made


def _motive(
    bone_messages: Callable[[int, list[float], Moment], list[bytes]],
    start: str = "/frame/start",
    end: str = "/frame/end",
) -> Layout:
    """Make the layout of a mode of NatNetThree2OSC: the messages of each numbered bone between start and end."""

    def made(moment: Moment) -> list[bytes]:
        order = builtin_preset("natnetthree2osc").order
        joints = named("natnetthree2osc", moment.places)
        bones = [
            packet
            for name, place in joints.items()
            for packet in bone_messages(order.index(name) + 1, place.tolist(), moment)
        ]
        return [message(start, "i", moment.number), *bones, message(end, "i", moment.number)]

    return made


def natnetthree2osc(moment: Moment) -> list[bytes]:
    """Mode max, the time after the start of the frame."""
    begin, *bones = _motive(
        lambda bone, place, _: [
            message("/skeleton/bone", "iisfff", 1, bone, "position", *place),
            message("/skeleton/bone", "iisffff", 1, bone, "quat", *_NO_TURN),
        ]
    )(moment)
    return [begin, message("/frame/timestamp", "f", 1000 * moment.time), *bones]


def mediapipe(moment: Moment) -> list[bytes]:
    """33 landmarks as shares of a picture of 16 to 9, y down; landmarks that HDM05 lacks stay in a corner."""
    joints = named("mediapipe", moment.places)
    arguments: list[float] = []
    for name in builtin_preset("mediapipe").order:
        x, y, z = joints.get(name, np.zeros(3)).tolist()
        arguments += (x / 1.78, -y, -z / 1.78, 0.9)
    return [message("/mediapipe/pose", "i" + "f" * len(arguments), 1, *arguments)]


def _landmark(name: str, place: Any, _: Moment) -> bytes:  # noqa: ANN401 - three numbers
    """Pose2Art: numbered landmarks, y down."""
    number = builtin_preset("mediapipe").order.index(name)
    return message(f"/pose/p1/{number}", "fff", *place / (1.78, -1, -1.78))


def wekinator(moment: Moment) -> list[bytes]:
    """One message of floats."""
    numbers = [number for place in moment.places.values() for number in place.tolist()]
    return [message("/wek/inputs", "f" * len(numbers), *numbers)]


def _vmc_bones(moment: Moment) -> dict[str, tuple[list[float], list[float]]]:
    """Give each humanoid bone's position in its parent's axes and its own rotation, in Unity's axes (z mirrored).

    Every bone has a rotation, another one in each frame: only forward kinematics finds the joints again.
    """
    preset = builtin_preset("vmc")
    mirrored = {joint: place * (1, 1, -1) for joint, place in moment.places.items()}
    world = {name: mirrored[target] for name, target in preset.joint_map.items() if target}
    world["root"] = np.array([0.3, 0.0, 0.2])
    for side, letter in (("Left", "l"), ("Right", "r")):
        world[f"{side}Shoulder"] = (mirrored["thorax"] + mirrored[f"{letter}clavicle"]) / 2
        world[f"{side}ThumbProximal"] = mirrored[f"{letter}thumb"]
    generator = np.random.default_rng(moment.number)
    turned: dict[str, Rotation] = {}
    sent: dict[str, tuple[list[float], list[float]]] = {}
    for name, bone in preset.bones.items():
        own = Rotation.random(rng=generator)
        local = world[name]
        turned[name] = own
        if bone.parent:
            above = turned[bone.parent]
            local = above.inv().apply(world[name] - world[bone.parent])
            turned[name] = above * own
        sent[name] = (local.tolist(), own.as_quat().tolist())
    return sent


def _vmc(moment: Moment, root_tags: str = "", *more: float) -> tuple[bytes, list[bytes]]:
    """Give the message of the root, and those of all other bones."""
    sent = _vmc_bones(moment)
    (place, turn), tags = sent.pop("root"), "s" + "f" * 7
    root = message("/VMC/Ext/Root/Pos", tags + root_tags, "root", *place, *turn, *more)
    return root, [message("/VMC/Ext/Bone/Pos", tags, name, *place, *turn) for name, (place, turn) in sent.items()]


def vmc(moment: Moment) -> list[bytes]:
    """As the reference sender: 13 bones a datagram; the last datagram nests the rest, and holds root, OK and time."""
    root, bones = _vmc(moment)
    parts = [bones[start : start + 13] for start in range(0, len(bones), 13)]
    camera = message("/VMC/Ext/Cam", "s" + "f" * 8, "Camera", *[0.0] * 8)
    end = message("/VMC/Ext/OK", "i", 1), message("/VMC/Ext/T", "f", moment.time)
    return [*(bundle(*part) for part in parts[:-1]), bundle(root, bundle(*parts[-1]), camera, *end)]


def vmc_xr_animator(moment: Moment) -> list[bytes]:
    """As XR Animator: root alone with scale and offset, one bundle of all bones with time tag 0, OK at the end."""
    root, bones = _vmc(moment, "ffffff", 1.0, 1.0, 1.0, 0.0, 0.0, 0.0)
    blend = bundle(message("/VMC/Ext/Blend/Val", "sf", "Joy", 0.5), message("/VMC/Ext/Blend/Apply"), tag=bytes(8))
    return [root, bundle(*bones, tag=bytes(8)), blend, message("/VMC/Ext/OK", "i", 1)]


def vmc_loose(moment: Moment) -> list[bytes]:
    """As small senders: loose messages, no end."""
    root, bones = _vmc(moment)
    return [root, *bones]


def rokoko(moment: Moment) -> list[bytes]:
    """One JSON object a frame (Rokoko's example of version 3), here of two actors, one of whom has no body."""
    turn = dict(zip("xyzw", _NO_TURN, strict=True))
    body = {
        name: {"position": dict(zip("xyz", place.tolist(), strict=True)), "rotation": turn}
        for name, place in named("rokoko", moment.places).items()
    }
    meta = {"hasGloves": False, "hasLeftGlove": False, "hasRightGlove": False, "hasBody": True, "hasFace": False}
    actors = [{"name": "Dimitris", "color": [1, 2, 3], "meta": meta, "body": body}, {"name": "Face", "face": {}}]
    scene = {"timestamp": moment.time, "actors": actors, "props": []}
    return [json.dumps({"version": 3, "fps": 60, "scene": scene}).encode()]


def xsens(moment: Moment) -> list[bytes]:
    """One MXTP02 datagram: 24 bytes of header, 23 segments of 32 bytes, z up."""
    joints, segments = named("xsens", moment.places), b""
    for number, name in enumerate(builtin_preset("xsens").order, start=1):
        x, y, z = joints.get(name, np.zeros(3))
        segments += struct.pack(">i7f", number, z, x, y, 1.0, 0.0, 0.0, 0.0)
    header = struct.pack(
        ">6sIBBIBBBBHH", b"MXTP02", moment.number, 0x80, 23, round(moment.time * 1000), 0, 23, 0, 0, 0, 736
    )
    return [header + segments]


def zigsim(moment: Moment) -> list[bytes]:
    """As JSON: x, y, z of each joint in a list, beside the phone's own place."""
    body = {name: place.tolist() for name, place in named("zigsim", moment.places).items()}
    sensors = {"bodyTracking": body, "arkit": {"position": {"x": 0.0, "y": 1.0, "z": 2.0}}}
    device = {"name": "iPhone", "uuid": "B8-27", "os": "ios", "osversion": "17", "displaywidth": 1, "displayheight": 2}
    return [json.dumps({"device": device, "timestamp": "2026_11_22_07_00_00", "sensordata": sensors}).encode()]


def touchdesigner(moment: Moment) -> list[bytes]:
    """One float for each channel, as loose messages."""
    places = named("touchdesigner", moment.places).items()
    return [message(f"/p1/{name}:t{axis}", "f", place["xyz".index(axis)]) for name, place in places for axis in "xyz"]


_MADE: dict[str, Layout] = {
    **{each.__name__: each for each in (native, vmc, qtm, natnet2osc, mediapipe, wekinator, rokoko, xsens, zigsim)},
    "osceleton": by_joint("osceleton", lambda name, place, _: message("/joint", "sifff", name, 1, *_shares(place))),
    "osceleton -q": by_joint("osceleton", lambda name, place, _: message(f"/joint/{name}/1", "fff", *_shares(place))),
    "osceleton2": by_joint("osceleton2", _osceleton2),
    "kinectv2": by_joint("kinectv2", _kinectv2),
    # Older versions.
    "kinectv2 bare": by_joint("kinectv2", lambda name, place, _: message(f"/bodies/1/joints/{name}", "fff", *place)),
    # Basic + orientation.
    "nimate": by_joint("nimate", lambda name, place, _: message(f"/skeleton_{name}", "f" * 7, *place, *_NO_TURN)),
    "nimate-omni": nimate_omni,
    "synapse": by_joint("synapse", lambda name, place, _: message(f"/{name}_pos_world", "fff", *1000 * place)),
    "vrchat": by_joint("vrchat", _vrchat),
    "vmc xr animator": vmc_xr_animator,
    "vmc loose": vmc_loose,
    "natnet2osc flat": _flat(""),
    # With parents and offsets.
    "natnet2osc offsets": _flat("ifff", 1, 0.0, 0.1, 0.0),
    "natnetthree2osc max": natnetthree2osc,
    "natnetthree2osc isadora": bundled(
        _motive(lambda bone, place, _: [message(f"/skeleton/1/bone/{bone}/position", "fff", *place)])
    ),
    "natnetthree2osc touch": _motive(
        lambda bone, place, _: [message(f"/skeleton/1/bone/{bone}/transformation", "f" * 7, *place, *_NO_TURN)]
    ),
    "natnetthree2osc sparck": _motive(
        lambda bone, place, now: [message("/skel", "iif" + "f" * 7, 1, bone, now.time, *place, *_NO_TURN)],
        "/f/s",
        "/f/e",
    ),
    "mediapipe pose2art": bundled(by_joint("mediapipe", _landmark)),
    "joints": by_joint("joints", lambda name, place, _: message(f"/{name}", "fff", *place)),
    "joints of two": by_joint("joints", lambda name, place, _: message(f"/ann/{name}", "fff", *place)),
    "captury": by_joint("captury", lambda name, at, _: message(f"/John-Doe/blender/{name}/vector", "fff", *1000 * at)),
    "zigsim osc": bundled(by_joint("zigsim", lambda name, place, _: message(f"/B8-27/{name}", "fff", *place))),
    # Stamped with a real time.
    "touchdesigner": lambda moment: [bundle(*touchdesigner(moment), tag=struct.pack(">Q", 1 << 40))],
    "touchdesigner loose": touchdesigner,
}
#: Every layout, with the preset that reads it: its first word.
LAYOUTS = {name: (name.split()[0], layout) for name, layout in _MADE.items()}


def moments(
    layout: str, positions: Iterable[NDArray[np.floating]], rate: float = 30.0, begin: float = 1.0
) -> Iterator[tuple[float, list[bytes]]]:
    """Show a body of HDM05's joints as a product does: the time of each frame, and its datagrams."""
    for number, joints in enumerate(positions):
        time = begin + number / rate
        yield time, LAYOUTS[layout][1](Moment(dict(zip(SKELETON.joints, joints, strict=True)), time, number))
