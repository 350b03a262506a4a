"""Frames out of joints: the closing rules, split and nested bundles, late and absent joints, several performers."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from golden import bundle, message
from hypothesis import given
from hypothesis import strategies as st

from kinespace.library.naming import hdm05
from kinespace.stream import Announcement, Frame
from kinespace.stream.feeds import FrameAssembler, builtin_preset
from kinespace.stream.feeds.frame_assembler import FORGET_AFTER, MAX_PERFORMERS
from kinespace.stream.feeds.kinematics import Bone, world_positions
from kinespace.stream.feeds.preset import parse_preset
from kinespace.stream.osc import decode_packet

JOINTS = ("a", "b", "c", "d")


def preset_text(close: Sequence[str], *, frame: str = "", top: str = "") -> str:
    """Give a small preset of four joints."""
    text, closings = Path(__file__).with_name("small.toml").read_text(encoding="utf-8"), json.dumps([*close])
    return text.replace("close = []", f"close = {closings}").replace("# frame", frame).replace("# top", top)


def assembler(*close: str, frame: str = "", top: str = "") -> FrameAssembler:
    """Make an assembler that closes frames by some rules."""
    return FrameAssembler(parse_preset(preset_text(close, frame=frame, top=top), "small", "small.toml"))


def joint(name: str, value: float, performer: str = "p") -> bytes:
    """Say where a joint is; all three coordinates are the same."""
    return message("/j", "ssfff", name, performer, value, value, value)


def pushed(target: FrameAssembler, packets: Sequence[bytes], arrival: float, sender: int = 1) -> list[Frame]:
    """Push datagrams; the frames that came of it, announcements aside."""
    made: list[Frame | Announcement] = []
    for packet in packets:
        made += target.push(decode_packet(packet), arrival, bundle=packet.startswith(b"#"), sender=sender)
    return [each for each in made if isinstance(each, Frame)]


def whole(value: float, performer: str = "p") -> list[bytes]:
    """Give all four joints."""
    return [joint(name, value, performer) for name in JOINTS]


def values(frame: Frame) -> list[float]:
    """Give the joints' first coordinates."""
    return frame.positions[:, 0].tolist()


# --- closing a frame ---------------------------------------------------------------------------------------------


END, BEGIN = message("/end"), message("/begin")
_NESTED = bundle(joint("a", 2.0), bundle(joint("b", 2.0), bundle(joint("c", 2.0))), joint("d", 2.0))
#: By what a preset says of closing: packets, and the frame that each gives, if any.
CLOSED: list[tuple[str, list[bytes], list[float | None]]] = [
    ("end", [*whole(1.0), END, END, *whole(2.0), END], [None] * 4 + [1.0, None] + [None] * 4 + [2.0]),
    # The end message was lost.
    ("end", [BEGIN, *whole(1.0), BEGIN, *whole(2.0)], [None] * 5 + [1.0] + [None] * 4),
    # Joints behind the end message in the same bundle.
    ("end", [bundle(joint("a", 1.0), END, *whole(1.0)[1:])], [1.0]),
    # An end message in a bundle of its own ends nothing in the next bundle.
    (
        "end",
        [bundle(*whole(1.0), END), bundle(END), bundle(*whole(2.0)[:2]), bundle(END, *whole(2.0)[2:])],
        [1.0, None, None, 2.0],
    ),
    ("bundle", [bundle(*whole(1.0)), _NESTED], [1.0, 2.0]),
    ("repeat", [*whole(1.0), *whole(2.0)], [None] * 4 + [1.0] + [None] * 3),
    ("complete repeat", whole(1.0), [None] * 3 + [1.0]),
]


@pytest.mark.parametrize(("close", "packets", "expected"), CLOSED)
def test_a_frame_is_closed_by_its_packet(close: str, packets: list[bytes], expected: list[float | None]) -> None:
    """Not before and not after: by the end message, the next beginning, the bundle, the first joint of the next."""
    target = assembler(*close.split())
    made = [pushed(target, [packet], place / 1000) for place, packet in enumerate(packets)]
    assert [[values(one) for one in each] for each in made] == [[[value] * 4] if value else [] for value in expected]
    assert {frame.performer for each in made for frame in each} == {"p"}
    assert set(target.counts.closed_by) <= {*close.split(), "begin"}
    assert sum(target.counts.closed_by.values()) == len([value for value in expected if value])


