"""Packets of other products, put together byte by byte from their published layouts; our encoders are not used.

Positions come in as HDM05's joints in metres, x right, y up, z towards the viewer. Each function turns them into one
product's units, axes, names and messages, and gives the datagrams of one frame in the order in which the product sends
them.
"""

from __future__ import annotations

import json
import re
import struct
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from kinespace.stream.feeds import builtin_preset

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    Places = Mapping[str, NDArray[np.floating]]

#: The time tag that means "immediately".
IMMEDIATELY = struct.pack(">Q", 1)


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
    joint_map = builtin_preset(preset).joint_map
    return {name: places[target] for name, target in joint_map.items() if target}


def native(moment: Moment) -> list[bytes]:
    """One message of x y z of the 31 joints in order, after a message that names them."""
    joints = list(moment.places)
    numbers = np.concatenate([moment.places[joint] for joint in joints]).tolist()
    return [
        message("/motion/skeleton", "s" * (1 + len(joints)), "jan", *joints),
        message("/motion/frame", "sd" + "f" * len(numbers), "jan", moment.time, *numbers),
    ]


def osceleton(moment: Moment) -> list[bytes]:
    """Loose messages; x and y a share of 2.56 and 1.92 metres running backwards, z by 1.28."""
    joints = named("osceleton", moment.places)
    return [
        message("/joint", "sifff", name, 1, (1.28 - x) / 2.56, (0.96 - y) / 1.92, z / 1.28)
        for name, (x, y, z) in joints.items()
    ]


def osceleton_quartz(moment: Moment) -> list[bytes]:
    """Option -q: name and user in the address."""
    joints = named("osceleton", moment.places)
    return [
        message(f"/joint/{name}/1", "fff", (1.28 - x) / 2.56, (0.96 - y) / 1.92, z / 1.28)
        for name, (x, y, z) in joints.items()
    ]


def osceleton2(moment: Moment) -> list[bytes]:
    """Centimetres, confidence, and milliseconds as a double."""
    joints = named("osceleton2", moment.places)
    time = moment.time * 1000
    return [
        message("/osceleton2/joint", "siiffffd", name, 0, 1, 100 * x, 100 * y, 100 * z, 1.0, time)
        for name, (x, y, z) in joints.items()
    ]


def kinectv2(moment: Moment) -> list[bytes]:
    """Body and joint in the address, tracking state as a word."""
    joints = named("kinectv2", moment.places)
    return [
        message(f"/bodies/72057594037928017/joints/{name}", "fffs", x, y, z, "Tracked")
        for name, (x, y, z) in joints.items()
    ]


def kinectv2_bare(moment: Moment) -> list[bytes]:
    """Older versions: three floats."""
    joints = named("kinectv2", moment.places)
    return [message(f"/bodies/1/joints/{name}", "fff", *place) for name, place in joints.items()]


def nimate(moment: Moment) -> list[bytes]:
    """Send Basic + orientation: /skeleton_left_hand x y z and a quaternion."""
    joints = named("nimate", moment.places)
    return [message(f"/skeleton_{name}", "f" * 7, *place, 0.0, 0.0, 0.0, 1.0) for name, place in joints.items()]


def nimate_omni(moment: Moment) -> list[bytes]:
    """All coordinates in the order of NI mate's list."""
    joints = named("nimate-omni", moment.places)
    numbers = [number for name in builtin_preset("nimate-omni").order for number in joints[name].tolist()]
    return [message("/skeleton", "f" * len(numbers), *numbers)]


def synapse(moment: Moment) -> list[bytes]:
    """Millimetres, the joint in the address; body and screen positions beside them."""
    joints = named("synapse", moment.places)
    return [message(f"/{name}_pos_world", "fff", *(1000 * place).tolist()) for name, place in joints.items()]


def vrchat(moment: Moment) -> list[bytes]:
    """Numbered trackers and the head, Unity's axes: z the other way."""
    joints = named("vrchat", moment.places)
    numbers = {name: str(index) for index, name in enumerate(builtin_preset("vrchat").order, start=1)}
    return [
        message(f"/tracking/trackers/{numbers.get(name, name)}/position", "fff", x, y, -z)
        for name, (x, y, z) in joints.items()
    ]


