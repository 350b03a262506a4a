"""Raw recordings: packets come back byte for byte, also from a file that was cut off or damaged."""

from __future__ import annotations

import errno
import json
import re
import struct
import zlib
from typing import TYPE_CHECKING

import pytest

from kinespace.stream.inputs.recording import Recorder, kinerec
from kinespace.stream.inputs.recording.kinerec import (
    RawFile,
    RawFileError,
    RawHeader,
    RawPacket,
    RawWriter,
    encode_header,
    encode_packet,
)

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

SOURCES = ("osc 127.0.0.1:9310", "zmq tcp://127.0.0.1:9320")
PACKETS = [
    RawPacket(1.5, 0, "10.0.0.7:4000", (b"/motion/frame\0\0\0",)),
    RawPacket(1.5, 1, "", (b"frame/p/", b"{}", b"\x00" * 372)),
    RawPacket(2.25, 0, "[::1]:9", (b"",)),
    RawPacket(1e9 + 1e-3, 1, "", ()),
]


def write(path: Path, packets: Sequence[RawPacket] = PACKETS) -> Path:
    """Write the bytes for which there is room."""
    with RawWriter(path, SOURCES) as writer:
        for packet in packets:
            writer.write(packet)
    assert (writer.written, writer.failed) == (len(packets), 0)
    return path


def test_recorded_packets_are_read_back(tmp_path: Path) -> None:
    """Arrivals, senders, sources and parts come back exactly, in order, every time the file is gone through."""
    recording = RawFile(write(tmp_path / "a.kinerec"))
    assert recording.header.sources == SOURCES
    assert re.match(r"\d{4}-\d\d-\d\dT.*\+00:00$", recording.header.began)
    for _ in range(2):
        assert list(recording.packets()) == PACKETS
        assert (recording.lost_from, recording.damage()) == (None, "")


def test_presets_are_kept_and_older_headers_read(tmp_path: Path) -> None:
    """Presets come back unchanged; a header without them has none, and one of another kind is no header."""
    presets = {"vmc": 'port = 1 # "søren"\n', "mine": ""}
    with RawWriter(tmp_path / "a.kinerec", SOURCES, presets):
        pass
    assert RawFile(tmp_path / "a.kinerec").header.presets == presets
    assert RawFile(write(tmp_path / "b.kinerec", [])).header.presets == {}
    assert b"presets" not in (tmp_path / "b.kinerec").read_bytes()
    told = {"format": kinerec.FORMAT, "version": kinerec.VERSION, "began": "", "sources": [], "presets": ["vmc"]}
    body = b"\0" + json.dumps(told).encode()
    (tmp_path / "c.kinerec").write_bytes(struct.pack("<II", len(body), zlib.crc32(body)) + body)
    with pytest.raises(RawFileError, match="byte 0: not a raw recording"):
        RawFile(tmp_path / "c.kinerec")
    with pytest.raises(ValueError, match="presets: expected at most 2097152 bytes"):
        RawWriter(tmp_path / "d.kinerec", SOURCES, {"mine": "#" * (1 << 21)})
    assert not (tmp_path / "d.kinerec").exists()


def test_a_file_is_read_to_its_last_whole_record(tmp_path: Path) -> None:
    """Cut off or changed at any byte, a file gives the records before it, and the byte and length of the rest."""
    path = write(tmp_path / "a.kinerec")
    whole = path.read_bytes()
    ends = [len(encode_header(RawFile(path).header))]
    for packet in PACKETS:
        ends.append(ends[-1] + len(encode_packet(packet)))
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


_LATER = kinerec._record(  # noqa: SLF001 - a whole record
    b'\0{"format": "kinespace raw recording", "version": 9, "began": "", "sources": []}'
)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "byte 0: not a raw recording"),
        (b"PK\x03\x04" + b"\0" * 500, "byte 0: not a raw recording"),
        (encode_packet(PACKETS[0]), "byte 0: not a raw recording"),
        (kinerec._record(b'\0{"format": "x"}'), "byte 0: not a raw recording"),  # noqa: SLF001 - a whole record
        (kinerec._record(b"\0[]"), "byte 0: not a raw recording"),  # noqa: SLF001 - as above
        (encode_header(RawHeader("now", SOURCES))[:-3], "byte 0: not a raw recording"),
        (_LATER, "format version 9, this kinespace reads 1"),
    ],
)
def test_another_kind_of_file_is_refused(tmp_path: Path, content: bytes, message: str) -> None:
    """A file without our header is refused by name."""
    path = tmp_path / "a.kinerec"
    path.write_bytes(content)
    with pytest.raises(RawFileError, match=re.escape(f"{path}: {message}")):
        RawFile(path)


