"""The file of a motion library: a header and arrays in one `.npz` without pickle, written atomically.

The header is JSON. `positions` holds the second differences along time of all motions, one after the other, in whole
millimetres from each motion's first root position; `starts` holds those first positions. Differences and sums wrap
around at the integers' range, so nothing is lost. Zip's checksums show whether a file is damaged.
"""

import errno
import io
import math
import os
import stat
import tempfile
import warnings
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, BinaryIO

import msgspec
import numpy as np
from numpy.typing import DTypeLike, NDArray

from kinespace.library import memory
from kinespace.library.clip import Clip
from kinespace.library.skeleton import Skeleton

FORMAT = "kinespace motion library"
#: The beginning of the names of arrays that only hold for the motions that taught them.
TAUGHT = "taught "


#: Numbers learned from people, kept with a library's motions, by name; empty when nothing was learned.
Learned = Mapping[str, NDArray[np.float32]]


def for_other_motions(learned: Learned) -> Learned:
    """Give the learned numbers that hold for other motions than those that taught them, too."""
    return {name: array for name, array in learned.items() if not name.startswith(TAUGHT)}


#: Version 3 keeps the motions themselves; older versions kept numbers computed from them.
VERSION = 3

MAX_MOTIONS = 100_000
MAX_JOINTS = 512
#: Frames × joints × 3 of all motions together, at most: some five hours of 31 joints, 0.8 GB when read.
MAX_COORDINATES = 100_000_000
#: Metres of any joint from the origin, at most.
MAX_METRES = 1000.0
MAX_HEADER_BYTES = 16_000_000
MAX_LEARNED_BYTES = 64_000_000
#: Characters of a class, an actor, a take, a name or a joint, and of where a motion is from, at most.
MAX_NAME, MAX_ORIGIN = 400, 4000
#: Bytes in front of an array's numbers, at most: numpy's own limit.
_MAX_PREFIX_BYTES = 10_000

#: Bytes of memory for each coordinate: the differences in the file, their sums, and metres.
_BYTES_READ = 16

_MILLIMETRES = 1000.0
#: The integers of second differences, of which a file holds the smaller kind that is large enough.
_SMALL = np.dtype("<i2")
_LARGE = np.dtype("<i4")
_LEARNED = "learned_"


_Name = Annotated[str, msgspec.Meta(max_length=MAX_NAME)]
_Origin = Annotated[str, msgspec.Meta(max_length=MAX_ORIGIN)]


class LibraryFileError(ValueError):
    """A file is not a usable motion library; the message names the file and says why."""


#: What a file holds: the skeleton of all motions, the motions, and the learned numbers.
Contents = tuple[Skeleton, tuple[Clip, ...], Learned]


class _Motions(msgspec.Struct):
    """The header's columns: a value for each motion."""

    class_name: list[_Name]
    actor: list[_Name]
    take: list[_Name]
    name: list[_Name]
    frame_rate: list[float]
    frames: list[Annotated[int, msgspec.Meta(ge=2, le=MAX_COORDINATES)]]
    #: The index of the motion's source, licence and attribution in the header's `origins`.
    origin: list[Annotated[int, msgspec.Meta(ge=0)]]


class _LibraryHeader(msgspec.Struct):
    """The header of a file."""

    format: str
    version: int
    joints: Annotated[list[_Name], msgspec.Meta(max_length=MAX_JOINTS)]
    parents: list[int]
    motions: _Motions
    origins: list[tuple[_Origin, _Origin, _Origin]]
    #: The shapes of the learned arrays, by name.
    learned: dict[str, tuple[Annotated[int, msgspec.Meta(ge=0, le=MAX_LEARNED_BYTES)], ...]]
    #: So many of the last motions of an older file were for bodies of few joints alone; they are left out.
    guests: Annotated[int, msgspec.Meta(ge=0)] = 0


class _FileKind(msgspec.Struct):
    """The part of a header that says whether the rest can be read; what else it holds is passed over unread."""

    format: str | None = None
    version: int | float | str | None = None


def rounded(positions: NDArray[np.floating]) -> NDArray[np.float32]:
    """Round positions of any shape, metres, to the whole millimetres of a file, which single numbers hold."""
    return (np.rint(positions * np.float64(_MILLIMETRES)) / _MILLIMETRES).astype(np.float32)


