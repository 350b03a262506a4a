"""Bad input: programs end with one line that names file and mistake."""

import errno
import os
import re
import resource
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from programs import LOOPBACK, REMARK
from recorded import write_take, write_takes
from synthetic import stick_clips

from kinespace.library import MotionLibrary
from kinespace.stream import osc, zeromq
from kinespace.stream.inputs import kinerec as rawfile
from kinespace.stream.zeromq import Endpoint
from kinespace.tools.cli.main import main

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("no_waiting")]

# --- Commands ---------------------------------------------------------------------------------------------------------


def one_line(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """Run `kinespace`, which must end with 2 and one line; give the line.

    Before the line, remarks on bodies that could be read may stand. It prints nothing, save replay what was sent before
    it came to a recording that it cannot read.
    """
    assert main([str(argument) for argument in arguments]) == 2
    out, err = capsys.readouterr()
    sent = r"(sending \d+ recordings?\n)?(\d+ frames sent, 0 refused by the system\n"
    sent += r"(the feed stood still for .*\n)?(no program listens at .*\n)?)?"
    assert re.fullmatch(sent if arguments[0] == "replay" else "", out)
    assert err.endswith("\n")
    said = (each for each in err.splitlines() if "no program listens" not in each)
    (line,) = [each for each in said if not REMARK.search(each)]
    assert line.startswith("kinespace: ")
    return line.removeprefix("kinespace: ")


def commands_with(path: Path, made: Path) -> dict[str, tuple[object, ...]]:
    """Give every program that reads recordings, reading these."""
    return {
        "build": ("build", path, "-o", made),
        "replay": ("replay", path, "--osc", f"{LOOPBACK}:9", "--speed", 50),
        "evaluate": ("evaluate", "retrieval", path, "--json"),
    }


def _spoilt(folder: Path) -> Path:
    """Name a bone that there is not, in one recording among good ones."""
    path = write_takes(folder, takes=1)[2]
    path.write_text(path.read_text().replace("rlower", "tail", 1))
    return folder


def _without_skeleton(folder: Path) -> Path:
    path = write_take(folder, "bd", "bendLeft", 1)
    (folder / "HDM_bd.asf").unlink()
    return path


def _of_another_kind(folder: Path) -> Path:
    (folder / "take.fbx").write_text("Kaydara")
    return folder / "take.fbx"


#: What may be wrong with recordings, and the line that says so; {} is the test's folder.
FAULTS: dict[str, tuple[Callable[[Path], Path], str]] = {
    "missing": (lambda folder: folder / "nowhere.amc", "{}/nowhere.amc: no such file or folder"),
    "none in the folder": (lambda folder: folder, "{}: no recording.*"),
    "another kind": (_of_another_kind, r"{}/take.fbx: expected a recording \(.amc.*"),
    "unknown bone": (_spoilt, "{}/.*amc:8: .*'tail'.*"),
    "no skeleton": (_without_skeleton, "{}/.*amc: no skeleton HDM_bd.asf.*"),
}


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("program", ["build", "replay", "evaluate"])
def test_a_recording_that_cannot_be_read_is_named(
    program: str, fault: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Every program that reads recordings ends with one line that names file and mistake; no library is written."""
    spoil, expected = FAULTS[fault]
    made = tmp_path / "made.npz"
    error = one_line(capsys, *commands_with(spoil(tmp_path), made)[program])
    assert re.fullmatch(expected.format(re.escape(str(tmp_path))), error)
    assert not made.exists()


LIBRARY_READERS: dict[str, Callable[[Path], tuple[object, ...]]] = {
    "info": lambda path: ("info", path),
    "live": lambda path: ("live", "--osc-in", f"{LOOPBACK}:0", "--library", path),
    "build": lambda path: ("build", path, "-o", path.with_name("made.npz")),
}


@pytest.mark.parametrize("program", LIBRARY_READERS)
@pytest.mark.parametrize("fault", ["cut short", "changed", "missing", "a folder"])
def test_a_library_that_cannot_be_read_is_named(
    program: str, fault: str, small_library: MotionLibrary, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A broken library file is named by every program that reads one, one that is not there with the reason."""
    path, reason = tmp_path / "mine.npz", ""
    match fault:
        case "missing":
            reason = os.strerror(errno.ENOENT)
        case "a folder":
            path.mkdir()
            reason = os.strerror(errno.EISDIR)
        case _:
            small_library.save(path)
            whole = bytearray(path.read_bytes())
            whole[len(whole) // 2] ^= 255
            path.write_bytes(whole if fault == "changed" else whole[: len(whole) // 2])
    before = [*tmp_path.iterdir()]
    error = one_line(capsys, *LIBRARY_READERS[program](path))
    assert error == f"{path}: {reason}" if reason else error.startswith(f"{path}: ")
    assert [*tmp_path.iterdir()] == before


@pytest.mark.parametrize(
    ("arguments", "mark"),
    [
        ("live --osc-in", ""),
        ("replay {clip} --osc 127.0.0.1:9 --listen", ""),
        ("live --zmq-in", "tcp://"),
        ("live --osc-in 127.0.0.1:0 --zmq-out", "tcp://"),
        ("replay {clip} --zmq", "@tcp://"),
        ("replay {clip} --osc 127.0.0.1:9 --listen", "@tcp://"),
    ],
)
def test_a_busy_port_is_named(arguments: str, mark: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A port that another program listens on is named by either transport, and that program keeps it."""
    clip = write_take(tmp_path, "bd", "bendLeft", 1)
    bound = Endpoint(f"tcp://{LOOPBACK}:*", bind=True)
    with closing(zeromq.ZmqReceiver(bound) if mark else osc.OscReceiver(LOOPBACK, 0)) as receiver:
        address = receiver.address if isinstance(receiver.address, str) else f"{LOOPBACK}:{receiver.address[1]}"
        given = mark.removesuffix("tcp://") + address
        error = one_line(capsys, *arguments.format(clip=clip).split(), given)
        assert error.startswith(
            f"{arguments.rsplit(maxsplit=1)[-1]} {address}: another program has this port, perhaps another kinespace"
        )
        assert receiver.receive() is None


# --- Hostile files ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("arrival", [1e300, np.inf, np.nan])
def test_an_impossible_arrival_ends_a_recording(
    arrival: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A record with an impossible time counts as damage: the replay does not wait for it."""
    path = tmp_path / "far.kinerec"
    with closing(rawfile.RawWriter(path, ["osc 127.0.0.1:9310"])) as writer:
        for time in (1.0, arrival, 2.0):
            writer.write(rawfile.RawPacket(time, 0, "", (b"/x\0\0,\0\0\0",)))
    with closing(osc.OscReceiver(LOOPBACK, 0)) as somebody:
        assert main(["replay", str(path), "--osc", f"{LOOPBACK}:{somebody.address[1]}"]) == 0
    assert "cut off or damaged" in capsys.readouterr().out
    recording = rawfile.RawFile(path)
    assert [packet.arrival for packet in recording.packets()] == [1.0]
    assert recording.damage()


def test_control_characters_are_shown_as_marks(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Class names, licences and a raw recording's header reach the terminal without control characters."""
    library, recording = tmp_path / "red.npz", tmp_path / "red.kinerec"
    stained = [
        replace(clip, class_name=f"\x1b[31m{clip.class_name}", licence="\x1b]0;mine\x07", source="\x9b2J")
        for clip in stick_clips()
    ]
    MotionLibrary.of_clips(stained).save(library)
    with closing(rawfile.RawWriter(recording, ["osc \x1b[2J"], {"\x1b[2J": ""})) as writer:
        writer.write(rawfile.RawPacket(1.0, 0, "\x1b[2J", (b"x",)))
    for arguments in (["info", str(library)], ["info", str(recording)]):
        assert main(arguments) == 0
        out = capsys.readouterr().out
        assert "\N{REPLACEMENT CHARACTER}" in out
        assert all(character.isprintable() or character == "\n" for character in out)
    error = one_line(capsys, "build", library, "--without", "\x1b[31mnobody", "-o", tmp_path / "made.npz")
    assert error.isprintable()


def test_a_file_that_would_take_too_much_memory_is_refused_before(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The memory that a file needs is compared with --max-memory before it is taken."""
    take, library = write_take(tmp_path, "bd", "bendLeft", 1), tmp_path / "mine.npz"
    MotionLibrary.of_clips(stick_clips()).save(library)
    for path in (take, library):
        error = one_line(capsys, "--max-memory", "10kB", "info", path)
        assert error.startswith(f"{path}: ")
        assert "expected at most 0 MB once it is read" in error
        assert "--max-memory" in error


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
    "a long line": (
        "line.trc",
        lambda: "PathFileType\t4\t(X/Y/Z)\n" + "DataRate\t" * 200_000,
        "expected a shorter line",
    ),
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
def test_some_megabytes_take_little_memory(kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Counts and depths are bounded, and no number in a file says how much memory is taken."""
    name, text, line = BOMBS[kind]
    path = tmp_path / name
    path.write_text(text())
    path.with_suffix(".asf").write_text(":bonedata\n" + "a b\n" * 400_000)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert line in one_line(capsys, "info", path)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 150_000


#: Every program that reads a file which a person names, by the file's ending; {} is the file.
READERS = (
    *(f"info {{}}.{ending}" for ending in ("bvh", "c3d", "trc", "csv", "npz", "kinerec")),
    "info {take} --asf {}.asf",
    "info {take} --names {}.toml",
    "build {take} --labels {}.csv -o made.npz",
    "feeds {}.toml",
    "replay {}.kinerec --osc 127.0.0.1:9",
    "live --osc-in 127.0.0.1:0 --library {}.npz",
    "live --osc-in 127.0.0.1:0 --teach {}.npz",
    "evaluate stream --takes {}.csv",
)


@pytest.mark.skipif(os.name != "posix", reason="pipes and devices in folders")
@pytest.mark.parametrize("kind", ["pipe", "device"])
@pytest.mark.parametrize("command", READERS)
def test_a_pipe_or_a_device_is_no_file(
    command: str, kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What never ends, or never begins, is refused before it is read."""
    take, place = write_take(tmp_path, "bd", "bendLeft", 1), tmp_path / "endless"
    arguments = command.format(place, take=take).split()
    path = next(each for each in arguments if each.startswith(str(place)))
    if kind == "pipe":
        os.mkfifo(path)
    else:
        Path(path).symlink_to("/dev/zero")
    assert one_line(capsys, *arguments) == f"{path}: expected a file, got a pipe or a device"
