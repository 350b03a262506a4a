"""Raw recordings of feeds, `.kinerec`: every packet as it came, with its arrival and its sender.

The file is a row of records, each `u32 length, u32 CRC-32 of what follows, u8 kind, body`, little-endian. The first is
the header (kind 0): JSON with `format`, `version`, `began` (UTC), `sources` and, where packets were read as another
product's feed, `presets` (their TOML by name; older recordings lack it). Every other is a packet (kind 1):

    u8 source  f64 arrival  u16 bytes of sender  sender  (u32 bytes of part, part)*

`arrival` is seconds on the recorder's clock, whose zero means nothing. A datagram is one part; a ZeroMQ message keeps
its parts. Records are only ever appended, so a recorder that is killed leaves whole records and at most one torn one.
"""

import os
import struct
import threading
import zlib
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import BinaryIO, NamedTuple

import msgspec

from kinespace.library import memory
from kinespace.stream.feeds import Preset
from kinespace.stream.packet import Packet, Sender, parts_of

ENDING = ".kinerec"
FORMAT = "kinespace raw recording"
VERSION = 1
#: Seconds after which at the latest every packet is on the disk.
SYNC_EVERY = 1.0
#: Bytes of the largest record: a ZeroMQ message of the largest size that is received, and its head.
MAX_RECORD = 1 << 21

#: Bytes that wait in memory when the disk does not take them: a minute of a large feed.
MAX_WAITING = 16 << 20

#: Seconds on any clock, at most: a century after 1970, and as long as a program can wait.
_MAX_ARRIVAL = 4e9

_RECORD = struct.Struct("<II")
_PACKET = struct.Struct("<BBdH")
_PART = struct.Struct("<I")
#: The kinds of records: a header, and a packet that arrived.
_HEADER = 0
_ARRIVED = 1


class RawFileError(ValueError):
    """A file is not a usable raw recording; the message names the file and the byte."""


class RawPacket(NamedTuple):
    """One packet as it came.

    Attributes
    ----------
    arrival
        Seconds on the recorder's clock.
    source
        Index of the source in the header's `sources`.
    sender
        The sender, if the transport says: `host:port` of a datagram, else empty.
    parts
        A single datagram, or the parts of a ZeroMQ message.
    """

    arrival: float
    source: int
    sender: str
    parts: tuple[bytes, ...]


class RawHeader(msgspec.Struct, frozen=True, tag_field="format", tag=FORMAT):
    """The header of a recording.

    Attributes
    ----------
    began
        Time of day at which it began, UTC, ISO 8601.
    sources
        Where packets came in: `osc` or `zmq`, a space, and the address; then perhaps ` feed ` and a preset's name.
    presets
        The texts of the presets by which packets were read, by name: a user's own preset may have the name of a
        built-in one, and the built-in ones change. A preset that is missing here was built in, as far as is known.
    version
        The version of the format.
    """

    began: str
    sources: tuple[str, ...]
    presets: dict[str, str] = {}
    version: int = VERSION


_read_header = msgspec.json.Decoder(RawHeader).decode


def encode_packet(packet: RawPacket) -> bytes:
    """Encode a packet as one record."""
    sender = packet.sender.encode()[:65535]
    head = _PACKET.pack(_ARRIVED, packet.source, packet.arrival, len(sender))
    return _record(b"".join([head, sender, *(_PART.pack(len(part)) + part for part in packet.parts)]))


def encode_header(header: RawHeader) -> bytes:
    """Encode the header as one record; a preset is far smaller than a record may be."""
    return _record(bytes([_HEADER]) + msgspec.json.encode(header))


def _record(body: bytes) -> bytes:
    return _RECORD.pack(len(body), zlib.crc32(body)) + body


def _decode_packet(body: bytes) -> RawPacket:
    """Decode a record whose CRC is right; raises ValueError or struct.error when it holds no packet."""
    kind, source, arrival, size = _PACKET.unpack_from(body)
    if kind != _ARRIVED:
        raise ValueError(f"kind {kind}")
    if not abs(arrival) <= _MAX_ARRIVAL:
        raise ValueError(f"arrival {arrival}")
    place = _PACKET.size + size
    sender = body[_PACKET.size : place].decode()
    parts = []
    while place < len(body):
        (length,) = _PART.unpack_from(body, place)
        place += _PART.size
        if place + length > len(body):
            raise ValueError("a part reaches beyond its record")
        parts.append(body[place : place + length])
        place += length
    return RawPacket(arrival, source, sender, tuple(parts))


