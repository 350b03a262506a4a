"""`kinespace build`, `cut` and `info`: recordings and libraries in, one motion library file out, and what is in it."""

import csv
import json
import time
from contextlib import closing
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from programs import LOOPBACK, ran, started, until
from synthetic import ARM, TinyBone, amc_text
from written import JOINTS, SWINGS, write_clip, write_clips

from kinespace.library import NOTHING, MotionLibrary, read_recordings
from kinespace.library.naming import hdm05
from kinespace.library.windows.opening import opened
from kinespace.stream import Announcement, Frame, osc
from kinespace.stream.inputs.kinerec import RawFile, RawHeader, RawPacket, RawWriter, encode_header, encode_packet
from kinespace.stream.osc.messages import encode_frame
from kinespace.tools.programs.replay import cut

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("wide")]


# --- recordings --------------------------------------------------------------------------------------------------


def test_a_folder_becomes_a_library(tmp_path: Path) -> None:
    """Every recording under a folder is a motion of its class, the same as built from the clips by hand."""
    (tmp_path / "cut").mkdir()
    paths, output = write_clips(tmp_path / "cut"), tmp_path / "mine.npz"
    status, printed, _ = ran("build", tmp_path / "cut", "-o", output)
    built = MotionLibrary.load(output)
    assert built.classes == tuple(sorted(SWINGS))
    assert set(built.skeleton.joints) == set(JOINTS)
    for one, other in zip(built.motions, MotionLibrary.of_clips(read_recordings(paths)).motions, strict=True):
        assert np.array_equal(one.positions, other.positions)
    assert {motion.frame_rate for motion in built.motions} == {60.0}
    assert (status, printed) == (0, f"{output}: 12 motions, 3 classes, {output.stat().st_size / 1e6:.2f} MB\n")


def test_labels_beside_recordings_cut_them(tmp_path: Path) -> None:
    """Labels beside a take with its name are used, and odd labels cause a remark."""
    cut, whole = write_clip(tmp_path, "bd", "bendLeft", 1), write_clip(tmp_path, "bd", "bendLeft", 2)
    cut.with_suffix(".txt").write_text("0.0\t0.75\tup\n0.75\t1.5\tdown\n1.5\t9.0\taway\n")
    output = tmp_path / "library.npz"
    _, printed, _ = ran("build", cut, whole, "-o", output)
    assert [motion.class_name for motion in MotionLibrary.load(output).motions] == ["bendLeft", "down", "up"]
    assert "1 of 2 recordings cut by the labels next to them" in printed
    assert "1 of 3 labels reach beyond the take (0.0 to 1.5 s): 0 shortened, 1 left out" in printed
    cut.with_suffix(".csv").write_text("start_s,end_s,label\n20.5,180,up\n")
    status, _, said = ran("build", cut, "-o", tmp_path / "none.npz")
    assert (status, "expected segments with two frames or more" in said) == (2, True)


def test_nothing_is_lost_in_silence(tmp_path: Path) -> None:
    """Files that are passed over, a second file of labels and labels of somebody else are listed."""
    (tmp_path / "cut").mkdir()
    take = write_clip(tmp_path / "cut", "bd", "bendLeft", 1)
    take.with_suffix(".csv").write_text("start_s,end_s,label,performer\n0,0.75,up,bd\n0.75,1.5,down,zoe\n")
    take.with_suffix(".txt").write_text("0.0\t0.75\tup\n")
    (tmp_path / "cut" / "notes.csv").write_text("day;weather\n")
    _, out, _ = ran("build", tmp_path / "cut", "-o", tmp_path / "library.npz")
    name, printed = take.stem, out.splitlines()
    assert printed[0].startswith(f"{tmp_path / 'library.npz'}: 1 motion, 1 class, ")
    assert printed[1:] == [
        "1 of 1 recording cut by the labels next to them",
        f"{name}.amc: cut by {name}.csv, not by {name}.txt",
        "1 file passed over: notes.csv (a .csv without joints' positions: columns like time, head_x, head_y, head_z)",
        f"{name}.amc: 1 label of zoe left out: bd is in the recording",
    ]


