"""The reader of messages: the meaning of each message, its performer and its joint, with any numbers and names."""

import pytest
from golden import message

from kinespace.stream.feeds import Mapper, builtin_preset
from kinespace.stream.feeds.message_reader import MessageError, Reading
from kinespace.stream.feeds.preset import Means, parse_preset
from kinespace.stream.osc import decode_packet
from kinespace.stream.osc.packet import Message

JOINTS = '[joints]\nhand = "lhand"\nhead = "head"\nneck = ""\n'


def mapper(text: str) -> Mapper:
    """Make a mapper of a preset's text, port and joints added."""
    return Mapper(parse_preset(f"port = 1\n{text}\n{JOINTS}", "mine", "mine.toml"))


def read(target: Mapper, packet: bytes) -> Reading:
    """Read one message that is understood."""
    (decoded,) = decode_packet(packet)
    reading = target.read(decoded)
    assert reading is not None
    return reading


LOOSE = mapper(
    """
[[message]]
address = "/{performer}/at/{joint}"
arguments = ["x", "y", "z"]
[[message]]
address = "/at"
arguments = ["=pos", "joint", "performer", "x", "y", "z"]
"""
)


def test_addresses_name_joint_and_performer() -> None:
    """The placeholders' texts are read; capitals elsewhere in the address are ignored."""
    reading = read(LOOSE, message("/Ada/AT/Hand", "fff", 1.0, 2.0, 3.0))
    assert (reading.performer, reading.sightings[0].joint) == ("Ada", "hand")
    assert reading.sightings[0].position == (1.0, 2.0, 3.0)


def test_a_text_that_must_stand_there_decides() -> None:
    """With another text the message is foreign, with fewer arguments after the text it is malformed."""
    assert read(LOOSE, message("/at", "sssfff", "pos", "head", "p", 1.0, 2.0, 3.0)).performer == "p"
    (other,) = decode_packet(message("/at", "sss", "quat", "head", "p"))
    assert LOOSE.read(other) is None
    (short,) = decode_packet(message("/at", "sss", "pos", "head", "p"))
    with pytest.raises(MessageError, match="/at: expected other arguments, got 3"):
        LOOSE.read(short)


@pytest.mark.parametrize("performer", [7, 7.0, "7"])
def test_numbers_are_names_too(performer: object) -> None:
    """A performer's id may be an integer, a whole float or text: it is the same performer."""
    reading = LOOSE.read(Message("/at", ["pos", "hand", performer, 1.0, 2, 3.0]))
    assert reading.performer == "7"


def test_an_unnamed_joint_is_remembered() -> None:
    """A joint that the preset does not name is passed over and can be shown; a joint without counterpart is known."""
    target = mapper('[[message]]\naddress = "/{joint}"\narguments = ["x", "y", "z"]')
    assert not read(target, message("/tail", "fff", 1.0, 2.0, 3.0)).sightings
    assert read(target, message("/neck", "fff", 1.0, 2.0, 3.0)).sightings
    assert target.unknown == {"tail"}


def test_missing_coordinates_are_nan() -> None:
    """None, NaN and infinity in a coordinate mean that the joint is not seen."""
    for coordinate in (None, float("nan"), float("inf")):
        reading = LOOSE.read(Message("/p/at/hand", [1.0, coordinate, 3.0]))
        assert reading.sightings[0].position is None


def test_the_first_rule_that_fits_is_used() -> None:
    """Two rules of one address are told apart by the number and kinds of their arguments."""
    target = Mapper(builtin_preset("natnet2osc"))
    bone = ("Hip", 1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0)
    offsets = (2, 0.0, 0.0, 0.0)
    short = read(target, message("/skeleton", "si" + "sfffffff" * 3, "Jan", 1, *bone * 3))
    long = read(target, message("/skeleton", "si" + "sfffffffifff" * 2, "Jan", 1, *(bone + offsets) * 2))
    assert (len(short.sightings), len(long.sightings)) == (3, 2)
    for reading in (short, long):
        assert {sighting.position for sighting in reading.sightings} == {(1.0, 2.0, 3.0)}


def test_numbers_of_joints_are_taught_by_the_sender() -> None:
    """A number is the preset's joint at that place until the sender gives it a name; each performer's own."""
    target = Mapper(builtin_preset("natnetthree2osc"))
    place = message("/skeleton/1/bone/5/position", "fff", 1.0, 2.0, 3.0)
    assert read(target, place).sightings[0].joint == "Head"
    taught = read(target, message("/motive/skeleton/id/bone", "iis", 1, 5, "LHand"))
    assert taught.means is Means.NAME
    assert read(target, place).sightings[0].joint == "LHand"
    other = message("/skeleton/2/bone/5/position", "fff", 1.0, 2.0, 3.0)
    assert read(target, other).sightings[0].joint == "Head"


def test_the_order_of_joints_is_taught_by_the_sender() -> None:
    """After /motion/skeleton with another order, the same numbers are other joints'."""
    target = Mapper(builtin_preset("native"))
    frame = message("/motion/frame", "sd" + "f" * 6, "p", 1.0, *[1.0] * 3, *[2.0] * 3)
    assert [sighting.joint for sighting in read(target, frame).sightings] == ["root", "lhipjoint"]
    read(target, message("/motion/skeleton", "sss", "p", "head", "root"))
    assert [sighting.joint for sighting in read(target, frame).sightings] == ["head", "root"]


def test_more_joints_than_names_are_refused() -> None:
    """A whole frame with more joints than the order has, or a broken group, is a wrong message; fewer are taken."""
    target = Mapper(builtin_preset("nimate-omni"))
    assert len(read(target, message("/skeleton", "f" * 42, *[1.0] * 42)).sightings) == 14
    for count in (48, 44, 0):
        with pytest.raises(MessageError):
            target.read(Message("/skeleton", [1.0] * count))


def test_a_time_of_64_bits_comes_in_two_halves() -> None:
    """QTM's microseconds are put together from two integers, the low one with or without a sign."""
    target = Mapper(builtin_preset("qtm"))
    for low, expected in ((5, (3 << 32) + 5), (-2, (3 << 32) + 2**32 - 2)):
        reading = read(target, message("/qtm/data", "iiiiiii", 3, low, 0, 1, 0, 0, 1))
        assert reading.time == pytest.approx(expected * 1e-6)


def test_memory_is_bounded() -> None:
    """A sender that makes up addresses, joints and names fills a bounded memory."""
    target = Mapper(builtin_preset("natnetthree2osc"))
    for number in range(9000):
        target.read(Message(f"/skeleton/p{number}/bone/x{number}/position", [1.0, 2.0, 3.0]))
        target.read(Message("/motive/skeleton/id/bone", [f"p{number}", number, "Hip"]))
    sizes = [len(target._taught), len(target.unknown)]  # noqa: SLF001 - sizes cannot be seen from outside
    sizes += [cache.cache_info().currsize for cache in (target._ways, target._resolved)]  # noqa: SLF001 - as above
    assert max(sizes) <= 4096