def qtm(moment: Moment) -> list[bytes]:
    """One bundle: /qtm/data with a time of 64 bits in microseconds, then the segments in millimetres, z up."""
    joints = named("qtm", moment.places)
    microseconds = round(moment.time * 1e6)
    low = microseconds & 0xFFFFFFFF
    head = message("/qtm/data", "iiiiiii", microseconds >> 32, low - (low >> 31 << 32), 0, moment.number, 0, 0, 1)
    segments = [
        message(f"/qtm/skeleton/Jan/{name}", "i" + "f" * 7, index, 1000 * x, -1000 * z, 1000 * y, 0.0, 0.0, 0.0, 1.0)
        for index, (name, (x, y, z)) in enumerate(joints.items())
    ]
    return [bundle(head, *segments)]


def natnet2osc(moment: Moment) -> list[bytes]:
    """Hierarchy on: one bundle of a message for each joint, with rigid bodies beside them."""
    joints = named("natnet2osc", moment.places)
    tags = "sfffffffifff"
    bones = [
        message(f"/skeleton/Jan/{name}", tags, name, *place, 0.0, 0.0, 0.0, 1.0, 1, 0.0, 0.1, 0.0)
        for name, place in joints.items()
    ]
    return [bundle(message("/rigidBody/Hat", "is" + "f" * 7 + "i", 1, "Hat", *[0.5] * 7, 1), *bones)]


def natnet2osc_flat(moment: Moment) -> list[bytes]:
    """Hierarchy off: all joints in one message."""
    joints = named("natnet2osc", moment.places)
    arguments = [value for name, place in joints.items() for value in (name, *place, 0.0, 0.0, 0.0, 1.0)]
    return [bundle(message("/skeleton", "si" + "sfffffff" * len(joints), "Jan", 3, *arguments))]


def natnet2osc_offsets(moment: Moment) -> list[bytes]:
    """Hierarchy off, with parents and offsets."""
    joints = named("natnet2osc", moment.places)
    after = (0.0, 0.0, 0.0, 1.0, 1, 0.0, 0.1, 0.0)
    arguments = [value for name, place in joints.items() for value in (name, *place, *after)]
    return [bundle(message("/skeleton", "si" + "sfffffffifff" * len(joints), "Jan", 3, *arguments))]


def _motive(places: Places) -> dict[int, list[float]]:
    order = builtin_preset("natnetthree2osc").order
    joints = named("natnetthree2osc", places)
    return {order.index(name) + 1: place.tolist() for name, place in joints.items()}


def natnetthree2osc(moment: Moment) -> list[bytes]:
    """Mode max, between /frame/start and /frame/end."""
    number, milliseconds = moment.number, 1000 * moment.time
    bones = [
        packet
        for bone, place in _motive(moment.places).items()
        for packet in (
            message("/skeleton/bone", "iisfff", 1, bone, "position", *place),
            message("/skeleton/bone", "iisffff", 1, bone, "quat", 0.0, 0.0, 0.0, 1.0),
        )
    ]
    start = [message("/frame/start", "i", number), message("/frame/timestamp", "f", milliseconds)]
    return [*start, *bones, message("/frame/end", "i", number)]


def natnetthree2osc_isadora(moment: Moment) -> list[bytes]:
    """Mode isadora, bundled."""
    bones = [
        message(f"/skeleton/1/bone/{bone}/position", "fff", *place) for bone, place in _motive(moment.places).items()
    ]
    return [bundle(message("/frame/start", "i", moment.number), *bones, message("/frame/end", "i", moment.number))]


def natnetthree2osc_touch(moment: Moment) -> list[bytes]:
    """Mode touch."""
    bones = [
        message(f"/skeleton/1/bone/{bone}/transformation", "f" * 7, *place, 0.0, 0.0, 0.0, 1.0)
        for bone, place in _motive(moment.places).items()
    ]
    return [message("/frame/start", "i", moment.number), *bones, message("/frame/end", "i", moment.number)]


def natnetthree2osc_sparck(moment: Moment) -> list[bytes]:
    """Mode sparck."""
    bones = [
        message("/skel", "iif" + "f" * 7, 1, bone, moment.time, *place, 0.0, 0.0, 0.0, 1.0)
        for bone, place in _motive(moment.places).items()
    ]
    return [message("/f/s", "i", moment.number), *bones, message("/f/e", "i", moment.number)]


def mediapipe(moment: Moment) -> list[bytes]:
    """33 landmarks as shares of a picture of 16 to 9, y down; landmarks that HDM05 lacks stay in a corner."""
    joints = named("mediapipe", moment.places)
    arguments: list[float] = []
    for name in builtin_preset("mediapipe").order:
        x, y, z = joints.get(name, np.zeros(3)).tolist()
        arguments += (x / 1.78, -y, -z / 1.78, 0.9)
    return [message("/mediapipe/pose", "i" + "f" * len(arguments), 1, *arguments)]


