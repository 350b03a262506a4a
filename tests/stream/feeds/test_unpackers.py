"""Packets that are no OSC become messages; a packet of another form raises one kind of error."""

import json
import struct

import pytest
from golden import bundle, message

from kinespace.stream.feeds import builtin_preset
from kinespace.stream.feeds.unpackers import ChannelUnpacker, unpack_rokoko, unpack_xsens, unpack_zigsim
from kinespace.stream.inputs.decoder import FeedDecoder
from kinespace.stream.osc.packet import MAX_MESSAGES, Message, PacketError


def _rokoko(actors: object) -> bytes:
    return json.dumps({"version": 3, "fps": 60, "scene": {"timestamp": 0, "actors": actors, "props": []}}).encode()


def _joint(x: float) -> dict[str, dict[str, float]]:
    return {"position": {"x": x, "y": 2.0, "z": 3.0}, "rotation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}


def test_rokoko_names_actors_and_joints() -> None:
    """All actors of a frame come together; characters that OSC reserves are written as in a URL."""
    actors = [{"name": "Ann/1", "body": {"hip": _joint(1.0)}}, {"name": "Bo", "body": {"head": _joint(4.0)}}]
    assert unpack_rokoko(_rokoko(actors)) == [
        Message("/rokoko/Ann%2F1/hip", [1.0, 2.0, 3.0]),
        Message("/rokoko/Bo/head", [4.0, 2.0, 3.0]),
    ]
    assert unpack_rokoko(_rokoko([{"name": "Face", "face": {"jawOpen": 3}}])) == []
    most = {f"joint{number}": _joint(0.0) for number in range(MAX_MESSAGES)}
    assert len(unpack_rokoko(_rokoko([{"name": "Ann", "body": most}]))) == MAX_MESSAGES


@pytest.mark.parametrize(
    "packet",
    [
        b"",
        b"{",
        b"\x04\x22M\x18 lz4",
        b"[]",
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
    assert unpack_xsens(header + segments) == [
        Message("/xsens/4/1", [1.0, 2.0, 3.0, 1500.0]),
        Message("/xsens/4/2", [1.0, 2.0, 3.0, 1500.0]),
    ]
    assert unpack_xsens(header.replace(b"MXTP02", b"MXTP13") + segments) == []
    assert unpack_xsens(struct.pack(">6sIBBIBBBBHH", b"MXTP02", *[0] * 10)) == []


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
    assert [unpack(message("/p1/a:tx", "f", number)) for number in (7.0, 8.0)] == [
        [],
        [Message("/p1/a", [7.0, 6.0, 1.0])],
    ]


@pytest.mark.parametrize("place", ["[1,2,3]", '{"x":1,"y":2,"z":3}', "null"])
def test_places_in_json_have_several_forms(place: str) -> None:
    """ZIG SIM's and Rokoko's places are read as lists, as objects, and as joints that are lost."""
    expected = [None] * 3 if place == "null" else [1.0, 2.0, 3.0]
    packet = '{"sensordata":{"bodyTracking":{"head":PLACE}},"device":{"name":"太郎のiPhone"}}'.replace("PLACE", place)
    assert unpack_zigsim(packet.encode()) == [Message("/zigsim/太郎のiPhone/head", expected)]
    packet = '{"scene":{"actors":[{"name":"Ann/1","body":{"hip":{"position":PLACE}}}]}}'.replace("PLACE", place)
    assert unpack_rokoko(packet.encode()) == [Message("/rokoko/Ann%2F1/hip", expected)]


def test_channels_of_a_sender_that_invents_names_do_not_pile_up() -> None:
    """Channels that wait for further numbers are limited."""
    unpack = ChannelUnpacker()
    for number in range(5000):
        assert unpack(message(f"/p1/joint{number}:tx", "f", 1.0)) == []
    assert len(unpack._waiting) <= 1024  # noqa: SLF001 - the bound under test
