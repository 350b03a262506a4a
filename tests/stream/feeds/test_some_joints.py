"""One message a joint, by the preset `joints`: a body has the joints that come, whatever they are."""

import numpy as np
from golden import message

from kinespace.stream import Announcement, Frame
from kinespace.stream.feeds import FrameAssembler, builtin_preset
from kinespace.stream.feeds.frame_assembler import FORGET_AFTER
from kinespace.stream.feeds.unpackers import UNPACKERS
from kinespace.stream.osc import decode_packet

NAMES = {"Hips": "root", "Spine": "lowerback", "Neck": "lowerneck", "LeftHand": "lradius", "right_hand": "rradius"}


class _Sender:
    """Sends frames at 30 Hz, a datagram for each joint."""

    def __init__(self) -> None:
        self.assembler, self.number = FrameAssembler(builtin_preset("joints")), 0

    def send(self, names: list[str], frames: int, who: str = "") -> list[Announcement | Frame]:
        """Send some frames; give what came of them."""
        made: list[Announcement | Frame] = []
        for _ in range(frames):
            self.number += 1
            for place, name in enumerate(names):
                packet = message(f"{who}/{name}", "fff", float(place), self.number / 10, 1.0)
                made += self.assembler.push(decode_packet(packet), 1 + self.number / 30 + place * 1e-5)
        return made


def _announced(made: list[Announcement | Frame]) -> list[tuple[str, ...]]:
    return [each.joints for each in made if isinstance(each, Announcement)]


def test_a_body_has_the_joints_that_come() -> None:
    """Names of several spellings are read; every frame has these joints in the announced order."""
    sender = _Sender()
    made = sender.send([*NAMES], 20)
    frames = [each for each in made if isinstance(each, Frame)]
    (joints,) = _announced(made)
    assert set(joints) == set(NAMES.values())
    assert len(frames) >= 18
    for frame in frames:
        assert frame.performer == "me"
        places = dict(zip(joints, frame.positions[:, 0].tolist(), strict=True))
        assert places == {joint: place for place, joint in enumerate(NAMES.values())}
    assert _announced(sender.send(["Head", "teapot"], 3, "/ann")) == [("upperneck",)]
    assert sender.assembler.mapper.unknown == {"teapot"}


def test_a_joint_that_begins_or_stops_makes_another_body() -> None:
    """A new joint is announced with the next frame, a gone one is held, lost, and after some seconds left out."""
    sender, names = _Sender(), [*NAMES]
    sender.send(names, 10)
    (more,) = _announced(sender.send([*names, "Head"], 5))
    assert set(more) == {*NAMES.values(), "upperneck"}
    made = sender.send(names, round(30 * FORGET_AFTER) + 20)
    (fewer,) = _announced(made)
    assert set(fewer) == set(NAMES.values())
    lost = [each for each in made if isinstance(each, Frame) and np.isnan(each.positions).any()]
    assert 0.8 * FORGET_AFTER * 30 < len(lost) < FORGET_AFTER * 30
    assert all(np.isnan(each.positions).any(axis=1).sum() == 1 for each in lost)


def test_channels_of_touchdesigner_may_use_names_of_the_tables() -> None:
    """Channels of one coordinate, named as Mixamo names bones, are a body."""
    preset, made = builtin_preset("joints"), list[Announcement | Frame]()
    assembler, unpack = FrameAssembler(preset), UNPACKERS[preset.packing]()
    for number in range(10):
        for place, name in enumerate(NAMES):
            for axis in "xyz":
                packet = message(f"/p1/{name}:t{axis}", "f", place + number / 10)
                made += assembler.push(unpack(packet), 1 + number / 30 + place * 1e-4)
    assert set(_announced(made)[0]) == set(NAMES.values())
    assert {each.performer for each in made if isinstance(each, Frame)} == {"p1"}
