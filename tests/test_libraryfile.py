"""The library's file: written whole or not at all, and refused by one error whatever has become of it."""

from __future__ import annotations

import io
import os
import pickle
import re
import stat
import sys
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from synthetic import STICK_CLASSES, stick_clip, stick_clips

from library import libraryfile
from library.comparison import Comparison
from library.libraryfile import LibraryFileError
from library.motionlibrary import MotionLibrary

if TYPE_CHECKING:
    from collections.abc import Callable

NAMES = ("means", "axes", "deviations")


@pytest.fixture(scope="module")
def small_library() -> MotionLibrary:
    return MotionLibrary.of_clips(stick_clips(), licence="CC0", attribution="nobody, somewhere")


@pytest.fixture(scope="module")
def content(small_library: MotionLibrary, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Give the bytes of a good library file."""
    path = tmp_path_factory.mktemp("good") / "small.npz"
    small_library.save(path)
    return path.read_bytes()


def _are_equal(first: MotionLibrary, second: MotionLibrary) -> bool:
    arrays = all(np.array_equal(getattr(first, name), getattr(second, name)) for name in NAMES)
    said = ("skeleton", "motions", "classes", "licence", "attribution")
    return arrays and all(getattr(first, name) == getattr(second, name) for name in said)


def _assert_refused(path: Path, content: bytes) -> None:
    path.write_bytes(content)
    with pytest.raises(LibraryFileError, match=re.escape(str(path)) + ": "):
        MotionLibrary.load(path)


# --- round trip --------------------------------------------------------------------------------------------------


def test_header_and_arrays_come_back_as_they_were(tmp_path: Path) -> None:
    """What was written is read: any JSON header, and any number of float32 arrays of any shape, bit for bit."""
    header = {"title": "Übung", "numbers": [1, 2.5, None], "nested": {"empty": {}}}
    generator = np.random.default_rng(1)
    arrays = {"flat": generator.normal(size=7).astype("f4"), "deep": generator.normal(size=(2, 3, 4)).astype("f4")}
    libraryfile.write(tmp_path / "file.npz", header, arrays)
    read_header, read_arrays = libraryfile.read(tmp_path / "file.npz")
    assert read_header == {"format": libraryfile.FORMAT, "version": libraryfile.VERSION, **header}
    assert list(read_arrays) == ["flat", "deep"]
    assert all(np.array_equal(read_arrays[name], array) for name, array in arrays.items())


def test_the_file_is_an_npz_without_pickle(content: bytes) -> None:
    """Numpy alone opens the file with pickle forbidden, and finds little-endian single precision in it."""
    with np.load(io.BytesIO(content), allow_pickle=False) as stored:
        assert {name: stored[name].dtype.str for name in NAMES} == dict.fromkeys(NAMES, "<f4")


def test_the_same_library_makes_the_same_numbers(content: bytes, small_library: MotionLibrary, tmp_path: Path) -> None:
    """Saved again, what was loaded is equal: nothing is lost or rounded on the way."""
    first, second = tmp_path / "first.npz", tmp_path / "second.npz"
    first.write_bytes(content)
    MotionLibrary.load(first).save(second)
    assert _are_equal(MotionLibrary.load(second), small_library)


# --- saving is atomic --------------------------------------------------------------------------------------------


def _broken_savez(file: Any, **_arrays: object) -> None:  # noqa: ANN401 - what numpy takes
    file.write(b"PK\x03\x04 half of a file")
    raise OSError(28, "No space left on device")


def _interrupted_savez(file: Any, **_arrays: object) -> None:  # noqa: ANN401 - what numpy takes
    file.write(b"PK\x03\x04 half of a file")
    raise KeyboardInterrupt


def _refusing(*_arguments: object) -> None:
    raise OSError(5, "Input/output error")


FAILURES = [
    pytest.param(np, "savez_compressed", _broken_savez, OSError, id="disk full"),
    pytest.param(np, "savez_compressed", _interrupted_savez, KeyboardInterrupt, id="Ctrl-C"),
    pytest.param(os, "fsync", _refusing, OSError, id="disk gone"),
    pytest.param(Path, "replace", _refusing, OSError, id="not replaced"),
]


@pytest.mark.parametrize(("owner", "name", "failing", "error"), FAILURES)
@pytest.mark.parametrize("exists", [True, False])
def test_a_failure_in_the_middle_leaves_all_as_it_was(  # noqa: PLR0913, PLR0917 - a failure takes four words to say
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    owner: object,
    name: str,
    failing: Callable[..., None],
    error: type[BaseException],
    content: bytes,
    *,
    exists: bool,
) -> None:
    """When saving fails the old file is untouched, or still absent, and nothing else is left in the folder."""
    path = tmp_path / "library.npz"
    if exists:
        path.write_bytes(content)
    monkeypatch.setattr(owner, name, failing)
    with pytest.raises(error):
        MotionLibrary.of_clips(stick_clips(takes=1)).save(path)
    monkeypatch.undo()
    assert [entry.name for entry in tmp_path.iterdir()] == (["library.npz"] if exists else [])
    assert not exists or path.read_bytes() == content


def test_until_the_new_file_is_whole_the_old_one_is_read(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, content: bytes, small_library: MotionLibrary
) -> None:
    """A reader who comes while a library is being written sees the old one; who comes after, the new one."""
    path = tmp_path / "library.npz"
    path.write_bytes(content)
    seen: list[MotionLibrary] = []
    fsync = os.fsync

    def look_meanwhile(handle: int) -> None:
        seen.append(MotionLibrary.load(path))
        fsync(handle)

    monkeypatch.setattr(os, "fsync", look_meanwhile)
    new = MotionLibrary.of_clips(stick_clips(takes=1))
    new.save(path)
    assert len(seen) == 1
    assert _are_equal(seen[0], small_library)
    assert _are_equal(MotionLibrary.load(path), new)
    assert [entry.name for entry in tmp_path.iterdir()] == ["library.npz"]


def test_a_folder_that_is_not_there_is_an_os_error(small_library: MotionLibrary, tmp_path: Path) -> None:
    """Saving into a folder that does not exist, or over a folder, is the system's error and leaves nothing behind."""
    with pytest.raises(FileNotFoundError):
        small_library.save(tmp_path / "absent" / "library.npz")
    (tmp_path / "folder").mkdir()
    with pytest.raises(OSError, match="folder"):
        small_library.save(tmp_path / "folder")
    assert [entry.name for entry in tmp_path.iterdir()] == ["folder"]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no umask to speak of")
@pytest.mark.parametrize(("mask", "mode"), [(0o022, 0o644), (0o027, 0o640), (0o077, 0o600)])
def test_a_library_is_as_readable_as_any_other_file(
    small_library: MotionLibrary, tmp_path: Path, mask: int, mode: int
) -> None:
    """The file's mode follows the umask, which saving leaves as it was."""
    before = os.umask(mask)
    try:
        small_library.save(tmp_path / "library.npz")
    finally:
        after = os.umask(before)
    assert stat.S_IMODE((tmp_path / "library.npz").stat().st_mode) == mode
    assert after == mask


# --- damaged files -----------------------------------------------------------------------------------------------


def test_a_file_cut_short_anywhere_is_refused(content: bytes, tmp_path: Path) -> None:
    """Cut at any of several hundred places, the first byte and the last among them, the file is refused by name."""
    for length in [*range(0, len(content), 11), 1, 2, 3, 4, len(content) - 1]:
        _assert_refused(tmp_path / "cut.npz", content[:length])


def test_a_file_cut_out_of_the_middle_is_refused(content: bytes, tmp_path: Path) -> None:
    """Bytes missing from the middle are noticed too."""
    for start in range(0, len(content) - 40, 97):
        _assert_refused(tmp_path / "cut.npz", content[:start] + content[start + 40 :])


def _assert_refused_or_equal(path: Path, content: bytes, expected: MotionLibrary) -> bool:
    """Say whether a file is refused; if not, what is read of it is the library that was written."""
    path.write_bytes(content)
    try:
        library = MotionLibrary.load(path)
    except LibraryFileError as error:
        assert str(path) in str(error)  # noqa: PT017 - a flipped date in the zip's directory is no error
        return True
    assert _are_equal(library, expected)
    return False


#: The end record of a zip file is its last 22 bytes.
END = 22


@pytest.mark.parametrize("mask", [0x01, 0x10, 0xFF])
def test_flipped_bytes_are_refused_or_do_not_matter(
    content: bytes, small_library: MotionLibrary, tmp_path: Path, mask: int
) -> None:
    """A byte flipped anywhere gives the one error, or sits where zip files keep dates and the library is whole."""
    places = range(0, len(content) - END, 3)
    refused = sum(
        _assert_refused_or_equal(
            tmp_path / "flipped.npz",
            content[:place] + bytes([content[place] ^ mask]) + content[place + 1 :],
            small_library,
        )
        for place in places
    )
    assert refused > 0.9 * len(places)


def test_a_flipped_end_of_the_file_is_refused(content: bytes, small_library: MotionLibrary, tmp_path: Path) -> None:
    """A byte flipped in the zip's end record, which says where its directory is, gives the one error."""
    for place in range(len(content) - END, len(content)):
        for mask in (0x01, 0x80, 0xFF):
            flipped = content[:place] + bytes([content[place] ^ mask]) + content[place + 1 :]
            _assert_refused_or_equal(tmp_path / "flipped.npz", flipped, small_library)


@pytest.mark.parametrize("filling", [b"\x00", b"\xff", b"A"])
def test_overwritten_stretches_are_refused(content: bytes, tmp_path: Path, filling: bytes) -> None:
    """A stretch of the file overwritten with one byte is refused, wherever it begins."""
    for start in range(0, len(content) - 64, 89):
        _assert_refused(tmp_path / "over.npz", content[:start] + filling * 64 + content[start + 64 :])


@pytest.mark.parametrize(
    ("field", "value"),
    [pytest.param(6, 200, id="version"), pytest.param(8, 1, id="password"), pytest.param(10, 99, id="method")],
)
def test_a_zip_beyond_what_python_reads_is_refused(content: bytes, tmp_path: Path, field: int, value: int) -> None:
    """A zip whose directory asks for a later version, a password or an unknown compression is refused by name."""
    changed = bytearray(content)
    for entry in re.finditer(rb"PK\x01\x02", content):
        changed[entry.start() + field] = value
    _assert_refused(tmp_path / "beyond.npz", bytes(changed))


# --- foreign files -----------------------------------------------------------------------------------------------


class _Trap:
    """Leaves a mark when unpickled."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self) -> tuple[Callable[..., object], tuple[object, ...]]:
        return (Path.touch, (self.mark,))


def _npy(array: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def _npz(**arrays: object) -> bytes:
    file = io.BytesIO()
    np.savez(file, allow_pickle=True, **arrays)
    return file.getvalue()


def _zip(**members: bytes) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for name, member in members.items():
            archive.writestr(name, member)
    return file.getvalue()


def _header(text: str) -> np.ndarray:
    return np.frombuffer(text.encode(), dtype=np.uint8)


@pytest.mark.parametrize(
    "foreign",
    [
        pytest.param(b"", id="empty"),
        pytest.param(b"motions: none\n", id="text"),
        pytest.param(b'{"format": "kinespace motion library", "version": 2}', id="JSON"),
        pytest.param(np.random.default_rng(2).bytes(2048), id="random bytes"),
        pytest.param(_npy(np.zeros((3, 4))), id="npy"),
        pytest.param(_npy(np.array([{}, None], dtype=object)), id="npy of objects"),
        pytest.param(_npz(weights=np.zeros(3)), id="npz of something else"),
        pytest.param(_npz(), id="npz of nothing"),
        pytest.param(_npz(header=np.zeros(3)), id="header of numbers"),
        pytest.param(_npz(header=np.array(7)), id="header of one number"),
        pytest.param(_npz(header=_header("{}")), id="header of nothing"),
        pytest.param(_npz(header=_header("[1, 2]")), id="header that is a list"),
        pytest.param(_npz(header=_header("{broken")), id="header that is no JSON"),
        pytest.param(_npz(header=_header("[" * 100_000)), id="header nested too deep"),
        pytest.param(_npz(header=_header('{"format": "kinespace motion library"}')), id="header without version"),
        pytest.param(_npz(header=_header('{"format": "kinespace motion library", "version": 2}')), id="no digest"),
        pytest.param(_zip(**{"readme.txt": b"hello"}), id="zip"),
        pytest.param(_zip(header=b"hello", digest=b"hello"), id="zip with our names"),
        pytest.param(_zip(**{"header.npy": b"\x93NUMPY\x01\x00"}), id="zip with half an array"),
    ],
)
def test_a_foreign_file_is_refused(tmp_path: Path, foreign: bytes) -> None:
    """A file of another kind, however near, is refused by name."""
    _assert_refused(tmp_path / "foreign.npz", foreign)


@pytest.mark.parametrize("place", ["alone", "header", "digest", "means"])
def test_nothing_is_unpickled(content: bytes, tmp_path: Path, place: str) -> None:
    """A pickle, alone or in place of a part, is refused without running what is in it."""
    mark = tmp_path / "mark"
    trap = _Trap(mark)
    pickle.loads(pickle.dumps(trap))  # noqa: S301 - shows that the trap is set
    assert mark.exists()
    mark.unlink()
    with np.load(io.BytesIO(content), allow_pickle=False) as stored:
        parts: dict[str, object] = dict(stored)
    parts[place] = np.array([trap], dtype=object)
    _assert_refused(tmp_path / "trap.npz", pickle.dumps(trap) if place == "alone" else _npz(**parts))
    assert not mark.exists()


@pytest.mark.parametrize(("version", "said"), [(1, "1"), (99, "99"), (0, "0"), ("2", "2"), (None, "None")])
def test_another_version_is_refused(small_library: MotionLibrary, tmp_path: Path, version: object, said: str) -> None:
    """A file of a newer or unknown format version is refused, saying which it is and which are read."""
    path = tmp_path / "library.npz"
    small_library.save(path)
    header, arrays = libraryfile.read(path)
    libraryfile.write(path, {**header, "version": version}, arrays)
    with pytest.raises(LibraryFileError, match=re.escape(f"{path}: format version {said}, this kinespace reads 2")):
        MotionLibrary.load(path)


def test_a_changed_number_is_noticed(content: bytes, tmp_path: Path) -> None:
    """A file put together anew with one number changed does not fit its digest."""
    with np.load(io.BytesIO(content), allow_pickle=False) as stored:
        parts = dict(stored)
    path = tmp_path / "library.npz"
    path.write_bytes(_npz(**parts))
    assert len(MotionLibrary.load(path)) == 18
    parts["axes"][3, 5] += 1e-6
    path.write_bytes(_npz(**parts))
    with pytest.raises(LibraryFileError, match=re.escape(f"{path}: changed since it was written")):
        MotionLibrary.load(path)


@pytest.mark.parametrize("change", [("licence", "CC0", "none"), ("skeleton", "root", "toor")])
def test_a_changed_word_is_noticed(content: bytes, tmp_path: Path, change: tuple[str, str, str]) -> None:
    """A file put together anew with another licence or joint in its header does not fit its digest."""
    _, old, new = change
    with np.load(io.BytesIO(content), allow_pickle=False) as stored:
        parts = dict(stored)
    text = bytes(parts["header"]).decode()
    assert old in text
    path = tmp_path / "library.npz"
    path.write_bytes(_npz(**{**parts, "header": _header(text.replace(old, new, 1))}))
    with pytest.raises(LibraryFileError, match=re.escape(f"{path}: changed since it was written")):
        MotionLibrary.load(path)


def test_a_file_that_is_not_there_is_an_os_error(tmp_path: Path) -> None:
    """A file that cannot be opened is the system's error, which names it, and no library error."""
    with pytest.raises(FileNotFoundError, match=r"absent\.npz"):
        MotionLibrary.load(tmp_path / "absent.npz")
    with pytest.raises(OSError, match=re.escape(tmp_path.name)):
        MotionLibrary.load(tmp_path)


# --- a header at odds with its arrays ----------------------------------------------------------------------------


def _without(*path: str) -> Callable[[dict[str, Any], dict[str, Any]], None]:
    def change(header: dict[str, Any], _arrays: dict[str, Any]) -> None:
        for step in path[:-1]:
            header = header[step]
        del header[path[-1]]

    return change


def _setting(*path: str | int, to: object) -> Callable[[dict[str, Any], dict[str, Any]], None]:
    def change(header: dict[str, Any], _arrays: dict[str, Any]) -> None:
        place: Any = header
        for step in path[:-1]:
            place = place[step]
        place[path[-1]] = to

    return change


def _array(name: str, make: Callable[[np.ndarray], np.ndarray]) -> Callable[[dict[str, Any], dict[str, Any]], None]:
    def change(_header: dict[str, Any], arrays: dict[str, Any]) -> None:
        arrays[name] = make(arrays[name])

    return change


#: Numbers and words are not told apart when a header is read.


@pytest.mark.parametrize(
    "change",
    [
        *(pytest.param(_without(key), id=f"no {key}") for key in ("skeleton", "motions", "licence", "attribution")),
        *(pytest.param(_without("skeleton", key), id=f"no {key}") for key in ("joints", "parents", "with_segments")),
        pytest.param(_setting("motions", to=[]), id="motions without entries"),
        pytest.param(_setting("motions", to=5), id="motions a number"),
        pytest.param(_setting("motions", to="wave"), id="motions a word"),
        pytest.param(_setting("motions", 0, to=None), id="a motion of nothing"),
        pytest.param(_setting("motions", 0, to={}), id="a motion without entries"),
        pytest.param(_setting("motions", 0, "colour", to="red"), id="a motion with one entry more"),
        pytest.param(_setting("motions", 0, "class_name", to=""), id="a motion without class"),
        pytest.param(_setting("motions", 0, "class_name", to=None), id="a class that is nothing"),
        pytest.param(_setting("motions", 0, "class_name", to=["bow"]), id="a class that is a list"),
        pytest.param(_setting("skeleton", to="stick"), id="skeleton a word"),
        pytest.param(_setting("skeleton", "joints", to=None), id="joints nothing"),
        pytest.param(_setting("skeleton", "joints", to=["root"] * 6), id="joints alike"),
        pytest.param(_setting("skeleton", "joints", to=["a", "b"]), id="fewer joints"),
        pytest.param(_setting("skeleton", "parents", to=[-1]), id="fewer parents"),
        pytest.param(_setting("skeleton", "parents", to=["root"] * 6), id="parents by name"),
        pytest.param(_setting("skeleton", "with_segments", to=False), id="other pairs"),
        pytest.param(_array("means", lambda means: means[1:]), id="a mean missing"),
        pytest.param(_array("axes", lambda axes: axes[:, 1:]), id="a pair missing"),
        pytest.param(_array("deviations", lambda deviations: deviations.T), id="deviations turned"),
        pytest.param(_array("axes", lambda axes: axes * np.nan), id="axes of NaN"),
        pytest.param(_array("means", lambda means: means / 0.0), id="means of infinity"),
        pytest.param(lambda _header, arrays: arrays.pop("axes"), id="no axes"),
        pytest.param(_setting("motions", 0, "class_name", to=7), id="a class that is a number"),
        pytest.param(_setting("motions", 0, "frames", to="many"), id="frames a word"),
        pytest.param(_setting("motions", 0, "frame_rate", to=0), id="no frame rate"),
        pytest.param(_setting("skeleton", "joints", to=[1, 2, 3, 4, 5, 6]), id="joints numbers"),
        pytest.param(_setting("licence", to=None), id="licence nothing"),
    ],
)
@pytest.mark.filterwarnings("ignore:divide by zero:RuntimeWarning")
def test_a_header_at_odds_with_its_arrays_is_refused(
    small_library: MotionLibrary, tmp_path: Path, change: Callable[[dict[str, Any], dict[str, Any]], None]
) -> None:
    """A file whose digest fits but whose parts do not fit each other is refused by name."""
    path = tmp_path / "library.npz"
    small_library.save(path)
    header, arrays = libraryfile.read(path)
    change(header, arrays)
    libraryfile.write(path, header, arrays)
    with pytest.raises(LibraryFileError, match=re.escape(f"{path}: not a usable motion library (")):
        MotionLibrary.load(path)


# --- windows -----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def windowed_library() -> MotionLibrary:
    clips = [stick_clip(name, seed=seed, frames=130, actor=actor) for name in STICK_CLASSES for seed, actor in PEOPLE]
    return MotionLibrary.of_clips(clips, comparison=Comparison.learned(clips))


PEOPLE = ((1, "aa"), (2, "bb"), (3, "aa"))


def _without_array(name: str) -> Callable[[dict[str, Any], dict[str, Any]], None]:
    def change(_header: dict[str, Any], arrays: dict[str, Any]) -> None:
        del arrays[name]

    return change


def _not_finite(array: np.ndarray, number: float = np.nan) -> np.ndarray:
    changed = array.copy()
    changed.flat[1] = number
    return changed


def _partly_infinite(array: np.ndarray) -> np.ndarray:
    return np.append(array[:-1], np.float32(np.inf))


LEARNED = ("spread250", "spread1000", "posture125")
WINDOW_ARRAYS = (
    *("window_motions", "basis", "basis_weights", "body_stretches"),
    *("window_vectors0", "window_vectors1", "window_vectors2"),
    *(
        f"{name}_{part}"
        for name in ("spread250", "spread1000", "shape2000", "posture125")
        for part in ("origin", "axes")
    ),
)
#: What only a comparison has that was learned, not made for fewer joints.
LEARNED_ARRAYS = tuple(f"{name}_{part}" for name in LEARNED for part in ("together", "spare"))


def test_windows_are_kept_in_half_precision(windowed_library: MotionLibrary, tmp_path: Path) -> None:
    """A file with windows holds their arrays as float16 and the motions' as float32, and nothing else."""
    windowed_library.save(tmp_path / "library.npz")
    _, arrays = libraryfile.read(tmp_path / "library.npz")
    expected = {*NAMES, *WINDOW_ARRAYS, *LEARNED_ARRAYS, "window_thresholds", "shape1000_origin", "shape1000_axes"}
    assert set(arrays) == expected
    single = {*NAMES, "window_motions", "window_thresholds", "body_stretches"}
    assert {name for name, array in arrays.items() if array.dtype == "<f4"} == single
    assert {name for name, array in arrays.items() if array.dtype == "<f2"} == set(arrays) - single


def test_a_restricted_library_keeps_nothing_learned_together(windowed_library: MotionLibrary, tmp_path: Path) -> None:
    """A library restricted to fewer joints has the same arrays but for what varies together, and loads."""
    restricted = windowed_library.restricted_to(["root", "head", "left", "right", "foot"])
    restricted.save(tmp_path / "library.npz")
    header, arrays = libraryfile.read(tmp_path / "library.npz")
    shown = {name for name in arrays if "shown" in name}
    assert set(arrays) - shown == {*NAMES, *WINDOW_ARRAYS, "window_thresholds", "shape1000_origin", "shape1000_axes"}
    assert {"directions_shown", "shown_window_vectors0", "shown_window_thresholds", "shown_shape1000_axes"} < shown
    assert not any(name.endswith(("_together", "_spare")) for name in arrays)
    assert header["windows"]["body_scale"] != 1.0
    assert not (arrays["body_stretches"] == 1.0).all()
    loaded = MotionLibrary.load(tmp_path / "library.npz").windows
    assert loaded is not None
    assert not loaded.comparison.can_be_restricted


def test_a_library_without_windows_is_one(small_library: MotionLibrary, tmp_path: Path) -> None:
    """A file that says nothing of windows is read as a library of whole motions."""
    small_library.save(tmp_path / "library.npz")
    header, arrays = libraryfile.read(tmp_path / "library.npz")
    assert "windows" not in header
    assert set(arrays) == set(NAMES)
    assert MotionLibrary.load(tmp_path / "library.npz").windows is None


@pytest.mark.parametrize(
    "change",
    [
        *(pytest.param(_without_array(name), id=f"no {name}") for name in WINDOW_ARRAYS),
        *(pytest.param(_array(name, lambda array: array[:-1]), id=f"{name} shorter") for name in WINDOW_ARRAYS),
        *(pytest.param(_array(name, np.ravel), id=f"{name} flat") for name in WINDOW_ARRAYS if "axes" in name),
        *(pytest.param(_array(name, lambda array: array[..., None]), id=f"{name} deeper") for name in WINDOW_ARRAYS),
        *(pytest.param(_array(name, lambda array: array[:0]), id=f"{name} empty") for name in WINDOW_ARRAYS),
        *(pytest.param(_array(name, _not_finite), id=f"{name} NaN") for name in WINDOW_ARRAYS),
        *(
            pytest.param(_array(name, lambda array: _not_finite(array, -np.inf)), id=f"{name} infinite")
            for name in WINDOW_ARRAYS
        ),
        *(pytest.param(_array(name, lambda array: array[:-1]), id=f"{name} shorter") for name in LEARNED_ARRAYS),
        *(pytest.param(_array(name, lambda array: array[..., None]), id=f"{name} deeper") for name in LEARNED_ARRAYS),
        *(pytest.param(_array(name, _not_finite), id=f"{name} NaN") for name in LEARNED_ARRAYS),
        *(pytest.param(_without_array(f"{name}_spare"), id=f"no {name}_spare") for name in LEARNED),
        *(pytest.param(_array(f"{name}_spare", np.zeros_like), id=f"{name}_spare zero") for name in LEARNED),
        pytest.param(_array("spread250_together", lambda array: array[:, 1:]), id="together of fewer numbers"),
        pytest.param(_array("basis_weights", lambda weights: -weights), id="pairs weighing less than nothing"),
        pytest.param(_array("body_stretches", np.zeros_like), id="a body without ways"),
        pytest.param(_array("body_stretches", lambda stretches: -stretches), id="ways shorter than nothing"),
        pytest.param(_without("windows", "body_scale"), id="no body's size"),
        *(
            pytest.param(_setting("windows", "body_scale", to=scale), id=f"a body's size {scale}")
            for scale in (0, -1.0, float("nan"), float("inf"), "large", None, [1.0])
        ),
        pytest.param(_array("window_thresholds", lambda array: array[::-1]), id="thresholds descending"),
        pytest.param(_array("window_thresholds", _partly_infinite), id="a threshold infinite"),
        pytest.param(_without_array("window_thresholds"), id="no thresholds"),
        pytest.param(_array("window_thresholds", lambda array: array[:-1]), id="a threshold missing"),
        pytest.param(_array("window_thresholds", lambda array: array[..., None]), id="thresholds deeper"),
        pytest.param(_array("window_thresholds", _not_finite), id="a threshold NaN"),
        pytest.param(_array("basis", lambda basis: basis[:, 1:]), id="a direction missing"),
        pytest.param(_array("spread1000_axes", lambda axes: axes[:, 1:]), id="an axis missing"),
        pytest.param(_array("window_vectors1", lambda vectors: vectors[:, 1:]), id="a number missing"),
        pytest.param(_array("window_motions", lambda motions: motions + 1), id="motions beyond"),
        pytest.param(_array("window_motions", lambda motions: motions - 1), id="motions below"),
        pytest.param(_array("window_motions", lambda motions: motions + np.float32(0.5)), id="motions by halves"),
        pytest.param(_array("window_motions", lambda motions: motions[::-1]), id="motions backwards"),
        pytest.param(_array("window_motions", lambda motions: motions * 0), id="one motion's windows"),
        pytest.param(_setting("windows", to=[]), id="windows a list"),
        pytest.param(_setting("windows", to="many"), id="windows a word"),
        pytest.param(_setting("windows", to={}), id="windows without entries"),
        pytest.param(_without("windows", "further"), id="nothing said of fewer joints"),
        *(
            pytest.param(_setting("windows", "further", to=further), id=f"further by {further}")
            for further in (-0.1, float("nan"), float("inf"), "much", None, [0.1])
        ),
        pytest.param(_setting("windows", "shown", to={}), id="shown without entries"),
        pytest.param(_setting("windows", "shown", to=3), id="shown a number"),
        pytest.param(_without("windows", "groups"), id="no groups"),
        pytest.param(_without("windows", "outside"), id="no weights"),
        pytest.param(_without("windows", "outside", "shape1000"), id="a weight missing"),
        pytest.param(_setting("windows", "outside", to=5), id="weights a number"),
        pytest.param(_setting("windows", "outside", "shape1000", to="much"), id="a weight a word"),
        pytest.param(_setting("windows", "outside", "shape1000", to=-1), id="a weight below 0"),
        pytest.param(_setting("windows", "outside", "shape1000", to=float("inf")), id="a weight infinite"),
        pytest.param(_setting("windows", "outside", "shape1000", to=10**400), id="a weight without bounds"),
        pytest.param(_setting("windows", "groups", to=[]), id="groups without entries"),
        pytest.param(_setting("windows", "groups", to=3), id="groups a number"),
        pytest.param(_setting("windows", "groups", 0, to=[]), id="a group of nothing"),
        pytest.param(_setting("windows", "groups", 0, to=[["spread", 1.0]]), id="a group without weight"),
        pytest.param(_setting("windows", "groups", 0, to=[["spread", 3.0, 1.0]]), id="another length"),
        pytest.param(_setting("windows", "groups", 0, to=[["colour", 1.0, 1.0]]), id="another kind"),
        pytest.param(_setting("windows", "groups", 0, to=[["spread", 1.0, -1.0]]), id="weighing less than nothing"),
        pytest.param(_setting("skeleton", "parents", to=[]), id="no parents"),
        pytest.param(_setting("skeleton", "parents", to=[-1, 2, 1, 1, 1, 0]), id="parents in a circle"),
    ],
)
def test_broken_windows_are_refused(
    windowed_library: MotionLibrary, tmp_path: Path, change: Callable[[dict[str, Any], dict[str, Any]], None]
) -> None:
    """A file whose windows are missing, of another shape, not finite or at odds with the rest is refused by name."""
    path = tmp_path / "library.npz"
    windowed_library.save(path)
    header, arrays = libraryfile.read(path)
    change(header, arrays)
    libraryfile.write(path, header, arrays)
    with pytest.raises(LibraryFileError, match=re.escape(f"{path}: not a usable motion library (")):
        MotionLibrary.load(path)


@pytest.mark.parametrize(
    "change",
    [
        pytest.param(_setting("windows", "shown", to={}), id="shown without entries"),
        pytest.param(_without_array("directions_shown"), id="no directions"),
        pytest.param(_array("directions_shown", lambda array: array[:-1]), id="a direction shorter"),
        pytest.param(_array("directions_shown", lambda array: array[:, :-1]), id="a direction missing"),
        pytest.param(_array("directions_shown", _not_finite), id="a direction NaN"),
        pytest.param(_without_array("shown_window_vectors0"), id="no vectors shown"),
        pytest.param(_array("shown_window_motions", np.zeros_like), id="other motions shown"),
        pytest.param(_array("shown_spread1000_axes", lambda axes: axes[:, 1:]), id="an axis missing"),
    ],
)
def test_broken_windows_of_fewer_joints_are_refused(
    windowed_library: MotionLibrary, tmp_path: Path, change: Callable[[dict[str, Any], dict[str, Any]], None]
) -> None:
    """A file of a library restricted to fewer joints, whose windows shown do not fit the others, is refused by name."""
    path = tmp_path / "library.npz"
    windowed_library.restricted_to(windowed_library.skeleton.joints[:5]).save(path)
    header, arrays = libraryfile.read(path)
    libraryfile.write(path, header, arrays)
    assert MotionLibrary.load(path).windows is not None
    change(header, arrays)
    libraryfile.write(path, header, arrays)
    with pytest.raises(LibraryFileError, match=re.escape(f"{path}: not a usable motion library (")):
        MotionLibrary.load(path)


def test_a_damaged_file_with_windows_is_refused(windowed_library: MotionLibrary, tmp_path: Path) -> None:
    """Cut short, or with a stretch overwritten, at any of some hundred places, a file with windows is refused."""
    path = tmp_path / "library.npz"
    windowed_library.save(path)
    content = path.read_bytes()
    step = len(content) // 60
    for place in range(0, len(content) - 64, step):
        _assert_refused(path, content[:place])
        _assert_refused(path, content[:place] + b"\xff" * 64 + content[place + 64 :])
