"""`kinespace record` and its files: replayed bit for bit, described, converted, after any end of the recorder."""

import csv
import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from programs import LOOPBACK, Program, ran, started, until
from recorded import JOINTS

from kinespace.stream import Announcement, Frame, osc
from kinespace.stream.inputs.kinerec import RawFile, RawHeader, RawPacket, encode_header, encode_packet

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("wide")]


@contextmanager
def recording(path: Path, *options: object) -> Iterator[tuple[Program, osc.OscSender]]:
    """Run `kinespace record` on a port chosen by the system, and a sender to it."""
    with started("record", path, "--osc-in", f"{LOOPBACK}:0", *options) as program:
        port = int(program.expect(r"recording osc 127\.0\.0\.1:(\d+)")[1])
        sender = osc.OscSender(LOOPBACK, port)
        yield program, sender
        sender.close()


def datagrams(count: int) -> list[bytes]:
    """Make packets that cannot be confused, some of them no OSC."""
    positions = np.arange(18, dtype=np.float32).reshape(6, 3)
    return [
        b"rubbish %d" % index if index % 10 == 9 else osc.encode_frame(Frame("p", 1.0 + index / 100, positions + index))
        for index in range(count)
    ]


def written(path: Path, *packets: RawPacket, sources: tuple[str, ...] = ("osc here",)) -> Path:
    """Write a recording as a crash would leave it: never closed, which makes no difference."""
    path.write_bytes(encode_header(RawHeader("now", sources)) + b"".join(map(encode_packet, packets)))
    return path


def received(receiver: osc.OscReceiver, count: int) -> list[bytes]:
    """Take in so many datagrams."""
    got: list[bytes] = []
    until(lambda: got.extend(iter(receiver.receive, None)) or len(got) >= count)
    return got


# --- recording ---------------------------------------------------------------------------------------------------


def test_recorded_packets_are_replayed_bit_for_bit(tmp_path: Path, stage: osc.OscReceiver) -> None:
    """Every packet, also a malformed one, is kept in order and sent again unchanged, to another port and faster."""
    path, sent = tmp_path / "a.kinerec", datagrams(200)
    with recording(path) as (program, sender):
        for datagram in sent:
            sender.send(datagram)
            time.sleep(0.001)
        until(lambda: len(list(RawFile(path).packets())) >= 200)
        assert program.interrupt() == 0
        assert program.errors == ""
        assert "200 packets" in program.output
    packets = list(RawFile(path).packets())
    assert [packet.parts for packet in packets] == [(datagram,) for datagram in sent]
    assert len({packet.sender for packet in packets}) == 1
    # A process that is held between two looks at a clock dates a packet a little early.
    assert all(first.arrival <= second.arrival + 0.5 for first, second in pairwise(packets))
    status, printed, _ = ran("replay", path, "--osc", f"{LOOPBACK}:{stage.address[1]}", "--speed", 4, "--json")
    told = dict.fromkeys(("left_out", "failed", "unheard"), 0) | {"sent": 200, "lost_from": None}
    assert (status, json.loads(printed)) == (0, told)
    assert received(stage, 200) == sent


# --- telling and converting --------------------------------------------------------------------------------------


def a_recording(path: Path) -> Path:
    """Write a recording of two performers, one of whom changes the order of her joints."""
    frames = np.random.default_rng(8).normal(size=(6, 6, 3)).astype(np.float32)
    events = [Announcement("ann", JOINTS), *(Frame("ann", 1.0 + index, frames[index]) for index in range(3))]
    events += [Frame("bob", 0.0, frames[0, :4]), Announcement("ann", JOINTS[::-1])]
    events += [Frame("ann", 4.0, frames[3, ::-1]), Frame("ann", 5.0, frames[4, :5])]
    encoded = [osc.encode_frame(e) if isinstance(e, Frame) else osc.encode_announcement(e) for e in events]
    return written(path, *(RawPacket(index / 8, 0, "x:1", (each,)) for index, each in enumerate(encoded)))


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