class RawWriter:
    """Appends packets to a new file.

    `write` copies the packet into memory. A thread writes the memory to the disk every second, so that a crash or a
    power cut loses no more than that, and no packet waits for a disk. Packets that the disk does not take stay in
    memory, up to `MAX_WAITING`, and are tried again every second; the file never holds a part of a record in its
    middle.

    Parameters
    ----------
    path
        The file; it must not exist, because no performance may be overwritten.
    sources
        Where packets will come in: `osc` or `zmq`, a space, and the address.
    presets
        TOML of the presets by which packets are read, by name.

    Attributes
    ----------
    written
        Packets so far, including packets that wait in memory.
    failed
        Packets that could not be written (the disk is full); they are lost, the feed goes on.
    trouble
        Why the disk takes nothing now; empty when it does.

    Raises
    ------
    OSError
        The file exists, or cannot be written.
    """

    def __init__(self, path: Path, sources: Sequence[str], presets: Mapping[str, str] | None = None) -> None:
        self.written = 0
        self.failed = 0
        self.trouble = ""
        header = encode_header(RawHeader(datetime.now(UTC).isoformat(), tuple(sources), {**(presets or {})}))
        self._file = path.open("xb", buffering=0)
        #: Bytes of the file up to the end of its last whole record.
        self._whole = 0
        self._lock = threading.Lock()
        self._waiting = [header]
        self._waiting_bytes = 0
        self._ended = threading.Event()
        try:
            self._sync()
        except OSError:
            self._file.close()
            path.unlink(missing_ok=True)
            raise
        self._syncing = threading.Thread(target=self._sync_every_second, name="kinespace recording", daemon=True)
        self._syncing.start()

    def write(self, packet: RawPacket) -> None:
        """Append one packet; a packet without room is counted, and nothing is raised."""
        record = encode_packet(packet)
        with self._lock:
            if self._waiting_bytes + len(record) > MAX_WAITING:
                self.failed += 1
                return
            self._waiting.append(record)
            self._waiting_bytes += len(record)
            self.written += 1

    def close(self) -> None:
        """Put everything on the disk and close the file; packets that the disk refuses now are lost and counted."""
        self._ended.set()
        self._syncing.join()
        self._try_to_sync()
        self.failed += len(self._waiting)
        self.written -= len(self._waiting)
        self._waiting.clear()
        self._file.close()

    def _sync_every_second(self) -> None:
        while not self._ended.wait(SYNC_EVERY):
            self._try_to_sync()

    def _try_to_sync(self) -> None:
        try:
            self._sync()
        except OSError as error:
            self.trouble = error.strerror or str(error)

    def _sync(self) -> None:
        """Write the waiting packets; after a failure the file is as before, and they wait again."""
        with self._lock:
            batch, self._waiting, self._waiting_bytes = self._waiting, [], 0
        written = memoryview(b"".join(batch))
        taken = 0
        # Outside the lock, because the disk may take long.
        try:
            while taken < len(written):
                taken += self._file.write(written[taken:])
            os.fsync(self._file.fileno())
        except OSError:
            with self._lock:
                self._waiting = batch + self._waiting
                self._waiting_bytes += len(written)
            # First the place, because a disk that takes nothing at all refuses to cut the file, too.
            self._file.seek(self._whole)
            self._file.truncate()
            raise
        self._whole += len(written)
        self.trouble = ""


def source_name(place: str, preset: Preset | None) -> str:
    """Name the place where packets come in, and the preset by which they are read, for a raw recording's header."""
    return f"{place} feed {preset.name}" if preset else place


class Recorder:
    """Writes the packets that come in at one place.

    Parameters
    ----------
    writer, index
        The writer, and the index of this source in the recording.
    """

    def __init__(self, writer: RawWriter, index: int) -> None:
        self._writer = writer
        self._index = index

    @property
    def note(self) -> str:
        """A note on the recording for a person; empty when all is well."""
        writer = self._writer
        return f"recording: {writer.trouble}; {writer.failed} packets lost" if writer.trouble or writer.failed else ""

    def keep(self, packet: Packet, arrival: float, sender: Sender) -> None:
        """Write one packet that came at `arrival`, seconds; the writer counts a failure."""
        named = f"{sender[0]}:{sender[1]}" if sender else ""
        self._writer.write(RawPacket(arrival, self._index, named, tuple(parts_of(packet))))


class RawFile:
    """A raw recording, read record by record; only one record is in memory.

    Parameters
    ----------
    path
        The file.

    Attributes
    ----------
    header
        The recording's header.
    lost_from
        First byte that could not be read when `packets` last ran to its end; None when the file was whole.
    lost
        Bytes that could not be read then.

    Raises
    ------
    RawFileError
        The file is no raw recording, or of another version.
    OSError
        The file cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.lost_from: int | None = None
        self.lost = 0
        with memory.opened(path) as file:
            body = _next_body(file)
        try:
            if not body or body[0] != _HEADER:
                raise ValueError("no header")  # noqa: TRY301 - refused as the others
            self.header = _read_header(body[1:])
        except (ValueError, RecursionError) as error:
            raise RawFileError(f"{path}: byte 0: not a raw recording ({error})") from error
        if self.header.version != VERSION:
            raise RawFileError(f"{path}: format version {self.header.version}, this kinespace reads {VERSION}")

    def packets(self) -> Iterator[RawPacket]:
        """Give the packets in the order in which they came, up to the first record that is torn or damaged.

        `lost_from` and `lost` then say which part could not be read.
        """
        self.lost_from, self.lost = None, 0
        with memory.opened(self.path) as file:
            _next_body(file)
            place = file.tell()
            while (body := _next_body(file)) is not None:
                try:
                    packet = _decode_packet(body)
                except (ValueError, struct.error):
                    break
                if packet.source >= len(self.header.sources):
                    break
                place = file.tell()
                yield packet
            self.lost = file.seek(0, os.SEEK_END) - place
            self.lost_from = place if self.lost else None

    def damage(self) -> str:
        """Say which part of the file could not be read; empty when all could."""
        if self.lost_from is None:
            return ""
        where = f"{self.path}: byte {self.lost_from}: cut off or damaged"
        return f"{where}; the {self.lost} bytes from there on are not read"


def _next_body(file: BinaryIO) -> bytes | None:
    """Read the next record; None at the end, and where no whole record follows."""
    head = file.read(_RECORD.size)
    if len(head) < _RECORD.size:
        return None
    length, crc = _RECORD.unpack(head)
    if not 0 < length <= MAX_RECORD:
        return None
    body = file.read(length)
    return body if len(body) == length and zlib.crc32(body) == crc else None
