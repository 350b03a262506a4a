"""Bad input: programs end with one line that names file and mistake; a running recogniser counts it and goes on."""

from __future__ import annotations

import errno
import json
import os
import re
import struct
from contextlib import ExitStack, closing
from dataclasses import dataclass, field, replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from programs import COUNTED, LOOPBACK, PATIENCE, Publisher, finished, ghost_cues, live, small_library, summary_counts
from recorded import write_take, write_takes
from synthetic import stick_clips

from kinespace.library import MotionLibrary
from kinespace.library.naming import hdm05
from kinespace.library.windows.index import WindowIndex, opened
from kinespace.stream import Announcement, Performers, Recognizer, osc, zeromq
from kinespace.stream.inputs import OscDecoder, Source, ZmqDecoder
from kinespace.stream.inputs.admission import Admission
from kinespace.stream.inputs.recording import kinerec as rawfile
from kinespace.stream.outputs import Sink
from kinespace.stream.service.loop import Service
from kinespace.stream.zeromq import Endpoint
from kinespace.tools.cli.main import main
from kinespace.tools.feeding.feed import OscFrameSender
from kinespace.tools.terminal.live_table import summary

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from kinespace.stream.recognition import Recognition
    from kinespace.tools.feeding.feed import Cue, Packet
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


READERS = ("build", "replay", "evaluate")


