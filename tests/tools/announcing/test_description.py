"""OSCQuery's objects: every address we take and send, with types, access and ranges."""

from collections.abc import Iterator
from typing import Any

from programs import builtin_library, ghost_cues
from pythonosc.osc_message import OscMessage

from kinespace.stream.frame import Announcement, Frame
from kinespace.stream.osc import encode_announcement
from kinespace.stream.osc.frames import encode_frame
from kinespace.stream.outputs.layouts import LAYOUTS
from kinespace.stream.recognizer import Recognizer
from kinespace.tools.announcing.description import Known, described, reply

LIBRARY = builtin_library()
KNOWN = Known(31, LIBRARY.classes, ("Ada L",), teaches=True)


def _messages(datagram: bytes) -> Iterator[OscMessage]:
    from pythonosc.osc_packet import OscPacket  # noqa: PLC0415 - its name alone

    yield from (each.message for each in OscPacket(datagram).messages)


def _types(message: OscMessage) -> str:
    tags = {str: "s", int: "i", float: "f"}
    return "".join(tags[type(each)] for each in message.params)


def node_at(address: str, known: Known = KNOWN) -> Any:  # noqa: ANN401 - JSON
    """Ask for an address."""
    status, node = reply(described(known), {}, address)
    assert status == 200
    return node


def test_every_answer_has_its_node() -> None:
    """The messages of the native layout have nodes of their addresses and types, and their values lie in the ranges."""
    layout, recognizer = LAYOUTS["native"](), Recognizer(LIBRARY)
    answers = [
        answer for cue in ghost_cues("squat1Reps", 1.5, performer="Ada L") if (answer := recognizer.push(cue.frame))
    ]
    sent = [message for answer in answers for message in _messages(layout.recognition(answer))]
    sent += [m for answer in answers for event in answer.events for m in _messages(layout.event(event) or b"")]
    sent += [*_messages(layout.classes(LIBRARY.classes) or b"")]
    assert {message.address.rpartition("/")[2] for message in sent} == {
        "class",
        "guess",
        "label",
        "sofar",
        "scores",
        "event",
        "classes",
    }
    for message in sent:
        node = node_at(message.address)
        assert (node["FULL_PATH"], node["TYPE"], node["ACCESS"]) == (message.address, _types(message), 1)
        for value, allowed in zip(message.params, node["RANGE"], strict=True):
            if allowed and "VALS" in allowed:
                assert value in allowed["VALS"]
            elif allowed:
                assert allowed["MIN"] <= value <= allowed["MAX"]


def test_what_is_taken_has_its_node() -> None:
    """Frames and names of joints are of the described types; teaching is described where it is possible."""
    frame = Frame("ann", 1.0, LIBRARY.motions[0].positions[0])
    for datagram in (encode_frame(frame), encode_announcement(Announcement("ann", LIBRARY.skeleton.joints))):
        (message,) = _messages(datagram)
        node = node_at(message.address)
        assert (node["TYPE"].replace("d", "f"), node["ACCESS"]) == (_types(message), 2)
    assert node_at("/motion/teach")["TYPE"] == "ss"
    assert reply(described(KNOWN._replace(teaches=False)), {}, "/motion/teach") == (404, None)
