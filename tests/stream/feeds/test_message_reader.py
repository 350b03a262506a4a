"""Presets: the built-in ones are complete, and a mistake in a user's own is one line with its place."""

import itertools
import json
import struct
import tomllib
from pathlib import Path

import pytest
from golden import bundle, message

from kinespace.library.naming.hdm05 import SKELETON
from kinespace.stream.feeds import Mapper, PresetError, builtin_names, builtin_preset, load_preset
from kinespace.stream.feeds.frame_assembler import FORGET_AFTER
from kinespace.stream.feeds.message_reader import MessageError
from kinespace.stream.feeds.preset import Closing, parse_preset
from kinespace.stream.feeds.unpackers import ChannelUnpacker, unpack_rokoko, unpack_xsens
from kinespace.stream.frame import Announcement, Frame
from kinespace.stream.inputs.decoder import MAX_SENDERS, STEADY, FeedDecoder, SenderNumbers
from kinespace.stream.osc import decode_packet
from kinespace.stream.osc.packet import MAX_MESSAGES, Message, PacketError

GOOD = """
port = 7000
[[message]]
address = "/joint/{joint}"
arguments = ["x", "y", "z"]
[joints]
hand = "lhand"
head = "head"
"""


@pytest.mark.parametrize("name", builtin_names())
def test_a_preset_is_whole_and_its_copy_is_the_same(name: str, tmp_path: Path) -> None:
    """Each has a product, something to set, at least nine joints of HDM05's, and means the same in one's own file."""
    path = tmp_path / "mine.toml"
    path.write_text(builtin_preset(name).text, encoding="utf-8")
    mine, theirs = load_preset(path), builtin_preset(name)
    assert (mine.name, theirs.name) == ("mine", name)
    assert theirs.product
    assert "nothing: this is your own" not in theirs.sender
    assert len(theirs.joints) >= 9
    assert set(theirs.joints) <= set(SKELETON.joints)
    assert {Closing.TIMEOUT} <= theirs.closings.by
    for field in ("port", "joints", "messages", "closings", "order", "bones", "axes", "metres", "asking", "seconds"):
        assert getattr(mine, field) == getattr(theirs, field)


#: Mistakes by the text in whose place they stand, and the beginning of the line that says so.
MISTAKES = tomllib.loads(Path(__file__).with_name("mistakes.toml").read_text(encoding="utf-8"))
MISTAKES["port = 7000"] |= {
    f"port = {'[' * 20_000}": "expected TOML, got tables or lists nested too deep",
    "#" * 32_001: "expected at most 32000 characters, got 3",
}


@pytest.mark.parametrize(
    ("old", "new"), [pytest.param(old, new, id=new[:40]) for old, mistakes in MISTAKES.items() for new in mistakes]
)
def test_a_mistake_is_one_line(old: str, new: str) -> None:
    """The line has the file, the key, the expectation and the value found."""
    assert old in GOOD
    with pytest.raises(PresetError) as caught:
        parse_preset(GOOD.replace(old, new), "mine", "mine.toml")
    told = str(caught.value)
    assert told.startswith(f"mine.toml: {MISTAKES[old][new]}")
    assert "\n" not in told
    assert ", got " in told


def test_more_joints_than_names_are_refused() -> None:
    """A whole frame with more joints than the order has, or a broken group, is a wrong message; fewer are taken."""
    target = Mapper(builtin_preset("nimate-omni"))
    (decoded,) = decode_packet(message("/skeleton", "f" * 42, *[1.0] * 42))
    assert len(target.read(decoded).sightings) == 14
    for count in (48, 44, 0):
        with pytest.raises(MessageError):
            target.read(Message("/skeleton", [1.0] * count))


def test_bones_in_even_number_are_not_taken_for_longer_groups() -> None:
    """Twelve arguments each fill eights, too; a turn of nothing is no name."""
    preset = builtin_preset("natnet2osc")
    names = [*preset.joint_map][:18]
    bones = [each for name in names for each in (name, 0.1, 1.0, 0.2, 0.0, 0.0, 0.0, 1.0, 1, 0.0, 0.1, 0.0)]
    content = Mapper(preset).read(Message("/skeleton", ["Jan", 3, *bones]))
    assert content is not None
    assert len(content.sightings) == len(names)


def test_memory_is_bounded() -> None:
    """A sender that makes up addresses, joints and names fills a bounded memory."""
    target = Mapper(builtin_preset("natnetthree2osc"))
    for number in range(4200):
        target.read(Message(f"/skeleton/p{number}/bone/x{number}/position", [1.0, 2.0, 3.0]))
        target.read(Message("/motive/skeleton/id/bone", [f"p{number}", number, "Hip"]))
    sizes = [len(target._taught), len(target.unknown)]  # noqa: SLF001 - sizes cannot be seen from outside
    sizes += [cache.cache_info().currsize for cache in (target._ways, target._resolved)]  # noqa: SLF001 - as above
    assert max(sizes) <= 4096


