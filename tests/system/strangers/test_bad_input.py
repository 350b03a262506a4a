"""Bad input: programs end with one line that names file and mistake."""

from __future__ import annotations

import errno
import os
import re
from contextlib import closing
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from programs import LOOPBACK, finished
from recorded import write_take, write_takes
from synthetic import stick_clips

from kinespace.library import MotionLibrary
from kinespace.stream import osc, zeromq
from kinespace.stream.inputs.recording import kinerec as rawfile
from kinespace.stream.zeromq import Endpoint
from kinespace.tools.cli.main import main

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("no_waiting")]

# --- Commands ---------------------------------------------------------------------------------------------------------


def one_line(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """Run `kinespace`, which must end with 2 and one line; give the line.

    It prints nothing, save replay what was sent before it came to a recording that it cannot read.
    """
    assert main([str(argument) for argument in arguments]) == 2
    out, err = capsys.readouterr()
    sent = r"(sending \d+ recordings?\n)?(\d+ frames sent, 0 refused by the system\n"
    sent += r"(the feed stood still for .*\n)?(no program listens at .*\n)?)?"
    assert re.fullmatch(sent if arguments[0] == "replay" else "", out)
    assert err.startswith("kinespace: ")
    assert err.endswith("\n")
    assert err.count("\n") == 1
    return err.removeprefix("kinespace: ").removesuffix("\n")


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


def test_a_feed_without_answers_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A recording is sent whole to a listener that does not answer, and the program says so."""
    path = write_take(tmp_path, "bd", "bendLeft", 1, frames=20)
    with closing(osc.OscReceiver(LOOPBACK, 0)) as mute:
        to = f"{LOOPBACK}:{mute.address[1]}"
        assert main(["replay", str(path), "--osc", to, "--listen", f"{LOOPBACK}:0"]) == 1
    assert "no answers heard" in capsys.readouterr().out


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


def test_a_library_cannot_be_written_where_there_is_no_folder(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A library to be written into a missing folder, or over a folder, ends with one line that names the place."""
    path = write_take(tmp_path, "bd", "bendLeft", 1)
    missing, folder = tmp_path / "missing" / "made.npz", tmp_path / "bendLeft"
    assert one_line(capsys, "build", path, "-o", missing) == f"{missing.parent}: {os.strerror(errno.ENOENT)}"
    assert one_line(capsys, "build", path, "-o", folder) == f"{folder}: {os.strerror(errno.EISDIR)}"


def test_a_real_command_shows_no_traceback() -> None:
    """As a process of its own, a command that cannot do its work ends with 2 and one line, not a traceback."""
    status, output, errors = finished("replay", "nowhere")
    assert (status, output) == (2, "")
    assert errors.startswith("kinespace: ")
    assert errors.count("\n") == 1


# --- Hostile files ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("text", ["a = " + "[" * 20_000, "a." * 50_000 + "a = 1"], ids=["deep", "long"])
def test_a_preset_that_is_too_deep_or_too_long_is_named(
    text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """TOML that nests without end, or takes minutes to parse, is one line."""
    path = tmp_path / "deep.toml"
    path.write_text(text)
    assert one_line(capsys, "live", "--feed", path).startswith(f"{path}: expected ")


@pytest.mark.parametrize("arrival", [1e300, np.inf, np.nan])
def test_an_impossible_arrival_ends_a_recording(
    arrival: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A record with an impossible time counts as damage: the replay does not wait for it."""
    path = tmp_path / "far.kinerec"
    with rawfile.RawWriter(path, ["osc 127.0.0.1:9310"]) as writer:
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
    with rawfile.RawWriter(recording, ["osc \x1b[2J"], {"\x1b[2J": ""}) as writer:
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