def test_a_performance_is_never_overwritten(tmp_path: Path) -> None:
    """An existing file is refused and does not change."""
    path = write(tmp_path / "a.kinerec")
    before = path.read_bytes()
    with pytest.raises(FileExistsError):
        RawWriter(path, SOURCES)
    assert path.read_bytes() == before


class _Disk:
    """A file on a disk that has room for so many bytes more, and then takes a part and refuses the rest."""

    def __init__(self, file: object, room: int) -> None:
        self._file = file
        self.room = room

    def write(self, written: memoryview) -> int:
        """Take the bytes that there is room for."""
        if not self.room:
            raise OSError(errno.ENOSPC, "No space left on device")
        taken = written[: self.room]
        self.room -= len(taken)
        return self._file.write(taken)  # type: ignore[attr-defined, no-any-return]  # a file

    def __getattr__(self, name: str) -> object:
        return getattr(self._file, name)


def test_a_full_disk_costs_nothing_once_there_is_room_again(tmp_path: Path) -> None:
    """While the disk is full that is said and packets wait; then all of them are in the file, and none is torn."""
    path = tmp_path / "a.kinerec"
    with RawWriter(path, SOURCES) as writer:
        disk = writer._file = _Disk(writer._file, 20)  # type: ignore[assignment]  # noqa: SLF001 - a disk that fills
        for packet in PACKETS[:2]:
            writer.write(packet)
        writer._try_to_sync()  # noqa: SLF001 - without waiting for a second
        assert writer.trouble == "No space left on device"
        assert Recorder(writer, 0).note == "recording: No space left on device; 0 packets lost"
        assert list(RawFile(path).packets()) == []
        assert RawFile(path).damage() == ""
        writer.write(PACKETS[2])
        disk.room = 1 << 20
        writer._try_to_sync()  # noqa: SLF001 - as above
        assert (writer.trouble, Recorder(writer, 0).note) == ("", "")
        writer.write(PACKETS[3])
    assert (writer.written, writer.failed) == (4, 0)
    assert list(RawFile(path).packets()) == PACKETS


def test_a_disk_that_becomes_read_only_costs_nothing_once_it_can_be_written(tmp_path: Path) -> None:
    """It takes a part, and refuses the rest and to take the part away again; then all of it is written."""
    path = tmp_path / "a.kinerec"

    class ReadOnly(_Disk):
        def truncate(self) -> int:
            if not self.room:
                raise OSError(errno.EROFS, "Read-only file system")
            return self._file.truncate()  # type: ignore[attr-defined, no-any-return]  # a file

    with RawWriter(path, SOURCES) as writer:
        disk = writer._file = ReadOnly(writer._file, 20)  # type: ignore[assignment]  # noqa: SLF001 - a disk that fails
        for packet in PACKETS:
            writer.write(packet)
        writer._try_to_sync()  # noqa: SLF001 - without waiting for a second
        assert writer.trouble == "Read-only file system"
        disk.room = 1 << 20
    assert (writer.written, writer.failed, writer.trouble) == (len(PACKETS), 0, "")
    assert list(RawFile(path).packets()) == PACKETS


def test_packets_that_cannot_be_written_are_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a full disk the writer first loses packets beyond the memory's limit; it counts them and raises no error."""
    monkeypatch.setattr(kinerec, "MAX_WAITING", 100)
    path = tmp_path / "a.kinerec"
    with RawWriter(path, SOURCES) as writer:
        writer._file = _Disk(writer._file, 10)  # type: ignore[assignment]  # noqa: SLF001 - as above
        for _ in range(5):
            writer.write(PACKETS[0])
        assert (writer.written, writer.failed) == (1, 4)
    assert (writer.written, writer.failed) == (0, 5)
    assert list(RawFile(path).packets()) == []
    assert RawFile(path).damage() == ""
