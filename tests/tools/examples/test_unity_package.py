"""Unity's package: compiled with types named like Unity's, it sends frames that we read and hears what we answer."""

import json
import shutil
import subprocess
from contextlib import ExitStack, closing
from pathlib import Path

import numpy as np
import pytest
from programs import LOOPBACK, PATIENCE, ROOT, free_udp_port

from kinespace.library.naming import Naming, hdm05
from kinespace.stream import Announcement, Done, Event, EventKind, Frame, Outcome, Progress, Recognition, osc
from kinespace.stream.outputs import NativeLayout

PACKAGE = ROOT / "tools" / "examples" / "unity"
#: A name with a character that addresses cannot hold, and one that is two in C#.
PERFORMER, CLASSES = "Ada 🕺 L", ("bow", "squat1Reps")


def _stage(folder: Path) -> Path:
    """Compile the package with the types that stand for Unity's; skip the test where there is no compiler."""
    if not (shutil.which("mcs") and shutil.which("mono")):
        pytest.skip("mono is not installed")
    program = folder / "stage.exe"
    sources = [*Path(__file__).parent.glob("*.cs"), *(PACKAGE / "Runtime").glob("*.cs")]
    command = ["mcs", "-langversion:7", "-warnaserror+", f"-out:{program}", *map(str, sources)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=PATIENCE)
    assert done.returncode == 0, done.stdout + done.stderr
    return program


def _answers() -> list[bytes]:
    """Encode a squat's answers: an answer with progress, start, end and done; packets that are none come between."""
    layout = NativeLayout()
    progress = Progress(CLASSES[1], 0.5, 0.5, 1.25, 0.75, sure=1.0, cycles=0)
    scores = np.array([0.25, 0.75], dtype=np.float32)
    answer = Recognition(PERFORMER, 4.0, Outcome.NAMED, CLASSES, scores, movement=0.2, progress=progress)
    named = layout.recognition(answer)
    start, end = (layout.event(Event(PERFORMER, kind, CLASSES[1], 1, 0.75, 4.0)) for kind in EventKind)
    of_another = layout.event(Event("ann", EventKind.START, "bow", 0, 0.75, 4.0))
    broken = [b"", b"#bundle\0", named[:-2], named[:16] + b"\x7f\xff\xff\xff" + named[20:], b"/motion/a/label\0,b\0\0"]
    done = layout.done(Done(PERFORMER, CLASSES[1], 1, 6.0, 1.5, 0.875, 1.25, 0.75, 3))
    return [*broken, of_another, start, named, end, done]


@pytest.mark.slow
def test_a_humanoid_is_sent_and_its_motions_are_heard(tmp_path: Path) -> None:
    """Names, times and places are read as they were sent, z turned; start, end, done and label come to the scene."""
    answers, frames, joints = free_udp_port(), list[Frame](), ()
    with ExitStack() as opened:
        receiver = opened.enter_context(closing(osc.OscReceiver(LOOPBACK, 0)))
        sender = opened.enter_context(closing(osc.OscSender(LOOPBACK, answers)))
        command = ["mono", str(_stage(tmp_path)), PERFORMER, str(receiver.address[1]), str(answers)]
        stage = opened.enter_context(subprocess.Popen(command, stdout=subprocess.PIPE, text=True))
        opened.callback(stage.kill)
        receiver.socket.settimeout(PATIENCE)
        while len(frames) < 70:
            received = osc.decode(receiver.receive() or b"", 0.0)
            assert received.malformed == received.foreign == 0
            for event in received.events:
                if isinstance(event, Frame):
                    frames.append(event)
                elif isinstance(event, Announcement):
                    joints = event.joints
        for packet in _answers():
            sender.send(packet)
        printed, _ = stage.communicate(timeout=PATIENCE)
    assert len({*Naming().read(joints).joints} & {*hdm05.SKELETON.joints}) >= 15
    assert joints[:2] == ("Hips", "LeftUpperLeg")
    places = np.array([[0.25 * n, 0.5 * n, -0.75 * n] for n in (*range(19), 54)], dtype=np.float32)
    for number, frame in enumerate(frames, start=1):
        assert (frame.performer, frame.time) == (PERFORMER, 0.25 + (number - 1) / 64)
        np.testing.assert_array_equal(frame.positions, places)
    assert printed.splitlines() == [
        f"started {CLASSES[1]}",
        f"ended {CLASSES[1]}",
        f"done {CLASSES[1]}",
        f"label {CLASSES[1]} phase 0.5 speed 1.25 amplitude 0.75",
    ]


def test_the_package_is_whole() -> None:
    """The package names itself as Unity wants it and is of kinespace's version; it needs nothing else."""
    package = json.loads((PACKAGE / "package.json").read_text(encoding="utf-8"))
    assert package["name"] == package["name"].lower()
    assert "dependencies" not in package
    assert f'version = "{package["version"]}"' in (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert json.loads((PACKAGE / "Runtime" / "Kinespace.asmdef").read_text(encoding="utf-8"))["name"] == "Kinespace"