@pytest.mark.parametrize("rate", [15, 30, 120, 240])
@pytest.mark.parametrize("close", [("bundle",), ("complete", "repeat"), ("repeat",)], ids="-".join)
def test_a_start_between_two_joints_finds_the_next_frame(close: tuple[str, ...], rate: int) -> None:
    """Started between two joints, or after a lost packet, the assembler soon mixes no frames."""
    target = assembler(*close, "timeout")
    made: list[Frame] = []
    for number in range(200):
        packets = [bundle(*whole(number)[:2]), bundle(*whole(number)[2:])] if "bundle" in close else whole(number)
        lost = {0: len(packets) // 2, 100: 1}.get(number, 0)
        for place, packet in enumerate(packets[lost:]):
            made += pushed(target, [packet], number / rate + place * 1e-4)
    mixed = [frame for frame in made if len(set(values(frame))) > 1 and max(values(frame)) != 100]
    # The time between frames is learned, when it is not the preset's 30 Hz.
    assert len(mixed) <= (0 if rate <= 30 else 30)
    assert not [frame for frame in mixed if min(values(frame)) > 30]
    assert len(made) >= 195


def test_another_time_begins_another_frame() -> None:
    """Joints that carry their frame's time are assigned by it, even if other messages are missing."""
    target = assembler("repeat", top='clock = "sender"\nseconds = 0.001')

    def timed(name: str, value: float, time: float) -> bytes:
        return message("/t", "ssfffid", name, "p", value, value, value, 0, time)

    pushed(target, [timed(name, 1.0, 1000.0) for name in JOINTS], 0.0)
    (first,) = pushed(target, [timed(name, 2.0, 1030.0) for name in "ab"], 0.03)
    assert (values(first), first.time) == ([1.0] * 4, 1.0)
    assert pushed(target, [timed("c", 9.0, 1000.0)], 0.03) == []
    assert target.counts.late == 1
    (second,) = pushed(target, [*[timed(name, 2.0, 1030.0) for name in "cd"], timed("a", 3.0, 1060.0)], 0.06)
    assert (values(second), second.time) == ([2.0] * 4, 1.03)
    later = [timed("b", 3.0, 1060.0), timed("c", 3.0, 1060.0), timed("d", 4.0, 1090.0)]
    assert [values(frame) for frame in pushed(target, later, 0.09)] == [[3.0, 3.0, 3.0, 2.0]]


# --- late and absent joints --------------------------------------------------------------------------------------


def test_an_absent_joint_is_held_for_a_while() -> None:
    """A joint that is absent stays where it was, each time counted, then frames without it are refused and counted."""
    target = assembler("end")
    pushed(target, [*whole(0.0), message("/end")], 0.0)
    made: list[Frame] = []
    for number in range(1, 11):
        made += pushed(target, [*[joint(name, number) for name in "abc"], message("/end")], number * 0.05)
    assert [values(frame) for frame in made] == [[number] * 3 + [0.0] for number in range(1, 6)]
    # By default the time is the arrival.
    assert [frame.time for frame in made] == [number * 0.05 for number in range(1, 6)]
    assert (target.counts.held, target.counts.incomplete) == (5, 5)
    assert target.counts.absent == {"rhand": 5}
    (frame,) = pushed(target, [*whole(5.0), message("/end")], 1.0)
    assert values(frame) == [5.0] * 4


def test_one_lost_joint_of_many_costs_no_frame() -> None:
    """Of ten joints two may be absent for long, or never come: then they are NaN. Without three there is no frame."""
    names = "abcdefghij"
    joints = "\n".join(f'{name} = "{ours}"' for name, ours in zip(names, hdm05.SKELETON.joints, strict=False))
    text = preset_text(["end"]).split("[joints]")[0] + f"[joints]\n{joints}\n"
    target = FrameAssembler(parse_preset(text, "mine", "mine.toml"))
    pushed(target, [*(joint(name, 0.0) for name in names[:9]), message("/end")], 0.0)
    for lost, moment in ((0, 0.1), (1, 0.5), (2, 1.0)):
        made = pushed(target, [*(joint(name, 1.0) for name in names[lost:9]), message("/end")], moment)
        there = [[True] * lost + [False] * (9 - lost) + [True]] if lost < 2 else []
        assert [np.isnan(values(frame)).tolist() for frame in made] == there
    assert target.counts.incomplete == 1


def test_bones_below_a_lost_bone_are_lost() -> None:
    """Of VMC's bones a hand that does not come any more is NaN, with its fingers; without a spine there is no frame."""
    preset = builtin_preset("vmc")
    bones = list(preset.bones)

    def made_without(lost: str) -> list[Frame]:
        target = FrameAssembler(preset)
        everything = [message("/VMC/Ext/Bone/Pos", "sfffffff", name, 0, 0, 0, 0, 0, 0, 1) for name in bones]
        ended = message("/VMC/Ext/OK", "i", 1)
        pushed(target, [*everything, ended], 0.0)
        there = [packet for name, packet in zip(bones, everything, strict=True) if name != lost]
        return pushed(target, [*there, ended], 1.0)

    (frame,) = made_without("LeftHand")
    gone = [name for name, row in zip(preset.joints, frame.positions, strict=True) if np.isnan(row).any()]
    assert gone == ["lradius", "lhand"]
    assert made_without("Spine") == []


def test_an_uncertain_joint_is_absent() -> None:
    """A joint below the confidence floor, a NaN or a missing joint is held as absent; words are counted."""
    target = assembler("end", frame="confidence = 0.3\nwords = { Tracked = 1.0, Lost = 0.0 }")
    pushed(target, [*whole(0.0), message("/end")], 0.0)
    unsure = [
        message("/c", "ssffff", "a", "p", 1.0, 1.0, 1.0, 0.2),
        message("/c", "ssfffs", "b", "p", 1.0, 1.0, 1.0, "Lost"),
        message("/c", "ssffff", "c", "p", float("nan"), 1.0, 1.0, 1.0),
        message("/j", "ssNNN", "d", "p"),
        message("/c", "ssfffs", "d", "p", 1.0, 1.0, 1.0, "tracked"),
    ]
    assert pushed(target, [*unsure, joint("a", 2.0), message("/end")], 0.02)[0].positions[:, 0].tolist() == [2, 0, 0, 1]
    assert (target.counts.unsure, target.counts.held) == (4, 2)


# --- performers and senders --------------------------------------------------------------------------------------


def test_there_is_room_for_so_many() -> None:
    """A performer above the limit is refused and counted; the others go on."""
    target = assembler("end")
    crowd = [packet for number in range(MAX_PERFORMERS + 1) for packet in whole(1.0, f"p{number}")]
    made = pushed(target, [*crowd, message("/end")], 0.0)
    assert [frame.performer for frame in made] == [f"p{number}" for number in range(MAX_PERFORMERS)]
    assert target.counts.no_room == 4


def test_the_joints_of_a_performer_who_leaves_are_not_held() -> None:
    """When the sender says that a performer is gone, the last frame is given out and nothing is held afterwards."""
    target = assembler("end")
    pushed(target, whole(1.0), 0.0)
    (frame,) = pushed(target, [message("/gone", "si", "p", 0)], 0.01)
    assert values(frame) == [1.0] * 4
    assert pushed(target, [*whole(2.0)[:2], message("/end")], 0.02) == []
    assert target.counts.incomplete == 1


# --- clocks ------------------------------------------------------------------------------------------------------


@given(st.lists(st.sampled_from([*"abcdez", "end", "begin", "gone", "time"]), max_size=60), st.data())
def test_no_order_of_messages_invents_joints(words: list[str], data: st.DataObject) -> None:
    """Messages in any order give frames of joints that were sent, none older than the hold, with ascending times."""
    rules = st.sampled_from(["end", "bundle", "repeat", "complete", "timeout"])
    target = assembler(*data.draw(st.lists(rules, min_size=1)))
    sent: dict[str, dict[float, float]] = {}
    made: list[tuple[float, Frame]] = []
    now = 0.0
    for number, word in enumerate(words, start=1):
        now += data.draw(st.floats(0.0, 0.2))
        packet = {
            "end": message("/end"),
            "begin": message("/begin"),
            "gone": message("/gone", "si", "p", 0),
            "time": message("/time", "f", now),
        }.get(word) or joint(word, number)
        sent.setdefault(word, {})[float(number)] = now
        if data.draw(st.booleans()):
            packet = bundle(packet)
        made += [(now, frame) for frame in pushed(target, [packet], now)]
    made += [(now + 1.0, each) for each in target.expire(now + 1.0) if isinstance(each, Frame)]
    for _, frame in made:
        for name, value in zip(JOINTS, values(frame), strict=True):
            assert value in sent[name]
            assert frame.time - sent[name][value] <= 0.25 + 1e-9
    times = [frame.time for _, frame in made]
    assert times == sorted(times)
    assert target.counts.frames == len(made)


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


def test_things_beside_a_body_change_nothing() -> None:
    """Names that no convention knows close no frame, take no room, and do not pile up; turns are nobody's places."""
    sender, names = _Sender(), [*NAMES]
    sender.send([f"blob{number}" for number in range(3000)], 1)
    for number in range(100):
        sender.send([f"ball{number}"], 1, who=f"/thing{number}")
    assert not sender.send(names, 5, who="/rot")
    made = [each for number in range(30) for each in sender.send([*names, f"particle{number}"], 1, who="/ann")]
    assert sum(isinstance(each, Frame) for each in made) >= 28
    assert sender.assembler.counts.incomplete == sender.assembler.counts.no_room == 0


@pytest.mark.parametrize("rotation", [(0.0,) * 4, (1e300,) * 4, (1e-20,) * 4])
def test_a_rotation_that_is_none_is_no_rotation(rotation: tuple[float, ...]) -> None:
    """Zeros, and numbers too large or small for a direction, do not turn the bone."""
    bones = {"a": Bone(), "b": Bone("a", (1.0, 0.0, 0.0))}
    assert world_positions(bones, {"a": (None, rotation)})["b"] == (1.0, 0.0, 0.0)  # type: ignore[dict-item]  # of four
