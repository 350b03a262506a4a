"""Bad input: a program that cannot go on ends with 2 and one line that names the mistake, and writes nothing."""

import json
import os
import resource
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from programs import LOOPBACK, REMARK, free_udp_port, python, ran, started
from synthetic import stick_clips
from written import write_clip, write_clips

from kinespace.library import MotionLibrary
from kinespace.stream import Frame, osc, zeromq
from kinespace.stream.inputs import kinerec as rawfile
from kinespace.stream.zeromq import Endpoint

pytestmark = pytest.mark.slow

# --- what is refused --------------------------------------------------------------------------------------------------

#: By the arguments that a program cannot follow, a part of the line that says so; names in braces are `places`.
REFUSED = tomllib.loads(Path(__file__).with_name("refused.toml").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def places(tmp_path_factory: pytest.TempPathFactory, small_library: MotionLibrary) -> Iterator[dict[str, object]]:
    """Give good and bad files by name, ports that are taken, and one that is free."""
    folder = tmp_path_factory.mktemp("places")
    names = {"fbx": "take.fbx", "song": "song.mid", "made": "made.npz", "pipe": "pipe", "device": "device"}
    names |= {name: f"{name}.npz" for name in ("cut", "changed", "sticks")}
    names |= {name: f"{name}.kinerec" for name in ("tape", "torn", "none")}
    files = {name: folder / file for name, file in names.items()}
    for name in ("good", "alone", "spoilt", "empty"):
        (folder / name).mkdir()
    folder.with_suffix(".npz").mkdir()
    clip, alone = (write_clip(folder / name, "bd", "bendLeft", 1) for name in ("good", "alone"))
    (folder / "alone" / "HDM_bd.asf").unlink()
    # A bone that there is not, in one recording among good ones.
    spoilt = write_clips(folder / "spoilt", takes=1)[2]
    spoilt.write_text(spoilt.read_text().replace("rlower", "tail", 1))
    files["fbx"].write_text("Kaydara")
    files["song"].write_bytes(b"MThd")
    MotionLibrary.of_clips(stick_clips(takes=1)).save(files["sticks"])
    small_library.save(files["cut"])
    whole = bytearray(files["cut"].read_bytes())
    files["cut"].write_bytes(whole[: len(whole) // 2])
    whole[len(whole) // 2] ^= 255
    files["changed"].write_bytes(whole)
    with closing(rawfile.RawWriter(files["tape"], ["osc here"])) as tape:
        rawfile.RawWriter(files["none"], ["osc here"]).close()
        for number in range(6):
            frame = osc.encode_frame(Frame(("ann", "bob")[number % 2], 1.0 + number, np.ones((6, 3))))
            tape.write(rawfile.RawPacket(5.0 + number / 4, 0, "", (frame,)))
    files["torn"].write_bytes(files["tape"].read_bytes()[:-1])
    for ending in ("bvh", "c3d", "trc", "csv", "npz", "kinerec", "asf", "toml"):
        os.mkfifo(f"{files['pipe']}.{ending}")
        Path(f"{files['device']}.{ending}").symlink_to("/dev/zero")
    bound = Endpoint(f"tcp://{LOOPBACK}:*", bind=True)
    with closing(zeromq.ZmqReceiver(bound)) as zmq, closing(osc.OscReceiver(LOOPBACK, 0)) as udp:
        ports = {"osc": f"{LOOPBACK}:{udp.address[1]}", "zmq": zmq.address, "free": free_udp_port()}
        folders = {"folder": folder, "empty": folder / "empty", "spoilt": folder / "spoilt"}
        yield {**files, **ports, **folders, "clip": clip, "alone": alone}
        assert zmq.receive() is udp.receive() is None


def one_line(*arguments: object) -> str:
    """Run `kinespace`, which must end with 2 and one line on standard error; give the line.

    Before the line, remarks on bodies that could be read may stand.
    """
    status, out, err = ran(*arguments)
    assert status == 2
    assert not out or arguments[0] == "replay" or "--teach" in arguments
    *remarks, line = (each for each in err.splitlines() if "no program listens" not in each)
    assert all(map(REMARK.search, remarks)), err
    assert line.startswith("kinespace")
    return line


@pytest.mark.skipif(os.name != "posix", reason="pipes and devices in folders")
@pytest.mark.parametrize("command", REFUSED)
def test_a_refusal_is_one_line(command: str, places: dict[str, object], monkeypatch: pytest.MonkeyPatch) -> None:
    """The line names the file, the option or the value, what was expected and what came; no file is made or changed."""
    folder = Path(f"{places['folder']}")
    monkeypatch.chdir(folder / "empty")
    before = _there(folder)
    assert REFUSED[command].format_map(places) in one_line(*command.format_map(places).split())
    assert _there(folder) == before


def _there(folder: Path) -> dict[Path, tuple[int, int]]:
    """List a folder's files with lengths and times; a program that teaches leaves an empty file, its lock."""
    files = {path: path.lstat() for path in folder.rglob("*") if path.suffix != ".lock"}
    return {path: (each.st_size, each.st_mtime_ns) for path, each in files.items() if not path.is_dir()}


# --- hostile files ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("arrival", [1e300, np.inf, np.nan])
def test_an_impossible_arrival_ends_a_recording(arrival: float, tmp_path: Path) -> None:
    """A record with an impossible time counts as damage: the replay does not wait for it."""
    path = tmp_path / "far.kinerec"
    with closing(rawfile.RawWriter(path, ["osc 127.0.0.1:9310"])) as writer:
        for time in (1.0, arrival, 2.0):
            writer.write(rawfile.RawPacket(time, 0, "", (b"/x\0\0,\0\0\0",)))
    with closing(osc.OscReceiver(LOOPBACK, 0)) as somebody:
        status, out, _ = ran("replay", path, "--osc", f"{LOOPBACK}:{somebody.address[1]}")
    assert (status, "cut off or damaged" in out) == (0, True)
    recording = rawfile.RawFile(path)
    assert [packet.arrival for packet in recording.packets()] == [1.0]
    assert recording.damage()


def test_control_characters_are_shown_as_marks(tmp_path: Path) -> None:
    """Class names, licences and a raw recording's header reach the terminal without control characters."""
    library, recording = tmp_path / "red.npz", tmp_path / "red.kinerec"
    stained = [
        replace(clip, class_name=f"\x1b[31m{clip.class_name}", licence="\x1b]0;mine\x07", source="\x9b2J")
        for clip in stick_clips()
    ]
    MotionLibrary.of_clips(stained).save(library)
    with closing(rawfile.RawWriter(recording, ["osc \x1b[2J"], {"\x1b[2J": ""})) as writer:
        writer.write(rawfile.RawPacket(1.0, 0, "\x1b[2J", (b"x",)))
    for file in (library, recording):
        status, out, _ = ran("info", file)
        assert status == 0
        assert "\N{REPLACEMENT CHARACTER}" in out
        assert all(character.isprintable() or character == "\n" for character in out)
    # A shell gives the names of a stranger's files as arguments.
    for refused in (["build", library, "--without", "\x1b[31mnobody", "-o", "made.npz"], ["info", "a", "\x9b2J"]):
        assert one_line(*refused).isprintable()


def _hierarchy(joints: str, closing: str, frames: int) -> str:
    top = "HIERARCHY\nROOT r\n{\nOFFSET 0 1 0\nCHANNELS 3 Xrotation Yrotation Zrotation\n"
    return f"{top}{joints}{closing}}}\nMOTION\nFrames: {frames}\nFrame Time: 0.01\n" + "0 0 0\n" * frames


#: Some megabytes of text that once took gigabytes or minutes, and the line that refuses them.
BOMBS: dict[str, tuple[str, Callable[[], str], str]] = {
    "joints one in another": (
        "deep.bvh",
        lambda: _hierarchy("".join(f"JOINT j{n}\n{{\nOFFSET 0 1 0\n" for n in range(20_000)), "}\n" * 20_000, 2),
        "expected at most 1000 joints",
    ),
    "joints without numbers of their own": (
        "broad.bvh",
        lambda: _hierarchy("".join(f"JOINT j{n}\n{{\nOFFSET {n} 1 0\n}}\n" for n in range(400)), "", 30_000),
        "expected at most 1000 MB once it is read, got 17",
    ),
    "many columns": (
        "broad.csv",
        lambda: ",".join(f"j{n}_{axis}" for n in range(2000) for axis in "xyz") + ("\n" + "0," * 5999 + "0") * 3,
        "expected at most 1000 joints",
    ),
    "a row of many lines": (
        "row.csv",
        lambda: 'time,a_x,a_y,a_z,b_x,b_y,b_z\n1,"' + '","\n'.join("0" * 9) + "\n" + '0,"\n' * 400_000,
        "a quotation mark that does not end",
    ),
    "a long line": ("line.trc", lambda: "PathFileType\t4\t(X/Y/Z)\n" + "DataRate\t" * 200_000, "a shorter line"),
    "a long name": (
        "name.bvh",
        lambda: _hierarchy(f"JOINT {'a.' * 50_000}\n{{\nOFFSET 0 1 0\n}}\n", "", 2),
        "expected names of at most 400 characters, got 100000",
    ),
    "a long skeleton": ("take.amc", lambda: "1\n", "expected a shorter text"),
    "two times a year apart": (
        "year.csv",
        lambda: "time,a_x,a_y,a_z,b_x,b_y,b_z\n" + "".join(f"{t},1,1,{t},2,2,2\n" for t in (0, 0.01, 0.02, 50_000)),
        "expected at most 1000 MB once it is read",
    ),
}


@pytest.mark.parametrize("kind", BOMBS)
def test_some_megabytes_take_little_memory(kind: str, tmp_path: Path) -> None:
    """Counts and depths are bounded, and no number in a file says how much memory is taken."""
    name, text, line = BOMBS[kind]
    path = tmp_path / name
    path.write_text(text())
    path.with_suffix(".asf").write_text(":bonedata\n" + "a b\n" * 400_000)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert line in one_line("info", path)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 150_000


# --- every call that writes fails, one after the other, as on a full disk ---------------------------------------------


FAULTS = Path(__file__).with_name("faults")
COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux" or not COMPILER, reason="the faults are compiled for Linux")
def test_whichever_write_fails_what_is_lost_is_said(tmp_path: Path) -> None:
    """Opening, writing, renaming and `fsync`, once and from then on, in all that keeps something for a person."""
    shim = tmp_path / "shim.so"
    subprocess.run([COMPILER, "-shared", "-fPIC", "-o", shim, FAULTS / "shim.c", "-ldl"], check=True)
    found = json.loads(python(FAULTS / "work.py", env={**os.environ, "LD_PRELOAD": str(shim)}).stdout)
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