def test_all_damaged_recordings_are_named(tmp_path: Path) -> None:
    """A folder with damaged files ends with one line that names ten of them, and how many more there are."""
    for number in range(12):
        (tmp_path / f"{number:02}.bvh").write_text("HIERARCHY\n")
    status, _, message = ran("build", tmp_path, "-o", tmp_path / "library.npz")
    assert (status, message.count("\n")) == (2, 1)
    assert [f"{number:02}.bvh" in message for number in range(12)] == [True] * 10 + [False] * 2
    assert message.endswith("; and 2 more\n")


# --- libraries ---------------------------------------------------------------------------------------------------


def test_libraries_and_recordings_are_put_together(tmp_path: Path) -> None:
    """Two libraries and new recordings give one library of all motions, each once."""
    (tmp_path / "cut").mkdir()
    for actor in ("bd", "mm"):
        (tmp_path / actor).mkdir()
        write_clips(tmp_path / actor, actors=(actor,), takes=1)
        ran("build", tmp_path / actor, "-o", tmp_path / f"{actor}.npz")
    write_clips(tmp_path / "cut", actors=("bd", "tr"), takes=1)
    sources = (tmp_path / "bd.npz", tmp_path / "mm.npz", tmp_path / "cut")
    assert ran("build", *sources, "-o", tmp_path / "all.npz")[0] == 0
    assert [(motion.class_name, motion.actor) for motion in MotionLibrary.load(tmp_path / "all.npz").motions] == [
        (class_name, actor) for class_name in sorted(SWINGS) for actor in ("bd", "mm", "tr")
    ]


def test_classes_and_persons_are_left_out_and_classes_renamed(tmp_path: Path) -> None:
    """--without leaves out, --rename renames the other classes, each as often as it is given."""
    MotionLibrary.builtin().save(tmp_path / "all.npz")
    options = ("--without", "bk", "--without", "squat1Reps", "--without", "tr", "--rename", "grabHighR=grab")
    options = (*options, "--rename", "sneak2StepsLStart=sneak", "--rename", f"throwBasketball={NOTHING}")
    assert ran("build", tmp_path / "all.npz", "-o", tmp_path / "some.npz", *options)[0] == 0
    some, every = MotionLibrary.load(tmp_path / "some.npz"), MotionLibrary.builtin()
    assert some.actors == ("bd", "dg", "mm")
    gone = {"squat1Reps", "grabHighR", "sneak2StepsLStart", "throwBasketball"}
    assert set(some.classes) == (set(every.classes) - gone) | {"grab", "sneak"}
    kept = [each for each in every.motions if each.actor in some.actors and each.class_name != "squat1Reps"]
    assert {motion.name for motion in some.motions} == {motion.name for motion in kept}
    nothing = [motion.name for motion in some.motions if motion.class_name == NOTHING]
    assert nothing == [motion.name for motion in kept if motion.class_name == "throwBasketball"]


# --- cut -------------------------------------------------------------------------------------------------------------


STILL = 1.0
MOTIONS = (0, 40, 130)


@pytest.fixture
def evening(tmp_path: Path) -> Path:
    """Record two performers who stand still between motions; the second comes three seconds later."""
    library, generator = MotionLibrary.builtin(), np.random.default_rng(0)
    frames = []
    for performer, begin in (("ann", 100.0), ("bo", 103.0)):
        time = begin
        for motion in (library.motions[index] for index in MOTIONS):
            still = [motion.positions[0]] * round(STILL * 60), [motion.positions[-1]] * round(STILL * 60)
            for positions in (*still[0], *motion.positions, *still[1]):
                frames.append((time, performer, positions))
                time += 1 / 60
    with closing(RawWriter(tmp_path / "tonight.kinerec", ["osc 127.0.0.1:9310"])) as writer:
        for time, performer, positions in sorted(frames, key=lambda each: each[0]):
            packet = encode_frame(Frame(performer, time, positions))
            writer.write(RawPacket(time - 40 + generator.uniform(0, 0.005), 0, "127.0.0.1:5000", (packet,)))
    return tmp_path / "tonight.kinerec"