def mediapipe_loose(moment: Moment) -> list[bytes]:
    """Pose2Art: one bundle of a message for each landmark."""
    order = builtin_preset("mediapipe").order
    joints = named("mediapipe", moment.places)
    marks = [
        message(f"/pose/p1/{order.index(name)}", "fff", x / 1.78, -y, -z / 1.78) for name, (x, y, z) in joints.items()
    ]
    return [bundle(*marks)]


def captury(moment: Moment) -> list[bytes]:
    """Send the subscribed joints, millimetres."""
    joints = named("captury", moment.places)
    return [
        message(f"/John-Doe/blender/{name}/vector", "fff", *(1000 * place).tolist()) for name, place in joints.items()
    ]


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
    for bone in preset.bones:
        own = Rotation.random(rng=generator)
        local = world[bone.name]
        turned[bone.name] = own
        if bone.parent:
            above = turned[bone.parent]
            local = above.inv().apply(world[bone.name] - world[bone.parent])
            turned[bone.name] = above * own
        sent[bone.name] = (local.tolist(), own.as_quat().tolist())
    return sent


def vmc(moment: Moment) -> list[bytes]:
    """As the reference sender: 13 bones a datagram; the last datagram nests the rest, and holds root, OK and time."""
    sent = _vmc_bones(moment)
    root = message("/VMC/Ext/Root/Pos", "s" + "f" * 7, "root", *sent["root"][0], *sent["root"][1])
    bones = [
        message("/VMC/Ext/Bone/Pos", "s" + "f" * 7, name, *place, *turn)
        for name, (place, turn) in sent.items()
        if name != "root"
    ]
    parts = [bones[start : start + 13] for start in range(0, len(bones), 13)]
    last = bundle(
        root,
        bundle(*parts[-1]),
        message("/VMC/Ext/Cam", "s" + "f" * 8, "Camera", *[0.0] * 8),
        message("/VMC/Ext/OK", "i", 1),
        message("/VMC/Ext/T", "f", moment.time),
    )
    return [*(bundle(*part) for part in parts[:-1]), last]


def vmc_xr_animator(moment: Moment) -> list[bytes]:
    """As XR Animator: root alone with scale and offset, one bundle of all bones with time tag 0, OK at the end."""
    sent = _vmc_bones(moment)
    scale = (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)
    root = message("/VMC/Ext/Root/Pos", "s" + "f" * 13, "root", *sent["root"][0], *sent["root"][1], *scale)
    bones = [
        message("/VMC/Ext/Bone/Pos", "s" + "f" * 7, name, *place, *turn)
        for name, (place, turn) in sent.items()
        if name != "root"
    ]
    blend = bundle(message("/VMC/Ext/Blend/Val", "sf", "Joy", 0.5), message("/VMC/Ext/Blend/Apply"), tag=bytes(8))
    return [root, bundle(*bones, tag=bytes(8)), blend, message("/VMC/Ext/OK", "i", 1)]


def vmc_loose(moment: Moment) -> list[bytes]:
    """As small senders: loose messages, no end."""
    sent = _vmc_bones(moment)
    return [message("/VMC/Ext/Bone/Pos", "s" + "f" * 7, name, *place, *turn) for name, (place, turn) in sent.items()]


def rokoko(moment: Moment) -> list[bytes]:
    """One JSON object a frame (Rokoko's example of version 3), here of two actors, one of whom has no body."""
    body = {
        name: {
            "position": dict(zip("xyz", place.tolist(), strict=True)),
            "rotation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
        }
        for name, place in named("rokoko", moment.places).items()
    }
    meta = {"hasGloves": False, "hasLeftGlove": False, "hasRightGlove": False, "hasBody": True, "hasFace": False}
    actors = [{"name": "Dimitris", "color": [1, 2, 3], "meta": meta, "body": body}, {"name": "Face", "face": {}}]
    scene = {"timestamp": moment.time, "actors": actors, "props": []}
    return [json.dumps({"version": 3, "fps": 60, "scene": scene}).encode()]


def xsens(moment: Moment) -> list[bytes]:
    """One MXTP02 datagram: 24 bytes of header, 23 segments of 32 bytes, z up."""
    joints = named("xsens", moment.places)
    segments = b""
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


def zigsim_osc(moment: Moment) -> list[bytes]:
    """As OSC: device and joint in the address."""
    joints = named("zigsim", moment.places)
    return [bundle(*(message(f"/B8-27/{name}", "fff", *place) for name, place in joints.items()))]