# --- writing -----------------------------------------------------------------------------------------------------


def require_name(path: Path) -> None:
    """Refuse a new library's file by whose name programs would take it for a recording: ValueError."""
    if path.suffix != ".npz":
        raise ValueError(f"{path}: expected a name that ends in .npz, for a library")


def write(path: Path, contents: Contents, *, compressed: bool = True) -> None:
    """Write a library's file so that a reader sees the old file or the new one, never a part.

    Parameters
    ----------
    path
        The file; replaced when it exists.
    contents
        At least one motion, all of one skeleton; positions are rounded to whole millimetres.
    compressed
        Whether the file is small. A file that is not has the same bytes on every machine, and is written at once.

    Raises
    ------
    ValueError
        More motions, joints or coordinates than a file may hold, or positions too far from the origin.
    OSError
        The folder cannot be written; nothing is left behind.
    """
    skeleton, motions, learned = contents
    header = msgspec.json.encode(_described(contents))
    _require(len(header) <= MAX_HEADER_BYTES, f"header: expected at most {MAX_HEADER_BYTES} bytes, got {len(header)}")
    # What cannot be read again is not written.
    msgspec.json.decode(header, type=_LibraryHeader)
    _require_sizes(len(skeleton.joints), [motion.frames for motion in motions])
    arrays: dict[str, Any] = _encoded(motions)
    arrays |= {f"{_LEARNED}{name}": array.astype("<f4") for name, array in learned.items()}
    with replacing(path) as file:
        (np.savez_compressed if compressed else np.savez)(file, header=np.frombuffer(header, dtype=np.uint8), **arrays)


def _described(contents: Contents) -> _LibraryHeader:
    skeleton, motions, learned = contents
    origins = [(motion.source, motion.licence, motion.attribution) for motion in motions]
    places = {origin: place for place, origin in enumerate(dict.fromkeys(origins))}
    named = ("class_name", "actor", "take", "name", "frame_rate", "frames")
    columns = {name: [getattr(motion, name) for motion in motions] for name in named}
    table = _Motions(**columns, origin=[places[origin] for origin in origins])
    shapes = {name: array.shape for name, array in learned.items()}
    return _LibraryHeader(FORMAT, VERSION, list(skeleton.joints), list(skeleton.parents), table, list(places), shapes)


def _encoded(motions: Sequence[Clip]) -> dict[str, NDArray[Any]]:
    """Give `positions`, shape (joints, 3, frames of all motions), and `starts`, shape (motions, 3), millimetres."""
    starts = np.array([np.rint(motion.positions[0, 0] * _MILLIMETRES) for motion in motions])
    relative = [np.rint(motion.positions * _MILLIMETRES) - start for motion, start in zip(motions, starts, strict=True)]
    # Along time, because neighbouring numbers are alike there and the file gets smaller.
    along = np.concatenate([each.transpose(1, 2, 0) for each in relative], axis=2)
    _require_near(starts, along)
    along = along.astype(_SMALL if np.abs(along).max() <= np.iinfo(_SMALL).max else _LARGE)
    before = np.zeros((*along.shape[:2], 2), along.dtype)
    return {"positions": np.diff(along, n=2, axis=2, prepend=before), "starts": starts.astype(_LARGE)}


@contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """Open a file that takes another file's place once it is whole and on the disk."""
    if not path.absolute().parent.is_dir():
        raise FileNotFoundError(errno.ENOENT, "no such folder", str(path.parent))
    handle, temporary = tempfile.mkstemp(dir=path.absolute().parent, prefix=f".{path.name}.", suffix=".part")
    try:
        with os.fdopen(handle, "wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        # mkstemp makes a private file; ours gets the permissions of any new file.
        mask = os.umask(0)
        os.umask(mask)
        Path(temporary).chmod(0o666 & ~mask)
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


# --- other programs, and what is new ------------------------------------------------------------------------------


@contextmanager
def locked(path: Path, *, for_long: bool = False) -> Iterator[None]:
    """Have a library's file to ourselves; `for_long` lets others know, and a lock file stays beside the library.

    Raises
    ------
    ValueError
        Another program has it, or something else than a file lies where the lock is to be.
    OSError
        There is a link there, or the folder cannot be written.
    """
    try:
        import fcntl  # noqa: PLC0415 - there is none on Windows
    except ImportError:
        yield
        return
    lock = beside(path, "lock")
    # Anybody may have put anything there: nothing is followed, waited for or changed.
    flags = os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC | (os.O_CREAT if for_long else 0)
    if not (for_long or lock.exists()):
        yield
        return
    file = os.open(lock, flags, 0o666)
    try:
        if not stat.S_ISREG(os.fstat(file).st_mode):
            raise ValueError(f"{lock}: expected a file of ours, got something else")
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise ValueError(f"{path}: another kinespace teaches there; expected a file of its own") from error
        yield
    finally:
        os.close(file)


def beside(path: Path, what: str) -> Path:
    """Give the hidden file beside a library's, also where a link leads there: its lock, or what is `new`."""
    real = path.resolve()
    return real.with_name(f".{real.name}.{what}")


def _with_new(path: Path, contents: Contents) -> Contents:
    """Add the motions that a program which was killed, or teaches now, has not yet put into the file itself."""
    new = beside(path, "new")
    if not new.exists():
        return contents
    (skeleton, motions, learned), (other_skeleton, added, _) = contents, _read(new)
    known = {(each.class_name, each.take, each.name, each.frames) for each in motions}
    further = [each for each in added if (each.class_name, each.take, each.name, each.frames) not in known]
    if other_skeleton != skeleton or not further:
        return contents
    return skeleton, (*motions, *further), for_other_motions(learned)


# --- reading -----------------------------------------------------------------------------------------------------


def read(path: Path) -> Contents:
    """Read a library's file, and what is new; no array is unpacked before its size is known to be the expected one.

    Returns
    -------
    The contents that were written, positions rounded to whole millimetres and read-only.

    Raises
    ------
    LibraryFileError
        The file is cut short, not a motion library, of another format version, inconsistent or absurdly large.
    OSError
        The file cannot be opened.
    """
    return _with_new(path, _read(path))


def _read(path: Path) -> Contents:
    try:
        with memory.archive(path) as archive:
            return _restored(archive, _read_header(path, archive))
    except LibraryFileError:
        raise
    except OSError as error:
        if error.filename is not None:  # the file cannot be opened
            raise
        raise LibraryFileError(f"{path}: not a motion library, or cut short") from error
    except memory.DAMAGE as error:
        raise LibraryFileError(f"{path}: not a motion library, or cut short") from error
    except ValueError as error:
        raise LibraryFileError(f"{path}: not a usable motion library ({error})") from error


def _require(condition: bool, otherwise: str) -> None:  # noqa: FBT001 - reads like an assertion
    if not condition:
        raise ValueError(otherwise)


def _require_sizes(joints: int, frames: Sequence[int]) -> None:
    _require(0 < len(frames) <= MAX_MOTIONS, f"motions: expected 1 to {MAX_MOTIONS}, got {len(frames)}")
    _require(joints <= MAX_JOINTS, f"joints: expected at most {MAX_JOINTS}, got {joints}")
    is_held = sum(frames) * joints * 3 <= MAX_COORDINATES
    _require(is_held, f"frames: expected at most {MAX_COORDINATES} coordinates, got more")


def _numbers(
    archive: zipfile.ZipFile, name: str, kinds: Sequence[DTypeLike], shape: tuple[int, ...] | None = None
) -> NDArray[Any]:
    """Unpack an array; it must have one of some kinds and the shape that is given, or be a header's bytes."""
    most = MAX_HEADER_BYTES if shape is None else math.prod(shape) * max(np.dtype(each).itemsize for each in kinds)
    content = memory.unpacked(archive, name, most + _MAX_PREFIX_BYTES)
    file = io.BytesIO(content)
    if np.lib.format.read_magic(file) != (1, 0):
        raise zipfile.BadZipFile
    found, backwards, kind = np.lib.format.read_array_header_1_0(file)
    shape = (len(content) - file.tell(),) if shape is None else shape
    wanted = " or ".join(np.dtype(each).name for each in kinds)
    is_right = found == shape and not backwards and kind in kinds
    _require(is_right, f"{name}: expected {wanted} of shape {shape}, got {kind} {found}")
    return np.frombuffer(content, kind, math.prod(shape), file.tell()).reshape(shape)


def _read_header(path: Path, archive: zipfile.ZipFile) -> _LibraryHeader:
    if "header.npy" not in archive.namelist() and "joints.npy" in archive.namelist():
        raise LibraryFileError(f"{path}: a recording, no motion library: kinespace build {path} -o FILE makes one")
    text = bytes(_numbers(archive, "header", [np.uint8]))
    kind = msgspec.json.decode(text, type=_FileKind)
    if kind.format != FORMAT:
        raise LibraryFileError(f"{path}: not a motion library")
    if kind.version != VERSION:
        raise LibraryFileError(
            f"{path}: format version {str(kind.version)[:20]}, this kinespace reads {VERSION}; build the library again "
            f"from its recordings: kinespace build FOLDER -o {path}"
        )
    return msgspec.json.decode(text, type=_LibraryHeader)


def _restored(archive: zipfile.ZipFile, header: _LibraryHeader) -> Contents:
    motions, skeleton = header.motions, Skeleton(tuple(header.joints), tuple(header.parents))
    joints, count, total = len(skeleton.joints), len(motions.frames), sum(motions.frames)
    _require_sizes(joints, motions.frames)
    memory.require(total * joints * 3 * _BYTES_READ, "frames")
    for name, column in msgspec.structs.asdict(motions).items():
        _require(len(column) == count, f"{name}: expected {count}, one for each motion, got {len(column)}")
    _require(header.guests < count, f"guests: expected fewer than the {count} motions, got {header.guests}")
    known = len(header.origins)
    _require(all(place < known for place in motions.origin), f"origin: expected 0 to {known - 1}")
    learned_bytes = 4 * sum(map(math.prod, header.learned.values()))
    _require(learned_bytes <= MAX_LEARNED_BYTES, f"learned: expected at most {MAX_LEARNED_BYTES} bytes")
    names = ["header", "positions", "starts", *(f"{_LEARNED}{each}" for each in header.learned)]
    expected = sorted(f"{each}.npy" for each in names)
    _require(sorted(archive.namelist()) == expected, "arrays: expected exactly the arrays that the header lists")
    steps = _numbers(archive, "positions", [_SMALL, _LARGE], (joints, 3, total))
    starts = _numbers(archive, "starts", [_LARGE], (count, 3))
    learned = {}
    for own, shape in header.learned.items():
        name = f"{_LEARNED}{own}"
        learned[own] = array = _numbers(archive, name, [np.dtype("<f4")], shape)
        _require(bool(np.isfinite(array).all()), f"{name}: expected finite numbers, got NaN or infinity")
    positions = _decoded(steps, starts, motions.frames)
    texts = zip(motions.name, motions.class_name, motions.actor, motions.take, strict=True)
    origins = [header.origins[place] for place in motions.origin]
    each = zip(positions, motions.frame_rate, texts, origins, strict=True)
    clips = tuple(Clip(skeleton, metres, rate, *own, *origin) for metres, rate, own, origin in each)
    if header.guests:
        said = f"{header.guests} guests of an older file are left out: kinespace compares them with no body any more"
        warnings.warn(said, FutureWarning, stacklevel=2)
    return skeleton, clips[: count - header.guests], learned


def _decoded(
    steps: NDArray[np.signedinteger], starts: NDArray[np.int32], frames: Sequence[int]
) -> Iterator[NDArray[np.float32]]:
    """Give each motion's positions, shape (frames, joints, 3), metres, read-only."""
    along = np.cumsum(steps, axis=2, dtype=steps.dtype)
    np.cumsum(along, axis=2, dtype=steps.dtype, out=along)
    _require_near(starts, along)
    positions = np.ascontiguousarray(along.transpose(2, 0, 1)).astype(np.float32)
    # Motion by motion, while its numbers are in the processor's cache.
    for start, end, count in zip(starts, np.cumsum(frames), frames, strict=True):
        motion = positions[end - count : end]
        motion += start
        motion /= _MILLIMETRES
        motion.setflags(write=False)
        yield motion


def _require_near(starts: NDArray[Any], relative: NDArray[Any]) -> None:
    """Refuse positions that are far from the origin."""
    farthest = [max(float(each.max()), -float(each.min())) / _MILLIMETRES for each in (starts, relative)]
    is_near = farthest[0] <= MAX_METRES and farthest[1] <= 2 * MAX_METRES
    _require(is_near, f"positions: expected at most {MAX_METRES:g} m, got {max(farthest):.6g}")
