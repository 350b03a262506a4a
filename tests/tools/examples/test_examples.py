"""The examples in other languages: each that can run here sends its squat and gets its class; and the notebook."""

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from golden import message
from programs import LOOPBACK, PATIENCE, ROOT, builtin_library, free_udp_port, key_folders, python, ran, started
from written import write_clips

from kinespace.library import MotionLibrary
from kinespace.library.naming import Naming, hdm05
from kinespace.stream import Announcement, Event, EventKind, Frame, Outcome, Progress, Recognition, Recognizer, osc
from kinespace.stream.feeds import builtin_preset, load_preset
from kinespace.stream.inputs.decoder import FeedDecoder
from kinespace.stream.outputs import NativeLayout
from kinespace.stream.outputs.layouts import WrittenLayout
from kinespace.stream.recognition import Done

EXAMPLES = ROOT / "tools" / "examples"
#: The class that the examples' motion is of.
SQUAT = "squat1Reps"


def _node_modules() -> Path | None:
    """Find where npm put node-osc: beside the examples, above them, or in NODE_PATH; None where it is not."""
    places = [folder / "node_modules" for folder in (EXAMPLES, *EXAMPLES.parents)]
    places += [Path(each) for each in os.environ.get("NODE_PATH", "").split(os.pathsep) if each]
    return next((each for each in places if (each / "node-osc").is_dir()), None)


@pytest.mark.slow
def test_the_squat_is_named_by_default() -> None:
    """The built-in library's default signature names it in most answers, and says once that it starts."""
    recognizer = Recognizer(builtin_library())
    frames = np.tile(np.loadtxt(EXAMPLES / "squat.txt").reshape(-1, 31, 3), (2, 1, 1))
    pushed = [recognizer.push(Frame("drawn", 1 + number / 30, frame)) for number, frame in enumerate(frames)]
    answers = [each for each in pushed if each is not None]
    assert np.mean([each.label == SQUAT for each in answers]) > 0.8
    assert [(event.kind, event.label) for each in answers for event in each.events] == [(EventKind.START, SQUAT)]


#: By the program that must be there: how its example is run, the layout of the answers, and what it prints.
LANGUAGES = tomllib.loads(Path(__file__).with_name("languages.toml").read_text(encoding="utf-8"))


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
def test_an_example_gets_its_class(language: str, tmp_path: Path) -> None:
    """Run against a recogniser, without a screen, it sends its frames and prints the class that is answered."""
    if language != "python" and not shutil.which(language):
        pytest.skip(f"{language} is not installed")
    # A module looks for others from where it lies.
    shutil.copytree(EXAMPLES, tmp_path / "examples")
    if language == "node":
        modules = _node_modules()
        if modules is None:
            pytest.skip("node-osc is not installed: npm install node-osc")
        (tmp_path / "node_modules").symlink_to(modules)
    layout, expected, run = LANGUAGES[language].values()
    listens, answers = free_udp_port(), free_udp_port()
    options = ("--osc-in", f"{LOOPBACK}:{listens}", "--out", f"{layout}={LOOPBACK}:{answers}", "--signature", "paper")
    with started("live", *options, "--plain") as program:
        program.expect("listening on")
        ran = subprocess.run(
            [each.format(python=sys.executable, listens=listens, answers=answers) for each in run],
            cwd=tmp_path / "examples",
            # As root Qt's browser refuses to start.
            env={**os.environ, "QT_QPA_PLATFORM": "offscreen", "QTWEBENGINE_DISABLE_SANDBOX": "1"},
            capture_output=True,
            timeout=PATIENCE,
            check=False,
        )
        assert program.interrupt() == 0
        assert "malformed" not in program.output
    printed = (ran.stdout + ran.stderr).decode(errors="replace")
    assert ran.returncode == 0, printed
    assert all(each in printed for each in expected), printed
    assert language != "pd" or "error" not in printed