def touchdesigner(moment: Moment) -> list[bytes]:
    """Send a bundle of one float for each channel, stamped with a real time."""
    joints = named("touchdesigner", moment.places)
    channels = [
        (f"/p1/{name}:t{axis}", number)
        for name, place in joints.items()
        for axis, number in zip("xyz", place, strict=True)
    ]
    return [bundle(*(message(address, "f", number) for address, number in channels), tag=struct.pack(">Q", 1 << 40))]


def touchdesigner_loose(moment: Moment) -> list[bytes]:
    """Send the same as loose messages."""
    joints = named("touchdesigner", moment.places)
    return [
        message(f"/p1/{name}:t{axis}", "f", number)
        for name, place in joints.items()
        for axis, number in zip("xyz", place, strict=True)
    ]


#: Every layout, with the preset that reads it.
LAYOUTS: dict[str, tuple[str, Callable[[Moment], list[bytes]]]] = {
    "native": ("native", native),
    "osceleton": ("osceleton", osceleton),
    "osceleton -q": ("osceleton", osceleton_quartz),
    "osceleton2": ("osceleton2", osceleton2),
    "kinectv2": ("kinectv2", kinectv2),
    "kinectv2 bare": ("kinectv2", kinectv2_bare),
    "nimate": ("nimate", nimate),
    "nimate-omni": ("nimate-omni", nimate_omni),
    "synapse": ("synapse", synapse),
    "vmc": ("vmc", vmc),
    "vmc xr animator": ("vmc", vmc_xr_animator),
    "vmc loose": ("vmc", vmc_loose),
    "vrchat": ("vrchat", vrchat),
    "qtm": ("qtm", qtm),
    "natnet2osc": ("natnet2osc", natnet2osc),
    "natnet2osc flat": ("natnet2osc", natnet2osc_flat),
    "natnet2osc offsets": ("natnet2osc", natnet2osc_offsets),
    "natnetthree2osc max": ("natnetthree2osc", natnetthree2osc),
    "natnetthree2osc isadora": ("natnetthree2osc", natnetthree2osc_isadora),
    "natnetthree2osc touch": ("natnetthree2osc", natnetthree2osc_touch),
    "natnetthree2osc sparck": ("natnetthree2osc", natnetthree2osc_sparck),
    "mediapipe": ("mediapipe", mediapipe),
    "mediapipe pose2art": ("mediapipe", mediapipe_loose),
    "captury": ("captury", captury),
    "wekinator": ("wekinator", wekinator),
    "rokoko": ("rokoko", rokoko),
    "xsens": ("xsens", xsens),
    "zigsim": ("zigsim", zigsim),
    "zigsim osc": ("zigsim", zigsim_osc),
    "touchdesigner": ("touchdesigner", touchdesigner),
    "touchdesigner loose": ("touchdesigner", touchdesigner_loose),
}


class Packet(NamedTuple):
    """One message, byte by byte, and its joint: the preset's name for it, and its position in metres in our axes."""

    packet: bytes
    joint: str
    position: tuple[float, float, float]
    performer: str | None = None


def _hex(*parts: str) -> bytes:
    return b"".join(part.encode("latin-1") if part[:1] in "/," else bytes.fromhex(part) for part in parts)


#: 0.5, 0.25 and 1.5 as float32, big endian; 50, 25 and 150; 500, 250 and 1500.
_SMALL = "3f000000 3e800000 3fc00000"
_CENTI = "42480000 41c80000 43160000"
_MILLI = "43fa0000 437a0000 44bb8000"
_NO_TURN = "00000000 00000000 00000000 3f800000"
_R_HAND = "72 5f 68 61 6e 64 00 00"
_HIPS = "48 69 70 73 00 00 00 00"