def _filled_in(labels: Path) -> None:
    with labels.open(newline="") as file:
        rows = list(csv.DictReader(file))
    names = iter("abcabc")
    for row in sorted(rows, key=lambda row: (row["performer"], float(row["start_s"]))):
        row["label"] = next(names)
    with labels.open("w", newline="") as file:
        written = csv.DictWriter(file, rows[0])
        written.writeheader()
        written.writerows(rows)


def test_an_evening_becomes_a_library(evening: Path) -> None:
    """Cut proposes a row for each movement of each performer; with classes filled in, build makes a library of it."""
    labels, library = evening.with_suffix(".csv"), evening.with_name("mine.npz")
    assert "6 movements of ann, bo" in ran("cut", evening)[1]
    _filled_in(labels)
    assert ran("build", evening, "--labels", labels, "-o", library)[0] == 0
    built = MotionLibrary.load(library)
    assert [(motion.class_name, motion.actor) for motion in built.motions] == [
        (name, performer) for name in "abc" for performer in ("ann", "bo")
    ]
    whole = MotionLibrary.builtin()
    for name, index in zip("abc", MOTIONS, strict=True):
        mine = next(motion for motion in built.motions if motion.class_name == name)
        assert mine.duration == pytest.approx(whole.motions[index].duration, abs=0.8)


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("1,2,wave,", "expected a performer of ann, bo, got none"),
        ("1,2,wave,cleo", "expected a performer of ann, bo, got 'cleo'"),
        ("1,4,wave,bo", "a body that does not move"),
        ("1,2,,ann", "no segment in it"),
    ],
)
def test_labels_that_do_not_fit(evening: Path, row: str, message: str) -> None:
    """Labels that do not fit their recording are refused in one line."""
    labels = evening.with_name("labels.csv")
    labels.write_text(f"start_s,end_s,label,performer\n{row}\n")
    status, _, said = ran("build", evening, "--labels", labels, "-o", evening.with_name("m.npz"))
    assert (status, message in said) == (2, True)


# --- info ------------------------------------------------------------------------------------------------------------


def _row(printed: str, class_name: str) -> list[str]:
    """Give the cells of a class's row: class, index, motions, persons, seconds, frames per second."""
    (row,) = [cells for line in printed.splitlines() if (cells := line.split())[:1] == [class_name] and len(cells) > 4]
    return row


def test_info_describes_the_built_in_library() -> None:
    """Without a file, every class of the built-in library has its row, then come its terms."""
    (status, printed, _), library = ran("info"), MotionLibrary.builtin()
    assert status == 0
    assert printed.startswith("built-in ")
    for index, class_name in enumerate(library.classes):
        motions = [motion for motion in library.motions if motion.class_name == class_name]
        seconds = sum(motion.frames / motion.frame_rate for motion in motions)
        row = class_name, index, len(motions), len({motion.actor for motion in motions}), f"{seconds:.1f}", 60
        assert _row(printed, class_name) == [*map(str, row)]
    for line in (
        "motions: 288 of 11 classes, 595 s",
        "persons: bd, bk, dg, mm, tr",
        f"joints: 31: {', '.join(hdm05.SKELETON.joints)}",
        "sources: HDM05",
        f"licence: {library.licence}",
        f"attribution: {library.attribution}",
        f"done, ≤ 6/h false: {opened(library).courses.missed_at(6.0):.0%} of these motions missed",
    ):
        assert f"\n{line}\n" in printed