@pytest.mark.slow
def test_python_gets_answers_with_keys(tmp_path: Path) -> None:
    """The keyed client is let in and gets the class of its own motion; no other client gets the answers."""
    stage, client = key_folders(tmp_path, "stage", "client")
    endpoint = f"tcp://{LOOPBACK}:*"
    options = ("--zmq-in", endpoint, "--zmq-out", endpoint, "--keys", stage, "--signature", "paper", "--plain")
    with started("live", *options) as program:
        addresses = program.expect(r"listening on ZeroMQ (\S+); answering to ZeroMQ (\S+);").groups()
        keys = client / "client.key_secret", client / "stage.key"
        done = python("-W", "error", EXAMPLES / "python_zeromq_keys.py", *addresses, *keys, 2)
        assert (done.returncode, done.stderr) == (0, "")
        assert program.interrupt() == 0
        assert "malformed" not in program.output
    assert f"python: {SQUAT} starts" in done.stdout


@pytest.mark.slow
def test_the_examples_come_with_the_program() -> None:
    """`kinespace examples` lists every file, prints one as it is, and says which names there are."""
    assert {"node.mjs", "processing.pde", "touchdesigner.py"} <= {*ran("examples")[1].splitlines()}
    assert ran("examples", "node.mjs") == (0, (EXAMPLES / "node.mjs").read_text(encoding="utf-8"), "")
    status, _, said = ran("examples", "node")
    assert (status, "lists, got 'node', perhaps node.mjs is meant" in said) == (2, True)


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
            assert not received.refused
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
    told = [f"{what} {CLASSES[1]}" for what in ("started", "ended", "done", "label")]
    assert printed.splitlines() == [*told[:3], f"{told[3]} phase 0.5 speed 1.25 amplitude 0.75"]


def test_the_package_is_whole() -> None:
    """The package names itself as Unity wants it and is of kinespace's version; it needs nothing else."""
    package = json.loads((PACKAGE / "package.json").read_text(encoding="utf-8"))
    assert package["name"] == package["name"].lower()
    assert "dependencies" not in package
    assert f'version = "{package["version"]}"' in (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert json.loads((PACKAGE / "Runtime" / "Kinespace.asmdef").read_text(encoding="utf-8"))["name"] == "Kinespace"


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


# --- the notebook, cell by cell, as Jupyter runs it -------------------------------------------------------------------


@pytest.mark.slow
def test_the_notebook_goes_from_files_to_figures(
    tmp_path: Path, small_library: MotionLibrary, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It prints the paper's table as `evaluate retrieval` has it, draws two figures and keeps a taught library."""
    import matplotlib.pyplot as plt  # noqa: PLC0415 - it takes a second, which the other tests need not wait

    monkeypatch.chdir(tmp_path)
    drawn = list[int]()
    monkeypatch.setattr(plt, "show", lambda: (drawn.append(len(plt.gcf().axes)), plt.close()))
    plt.switch_backend("agg")
    notebook = (ROOT / "tools" / "examples" / "from_files_to_figures.ipynb").read_text(encoding="utf-8")
    cells = json.loads(notebook)["cells"]
    write_clips(tmp_path)
    first = "".join(next(cell for cell in cells if cell["cell_type"] == "code")["source"])
    exec(first.replace('folder = ""', f"folder = {str(tmp_path)!r}"), {})  # noqa: S102 - our own cell
    assert "12 motions of 3 classes by 2 persons" in capsys.readouterr().out
    names = dict[str, Any]()
    for cell in cells:
        if cell["cell_type"] == "code":
            assert not cell["outputs"]
            exec("".join(cell["source"]), names)  # noqa: S102 - our own cells
        if drawn:
            # The cells with a live feed, and with a library of one's own, get few motions: they open fast.
            names |= {"library": small_library, "clips": small_library.motions}
    printed = capsys.readouterr().out
    assert "288 motions of 11 classes by 5 persons" in printed
    assert re.search(r"any other +95\.8\nanother person's +90\.6\n", printed)
    assert drawn == [2, 1]
    guessed, asked = re.search(r"(\d+) of (\d+) squats of other persons are guessed bend", printed).groups()  # type: ignore[union-attr]
    assert int(guessed) >= 0.9 * int(asked) > 0
    assert "bend" in MotionLibrary.load("taught.npz").classes