#: Written out by hand from the layouts, so that no encoder, neither ours nor the tests', takes part.
PACKETS: dict[str, Packet] = {
    "rokoko": Packet(
        b'{"version":3,"fps":60,"scene":{"timestamp":0,"actors":[{"name":"Dimitris","body":{"hip":'
        b'{"position":{"x":0.5,"y":0.25,"z":1.5},"rotation":{"x":0,"y":0,"z":0,"w":1}}}}],"props":[]}}',
        "hip",
        (0.5, 0.25, 1.5),
        "Dimitris",
    ),
    "xsens": Packet(
        _hex(
            "4d 58 54 50 30 32 00 00 00 2a 80 01 00 00 04 d2 00 01 00 00 00 00 00 20",
            "00 00 00 01",
            _SMALL,
            "3f800000 00000000 00000000 00000000",
        ),
        "Pelvis",
        (0.25, 1.5, 0.5),
        "0",
    ),
    "zigsim": Packet(
        b'{"device":{"name":"iPhone","uuid":"B8"},"timestamp":"2026","sensordata":'
        b'{"bodyTracking":{"hips_joint":[0.5,0.25,1.5]},"arkit":{"position":{"x":0,"y":0,"z":0}}}}',
        "hips_joint",
        (0.5, 0.25, 1.5),
        "iPhone",
    ),
    "touchdesigner": Packet(
        _hex("23 62 75 6e 64 6c 65 00 00 00 00 00 00 00 00 01")
        + b"".join(
            bytes.fromhex("00 00 00 18") + _hex(f"/p1/wrist_l:t{axis}\0\0", ",f\0\0", number)
            for axis, number in zip("xyz", _SMALL.split(), strict=True)
        ),
        "wrist_l",
        (0.5, 0.25, 1.5),
        "p1",
    ),
    "osceleton": Packet(
        _hex("/joint\0\0", ",sifff\0\0", _R_HAND, "00000001", _SMALL), "r_hand", (-1.28, -0.48, 1.92), "1"
    ),
    "osceleton2": Packet(
        _hex(
            "/osceleton2/joint\0\0\0",
            ",siiffffd\0\0\0",
            _R_HAND,
            "00000000 00000002",
            _CENTI,
            "3f800000",
            "4276e2b0e6100000",
        ),
        "r_hand",
        (0.5, 0.25, 1.5),
        "2",
    ),
    "kinectv2": Packet(
        _hex("/bodies/7/joints/HandRight\0\0", ",fffs\0\0\0", _SMALL, "54 72 61 63 6b 65 64 00"),
        "HandRight",
        (0.5, 0.25, 1.5),
        "7",
    ),
    "nimate": Packet(
        _hex("/skeleton_left_hand\0", ",fffffff\0\0\0\0", _SMALL, _NO_TURN), "left_hand", (0.5, 0.25, 1.5)
    ),
    "synapse": Packet(_hex("/righthand_pos_world\0\0\0\0", ",fff\0\0\0\0", _MILLI), "righthand", (0.5, 0.25, 1.5)),
    "vmc": Packet(
        _hex("/VMC/Ext/Bone/Pos\0\0\0", ",sfffffff\0\0\0", _HIPS, _SMALL, _NO_TURN), "Hips", (0.5, 0.25, -1.5)
    ),
    "vrchat": Packet(_hex("/tracking/trackers/1/position\0\0\0", ",fff\0\0\0\0", _SMALL), "hip", (0.5, 0.25, -1.5)),
    "qtm": Packet(
        _hex("/qtm/skeleton/Jan/Hips\0\0", ",ifffffff\0\0\0", "00000001", _MILLI, _NO_TURN),
        "Hips",
        (0.5, 1.5, -0.25),
        "Jan",
    ),
    "natnet2osc": Packet(
        _hex("/skeleton/Jan/Hip\0\0\0", ",sfffffff\0\0\0", "48 69 70 00", _SMALL, _NO_TURN),
        "Hip",
        (0.5, 0.25, 1.5),
        "Jan",
    ),
    "natnetthree2osc": Packet(
        _hex("/skeleton/bone\0\0", ",iisfff\0", "00000001 00000001", "70 6f 73 69 74 69 6f 6e 00 00 00 00", _SMALL),
        "Hip",
        (0.5, 0.25, 1.5),
        "1",
    ),
    "mediapipe": Packet(
        _hex("/mediapipe/pose\0", ",iffff\0\0", "00000001", _SMALL, "3f800000"), "nose", (0.89, -0.25, -2.67)
    ),
    "captury": Packet(
        _hex("/live/John-Doe/blender/Hips/vector\0\0", ",fff\0\0\0\0", _MILLI), "Hips", (0.5, 0.25, 1.5), "John-Doe"
    ),
    "wekinator": Packet(_hex("/wek/inputs\0", ",fff\0\0\0\0", _SMALL), "root", (0.5, 0.25, 1.5)),
    "nimate-omni": Packet(_hex("/skeleton\0\0\0", ",fff\0\0\0\0", _SMALL), "head", (0.5, 0.25, 1.5)),
    "native": Packet(
        _hex("/motion/frame\0\0\0", ",sdfff\0\0", "6a 61 6e 00", "3ff0000000000000", _SMALL),
        "root",
        (0.5, 0.25, 1.5),
        "jan",
    ),
}