def test_an_archive_of_130_classes_is_built_and_compared(tmp_path: Path) -> None:
    """HDM05's archive has a folder for each class, and the persons' skeletons beside: all is found by its names."""
    legs = [TinyBone(each, parent="upper", dof=("rx", "ry")) for each in ("lleg", "rleg", "neck")]
    body, archive = replace(ARM, bones=(*ARM.bones, *legs)), tmp_path / "hdm05_cut_amc"
    for person, actor in enumerate(("bd", "bk"), start=1):
        for number in range(130):
            angles = 20 * np.random.default_rng(number).normal(size=(9, 40)).cumsum(axis=1).T
            angles += np.random.default_rng((number, person)).normal(size=angles.shape)
            turns = {"upper": angles[:, :3], "lower": angles[:, 3:4], "neck": angles[:, 4:5].repeat(2, axis=1)}
            turns |= {"lleg": angles[:, 5:7], "rleg": angles[:, 7:], "root": 0 * angles[:, :6]}
            frames = [{name: each[frame].tolist() for name, each in turns.items()} for frame in range(40)]
            path = archive / f"class{number}" / f"HDM_{actor}_class{number}_001_120.amc"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(amc_text(frames))
        (archive / f"HDM_{actor}.asf").write_text(replace(body, length=body.length * person).asf())
    assert ran("build", archive, "-o", tmp_path / "all.npz")[0] == 0
    library = MotionLibrary.load(tmp_path / "all.npz")
    assert (len(library.motions), len(library.classes), library.actors) == (260, 130, ("bd", "bk"))
    _, printed, _ = ran("evaluate", "retrieval", archive, "--protocol", "actor-held-out", "--json")
    rows = {row["space"]: row for row in json.loads(printed)}
    assert {(row["motions"], row["classes"], row["persons"]) for row in rows.values()} == {(260, 130, 2)}
    assert rows["distances"]["nearest"] > 0.9
    assert rows["distances"]["confusion"]["class7"]["class7"] == 1.0


# --- record: packets replayed bit for bit, described, converted -------------------------------------------------------


def datagrams(count: int) -> list[bytes]:
    """Make packets that cannot be confused, some of them no OSC."""
    positions = np.arange(18, dtype=np.float32).reshape(6, 3)
    return [
        b"rubbish %d" % index if index % 10 == 9 else osc.encode_frame(Frame("p", 1.0 + index / 100, positions + index))
        for index in range(count)
    ]


# --- recording ---------------------------------------------------------------------------------------------------


def test_recorded_packets_are_replayed_bit_for_bit(tmp_path: Path, receiver: osc.OscReceiver) -> None:
    """Every packet, also a malformed one, is kept in order and sent again unchanged, to another port and faster."""
    path, sent = tmp_path / "a.kinerec", datagrams(200)
    with started("record", path, "--osc-in", f"{LOOPBACK}:0") as program:
        port = int(program.expect(r"recording osc 127\.0\.0\.1:(\d+)")[1])
        with closing(osc.OscSender(LOOPBACK, port)) as sender:
            for datagram in sent:
                sender.send(datagram)
                time.sleep(0.001)
        until(lambda: len(list(RawFile(path).packets())) >= 200)
        assert (program.interrupt(), program.errors) == (0, "")
        assert "200 packets" in program.output
    packets = list(RawFile(path).packets())
    assert [packet.parts for packet in packets] == [(datagram,) for datagram in sent]
    assert len({packet.sender for packet in packets}) == 1
    # A process that is held between two looks at a clock dates a packet a little early.
    assert all(first.arrival <= second.arrival + 0.5 for first, second in pairwise(packets))
    status, printed, _ = ran("replay", path, "--osc", f"{LOOPBACK}:{receiver.address[1]}", "--speed", 4, "--json")
    told = dict.fromkeys(("left_out", "failed", "unheard"), 0) | {"sent": 200, "lost_from": None}
    assert (status, json.loads(printed)) == (0, told)
    got = list[bytes]()
    until(lambda: got.extend(iter(receiver.receive, None)) or len(got) >= 200)
    assert got == sent


