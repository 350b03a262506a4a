"""Raw recordings: packets come back byte for byte, also from a file that was cut off or damaged."""

import errno
import json
import re
import struct
import zlib
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from kinespace.stream import Frame, osc
from kinespace.stream.inputs import OwnDecoder, kinerec
from kinespace.stream.inputs.kinerec import RawFile, RawFileError, RawHeader, RawPacket, RawWriter
from kinespace.stream.inputs.takes import decoded

SOURCES = ("osc 127.0.0.1:9310", "zmq tcp://127.0.0.1:9320")
PACKETS = [
    RawPacket(1.5, 0, "10.0.0.7:4000", (b"/motion/frame\0\0\0",)),
    RawPacket(1.5, 1, "", (b"frame/p/", b"{}", b"\x00" * 372)),
    RawPacket(2.25, 0, "[::1]:9", (b"",)),
    RawPacket(1e9 + 1e-3, 1, "", ()),
]


def write(path: Path, packets: Sequence[RawPacket] = PACKETS) -> Path:
    """Write the bytes for which there is room."""
    with closing(RawWriter(path, SOURCES)) as writer:
        for packet in packets:
            writer.write(packet)
    assert (writer.written, writer.failed) == (len(packets), 0)
    return path


def test_presets_are_kept_and_older_headers_read(tmp_path: Path) -> None:
    """Presets come back unchanged; a header without them has none, and one of another kind is no header."""
    presets = {"vmc": 'port = 1 # "søren"\n', "mine": ""}
    with closing(RawWriter(tmp_path / "a.kinerec", SOURCES, presets)):
        pass
    header = RawFile(tmp_path / "a.kinerec").header
    assert (header.sources, header.presets) == (SOURCES, presets)
    assert re.match(r"\d{4}-\d\d-\d\dT.*\+00:00$", header.began)
    path, older = tmp_path / "b.kinerec", {"format": kinerec.FORMAT, "version": 1, "began": "", "sources": SOURCES}
    for more, read in (({}, {}), ({"presets": ["vmc"]}, None)):
        body = b"\0" + json.dumps(older | more).encode()
        path.write_bytes(struct.pack("<II", len(body), zlib.crc32(body)) + body)
        if read is None:
            with pytest.raises(RawFileError, match="byte 0: not a raw recording"):
                RawFile(path)
        else:
            assert (RawFile(path).header.sources, RawFile(path).header.presets) == (SOURCES, read)


def test_a_recorded_datagram_is_read_as_it_was_live() -> None:
    """Also one whose address lacks its slash, which ZeroMQ messages may not lack."""
    frame = osc.encode_frame(Frame("ann", 1.0, np.ones((5, 3))))
    packet = frame.replace(b"/motion/frame\0\0\0", b"motion/frame\0\0\0\0")
    assert len(OwnDecoder().decode(packet, 1.0, None)) == 1
    packets = [RawPacket(1.0, place, "10.0.0.7:4000", (packet,)) for place in (0, 1)]
    assert [len([*decoded(RawHeader("", SOURCES), [each])]) for each in packets] == [1, 0]


def test_a_file_is_read_to_its_last_whole_record(tmp_path: Path) -> None:
    """Cut off or changed at any byte, a file gives the records before it, and the byte and length of the rest."""
    path = write(tmp_path / "a.kinerec")
    whole, ends = path.read_bytes(), [len(kinerec.encode_header(RawFile(path).header))]
    for packet in PACKETS:
        ends.append(ends[-1] + len(kinerec.encode_packet(packet)))
    assert ends[-1] == len(whole)
    for place in range(ends[0], len(whole)):
        complete = sum(end <= place for end in ends[1:])
        for content in (whole[:place], whole[:place] + bytes([whole[place] ^ 0x40]) + whole[place + 1 :]):
            path.write_bytes(content)
            recording = RawFile(path)
            assert list(recording.packets()) == PACKETS[:complete]
            lost = len(content) - ends[complete]
            assert (recording.lost_from, recording.lost) == (ends[complete] if lost else None, lost)
            where = f"{path}: byte {ends[complete]}: cut off or damaged; the {lost} bytes from there on are not read"
            assert recording.damage() == (where if lost else "")


class _Disk:
    """A file on a disk that has room for so many bytes more, then takes a part and refuses the rest, or any change."""

    def __init__(self, file: object, room: int, *, read_only: bool = False) -> None:
        self._file = file
        self.room, self._read_only = room, read_only

    def write(self, written: memoryview) -> int:
        """Take the bytes that there is room for."""
        if not self.room:
            raise OSError(errno.ENOSPC, "No space left on device")
        taken = written[: self.room]
        self.room -= len(taken)
        return self._file.write(taken)  # type: ignore[attr-defined, no-any-return]  # a file

    def truncate(self) -> int:
        """Cut the file, unless nothing can be changed now."""
        if self._read_only and not self.room:
            raise OSError(errno.EROFS, "Read-only file system")
        return self._file.truncate()  # type: ignore[attr-defined, no-any-return]  # a file

    def __getattr__(self, name: str) -> object:
        return getattr(self._file, name)


@pytest.mark.parametrize("read_only", [False, True])
def test_a_disk_that_refuses_for_a_while_costs_nothing(tmp_path: Path, read_only: bool) -> None:  # noqa: FBT001
    """While the disk is full or read-only that is said and packets wait; then all are in the file, and none is torn."""
    path = tmp_path / "a.kinerec"
    with closing(RawWriter(path, SOURCES)) as writer:
        disk = _Disk(writer._file, 20, read_only=read_only)  # noqa: SLF001 - a disk that fills
        writer._file = disk  # type: ignore[assignment]  # noqa: SLF001 - as above
        for packet in PACKETS[:2]:
            writer.write(packet)
        writer._try_to_sync()  # noqa: SLF001 - without waiting for a second
        assert writer.trouble == ("Read-only file system" if read_only else "No space left on device")
        assert kinerec.Recorder(writer, 0).note == f"recording: {writer.trouble}; 0 packets lost"
        assert list(RawFile(path).packets()) == []
        assert writer._waiting_bytes == sum(len(kinerec.encode_packet(packet)) for packet in PACKETS[:2])  # noqa: SLF001 - unseen
        writer.write(PACKETS[2])
        disk.room = 1 << 20
        writer._try_to_sync()  # noqa: SLF001 - as above
        assert (writer.trouble, kinerec.Recorder(writer, 0).note) == ("", "")
        writer.write(PACKETS[3])
    assert (writer.written, writer.failed) == (4, 0)
    recording = RawFile(path)
    assert list(recording.packets()) == PACKETS
    assert recording.damage() == ""


def test_packets_that_cannot_be_written_are_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a full disk the writer first loses packets beyond the memory's limit; it counts them and raises no error."""
    monkeypatch.setattr(kinerec, "MAX_WAITING", 100)
    path = tmp_path / "a.kinerec"
    with closing(RawWriter(path, SOURCES)) as writer:
        writer._file = _Disk(writer._file, 10)  # type: ignore[assignment]  # noqa: SLF001 - as above
        for _ in range(5):
            writer.write(PACKETS[0])
        assert (writer.written, writer.failed) == (1, 4)
    assert (writer.written, writer.failed) == (0, 5)
    assert list(RawFile(path).packets()) == []
    assert RawFile(path).damage() == ""
