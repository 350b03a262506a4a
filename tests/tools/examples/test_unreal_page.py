"""The page for Unreal: its tables are read as it says, and the messages of its nodes are a body's frames."""

import re
import tomllib
from pathlib import Path

import numpy as np
from golden import message
from programs import ROOT, builtin_library

from kinespace.stream import Announcement, Frame
from kinespace.stream.feeds import builtin_preset, load_preset
from kinespace.stream.inputs.decoder import FeedDecoder
from kinespace.stream.outputs.layouts import WrittenLayout

PAGE = (ROOT / ".github" / "docs" / "unreal.md").read_text(encoding="utf-8")
ANSWERS, JOINTS = re.findall(r"```toml\n(.+?)```", PAGE, re.DOTALL)


def test_the_answers_have_the_addresses_of_the_nodes(tmp_path: Path) -> None:
    """The table is read, and sends to the addresses that the page lists, no others."""
    (tmp_path / "unreal-answers.toml").write_text(ANSWERS, encoding="utf-8")
    assert WrittenLayout(tmp_path / "unreal-answers.toml").port == 8000
    sent = {each["address"].replace("{performer}", "ann") for each in tomllib.loads(ANSWERS)["message"]}
    assert sent == {*re.findall(r"`(/motion/ann/\w+)`", PAGE)}


def test_what_the_nodes_send_is_a_body(tmp_path: Path) -> None:
    """The mannequin's bones in Unreal's axes and centimetres become the library's joints, each at its place."""
    axes, names = JOINTS.split("[joints]\n")
    preset = builtin_preset("joints").text.replace("[frame]", f"{axes}[frame]") + names
    (tmp_path / "unreal.toml").write_text(preset, encoding="utf-8")
    decoder, bones = FeedDecoder(load_preset(tmp_path / "unreal.toml")), tomllib.loads(JOINTS)["joints"]
    library = builtin_library()
    places = dict(zip(library.skeleton.joints, library.motions[0].positions[0], strict=True))
    events = []
    for number in range(60):
        for bone, joint in bones.items():
            x, y, z = places[joint]
            packet = message(f"/ann/{bone}", "fff", -100 * z, 100 * x, 100 * y)
            events += decoder.decode(packet, 1.0 + number / 30, ("127.0.0.1", 5))
    frame = next(each for each in reversed(events) if isinstance(each, Frame))
    joints = next(each.joints for each in reversed(events) if isinstance(each, Announcement))
    assert (frame.performer, sorted(joints)) == ("ann", sorted(bones.values()))
    centred = np.array([places[each] - places["root"] for each in joints])
    np.testing.assert_allclose(frame.positions - frame.positions[joints.index("root")], 100 * centred, atol=1e-3)
