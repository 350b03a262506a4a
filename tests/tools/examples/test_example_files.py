"""The examples in other languages: each that can run here sends its squat to a recogniser and gets its class."""

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from programs import LOOPBACK, PATIENCE, ROOT, builtin_library, free_udp_port, started

from kinespace.stream import EventKind, Frame, Recognizer
from kinespace.stream.zeromq.keys import make_keys
from kinespace.tools.cli.main import main

pytestmark = pytest.mark.slow

EXAMPLES = ROOT / "tools" / "examples"
#: The class that the examples' motion is of.
SQUAT = "squat1Reps"


def _node_modules() -> Path | None:
    """Find where npm put node-osc: beside the examples, above them, or in NODE_PATH; None where it is not."""
    places = [folder / "node_modules" for folder in (EXAMPLES, *EXAMPLES.parents)]
    places += [Path(each) for each in os.environ.get("NODE_PATH", "").split(os.pathsep) if each]
    return next((each for each in places if (each / "node-osc").is_dir()), None)


def _require(program: str) -> str:
    found = shutil.which(program)
    if not found:
        pytest.skip(f"{program} is not installed")
    return found


def _printed_by(run: Sequence[str], layout: str, environment: dict[str, str] | None = None) -> str:
    """Run an example against a recogniser; give its output."""
    listens, answers = free_udp_port(), free_udp_port()
    options = ("--osc-in", f"{LOOPBACK}:{listens}", "--out", f"{layout}={LOOPBACK}:{answers}", "--signature", "paper")
    with started("live", *options, "--plain") as program:
        program.expect("listening on")
        command = [each.format(listens=listens, answers=answers) for each in run]
        ran = subprocess.run(
            command,
            cwd=EXAMPLES,
            env={**os.environ, **(environment or {})},
            capture_output=True,
            timeout=PATIENCE,
            check=False,
        )
        assert program.interrupt() == 0
        assert "malformed" not in program.output
    printed = (ran.stdout + ran.stderr).decode(errors="replace")
    assert ran.returncode == 0, printed
    return printed


def test_the_squat_is_named_by_default() -> None:
    """The built-in library's default signature names it in most answers, and says once that it starts."""
    recognizer = Recognizer(builtin_library())
    frames = np.tile(np.loadtxt(EXAMPLES / "squat.txt").reshape(-1, 31, 3), (2, 1, 1))
    pushed = [recognizer.push(Frame("drawn", 1 + number / 30, frame)) for number, frame in enumerate(frames)]
    answers = [each for each in pushed if each is not None]
    assert np.mean([each.label == SQUAT for each in answers]) > 0.8
    assert [(event.kind, event.label) for each in answers for event in each.events] == [(EventKind.START, SQUAT)]


def test_pure_data_printed_by() -> None:
    """The patch runs without a window, sends its frames and prints the class that is answered, and when it starts."""
    pd = _require("pd")
    sends = [part for each in ("listens {listens}", "answers {answers}", "times 2") for part in ("-send", each)]
    # It leaves half a second after the last frame.
    script = EXAMPLES / "puredata.pd"
    printed = _printed_by([sys.executable, "-c", _PD, pd, *sends, str(script)], "puredata")
    assert f"label: {SQUAT}" in printed
    assert f"event: start {SQUAT}" in printed
    assert "error" not in printed


#: Runs Pure Data until the patch prints that it has sent all: Pure Data has no option to leave then.
_PD = """
import subprocess, sys
command = [sys.argv[1], "-nogui", "-noaudio", "-stderr", *sys.argv[2:]]
with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as pd:
    for line in pd.stderr:
        print(line, end="")
        if line.startswith("done"):
            pd.kill()
"""


