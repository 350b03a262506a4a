"""The terms on which a gateway and its workers must agree, and the library as it travels."""

from __future__ import annotations

import hashlib
import tempfile
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Annotated

import msgspec

from kinespace.library.motion_library import MotionLibrary
from kinespace.library.naming import Naming
from kinespace.library.windows.index import WindowIndex
from kinespace.stream.recognizer.performers import SentJoints
from kinespace.stream.recognizer.settings import Settings

#: The version of the messages.
PROTOCOL = 9
#: Bytes of a library's file, at most.
MAX_LIBRARY = 1 << 28
#: Performers of a gateway, at most.
MAX_PERFORMERS = 100_000
#: Joints of a performer, at most.
MAX_JOINTS = 4096


def own_version() -> str:
    """Give the version of this kinespace and of its messages."""
    try:
        own = version("kinespace")
    except PackageNotFoundError:
        own = "unknown"
    return f"{own}, protocol {PROTOCOL}"


class Terms(msgspec.Struct, frozen=True, kw_only=True):
    """The library, the settings and the version that a gateway demands of its workers.

    Attributes
    ----------
    settings, most, assumed, naming, silence, classes
        For the recognisers (`Performers`); the naming is written as in `--naming`.
    version
        The version of kinespace and of the messages: the worker must have the same.
    digest
        SHA-256 of the library as it travels, in hexadecimal.
    """

    settings: Settings
    most: Annotated[int, msgspec.Meta(ge=1, le=MAX_PERFORMERS)]
    assumed: Annotated[tuple[str, ...], msgspec.Meta(max_length=MAX_JOINTS)] = ()
    #: Never a path.
    naming: Annotated[str, msgspec.Meta(pattern=r"^[\w-]+$")] = "auto"
    silence: Annotated[float, msgspec.Meta(gt=0, le=1e6)] = 5.0
    classes: tuple[str, ...] = ()
    version: str = msgspec.field(default_factory=own_version)
    digest: str = ""

    @property
    def joints(self) -> SentJoints:
        """The joints that senders have."""
        return SentJoints(self.assumed, Naming.asked(self.naming))

    @property
    def refusal(self) -> str:
        """Why this worker cannot work for the gateway; empty when it can."""
        own = own_version()
        return "" if self.version == own else f"the gateway has version {self.version[:80]}, this worker {own}"


def file_of(library: MotionLibrary | WindowIndex) -> bytes:
    """Give a library's file. The same motions give the same bytes on every machine."""
    motions = library.library if isinstance(library, WindowIndex) else library
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "library.npz"
        motions.save(path, compressed=False)
        return path.read_bytes()


def library_in(file: bytes) -> MotionLibrary:
    """Read a library's file; ValueError for any other."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "library.npz"
        path.write_bytes(file)
        return MotionLibrary.load(path)


def digest_of(file: bytes) -> str:
    """Give the digest of a library's file."""
    return hashlib.sha256(file).hexdigest()
