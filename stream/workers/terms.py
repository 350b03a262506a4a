"""The terms on which a gateway and its workers must agree, and the keys of their messages.

| key | content | from |
|---|---|---|
| `kin/gateway/<gateway>`, `kin/worker/<worker>` | liveliness tokens | both |
| `kin/<gateway>/terms`, `kin/<gateway>/library` | queries: the terms; the library | gateway |
| `kin/<gateway>/to/<worker>` | frames, the performers that a worker takes over, changed terms | gateway |
| `kin/<gateway>/back/<worker>` | answers and reports | worker |
| `kin/<gateway>/answer/<performer>/class`, `.../event` | answers in JSON, for every listener | gateway |
"""

from __future__ import annotations

import hashlib
import tempfile
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Annotated
from urllib.parse import quote

import msgspec

from kinespace.library.motion_library import MotionLibrary
from kinespace.library.windows.index import WindowIndex
from kinespace.stream.recognizer.settings import Settings  # noqa: TC001 - msgspec reads annotations
from kinespace.stream.workers.partition import PARTITIONS
from kinespace.stream.workers.wire import decoder

#: The version of these messages.
PROTOCOL = 6
#: Bytes of a library's file, at most.
MAX_LIBRARY = 1 << 28
GATEWAYS, WORKERS = "kin/gateway", "kin/worker"


class Terms(msgspec.Struct, frozen=True):
    """The versions, library and settings that a gateway demands of its workers.

    Attributes
    ----------
    version, protocol, partitions
        The version of kinespace, the version of the messages, the number of partitions: the worker must have the same.
    session
        The name that Zenoh gave the gateway's session: workers ignore frames of other sessions.
    digest
        SHA-256 of the library as it travels, in hexadecimal.
    settings, assumed, naming, most, silence, classes
        For the recognisers (`Performers`); the naming is written as in `--naming`.
    number
        Raised when the terms change; answers name it.
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
    classes: tuple[str, ...] = ()
    number: int = 0

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


encode_terms = msgspec.json.Encoder().encode
decode_terms = decoder(msgspec.json.Decoder(Terms).decode)


def own_version() -> str:
    """Give the version of this kinespace."""
    try:
        return version("kinespace")
    except PackageNotFoundError:
        return "unknown"


def file_of(library: MotionLibrary | WindowIndex) -> bytes:
    """Give a library's file. The same motions give the same bytes on every machine."""
    motions = library.library if isinstance(library, WindowIndex) else library
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "library.npz"
        motions.save(path, compressed=False)
        return path.read_bytes()


def library_in(file: bytes) -> MotionLibrary:
    """Read a library's file; ValueError for any other."""
    if len(file) > MAX_LIBRARY:
        raise ValueError(f"library: expected {MAX_LIBRARY} bytes at most, got {len(file)}")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "library.npz"
        path.write_bytes(file)
        return MotionLibrary.load(path)


def digest_of(file: bytes) -> str:
    """Give the digest of a library's file."""
    return hashlib.sha256(file).hexdigest()


def key(*parts: object) -> str:
    """Give a key; a part may be any text."""
    return "/".join(["kin", *(quote(str(part), safe="", errors="surrogatepass") for part in parts)])