def _rokoko(actors: object) -> bytes:
    return json.dumps({"version": 3, "fps": 60, "scene": {"timestamp": 0, "actors": actors, "props": []}}).encode()


def _joint(x: float) -> dict[str, dict[str, float]]:
    return {"position": {"x": x, "y": 2.0, "z": 3.0}, "rotation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}


@pytest.mark.parametrize(
    "packet",
    [
        b"",
        b"\x04\x22M\x18 lz4",
        b'{"scene": {"actors": [{"body": {}}]}}',
        _rokoko([{"name": "Ann", "body": {"hip": {"position": {"x": 1.0}}}}]),
        _rokoko([{"name": "Ann", "body": {"hip": {"position": {"x": "1", "y": 2, "z": 3}}}}]),
        _rokoko([{"name": "Ann", "body": {f"joint{number}": _joint(0.0) for number in range(MAX_MESSAGES + 1)}}]),
        b'{"scene": ' + b"[" * 5000,
    ],
)
def test_broken_rokoko_packets_raise_one_error(packet: bytes) -> None:
    """Packets that are cut, compressed, of another shape, too large or too deep raise an error that the feed counts."""
    with pytest.raises(PacketError, match="packet: expected"):
        unpack_rokoko(packet)
    decoder = FeedDecoder(builtin_preset("rokoko"))
    assert decoder.decode(packet, 1.0, None) == ()
    assert decoder.counts.malformed == 1


def test_xsens_reads_the_body_alone() -> None:
    """Body segments are read with the sample's time; props and fingers after them are not."""
    segments = b"".join(struct.pack(">i7f", number, 1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0) for number in (1, 2, 24))
    header = struct.pack(">6sIBBIBBBBHH", b"MXTP02", 7, 0x80, 3, 1500, 4, 2, 1, 0, 0, len(segments))
    body = [Message(f"/xsens/4/{number}", [1.0, 2.0, 3.0, 1500.0]) for number in (1, 2)]
    assert unpack_xsens(header + segments) == body
    assert unpack_xsens(header.replace(b"MXTP02", b"MXTP13") + segments) == []
    assert unpack_xsens(struct.pack(">6sIBBIBBBBHH", b"MXTP02", *[0] * 10)) == []


@pytest.mark.parametrize(
    ("address", "before", "performer"),
    [
        *(("/{}", "", "me"), ("/ann/{}", "", "ann"), ("/ann/joint", "{}", "ann"), ("/{}/position", "", "me")),
        *(("/ann/{}/position", "", "ann"), ("/skeleton/ann/{}", "", "ann"), ("/skeleton/{}/position", "", "me")),
        *(("/skeleton/ann/{}/position", "", "ann"), ("/ann/{}/rotation", "", None), ("/rot/{}", "", None)),
    ],
)
def test_a_message_a_joint_may_be_written_in_many_ways(address: str, before: str, performer: str | None) -> None:
    """The joint's name stands in the address or before its place; numbers that are no place are nobody's."""
    decoder, made = FeedDecoder(builtin_preset("joints")), list[Announcement | Frame]()
    for step, name in itertools.product(range(20), ("Hips", "Spine", "Head", "LeftHand", "RightHand")):
        words = before.format(name).split()
        packet = message(address.format(name), "s" * len(words) + "fff", *words, float(len(name)), 1.0, step / 10)
        made += decoder.decode(packet, 1 + step / 30, ("127.0.0.1", 9000))
    assert {each.performer for each in made} == ({performer} if performer else set())
    assert [len(each.joints) for each in made if isinstance(each, Announcement)] == ([5] if performer else [])
    assert sum(isinstance(each, Frame) for each in made) == (19 if performer else 0)
    assert decoder.counts.foreign == (0 if performer else 100)


@pytest.mark.parametrize(
    "channel",
    [
        *("/p1/wrist_l:t{}", "/p1/wrist_l/t{}", "/p1/wrist_l_{}", "/p1/wrist_l.T{}", "/p1/wrist_l/{}/"),
        *("/p1/wrist_l/position/{}", "/p1/wrist_l_pos_{}", "p1/wrist_l/{}"),
    ],
)
def test_channels_become_joints(channel: str) -> None:
    """Three numbers of one joint are a message, in one packet or in three; other messages stay the same."""
    unpack, numbers = ChannelUnpacker(), (("x", 1.0), ("y", 2.0), ("z", 3.0))
    packets = [message(channel.format(axis), "f", number) for axis, number in numbers]
    joint = Message("/p1/wrist_l", [1.0, 2.0, 3.0])
    assert [unpack(packet) for packet in packets] == [[], [], [joint]]
    assert unpack(bundle(*packets, message("/p1/id", "f", 7.0))) == [joint, Message("/p1/id", [7.0])]


@pytest.mark.parametrize(
    ("names", "joints"),
    [
        ("pelvis neck head wrist_l knee_r", ("root", "rfemur", "lowerneck", "head", "lradius")),
        ("hip_c shoulder_c head wrist_l knee_r", ("root", "rfemur", "lowerneck", "head", "lradius")),
        ("mixamorig:Hips Neck Head LeftHand RightLeg", ("root", "rfemur", "lowerneck", "upperneck", "lradius")),
        ("foo bar baz qux quux", ()),
    ],
    ids=["kinect azure", "kinect", "mixamo", "unknown"],
)
def test_touchdesigner_sends_names_of_any_table(names: str, joints: tuple[str, ...]) -> None:
    """The joints that come are announced by the library's names, and make frames; names of no table make none."""
    decoder, made = FeedDecoder(builtin_preset("touchdesigner")), list[Announcement | Frame]()
    for step in range(20):
        sent = [message(f"/p1/{name}:t{axis}", "f", float(step)) for name in names.split() for axis in "xyz"]
        made += decoder.decode(bundle(*sent), 1 + step / 30, ("127.0.0.1", 9000))
    assert {each.joints for each in made if isinstance(each, Announcement)} == ({joints} if joints else set())
    assert sum(isinstance(each, Frame) for each in made) == (20 if joints else 0)


def test_numbers_that_did_not_change_are_kept() -> None:
    """In a bundle a joint keeps numbers that lack, and one that lacks keeps all while its performer's others go on."""
    unpack = ChannelUnpacker()
    whole = [message(f"/p1/{joint}:t{axis}", "f", 1.0) for joint in ("a", "b") for axis in "xyz"]
    assert len(unpack(bundle(*whole, message("/p2/c:tx", "f", 1.0)))) == 2
    assert unpack(bundle(message("/p1/a:ty", "f", 5.0))) == [Message("/p1/a", [1.0, 5.0, 1.0])]
    for _ in range(5):
        given = unpack(bundle(message("/p1/a:ty", "f", 6.0)))
    assert given == [Message("/p1/a", [1.0, 6.0, 1.0]), Message("/p1/b", [1.0, 1.0, 1.0])]
    # One by one a number that comes again says that the others did not change.
    again = [unpack(message("/p1/a:tx", "f", number)) for number in (7.0, 8.0)]
    assert again == [[], [Message("/p1/a", [7.0, 6.0, 1.0])]]


def test_channels_of_a_sender_that_invents_names_do_not_pile_up() -> None:
    """Channels that wait for further numbers are limited."""
    unpack = ChannelUnpacker()
    for number in range(5000):
        assert unpack(message(f"/p1/joint{number}:tx", "f", 1.0)) == []
    assert len(unpack._waiting) <= 1024  # noqa: SLF001 - the bound under test


def test_hosts_are_numbered() -> None:
    """Hosts get numbers; a host that is silent for long gives its number back; numbers are limited."""
    numbers = SenderNumbers()
    assert [numbers.number(host, 0.0) for host in ("a", "b", "a")] == [1, 2, 1]
    numbers.number("b", FORGET_AFTER)
    assert numbers.number("c", FORGET_AFTER + 1.0) == 1
    given = [numbers.number(f"h{index}", FORGET_AFTER) for index in range(20)]
    assert (max(given), given[-1]) == (MAX_SENDERS, MAX_SENDERS)
    assert numbers.number("b", FORGET_AFTER) == 2


def test_two_programs_of_one_host_are_told_apart() -> None:
    """Two that keep to their ports and send the same have two numbers; one that changes ports, or splits, has one."""
    numbers, times = SenderNumbers(), [step / 30 for step in range(60)]
    both = [(numbers.number("a", at, 5000, "/p1/head"), numbers.number("a", at, 5001, "/p1/head")) for at in times]
    assert both[0] == (1, 1)
    assert set(both[STEADY:]) == {(1, 2)}
    numbers = SenderNumbers()
    assert {numbers.number("a", time, 5000 + step, "/p1/head") for step, time in enumerate(times)} == {1}
    assert {numbers.number("a", time, 5000 + step % 2, f"/p{step % 2}/head") for step, time in enumerate(times)} == {1}
    numbers = SenderNumbers()
    assert {numbers.number("a", time, 5000 + (step > 30), "/p1/head") for step, time in enumerate(times)} == {1}
