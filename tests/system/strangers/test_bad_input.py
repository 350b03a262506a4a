"""Bad input: programs end with one line that names file and mistake; a running recogniser counts it and goes on."""

from __future__ import annotations

import errno
import os
import re
import time
from contextlib import closing
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
import wrong
from programs import COUNTED, LOOPBACK, finished, ghost_cues, live, small_library
from recorded import write_take, write_takes
from synthetic import stick_clips

from kinespace.library import MotionLibrary
from kinespace.library.windows.index import opened
from kinespace.stream import Recognizer, osc, zeromq
from kinespace.stream.inputs.recording import kinerec as rawfile
from kinespace.stream.zeromq import Endpoint
from kinespace.tools.cli.main import main

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from kinespace.tools.loopback.service_process import Transport

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


def _first(text: str, old: str, new: str) -> str:
    assert old in text
    return text.replace(old, new, 1)


def _in_a_recording(change: Callable[[str], str]) -> Callable[[Path], Path]:
    """Change the text of one recording among good ones."""

    def made(folder: Path) -> Path:
        path = write_takes(folder, takes=1)[2]
        path.write_text(change(path.read_text()), encoding="latin-1")
        return folder

    return made


def _with_skeleton(text: str | None) -> Callable[[Path], Path]:
    """Write a recording with another text for its skeleton, or without one."""

    def made(folder: Path) -> Path:
        path, asf = write_take(folder, "bd", "bendLeft", 1), folder / "HDM_bd.asf"
        asf.unlink()
        if text is not None:
            asf.write_text(text)
        return path

    return made


def _turned_on_itself(folder: Path) -> Path:
    path = write_take(folder, "bd", "bendLeft", 1)
    path.unlink()
    path.symlink_to(path)
    return folder


def _file(name: str, content: str) -> Callable[[Path], Path]:
    def made(folder: Path) -> Path:
        (folder / name).write_text(content)
        return folder if name.endswith(".txt") else folder / name

    return made


def _one_frame(folder: Path) -> Path:
    write_takes(folder, takes=1)
    write_take(folder, "bk", "bendLeft", 1, frames=1)
    return folder


