"""Every call that writes fails, one after the other, as on a full disk: what is lost is said, and nothing else is."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from programs import started

FAULTS = Path(__file__).with_name("faults")
COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux" or not COMPILER, reason="the faults are compiled for Linux")
def test_whichever_write_fails_what_is_lost_is_said(tmp_path: Path) -> None:
    """Opening, writing, renaming and `fsync`, once and from then on, in all that keeps something for a person."""
    shim = tmp_path / "shim.so"
    subprocess.run([COMPILER, "-shared", "-fPIC", "-o", shim, FAULTS / "shim.c", "-ldl"], check=True)
    surroundings = {**os.environ, "LD_PRELOAD": str(shim)}
    done = subprocess.run([sys.executable, FAULTS / "work.py"], env=surroundings, capture_output=True, check=True)
    found = json.loads(done.stdout)
    assert {*found} == {"teaching", "building", "labelling", "recording", "keys", "cache", "midi"}
    assert {name: each["wrong"] for name, each in found.items()} == {name: [] for name in found}
    # The faults reach the calls.
    assert all(each["calls"] >= 3 for each in found.values())


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_who_plays_into_a_file_that_lacks_notes_hears_it(tmp_path: Path) -> None:
    """`live` says it, and ends with 2, as where examples are not saved."""
    (tmp_path / "take.mid").symlink_to("/dev/full")
    song = ("--out", f"midi={tmp_path / 'take.mid'}", "--overwrite")
    with started("live", "--plain", "--osc-in", "127.0.0.1:0", *song) as program:
        program.expect("listening on")
        assert program.interrupt() == 2
        assert program.output.endswith("take.mid: not all notes are written: No space left on device\n")


#: What makes programs start processes or threads, and import what they need, and a line after which one is ended.
ARGUMENTS = {
    "live": "--plain --osc-in 127.0.0.1:0 --osc-out 127.0.0.1:1 --page 0 --ws 0 --workers 1 --teach mine.npz",
    "record": "a.kinerec --osc-in 127.0.0.1:0",
    "demo": "squat1Reps",
    "latency": "--transport osc --seconds 0.5",
}
SAID = {"live": "listening on(.|\n)*WebSocket", "record": "recording"}


@pytest.mark.slow
@pytest.mark.parametrize("program", ARGUMENTS)
def test_nothing_of_the_current_folder_runs(program: str, tmp_path: Path) -> None:
    """Modules of the names of Python's own and of packages that we use lie there; none is imported."""
    ran = tmp_path / "ran"
    for name in {*sys.stdlib_module_names, "numpy", "zmq", "scipy", "websockets", "kinespace", "sitecustomize"}:
        # The tests' own network guard is a sitecustomize, too.
        text = f"open({str(ran)!r}, 'a').write({name!r} + ' ')\nraise SystemExit('ran')\n"
        (tmp_path / f"{name}.py").write_text(text, encoding="utf-8")
    command = [Path(sys.executable).with_name("kinespace")]
    with started(program, *ARGUMENTS[program].split(), at=tmp_path, begins=command) as running:
        if program in SAID:
            running.expect(SAID[program])
            running.interrupt()
        # On a machine without an extra a program says so.
        assert running.wait() in (0, 1, 2)
    assert not ran.exists(), ran.read_text(encoding="utf-8")
