"""The charter, on which a gateway and its workers must agree, and the keys of their messages.

| key | what | from |
|---|---|---|
| `kin/gateway/<gateway>`, `kin/worker/<worker>` | liveliness tokens | both |
| `kin/<gateway>/charter`, `kin/<gateway>/library` | queries: the charter; the library's file | gateway |
| `kin/<gateway>/to/<worker>` | frames, and the performers that a worker takes over | gateway |
| `kin/<gateway>/back/<worker>` | answers and reports | worker |
| `kin/<gateway>/answer/<performer>/class`, `.../event` | answers in JSON, for every listener | gateway |
"""

from __future__ import annotations

import hashlib
import tempfile
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated
from urllib.parse import quote

import msgspec

from kinespace.stream.recognizer.settings import Settings  # noqa: TC001 - msgspec reads annotations
from kinespace.stream.workers.partition import PARTITIONS
from kinespace.stream.workers.wire import Answers  # noqa: TC001 - as above
from kinespace.stream.zeromq.frames import FormatError

if TYPE_CHECKING:
    from kinespace.library.motion_library import MotionLibrary

#: The version of these messages.
PROTOCOL = 5
#: Bytes of a library's file, at most.
MAX_LIBRARY = 1 << 28
GATEWAYS, WORKERS = "kin/gateway", "kin/worker"


class Charter(msgspec.Struct, frozen=True):
    """The versions, library and settings that a gateway demands of its workers.

    Attributes
    ----------
    version, protocol, partitions
        The version of kinespace, the version of the messages, the number of partitions: the worker must have the same.
    session
        The name that Zenoh gave the gateway's session: workers ignore frames of other sessions.
    digest
        SHA-256 of the library's file, in hexadecimal.
    settings, assumed, naming, most, silence
        For the recognisers; the naming is written as in `--naming`.
    """

    version: str
    protocol: int
    partitions: int
    session: str
    digest: str
    settings: Settings
    assumed: tuple[str, ...]
    naming: str
    most: Annotated[int, msgspec.Meta(ge=1)]
    silence: Annotated[float, msgspec.Meta(gt=0)]

    def refusal(self, own_digest: str | None) -> str:
        """Say why this worker cannot work for the gateway; empty when it can.

        Parameters
        ----------
        own_digest
            The digest of the library that the worker was given; None: it takes any.
        """
        ours = {"version": own_version(), "protocol": PROTOCOL, "partitions": PARTITIONS}
        for name, own in ours.items():
            if getattr(self, name) != own:
                return f"the gateway has {name} {getattr(self, name)}, this worker {own}"
        if own_digest not in (None, self.digest):
            return f"the gateway has library {self.digest[:12]}, this worker {(own_digest or '')[:12]}"
        return ""


class Back(msgspec.Struct, array_like=True, frozen=True):
    """A worker's answers, with the number of its membership; a worker without one sends 0 and asks for it."""

    member: int
    answers: Answers


encode = msgspec.msgpack.Encoder().encode
_read_charter = msgspec.json.Decoder(Charter).decode
_read_back = msgspec.msgpack.Decoder(Back).decode


def encode_charter(charter: Charter) -> bytes:
    """Encode a charter as JSON."""
    return msgspec.json.encode(charter)


def decode_charter(message: bytes) -> Charter:
    """Decode a charter; FormatError for any other message, and perhaps for another version's charter."""
    try:
        return _read_charter(message)
    except (ValueError, RecursionError) as error:
        raise FormatError(f"charter: {error}") from error


def decode_back(message: bytes) -> Back:
    """Decode a worker's answers; FormatError for a message that is not ours."""
    try:
        return _read_back(message)
    except (ValueError, RecursionError) as error:
        raise FormatError(f"back: {error}") from error


def own_version() -> str:
    """Give the version of this kinespace."""
    try:
        return version("kinespace")
    except PackageNotFoundError:
        return "unknown"


def file_of(library: MotionLibrary) -> bytes:
    """Give a library's file. The same motions give the same bytes on every machine."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "library.npz"
        library.save(path, compressed=False)
        return path.read_bytes()


def digest_of(file: bytes) -> str:
    """Give the digest of a library's file."""
    return hashlib.sha256(file).hexdigest()


def key(*parts: object) -> str:
    """Give a key; a part may be any text."""
    return "/".join(["kin", *(quote(str(part), safe="", errors="surrogatepass") for part in parts)])