#: What may be wrong with recordings, and the line that says so; {} is the test's folder.
FAULTS: dict[str, tuple[Callable[[Path], Path], str]] = {
    "missing": (lambda folder: folder / "nowhere.amc", "{}/nowhere.amc: no such file or folder"),
    "unreadable": (_turned_on_itself, f"{{}}/.*amc: {os.strerror(errno.ELOOP)}"),
    "none in the folder": (_file("notes.txt", "none yet"), "{}: no recording.*"),
    "another kind": (_file("take.fbx", "Kaydara"), r"{}/take.fbx: expected a recording \(.amc.*"),
    "unknown bone": (_in_a_recording(lambda text: _first(text, "rlower", "tail")), "{}/.*amc:8: .*'tail'.*"),
    "cut off": (_in_a_recording(lambda text: text[:-20]), r"{}/.*amc:\d+: (expected|the file ends).*"),
    "empty": (_in_a_recording(lambda _: ""), "{}/.*amc:0: no frames in it"),
    "random bytes": (_in_a_recording(lambda _: "\0\xff\1\x80" * 10), "{}/.*amc:1: expected a frame number or a bone.*"),
    "no skeleton": (_with_skeleton(None), "{}/.*amc: no skeleton HDM_bd.asf.*"),
    "no ASF": (_with_skeleton("rubbish"), "{}/HDM_bd.asf: not a usable ASF.*"),
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


def test_a_clip_of_one_frame_makes_no_library(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A recording of a single frame is named by build, and no library is written."""
    error = one_line(capsys, "build", _one_frame(tmp_path), "-o", tmp_path / "made.npz")
    assert error == "clip 'HDM_bk_bendLeft_001_120': expected at least 3 frames, got 1"
    assert not (tmp_path / "made.npz").exists()


def test_a_clip_shorter_than_a_window_is_played_and_not_answered(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A recording shorter than a window is sent whole, and the program says that no answer came."""
    path = write_take(tmp_path, "bd", "bendLeft", 1, frames=20)
    with live("--plain") as stage:
        to = f"{LOOPBACK}:{stage.port}"
        assert main(["replay", str(path), "--osc", to, "--listen", f"{LOOPBACK}:0"]) == 1
        stage.program.expect("listening")
        counts = stage.stopped()
    assert "no answers heard" in capsys.readouterr().out
    assert (counts["received"], counts["answers"]) == (21, 0)


LIBRARY_READERS: dict[str, Callable[[Path], tuple[object, ...]]] = {
    "info": lambda path: ("info", path),
    "live": lambda path: ("live", "--osc-in", f"{LOOPBACK}:0", "--library", path),
    "build": lambda path: ("build", path, "-o", path.with_name("made.npz")),
}


LIBRARY_FAULTS: dict[str, Callable[[bytes], bytes]] = {
    "truncated": lambda whole: whole[: len(whole) // 2],
    "tampered": lambda whole: (
        whole[: len(whole) // 2] + bytes([whole[len(whole) // 2] ^ 255]) + whole[len(whole) // 2 + 1 :]
    ),
    "text": lambda _: b"not a library",
}


@pytest.mark.parametrize("program", LIBRARY_READERS)
@pytest.mark.parametrize("fault", LIBRARY_FAULTS)
def test_a_broken_library_is_named(
    program: str, fault: str, small_library: MotionLibrary, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A library file that is cut short, changed or something else is named by every program that reads one."""
    path = tmp_path / "mine.npz"
    small_library.save(path)
    path.write_bytes(LIBRARY_FAULTS[fault](path.read_bytes()))
    assert one_line(capsys, *LIBRARY_READERS[program](path)).startswith(f"{path}: ")
    assert [each.name for each in tmp_path.iterdir()] == ["mine.npz"]


@pytest.mark.parametrize("program", LIBRARY_READERS)
def test_a_missing_library_is_named(program: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A library file that is not there, or is a folder, is named with the system's reason."""
    missing, folder = tmp_path / "nowhere.npz", tmp_path / "folder.npz"
    folder.mkdir()
    assert one_line(capsys, *LIBRARY_READERS[program](missing)) == f"{missing}: {os.strerror(errno.ENOENT)}"
    assert one_line(capsys, *LIBRARY_READERS[program](folder)) == f"{folder}: {os.strerror(errno.EISDIR)}"


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


# --- A running recogniser ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("transport", ["osc", "zmq"])
def test_the_program_counts_bad_packets_and_goes_on(transport: Transport) -> None:
    """Between two motions comes all that is wrong: it is counted, and every valid frame is used and answered."""
    before = ghost_cues("squat1Reps", 1.25, begin=1.0)
    after = [replace(cue, seq=cue.seq + len(before)) for cue in ghost_cues("squat1Reps", 1.25, begin=2.25)]
    twin = Recognizer(opened(small_library()))
    expected = [[each.label for cue in cues if (each := twin.push(cue.frame))] for cues in (before, after)]
    osc_packets = (wrong.MALFORMED_OSC, wrong.FOREIGN_OSC, wrong.OTHER_JOINTS_OSC)
    zmq_packets = (wrong.MALFORMED_ZMQ, wrong.FOREIGN_ZMQ, wrong.OTHER_JOINTS_ZMQ)
    malformed, foreign, others = (
        [packet for packet in packets.values() if isinstance(packet, bytes) or sum(map(len, packet)) < 100_000]
        for packets in (osc_packets if transport == "osc" else zmq_packets)
    )
    with live("--plain", transport=transport) as stage:
        stage.play(before)
        answers = [stage.answers(len(expected[0]))]
        for packet in (*malformed, *foreign, *others):
            stage.sender.send(packet)
            time.sleep(0.002)
        stage.play(after)
        answers.append(stage.answers(len(expected[1])))
        counts = stage.stopped()
    assert [[answer.label for answer in each] for each in answers] == expected
    assert min(map(len, expected)) > 5
    bad = {"malformed": len(malformed), "foreign": len(foreign), "other joints": len(others)}
    frames = len(before) + len(after)
    seen = {"received": frames + sum(bad.values()), "frames": frames, "answers": sum(map(len, expected))}
    assert counts == dict.fromkeys(COUNTED, 0) | bad | seen


# --- Hostile files ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("text", ["a = " + "[" * 20_000, "a." * 50_000 + "a = 1"], ids=["deep", "long"])
def test_a_preset_that_is_too_deep_or_too_long_is_named(
    text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """TOML that nests without end, or takes minutes to parse, is one line."""
    path = tmp_path / "deep.toml"
    path.write_text(text)
    assert one_line(capsys, "live", "--feed", path).startswith(f"{path}: expected ")


def test_labels_without_a_frame_of_their_take_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Labels beyond the end of their take leave no motion for a library."""
    take, labels = write_take(tmp_path, "bd", "bendLeft", 1), tmp_path / "late.csv"
    labels.write_text("start_s,end_s,label\n1000,1001,bend\n")
    error = one_line(capsys, "build", take, "--labels", labels, "-o", tmp_path / "made.npz")
    assert error.startswith("labels: expected segments with two frames or more")


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