def test_node_printed_by(tmp_path: Path) -> None:
    """The script sends its frames, prints the class that is answered, and meets no type that node-osc does not know."""
    node, modules = _require("node"), _node_modules()
    if modules is None:
        pytest.skip("node-osc is not installed: npm install node-osc")
    # A module looks for others from where it lies.
    (tmp_path / "node_modules").symlink_to(modules)
    for name in ("node.mjs", "squat.txt"):
        shutil.copy(EXAMPLES / name, tmp_path)
    printed = _printed_by([node, str(tmp_path / "node.mjs"), "{listens}", "{answers}", "2"], "native")
    assert f"node: {SQUAT}\n" in printed
    assert f"node: {SQUAT} starts at" in printed


def test_supercollider_printed_by() -> None:
    """The language sends its frames from the file beside it and posts the class that is answered."""
    sclang = _require("sclang")
    # Without a screen; as root Qt's browser refuses to start.
    surroundings = {"QT_QPA_PLATFORM": "offscreen", "QTWEBENGINE_DISABLE_SANDBOX": "1"}
    printed = _printed_by(
        [sclang, "-u", "{answers}", str(EXAMPLES / "supercollider.scd"), "{listens}", "2"],
        "supercollider",
        surroundings,
    )
    assert f"sc: {SQUAT}" in printed


def test_python_printed_by() -> None:
    """The sender and the listener, in two processes, as in two terminals."""
    run = [sys.executable, "-c", _PYTHON, "{listens}", "{answers}"]
    printed = _printed_by(run, "native")
    assert f"python: {SQUAT}" in printed
    assert f"python: {SQUAT} starts" in printed


#: Starts the listener, waits until it has its port, runs the sender, and ends the listener once it has told a start and
#: a class.
_PYTHON = """
import socket, subprocess, sys, time
listens, answers = sys.argv[1:]
listening = [sys.executable, "-u", "python_listen.py", answers]
with subprocess.Popen(listening, stdout=subprocess.PIPE, text=True) as listener:
    while True:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(("127.0.0.1", int(answers)))
            except OSError:
                break
        time.sleep(0.05)
    subprocess.run([sys.executable, "python_send.py", listens, "2"], check=True)
    told = ""
    while " starts" not in told or "python: squat1Reps\\n" not in told:
        line = listener.stdout.readline()
        assert line, told
        told += line
    print(told)
    listener.terminate()
"""


def test_python_gets_answers_with_keys(tmp_path: Path) -> None:
    """The keyed client is let in and gets the class of its own motion; no other client gets the answers."""
    stage, client = tmp_path / "stage", tmp_path / "client"
    for folder in (stage, client):
        make_keys(folder, folder.name)
    shutil.copy(client / "client.key", stage)
    shutil.copy(stage / "stage.key", client)
    endpoint = f"tcp://{LOOPBACK}:*"
    options = ("--zmq-in", endpoint, "--zmq-out", endpoint, "--keys", stage, "--signature", "paper", "--plain")
    with started("live", *options) as program:
        addresses = program.expect(r"listening on ZeroMQ (\S+); answering to ZeroMQ (\S+);").groups()
        script = [sys.executable, "-W", "error", EXAMPLES / "python_zeromq_keys.py", *addresses]
        done = subprocess.run(
            [*script, client / "client.key_secret", client / "stage.key", "2"],
            capture_output=True,
            timeout=PATIENCE,
            check=False,
        )
        assert (done.returncode, done.stderr) == (0, b"")
        assert program.interrupt() == 0
        assert "malformed" not in program.output
    assert f"python: {SQUAT} starts" in done.stdout.decode()


def test_the_examples_come_with_the_program(capsys: pytest.CaptureFixture[str]) -> None:
    """`kinespace examples` lists every file, prints one as it is, and says which names there are."""
    assert main(["examples"]) == 0
    listed = capsys.readouterr().out.splitlines()
    assert {"node.mjs", "processing.pde", "touchdesigner.py"} <= set(listed)
    assert main(["examples", "node.mjs"]) == 0
    assert capsys.readouterr().out == (EXAMPLES / "node.mjs").read_text(encoding="utf-8")
    assert main(["examples", "node"]) == 2
    error = capsys.readouterr().err
    assert "that `kinespace examples` lists, got 'node', perhaps node.mjs is meant" in error