def test_a_packet_that_is_dated_before_the_first_is_sent() -> None:
    """A recorder that was held between two looks at a clock dates a packet early."""
    packets = [RawPacket(arrival, 0, "x:1", (b"",)) for arrival in (5.0, 4.5, 6.0, 7.0)]
    assert [due for due, _ in cut(iter(packets), 0.0, 2.0)] == [0.0, 0.0, 1.0]
    assert [due for due, _ in cut(iter(packets), 0.5, None)] == [0.5, 1.5]


# --- telling and converting --------------------------------------------------------------------------------------


def a_recording(path: Path) -> Path:
    """Write a recording of two performers, one of whom changes the order of her joints."""
    frames = np.random.default_rng(8).normal(size=(6, 6, 3)).astype(np.float32)
    events = [Announcement("ann", JOINTS), *(Frame("ann", 1.0 + index, frames[index]) for index in range(3))]
    events += [Frame("bob", 0.0, frames[0, :4]), Announcement("ann", JOINTS[::-1])]
    events += [Frame("ann", 4.0, frames[3, ::-1]), Frame("ann", 5.0, frames[4, :5])]
    encoded = [osc.encode_frame(e) if isinstance(e, Frame) else osc.encode_announcement(e) for e in events]
    packets = [encode_packet(RawPacket(index / 8, 0, "x:1", (each,))) for index, each in enumerate(encoded)]
    # As a crash would leave it: never closed, which makes no difference.
    path.write_bytes(encode_header(RawHeader("now", ("osc here",))) + b"".join(packets))
    return path


def test_info_describes_a_recording(tmp_path: Path) -> None:
    """Info gives length, senders with packets, performers with frames, and the place of a cut."""
    path = a_recording(tmp_path / "a.kinerec")
    path.write_bytes(path.read_bytes() + b"torn")
    lines = ran("info", path)[1].splitlines()
    assert lines[0] == f"{path}: recorded now, 0.9 s"
    assert lines[1:4] == ["osc here from x:1: 8 packets", "performer ann: 5 frames", "performer bob: 1 frames"]
    assert "the 4 bytes from there on are not read" in lines[4]


def test_a_recording_becomes_numbers(tmp_path: Path) -> None:
    """Times and positions are the sent ones, in one order of joints, in .npz and in CSV."""
    frames = np.random.default_rng(8).normal(size=(6, 6, 3)).astype(np.float32)
    path = a_recording(tmp_path / "a.kinerec")
    for name in ("a.npz", "a.csv"):
        status, printed, _ = ran("convert", path, "-o", tmp_path / name, "--performer", "ann")
        assert (status, "4 frames of 6 joints, 1 frames of other joints left out" in printed) == (0, True)
    with np.load(tmp_path / "a.npz", allow_pickle=False) as numbers:
        assert numbers["time"].tolist() == [1.0, 2.0, 3.0, 4.0]
        np.testing.assert_array_equal(numbers["positions"], frames[:4])
        assert numbers["joints"].tolist() == list(JOINTS)
        assert numbers["performer"] == "ann"
    with (tmp_path / "a.csv").open(newline="", encoding="utf-8") as file:
        heads, *rows = csv.reader(file)
    assert heads == ["time", *(f"{joint}_{axis}" for joint in JOINTS for axis in "xyz")]
    np.testing.assert_array_equal(np.array(rows, dtype=np.float64)[:, 0], [1, 2, 3, 4])
    np.testing.assert_array_equal(np.array(rows, dtype=np.float64)[:, 1:].astype(np.float32), frames[:4].reshape(4, -1))
    assert sorted(each.name for each in tmp_path.iterdir()) == ["a.csv", "a.kinerec", "a.npz"]