@pytest.mark.parametrize("program", READERS)
def test_a_missing_recording_is_named(program: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A file or folder that is not there is named, and no library is written."""
    missing, made = tmp_path / "nowhere.amc", tmp_path / "made.npz"
    assert one_line(capsys, *commands_with(missing, made)[program]) == f"{missing}: no such file or folder"
    assert not made.exists()


@pytest.mark.parametrize("program", READERS)
def test_an_unreadable_recording_is_named(program: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A file the system will not open is named with the system's reason."""
    path = write_take(tmp_path, "bd", "bendLeft", 1)
    path.unlink()
    path.symlink_to(path)
    error = one_line(capsys, *commands_with(tmp_path, tmp_path / "made.npz")[program])
    assert error == f"{path}: {os.strerror(errno.ELOOP)}"
    assert not (tmp_path / "made.npz").exists()


@pytest.mark.parametrize("program", READERS)
def test_an_empty_folder_is_named(program: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A folder without any recording, other files aside, is named."""
    folder = tmp_path / "cut"
    folder.mkdir()
    (folder / "notes.txt").write_text("none yet")
    error = one_line(capsys, *commands_with(folder, tmp_path / "made.npz")[program])
    assert error.startswith(f"{folder}: no recording")


@pytest.mark.parametrize("program", READERS)
def test_another_kind_of_file_is_named(program: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A file of another kind is named, with the kinds that are read."""
    path = tmp_path / "take.fbx"
    path.write_text("Kaydara")
    error = one_line(capsys, *commands_with(path, tmp_path / "made.npz")[program])
    assert error.startswith(f"{path}: expected a recording (.amc")


def _first(text: str, old: str, new: str) -> str:
    assert old in text
    return text.replace(old, new, 1)


#: Mistakes in an AMC, and a part of the error that each must cause.
AMC_FAULTS: dict[str, tuple[Callable[[str], str], str]] = {
    "unknown bone": (lambda text: _first(text, "rlower", "tail"), ":8: .*'tail'"),
    "too many numbers": (lambda text: _first(text, "llower", "llower 1.0"), ":6: expected 1 numbers for 'llower'"),
    "too few numbers": (lambda text: _first(text, "rupper 0.0", "rupper"), ":7: expected 3 numbers for 'rupper'"),
    "NaN": (
        lambda text: _first(text, "llower ", "llower nan #"),
        r"(:6: .*finite.*'llower'|: NaN or infinity in frame 1)",
    ),
    "infinity": (
        lambda text: _first(text, "llower ", "llower 1e999 #"),
        r"(:6: .*finite.*'llower'|: NaN or infinity in frame 1)",
    ),
    "a word": (lambda text: _first(text, "llower ", "llower much #"), ":6: .*'much'"),
    "cut off between two bones": (
        lambda text: text[: text.index("rupper", len(text) // 2)],
        r":\d+: the file ends in the middle of frame \d+",
    ),
    "cut off between two numbers": (
        lambda text: text[: text.index("rupper", len(text) // 2) + 12],
        r":\d+: expected 3 numbers for 'rupper', got 2",
    ),
    "empty": (lambda _: "", "no frames in it"),
    "random bytes": (lambda _: "\x00\xff\x01\x80" * 10, ":1: expected a frame number or a bone"),
}


@pytest.mark.parametrize("fault", AMC_FAULTS)
@pytest.mark.parametrize("program", READERS)
def test_an_amc_that_does_not_fit_is_named_with_its_line(
    program: str, fault: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Among good recordings one that does not fit its skeleton is named, with line and mistake."""
    path = write_takes(tmp_path, takes=1)[2]
    spoil, expected = AMC_FAULTS[fault]
    path.write_text(spoil(path.read_text()), encoding="latin-1")
    error = one_line(capsys, *commands_with(tmp_path, tmp_path / "made.npz")[program])
    assert error.startswith(f"{path}:")
    assert re.search(expected, error)
    assert not (tmp_path / "made.npz").exists()


@pytest.mark.parametrize("program", READERS)
@pytest.mark.parametrize("skeleton", [None, "", "rubbish", ":version 1.10\n:units\n  angle deg\n"])
def test_a_skeleton_that_is_none_is_named(
    program: str, skeleton: str | None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A skeleton that is missing or no ASF is named, or the recording it is missing for."""
    path = write_take(tmp_path, "bd", "bendLeft", 1)
    asf = tmp_path / "HDM_bd.asf"
    if skeleton is None:
        asf.unlink()
    else:
        asf.write_text(skeleton)
    error = one_line(capsys, *commands_with(path, tmp_path / "made.npz")[program])
    assert error.startswith(f"{path}: no skeleton HDM_bd.asf" if skeleton is None else f"{asf}: not a usable ASF")


def test_a_clip_of_one_frame_makes_no_library(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A recording of a single frame is named by build, and no library is written."""
    write_takes(tmp_path, takes=1)
    write_take(tmp_path, "bk", "bendLeft", 1, frames=1)
    error = one_line(capsys, "build", tmp_path, "-o", tmp_path / "made.npz")
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


def _truncated(whole: bytes) -> bytes:
    return whole[: len(whole) // 2]


def _tampered(whole: bytes) -> bytes:
    place = len(whole) // 2
    return whole[:place] + bytes([whole[place] ^ 0xFF]) + whole[place + 1 :]


LIBRARY_FAULTS: dict[str, Callable[[bytes], bytes]] = {
    "truncated": _truncated,
    "tampered": _tampered,
    "empty": lambda _: b"",
    "text": lambda _: b"not a library",
    "random bytes": lambda whole: np.random.default_rng(3).bytes(len(whole)),
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
    "arguments",
    [("live", "--osc-in"), ("replay", "{clip}", "--osc", f"{LOOPBACK}:9", "--listen")],
    ids=["live", "replay"],
)
def test_a_busy_udp_port_is_named(
    arguments: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A UDP port that another program listens on is named, and that program keeps it."""
    clip = write_take(tmp_path, "bd", "bendLeft", 1)
    receiver = osc.OscReceiver(LOOPBACK, 0)
    address = f"{LOOPBACK}:{receiver.address[1]}"
    try:
        error = one_line(capsys, *(each.format(clip=clip) for each in arguments), address)
        assert error.startswith(f"{arguments[-1]} {address}: another program has this port, perhaps another kinespace")
        sender = osc.OscSender(*receiver.address)
        sender.send(b"still mine")
        sender.close()
        assert receiver.receive() == b"still mine"
    finally:
        receiver.close()


@pytest.mark.parametrize(
    ("arguments", "mark"),
    [
        (("live", "--zmq-in"), ""),
        (("live", "--osc-in", f"{LOOPBACK}:0", "--zmq-out"), ""),
        (("replay", "{clip}", "--zmq"), "@"),
        (("replay", "{clip}", "--osc", f"{LOOPBACK}:9", "--listen"), "@"),
    ],
    ids=["live in", "live out", "replay", "replay listening"],
)
def test_a_busy_zmq_endpoint_is_named(
    arguments: tuple[str, ...], mark: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A ZeroMQ endpoint that is bound already is named."""
    clip = write_take(tmp_path, "bd", "bendLeft", 1)
    receiver = zeromq.ZmqReceiver(Endpoint(f"tcp://{LOOPBACK}:*", bind=True))
    address = receiver.address
    try:
        error = one_line(capsys, *(each.format(clip=clip) for each in arguments), mark + address)
    finally:
        receiver.close()
    assert error.startswith(f"{arguments[-1]} {address}: another program has this port")


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("live", "--osc-in", "here"), "--osc-in: expected HOST:PORT, the port from 0 to 65535, got 'here'"),
        (
            ("live", "--osc-in", f"{LOOPBACK}:0", "--osc-out", "x:99999"),
            "--osc-out: expected HOST:PORT, the port from 0 to 65535, got 'x:99999'",
        ),
        (("live", "--zmq-in", "here"), "endpoint: expected an address like tcp://127.0.0.1:5556, got 'here'"),
        (("live", "--zmq-in", "pigeon://here"), "pigeon://here: Protocol not supported"),
        (("live", "--zmq-in", "tcp://"), "tcp://: Invalid argument"),
        (
            ("live", "--osc-in", f"{LOOPBACK}:0", "--signature", "paper", "--window", "1e9"),
            "--window: expected seconds that memory has room for",
        ),
        (("live", "--osc-in", f"{LOOPBACK}:0", "--window", "1"), "--window: expected --signature paper with it"),
        (
            ("live", "--osc-in", f"{LOOPBACK}:0", "--signature", "paper", "--sensitivity", "0.1"),
            "--sensitivity: expected --signature windows with it",
        ),
        (("live", "--osc-in", f"{LOOPBACK}:0", "--performers", "0"), "most: expected at least 1 performer, got 0"),
    ],
)
def test_an_address_that_makes_no_sense_is_named(
    arguments: tuple[str, ...], expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """An impossible address, window or number of performers is named."""
    assert one_line(capsys, *arguments).startswith(expected)


def test_a_library_cannot_be_written_where_there_is_no_folder(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A library to be written into a missing folder, or over a folder, ends with one line that names the place."""
    path = write_take(tmp_path, "bd", "bendLeft", 1)
    missing, folder = tmp_path / "missing" / "made.npz", tmp_path / "bendLeft"
    assert one_line(capsys, "build", path, "-o", missing) == f"{missing.parent}: {os.strerror(errno.ENOENT)}"
    assert one_line(capsys, "build", path, "-o", folder) == f"{folder}: {os.strerror(errno.EISDIR)}"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--feed", "kinect"), "--feed: expected one of captury, "),
        (("--feed", "nowhere.toml"), "nowhere.toml: No such file or directory"),
        (("--osc-in", f"{LOOPBACK}:0", "--out", "unity"), "--out: expected one of native, touchdesigner, max, "),
        (
            ("--osc-in", f"{LOOPBACK}:0", "--out", "max=there"),
            "--out: expected HOST:PORT, the port from 0 to 65535, got",
        ),
        (
            ("--zmq-in", f"tcp://{LOOPBACK}:*", "--out", "max=sender"),
            "--out: expected an OSC feed to reply to, got none",
        ),
        (("--osc-in", "nowhere"), "--osc-in: expected HOST:PORT, "),
    ],
)
def test_live_refuses_impossible_options(
    options: tuple[str, ...], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """A preset, output or address that does not exist ends the program with one line, and no socket stays open."""
    assert one_line(capsys, "live", *options).startswith(said)


def test_latency_refuses_too_few_seconds(capsys: pytest.CaptureFixture[str]) -> None:
    """A run that is shorter than a window is refused with one line."""
    assert "seconds" in one_line(capsys, "latency", "--seconds", 0.1)


def test_a_real_command_shows_no_traceback() -> None:
    """As a process of its own, a command that cannot do its work ends with 2 and one line, not a traceback."""
    status, output, errors = finished("replay", "nowhere")
    assert (status, output) == (2, "")
    assert errors.startswith("kinespace: ")
    assert errors.count("\n") == 1


# --- A running recogniser ---------------------------------------------------------------------------------------------

JOINTS = hdm05.SKELETON.joints
GOOD = "good"


def index() -> WindowIndex:
    """Give the small library, opened."""
    return opened(small_library())


@dataclass(frozen=True)
class Bad:
    """A fault of a feed: packets between valid frames, and their counts.

    Attributes
    ----------
    packets
        What comes.
    counts
        By how much each count rises for it, `received` aside, which counts every packet.
    begin
        Time of the first valid frame after it; None to go on as if nothing had been.
    """

    packets: list[Packet] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=dict)
    begin: float | None = None


def _datagram(positions: np.ndarray[Any, Any], performer: bytes = b"good", time: float = 2.0) -> bytes:
    """Write a `/motion/frame` by hand, with any content."""
    head = b"/motion/frame\0\0\0,sd" + b"f" * positions.size
    head += b"\0" * (4 - len(head) % 4)
    return (
        head
        + performer
        + b"\0" * (4 - len(performer) % 4)
        + struct.pack(">d", time)
        + positions.astype(">f4").tobytes()
    )


def _message(positions: np.ndarray[Any, Any], performer: bytes = b"good", **header: object) -> list[bytes]:
    """Write a ZeroMQ frame by hand, with any content; without a number unless given, so that none is missing."""
    described = {"v": 1, "t": 2.0, "shape": positions.shape, "dtype": "<f4"} | header
    return [b"frame/" + performer + b"/", json.dumps(described).encode(), positions.astype("<f4").tobytes()]


BODY = np.random.default_rng(1).normal(size=(31, 3))


def _with(value: float) -> np.ndarray[Any, Any]:
    spoilt = BODY.copy()
    spoilt[17, 1] = value
    return spoilt


def _random_datagrams() -> list[Packet]:
    generator = np.random.default_rng(9)
    # A slash or "#bundle" first could be OSC; chance never writes a whole message after it.
    return [generator.bytes(int(size)) for size in generator.integers(1, 1500, 50)]


def _late(transport: Transport, count: int) -> list[Packet]:
    """Give valid frames of the good performer, a tenth of a second older than the newest."""
    times = [2.0 + index / 120 for index in range(count)]
    if transport == "osc":
        return [_datagram(BODY, time=time) for time in times]
    return [_message(BODY, t=time) for time in times]


def _strangers(transport: Transport) -> list[Packet]:
    """Announce an unknown joint in the place of another, then send frames."""
    joints = ("tail", *JOINTS[1:])
    if transport == "osc":
        announced = osc.encode_announcement(Announcement("stranger", joints))
        return [announced, *(_datagram(BODY, b"stranger", 1.0 + index) for index in range(5))]
    return [_message(BODY, b"stranger", t=1.0 + index, joints=joints) for index in range(5)]


OSC_BAD = {
    "random bytes": Bad(_random_datagrams(), {"malformed": 50}),
    "no bytes at all": Bad([b""], {"malformed": 1}),
    "a 64 kB datagram of zeros": Bad([b"\0" * 65507], {"malformed": 1}),
    "a 64 kB frame of 4363 joints": Bad([_datagram(np.zeros((4363, 3)))], {"other joints": 1}),
    "a 64 kB frame cut short": Bad([_datagram(np.zeros((5000, 3)))[:65507]], {"malformed": 1}),
    "a 64 kB message of somebody else's": Bad(
        [b"/x\0\0,b\0\0" + struct.pack(">i", 65480) + b"\1" * 65480], {"foreign": 1}
    ),
    "NaN for all joints": Bad([_datagram(np.full_like(BODY, np.nan))], {"malformed": 1}),
    "infinity": Bad([_datagram(_with(np.inf)), _datagram(_with(-np.inf))], {"malformed": 2}),
    "a time that is NaN": Bad([_datagram(BODY, time=np.nan)], {"malformed": 1}),
    "a number too few": Bad([_datagram(BODY.ravel()[:-1])], {"malformed": 1}),
    "a joint too few and one too many": Bad([_datagram(BODY[:-1]), _datagram(np.zeros((32, 3)))], {"other joints": 2}),
    "no number at all": Bad([_datagram(BODY[:0])], {"other joints": 1}),
    "frames cut short": Bad([_datagram(BODY)[:size] for size in (17, 100, 300, 500)], {"malformed": 4}),
    "a performer without a name, and one with too long a name": Bad(
        [_datagram(BODY, b""), _datagram(BODY, b"x" * 65)], {"malformed": 2}
    ),
    "an unknown joint": Bad(_strangers("osc"), {"other joints": 5}),
    "other addresses": Bad([b"/eos/out/ping\0\0\0,\0\0\0", osc.encode_classes(("a", "b"))], {"foreign": 2}),
    "time running backwards": Bad(_late("osc", 8), {"out of order": 8}),
    "a feed that stops and comes back": Bad(begin=60.0, counts={"restarts": 1}),
    "a sender that starts again": Bad(begin=1.0, counts={"restarts": 1}),
}

ZMQ_BAD = {
    "random bytes": Bad([[b"frame/good/", packet, packet] for packet in _random_datagrams()], {"malformed": 50}),
    "a part too few and one too many": Bad(
        [_message(BODY)[:1], _message(BODY)[:2], [*_message(BODY), b""]], {"malformed": 3}
    ),
    "64 kB of positions": Bad([[*_message(BODY)[:2], b"\0" * 65536]], {"malformed": 1}),
    "64 kB of header": Bad([_message(BODY, note="x" * 65536)], {"malformed": 1}),
    "NaN for all joints, and infinity": Bad(
        [_message(each) for each in (np.full_like(BODY, np.nan), _with(np.inf), _with(-np.inf))], {"malformed": 3}
    ),
    "a time that is none": Bad(
        [_message(BODY, t=time) for time in (np.nan, np.inf, "noon", None, True)], {"malformed": 5}
    ),
    "a number too few": Bad([[*_message(BODY)[:2], _message(BODY)[2][:-4]]], {"malformed": 1}),
    "a joint too few and one too many": Bad([_message(BODY[:-1]), _message(np.zeros((32, 3)))], {"other joints": 2}),
    "other shapes": Bad(
        [_message(BODY, shape=shape) for shape in ([93], [31, 3, 1], [-31, 3], [31.0, 3], "31x3", [1 << 40, 3])],
        {"malformed": 6},
    ),
    "other types": Bad([_message(BODY, dtype=kind) for kind in ("O", "<i4", ">f4", 4, ["<f4"])], {"malformed": 5}),
    "another version": Bad([_message(BODY, v=2), _message(BODY, v=None)], {"malformed": 2}),
    "a count that is none": Bad([_message(BODY, seq=seq) for seq in (-1, 1.5, "7", True)], {"malformed": 4}),
    "an unknown joint": Bad(_strangers("zmq"), {"other joints": 5}),
    "other topics": Bad([[b"hello/", b""], [b"class/good/", b"{}"], [b""]], {"foreign": 3}),
    "time running backwards": Bad(_late("zmq", 8), {"out of order": 8}),
    "numbers skipped": Bad([_message(BODY, b"other", seq=seq, t=seq / 120) for seq in (5, 9, 20)], {"missing": 13}),
    "a feed that stops and comes back": Bad(begin=60.0, counts={"restarts": 1}),
    "a sender that starts again with seq 0": Bad(begin=1.0, counts={"restarts": 1}),
}
CASES = [("osc", name, bad) for name, bad in OSC_BAD.items()] + [("zmq", name, bad) for name, bad in ZMQ_BAD.items()]


#: Cases with which the program itself is started: it alone opens a library beside the loop for joints it does not know.
IN_THE_PROGRAM = ("random bytes", "an unknown joint")


def _feed(begin: float | None) -> tuple[list[Cue], list[Cue]]:
    """Give the good performer's frames before and after: enough for many answers, and older than any that is late."""
    again = begin == 1.0
    # Further back than any window reaches: a frame that is less late may have been overtaken.
    before = ghost_cues("squat1Reps", 1.25, performer=GOOD, begin=3.0 if again else 1.0)
    after = ghost_cues("squat1Reps", 1.25, performer=GOOD, begin=1.0 + 1.25 if begin is None else begin)
    # Only a sender that starts again counts from 0 again.
    return before, after if again else [replace(cue, seq=cue.seq + len(before)) for cue in after]


@cache
def _labels(begin: float | None) -> tuple[list[str], list[str]]:
    """Give the answers to these frames without a fault between them."""
    twin = Recognizer(index())
    before, after = ([twin.push(cue.frame) for cue in part] for part in _feed(begin))
    return [each.label for each in before if each], [each.label for each in after if each]


class Heard(Sink):
    """Keeps the answers about the good performer."""

    def __init__(self) -> None:
        self.labels = list[str]()

    def publish(self, recognition: Recognition) -> None:
        """Keep one."""
        if recognition.performer == GOOD:
            self.labels.append(recognition.label)


def _opened(transport: Transport, stack: ExitStack) -> tuple[OscFrameSender | Publisher, Source]:
    """Open a sender, and the source that hears it."""
    if transport == "osc":
        receiver = osc.OscReceiver(LOOPBACK, 0)
        datagrams = OscFrameSender(LOOPBACK, receiver.address[1])
        stack.callback(datagrams.close)
        return datagrams, Source(receiver, OscDecoder(), admission=Admission())
    publisher = Publisher()
    stack.callback(publisher.close)
    source = Source(zeromq.ZmqReceiver(Endpoint(publisher.address, bind=False)), ZmqDecoder(), admission=Admission())
    publisher.wait_for_subscriber()
    return publisher, source


def _counted(bad: Bad, used: int, answers: int, name: str) -> dict[str, int]:
    """Give all counts at the end, of so many valid frames and answers."""
    strangers = 3 if name == "numbers skipped" else 0
    seen = {"received": used + len(bad.packets), "frames": used + strangers, "answers": answers}
    return dict.fromkeys(COUNTED, 0) | seen | bad.counts


@pytest.mark.parametrize(
    ("transport", "name", "bad"),
    [case for case in CASES if case[1] != "an unknown joint"],
    ids=[f"{transport}: {name}" for transport, name, _ in CASES if name != "an unknown joint"],
)
def test_a_running_recogniser_counts_bad_packets_and_goes_on(transport: Transport, name: str, bad: Bad) -> None:
    """Between valid frames comes something bad: it is counted, exactly, and every valid frame is used and answered."""
    before, after = _feed(bad.begin)
    expected = _labels(bad.begin)
    heard, now, sent = Heard(), [0.0], 0
    with ExitStack() as stack:
        sender, source = _opened(transport, stack)
        service = stack.enter_context(Service(Performers(index()), [source], [heard], clock=lambda: now[0]))
        for packet in [*map(sender.encode, before), *bad.packets, *map(sender.encode, after)]:
            sender.send(packet)
            now[0], sent = now[0] + 1 / 120, sent + 1
            # One after the other, so that neither a full socket nor a busy machine loses any.
            while source.counts.received < sent:
                service.step(PATIENCE)
        counts = summary_counts(summary(service.status(), 1 / 30))
    assert heard.labels == [label for labels in expected for label in labels]
    assert min(map(len, expected)) > 5
    assert counts == _counted(bad, len(before) + len(after), sum(map(len, expected)), name)


@pytest.mark.parametrize(
    ("transport", "name", "bad"),
    [case for case in CASES if case[1] in IN_THE_PROGRAM],
    ids=[f"{transport}: {name}" for transport, name, _ in CASES if name in IN_THE_PROGRAM],
)
def test_the_program_counts_bad_packets_and_goes_on(transport: Transport, name: str, bad: Bad) -> None:
    """The same with the program as a person starts it."""
    before, after = _feed(None)
    expected = _labels(None)
    with live("--plain", transport=transport) as stage:
        stage.play(before)
        first = stage.answers(len(expected[0]))
        for packet in bad.packets:
            stage.sender.send(packet)
        stage.play(after)
        second = stage.answers(len(expected[1]))
        counts = stage.stopped()
    for answers, labels in zip((first, second), expected, strict=True):
        assert [answer.label for answer in answers if answer.performer == GOOD] == labels
    assert counts == _counted(bad, len(before) + len(after), sum(map(len, expected)), name)


def test_an_unknown_host_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    """A host name that cannot be resolved is in the error, with its port."""
    assert one_line(capsys, "live", "--osc-in", "nohost.invalid:9000").startswith("nohost.invalid:9000: ")


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
    skipping = tmp_path / "joints_s01_e01.txt"
    skipping.write_text("".join(f"{number} {'1.5 ' * 60}\n" for number in (1, 900_000)))
    for path in (take, library, skipping):
        error = one_line(capsys, "--max-memory", "10kB", "info", path)
        assert error.startswith(f"{path}: ")
        assert "expected at most 0 MB once it is read" in error
        assert "--max-memory" in error
    assert "got 864 MB" in one_line(capsys, "--max-memory", "500MB", "info", skipping)
