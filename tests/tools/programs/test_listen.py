"""`kinespace listen`: every feed is recognised by its packets, and its mistakes are named."""

import json
import subprocess
from contextlib import closing, suppress
from itertools import cycle

import numpy as np
import pytest
from golden import LAYOUTS, bundle, message, moments
from programs import LOOPBACK, free_udp_port, ghost_cues, ran, started
from skeletons import names_of

from kinespace.library.naming import Naming
from kinespace.library.naming.hdm05 import SKELETON
from kinespace.stream import Announcement, Frame, osc
from kinespace.stream.feeds import builtin_names, builtin_preset
from kinespace.stream.feeds.preset import parse_preset
from kinespace.stream.inputs.detection import Survey
from kinespace.tools.programs.listen import advice, as_object, command

# --- listen -----------------------------------------------------------------------------------------------------------


PRESETS = [builtin_preset(name) for name in builtin_names()]


def surveyed(layout: str, frames: int = 6, *, without: int = 0) -> Survey:
    """Let a survey see some frames of a layout at 30 Hz, a number of datagrams of each left out."""
    survey, shown = Survey(), ghost_cues("squat1Reps", 0.5)[: 4 * frames : 4]
    for time, packets in moments(layout, [cue.frame.positions for cue in shown]):
        for place, packet in enumerate(packets[without:]):
            survey.keep(packet, time + place * 1e-5, ("10.0.0.7", 5000))
    return survey


@pytest.mark.slow
@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_feed_is_guessed(layout: str) -> None:
    """A product's packets are recognised as its preset's, with all joints, frames and the rate, none missing."""
    survey = surveyed(layout)
    guess = survey.guess(PRESETS)
    # What TouchDesigner sends is one message a joint, too.
    assert guess.preset.name == LAYOUTS[layout][0].replace("touchdesigner", "joints")
    assert guess.missing == ()
    assert guess.frames >= 5
    assert guess.rate == pytest.approx(30.0, rel=0.01)
    assert advice(survey, guess, None) == []


def test_missing_joints_are_named() -> None:
    """Joints that do not come are named by the motion library's names; few are done without, for many frames lack."""
    for without, begin in ((2, "not used, because they never came: head, lowerneck"), (5, "missing for")):
        survey = surveyed("osceleton", without=without)
        guess = survey.guess(PRESETS)
        assert (guess.preset.name, bool(guess.frames)) == ("osceleton", without == 2)
        assert {"head", "lowerneck"} <= set(guess.missing)
        assert any(line.startswith(begin) for line in advice(survey, guess, None))
    # Of two feeds it is the one of which all joints come; of any a quarter must.
    more = builtin_preset("osceleton").text.replace("[joints]", '[joints]\nthumb = "lthumb"')
    guess = surveyed("osceleton").guess([parse_preset(more, "larger", "larger.toml"), builtin_preset("osceleton")])
    assert guess.preset.name == "osceleton"
    assert [surveyed("osceleton", without=each).guess(PRESETS) is None for each in (11, 12)] == [False, True]


def test_silence_and_foreign_packets_have_messages() -> None:
    """No packets, packets that are no OSC, and unknown OSC have three different messages."""
    survey = Survey()
    assert survey.guess(PRESETS) is None
    assert advice(survey, None, "127.0.0.1:1")[0].startswith("nothing arrived")
    assert len(advice(survey, None, "0.0.0.0:1")) == 1
    survey.keep(b"junk", 0.0, ("h", 1))
    assert advice(survey, None, None)[0] == "1 of 1 packets are no OSC: another protocol on this port?"
    survey.keep(message("/fader", "f", 0.5), 0.0, ("h", 1))
    assert survey.guess(PRESETS) is None
    assert advice(survey, None, None)[-1].startswith("no known feed")


def test_joints_that_wait_for_a_coordinate_are_named() -> None:
    """A sender that sends only what changes may never send a coordinate that stands still."""
    survey = Survey()
    for address in ("/p#/knee_l:ty", "/p#/knee_l:tz", *(f"/p#/head:t{axis}" for axis in "xyz"), "/p#/hand_l/x"):
        survey.keep(message(address, "f", 0.5), 0.0, ("h", 1))
    waiting = "/p#/knee_l waits for x, /p#/hand_l waits for y and z: the sender sends only what changes; "
    assert advice(survey, None, None) == [f"{waiting}let it send all once, or always"]


@pytest.mark.slow
def test_the_program_gives_json() -> None:
    """One object with the feed, its joints and every kind of message; packets come until it ends."""
    port, positions = free_udp_port(), cycle([cue.frame.positions for cue in ghost_cues("squat1Reps", 0.5)[::4]])
    with started("listen", port, "--seconds", 1.5, "--json") as program, closing(osc.OscSender(LOOPBACK, port)) as out:
        for _, packets in moments("qtm", positions):
            for packet in packets:
                out.send(packet)
            with suppress(subprocess.TimeoutExpired):
                program.process.wait(1 / 30)
                break
        assert (program.wait(), program.errors) == (0, "")
        report = json.loads(program.output)
    assert (report["feed"], report["performers"], report["missing"]) == ("qtm", ["Jan"], [])
    # On a busy machine the sender may pause.
    assert [line for line in report["advice"] if "nothing for" not in line] == []
    assert {"address": "/qtm/data", "types": "iiiii*"} not in report["messages"]
    assert "/qtm/data" in {kind["address"] for kind in report["messages"]}


def test_feeds_are_listed_and_printed() -> None:
    """Every preset has its port and its sender's settings; one of them is printed as its file."""
    _, output, _ = ran("feeds")
    for preset in PRESETS:
        assert f"\n{preset.name}  port {preset.port}, " in f"\n{output}"
        assert preset.sender in output
    assert "/VMC/Ext/Bone/Pos" in ran("feeds", "vmc")[1]
    assert ran("feeds", "kinect")[0] == 2


# --- listen names -----------------------------------------------------------------------------------------------------


def _heard(joints: tuple[str, ...], frames: int = 20) -> Survey:
    survey, ours = Survey(), dict(zip(SKELETON.joints, ghost_cues("squat1Reps", 0.5)[0].frame.positions, strict=True))
    pose = np.array([ours.get(name, ours["root"]) for name in Naming().read(joints).joints])
    survey.keep(osc.encode_announcement(Announcement("ann", joints)), 0.0, ("127.0.0.1", 9))
    for number in range(frames):
        frame = Frame("ann", 1.0 + number / 30, pose)
        survey.keep(osc.encode_frame(frame), number / 30, ("127.0.0.1", 9))
    return survey


def test_joints_in_another_order_are_said() -> None:
    """As a recording of them would be said to be odd; one joint is no body."""
    survey = Survey()
    survey.keep(osc.encode_announcement(Announcement("ann", tuple(sorted(SKELETON.joints)))), 0.0, None)
    for number, cue in enumerate(ghost_cues("squat1Reps", 0.5)[:20]):
        survey.keep(osc.encode_frame(Frame("ann", 1.0 + number / 30, cue.frame.positions)), number / 30, None)
        survey.keep(osc.encode_announcement(Announcement("bob", ("hand",))), number / 30, None)
        survey.keep(osc.encode_frame(Frame("bob", 1.0 + number / 30, np.ones((1, 3)))), number / 30, None)
    (line,) = [each for each in advice(survey, survey.guess(PRESETS), None) if each.startswith("performer")]
    assert line.startswith("performer ann: joints: 31 of 31 where no body has them: in another order")


@pytest.mark.parametrize("known", [5, 4])
def test_a_sender_of_some_joints_lacks_none(known: int) -> None:
    """One message a joint: what nobody knows is said, and how many are needed, not what might be sent, too."""
    survey, names = Survey(), ["Hips", "Spine", "LeftArm", "RightArm", "LeftUpLeg"][:known]
    places = [(0, 1, 0), (0, 1.1, 0.02), (0.2, 1.45, 0), (-0.2, 1.45, 0.05), (0.1, 0.95, 0.02), (1, 1, 1)]
    for number in range(30):
        for index, (name, (x, y, z)) in enumerate(zip((*names, "Sword"), places, strict=False)):
            survey.keep(message(f"/{name}", "fff", x, y, z + number / 90), number / 30 + index / 1e4, None)
    guess = survey.looked_at_as(builtin_preset("joints"))
    assert (guess.missing, guess.unknown, guess.frames > 20) == ((), ("Sword",), known == 5)
    lines = [] if known == 5 else ["joints whose names are known: 4, and 5 are needed at least"]
    assert advice(survey, guess, None) == ["joints sent that the preset does not name: Sword", *lines]
    best = survey.guess([builtin_preset(name) for name in builtin_names()])
    assert (best.preset.name if best else "") == ("joints" if known == 5 else "")


@pytest.mark.parametrize(
    ("joints", "title", "ours"),
    [(names_of("mixamo"), "Mixamo", 29), (names_of("smpl"), "SMPL", 22), (SKELETON.joints[:12], "", 12)],
)
def test_names_of_others_and_fewer_joints_are_well(joints: tuple[str, ...], title: str, ours: int) -> None:
    """A feed with known names, or with some of our joints, needs no change."""
    survey = _heard(joints)
    guess = survey.guess([builtin_preset(name) for name in builtin_names()])
    assert (guess.preset.name, guess.frames, len(guess.joints), guess.performers) == ("native", 20, ours, ["ann"])
    assert guess.rate == pytest.approx(30.0)
    assert guess.understood == 1.0
    assert advice(survey, guess, None) == []
    assert as_object(survey, guess, [])["names"] == title


def test_bones_that_never_came_are_named() -> None:
    """A body of VMC with some bones alone is made whole by the standard skeleton: the others are said to be at rest."""
    survey = Survey()
    for number in range(20):
        cues = [message("/VMC/Ext/Bone/Pos", "sfffffff", bone, *[0.0] * 6, 1.0) for bone in ("Hips", "Spine", "Neck")]
        survey.keep(bundle(*cues), 1 + number / 30, None)
    guess = survey.looked_at_as(builtin_preset("vmc"))
    assert "LeftHand" in guess.at_rest
    assert "Spine" not in guess.at_rest
    assert any(line.startswith("bones that never came, and stay at rest: ") for line in advice(survey, guess, None))


@pytest.mark.parametrize(
    ("preset", "feed", "place", "expected"),
    [
        ("native", None, ("127.0.0.1", 9310), "kinespace live"),
        ("native", None, ("0.0.0.0", 9310), "kinespace live --osc-in 0.0.0.0:9310"),  # noqa: S104 - not bound
        ("vmc", None, ("127.0.0.1", 39539), "kinespace live --feed vmc"),
        ("vmc", None, ("127.0.0.1", 7000), "kinespace live --feed vmc --osc-in 127.0.0.1:7000"),
        ("vmc", "my own.toml", ("127.0.0.1", 39539), "kinespace live --feed 'my own.toml'"),
    ],
)
def test_the_command_names_the_port(preset: str, feed: str | None, place: tuple[str, int], expected: str) -> None:
    """The command for recognition can be pasted: it listens on the same port."""
    assert command(_heard(SKELETON.joints).looked_at_as(builtin_preset(preset)), feed, place) == expected
