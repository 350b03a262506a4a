"""The motion library: made of clips, changed, merged, and the one that comes with the package."""

import dataclasses
import io
import json
import pickle
import re
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from synthetic import STICK, STICK_CLASSES, stick_clip, stick_clips

from kinespace.library import Clip, LibraryFileError, MotionLibrary, Skeleton, SkeletonMismatchError, library_file
from kinespace.library.naming import Naming, hdm05

SAID = ("name", "class_name", "actor", "take", "source", "licence", "attribution", "frame_rate")


def _assert_equal(first: MotionLibrary, second: MotionLibrary) -> None:
    assert first.skeleton == second.skeleton
    assert len(first) == len(second)
    for one, another in zip(first.motions, second.motions, strict=True):
        assert [getattr(one, name) for name in SAID] == [getattr(another, name) for name in SAID]
        assert np.array_equal(one.positions, another.positions)


def _shuffled(clip: Clip, seed: int = 5, *, parents: bool = True) -> Clip:
    """Give the same clip with its joints, and their parents, in another order."""
    order = np.random.default_rng(seed).permutation(len(clip.skeleton.joints))
    places = np.argsort(order)
    above = [clip.skeleton.parents[index] for index in order] if parents else []
    skeleton = Skeleton(
        tuple(clip.skeleton.joints[index] for index in order),
        tuple(-1 if each < 0 else int(places[each]) for each in above),
    )
    return dataclasses.replace(clip, skeleton=skeleton, positions=clip.positions[:, order])


# --- made of clips -----------------------------------------------------------------------------------------------


def test_the_order_of_hdm05s_joints_never_matters(builtin: MotionLibrary) -> None:
    """HDM05's joints in the order of the alphabet, or each clip in another, make the very same library."""
    motions = builtin.motions[::20]
    assert builtin.in_our_names(Naming()) is builtin
    mixed = MotionLibrary.of_clips([_shuffled(motion, seed) for seed, motion in enumerate(motions)])
    _assert_equal(mixed, MotionLibrary.of_clips(motions))
    unknown = MotionLibrary.of_clips([_shuffled(motion, seed, parents=False) for seed, motion in enumerate(motions)])
    assert unknown.skeleton == Skeleton(hdm05.SKELETON.joints)
    assert all(np.array_equal(a.positions, b.positions) for a, b in zip(unknown.motions, mixed.motions, strict=True))


WAVE = stick_clip("wave")
#: Clips that make no motion, and why.
REFUSED: list[tuple[Clip, str]] = [
    (stick_clip("wave", frames=2), "clip 'wave_0': expected at least 3 frames, got 2"),
    (dataclasses.replace(stick_clip("wave", frames=1), frame_rate=30.0), "expected at least 2 frames, got 1"),
    (dataclasses.replace(WAVE, class_name=""), "class_name: expected a class name for clip 'wave_0', got none"),
    *(
        (WAVE.moved_to(np.arange(18.0).reshape(6, 3) ** 1.5 + way), "expected a motion, got a body that does not move")
        for way in (np.zeros((60, 1, 1)), np.linspace(0, 5, 60)[:, None, None] * np.array([1, 0.3, 0.1]))
    ),
    (WAVE.moved_to(WAVE.positions + 1001.0), "clip 'wave_0': expected joints within 1000 m of the origin"),
    (dataclasses.replace(WAVE, frame_rate=0.5), "clip 'wave_0': expected 1 to 75 frames per second, got 0.5"),
    (
        stick_clip("wave", skeleton=Skeleton((*STICK.joints[:-1], "tail"))),
        "clip 'wave_0': expected the other recordings' 6 joints, got tail as well",
    ),
]


@pytest.mark.parametrize(("clip", "message"), REFUSED, ids=range(len(REFUSED)))
def test_a_clip_that_makes_no_motion_is_refused(clip: Clip, message: str) -> None:
    """A clip too short, still, far away, without class or of other joints is refused by name, added later too."""
    error = SkeletonMismatchError if "joints, got tail" in message else ValueError
    with pytest.raises(error, match=message):
        MotionLibrary.of_clips(iter([stick_clip("bow"), clip]))
    with pytest.raises(error, match=message):
        MotionLibrary.of_clips([stick_clip("bow")]).with_motions(iter([clip]))


def test_parts_that_do_not_fit_are_refused(sticks: MotionLibrary) -> None:
    """Motions of another skeleton, of too many frames per second or without class are refused."""
    with pytest.raises(SkeletonMismatchError, match="expected 6 joints"):
        MotionLibrary(Skeleton(STICK.joints[::-1]), sticks.motions)
    with pytest.raises(ValueError, match="expected 1 to 75 frames per second, got 120"):
        MotionLibrary(STICK, (stick_clip("bow"),))
    with pytest.raises(ValueError, match="expected at least 2 frames, got 1"):
        MotionLibrary(STICK, (sticks.motions[0].moved_to(sticks.motions[0].positions[:1]),))
    with pytest.raises(ValueError, match="class_name: expected"):
        MotionLibrary(STICK, (dataclasses.replace(sticks.motions[0], class_name=""),))
    mixed = MotionLibrary(STICK, sticks.motions[::-1])
    assert [motion.class_name for motion in mixed.motions] == [motion.class_name for motion in sticks.motions]


# --- saved -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("skeleton", [STICK, Skeleton(STICK.joints)])
def test_a_library_comes_back_from_its_file_unchanged(tmp_path: Path, skeleton: Skeleton) -> None:
    """Saved and loaded, a library has the same words and numbers."""
    words = {"actor": "Ü ß", "source": "x\ny", "licence": "CC0", "attribution": "Müller et al., „HDM05“"}
    clips = [
        dataclasses.replace(stick_clip(name, seed=seed, skeleton=skeleton), frame_rate=59.94, **words)
        for seed, name in enumerate((*STICK_CLASSES, "wave"))
    ]
    learned = {"weights": np.arange(6, dtype=np.float32).reshape(2, 3), "one": np.array(0.5, np.float32)}
    library = dataclasses.replace(MotionLibrary.of_clips(clips), learned=learned)
    library.save(tmp_path / "library.npz")
    loaded = MotionLibrary.load(tmp_path / "library.npz")
    _assert_equal(loaded, library)
    assert list(loaded.learned) == list(learned)
    assert all(np.array_equal(loaded.learned[name], learned[name]) for name in learned)
    assert not loaded.motions[0].positions.flags.writeable


# --- changed -----------------------------------------------------------------------------------------------------


def test_classes_persons_and_motions_are_left_out(sticks: MotionLibrary) -> None:
    """Classes, persons and motions are left out; all other motions stay."""
    assert sticks.without(classes=["bow", "wave"]).classes == ("jump",)
    assert sticks.without(actors=["aa"]).actors == ("bb",)
    assert sticks.without(motions=[sticks.motions[4]]).motions == (*sticks.motions[:4], *sticks.motions[5:])
    assert sticks.without().motions == sticks.motions


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda sticks: sticks.without(classes=["hop"]), "classes: expected some of bow, jump, wave, got 'hop'"),
        (lambda sticks: sticks.without(actors=["cc"]), "actors: expected some of aa, bb, got 'cc'"),
        (lambda sticks: sticks.without(motions=[stick_clip("bow")]), "motions: expected some of this library's own"),
        (lambda sticks: sticks.without(actors=["aa", "bb"]), "motions: expected at least one, got none"),
        (lambda sticks: sticks.renamed({"hop": "jump"}), "classes: expected some of bow, jump, wave, got 'hop'"),
        (lambda sticks: sticks.renamed({"bow": ""}), "expected a class name for clip"),
    ],
)
def test_changes_of_absent_classes_are_refused(
    sticks: MotionLibrary, change: Callable[[MotionLibrary], MotionLibrary], message: str
) -> None:
    """Leaving out or renaming a class that the library lacks is refused, and so is leaving out everything."""
    with pytest.raises(ValueError, match=message):
        change(sticks)


# --- merged ------------------------------------------------------------------------------------------------------


def test_a_motion_both_have_is_kept_once(sticks: MotionLibrary) -> None:
    """A motion the same in words and numbers is kept once; one that differs by a millimetre, or a take, is kept."""
    _assert_equal(sticks.merged_with(sticks), sticks)
    first = sticks.motions[0]
    moved = first.positions.copy()
    moved[3, 2, 1] += 0.001
    other = MotionLibrary(STICK, (first, first.moved_to(moved), dataclasses.replace(first, take="other")))
    assert len(sticks.merged_with(other)) == 20


# --- the built-in library ----------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_built_in_library_is_that_of_the_clips(builtin: MotionLibrary, amc_clips: tuple[Clip, ...]) -> None:
    """Built anew from the first clip of each class its motions are those in the package, to the millimetre."""
    terms = {"source": hdm05.SOURCE, "licence": hdm05.LICENCE, "attribution": hdm05.ATTRIBUTION}
    made = MotionLibrary.of_clips([dataclasses.replace(clip, **terms) for clip in amc_clips])
    names = {motion.name for motion in made.motions}
    kept = tuple(motion for motion in builtin.motions if motion.name in names)
    _assert_equal(made, dataclasses.replace(builtin, motions=kept))


#: Bytes that refusing any file here may take at most, and the motions of a file, fewer than really.
LITTLE, MAX_MOTIONS = 40_000_000, 1000


@pytest.fixture(scope="module")
def small_library() -> MotionLibrary:
    """Give a library with a licence and learned arrays."""
    clips = [dataclasses.replace(clip, licence="CC0", attribution="nobody, somewhere") for clip in stick_clips()]
    learned = {"weights": np.arange(12, dtype=np.float32).reshape(3, 4)}
    return dataclasses.replace(MotionLibrary.of_clips(clips), learned=learned)


@pytest.fixture(scope="module")
def content(small_library: MotionLibrary, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Give the bytes of a good library file."""
    path = tmp_path_factory.mktemp("good") / "small.npz"
    small_library.save(path)
    return path.read_bytes()


def _assert_refused(path: Path, content: bytes, message: str = "") -> None:
    """Expect that a file is refused by name, in one line, and without taking the memory that it claims to need."""
    path.write_bytes(content)
    tracemalloc.start()
    try:
        with pytest.raises(LibraryFileError, match=re.escape(f"{path}: ") + ".*" + re.escape(message)) as raised:
            MotionLibrary.load(path)
        assert tracemalloc.get_traced_memory()[1] < LITTLE
    finally:
        tracemalloc.stop()
    assert "\n" not in str(raised.value)


def _unpacked(content: bytes) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Take a good file apart: its header and its arrays."""
    with np.load(io.BytesIO(content), allow_pickle=False) as stored:
        arrays = dict(stored)
    return json.loads(bytes(arrays.pop("header"))), arrays


def _packed(header: object, arrays: dict[str, NDArray[Any]]) -> bytes:
    """Make a file of any content with checksums that fit."""
    file = io.BytesIO()
    np.savez_compressed(file, header=_header(json.dumps(header)), **arrays)  # type: ignore[arg-type]
    return file.getvalue()


# --- content of the file -----------------------------------------------------------------------------------------


def test_the_file_is_an_npz_without_pickle(content: bytes, small_library: MotionLibrary) -> None:
    """Numpy alone opens the file with pickle forbidden, and two sums along time give the motions' millimetres."""
    header, arrays = _unpacked(content)
    kinds = {name: array.dtype.str for name, array in arrays.items()}
    assert kinds == {"positions": "<i2", "starts": "<i4", "learned_weights": "<f4"}
    assert (header["format"], header["version"]) == ("kinespace motion library", 3)
    assert header["joints"] == list(STICK.joints)
    frames = header["motions"]["frames"]
    summed = arrays["positions"].astype(np.int64).cumsum(axis=2).cumsum(axis=2).astype(np.int16)
    end = 0
    for motion, start, count in zip(small_library.motions, arrays["starts"], frames, strict=True):
        millimetres = summed[:, :, end : end + count].transpose(2, 0, 1) + start
        np.testing.assert_array_equal(millimetres, np.round(motion.positions * 1000))
        end += count
    assert end == summed.shape[2]


# --- saving is atomic --------------------------------------------------------------------------------------------


def test_ctrl_c_while_saving_changes_nothing(tmp_path: Path, content: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    """The old file is untouched, and no half of a new one is left; `test_whichever_write_fails` lets each fail."""

    def interrupted(file: io.BufferedWriter, **_: object) -> None:
        file.write(b"PK\x03\x04 half of a file")
        raise KeyboardInterrupt

    path = tmp_path / "library.npz"
    path.write_bytes(content)
    monkeypatch.setattr(np, "savez_compressed", interrupted)
    with pytest.raises(KeyboardInterrupt):
        MotionLibrary.of_clips(stick_clips(takes=1)).save(path)
    assert [*tmp_path.iterdir()] == [path]
    assert path.read_bytes() == content


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


FOREIGN = (
    *(b"", b"motions: none\n", b'{"format": "kinespace motion library", "version": 3}'),
    np.random.default_rng(2).bytes(2048),
    *(_npy(np.zeros((3, 4))), _npy(np.array([{}, None], dtype=object))),
    *(_npz(weights=np.zeros(3)), _npz(), _npz(header=np.zeros(3)), _npz(header=np.array(7))),
    *(_npz(header=_header(text)) for text in ("{}", "[1, 2]", "{broken", "[" * 100_000)),
    _npz(header=_header('{"format": "kinespace motion library"}')),
    _npz(header=_header('{"format": "kinespace motion library", "version": 3}')),
    *(_zip(**{"readme.txt": b"hello"}), _zip(**{"header.npy": b"hello", "positions.npy": b"hello"})),
    _zip(**{"header.npy": b"\x93NUMPY\x01\x00"}),
)


@pytest.mark.parametrize("foreign", FOREIGN, ids=range(len(FOREIGN)))
def test_a_foreign_file_is_refused(tmp_path: Path, foreign: bytes) -> None:
    """A file of another kind, even a similar one, is refused by name."""
    _assert_refused(tmp_path / "foreign.npz", foreign)


def test_guests_of_an_older_file_are_left_out(content: bytes, small_library: MotionLibrary, tmp_path: Path) -> None:
    """The last motions of such a file are its guests: a warning counts them, and the others come back."""
    (header, arrays), path = _unpacked(content), tmp_path / "library.npz"
    path.write_bytes(_packed({**header, "guests": 2}, arrays))
    with pytest.warns(FutureWarning, match="2 guests of an older file are left out"):
        loaded = MotionLibrary.load(path)
    assert [each.name for each in loaded.motions] == [each.name for each in small_library.motions[:-2]]


@pytest.mark.parametrize("place", ["alone", "header", "positions", "learned_weights"])
def test_nothing_is_unpickled(content: bytes, tmp_path: Path, place: str) -> None:
    """A pickle, alone or in place of a part, is refused and its code does not run."""
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


# --- other versions ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("version", "said"), [(1, "1"), (99, "99"), (0, "0"), ("3", "3"), (None, "None"), (10**400, "1" + "0" * 19)]
)
def test_another_version_is_refused(content: bytes, tmp_path: Path, version: object, said: str) -> None:
    """A file of another format version, with any arrays, is refused in one line: both versions, and how to build it."""
    header, _ = _unpacked(content)
    other, path = _packed({**header, "version": version}, {"means": np.zeros((18, 15))}), tmp_path / "library.npz"
    expected = f"format version {said}, this kinespace reads 3; build the library again from its recordings: "
    _assert_refused(path, other, f"{expected}kinespace build FOLDER -o {path}")


# --- crafted files -----------------------------------------------------------------------------------------------


#: Stands for no entry.
GONE = object()


def _said(*keys: str | int, to: object) -> Callable[..., None]:
    """Make a change of one of the header's entries."""

    def change(header: Any, _arrays: dict[str, Any]) -> None:  # noqa: ANN401 - an object, then a list
        for key in keys[:-1]:
            header = header[key]
        header[keys[-1]] = to
        if to is GONE:
            del header[keys[-1]]

    return change


def _array(name: str, made: Callable[[NDArray[Any]], NDArray[Any]] | None) -> Callable[..., None]:
    """Make a change of an array, or leave it out; one that is not there is made of `starts`."""

    def change(_header: dict[str, Any], arrays: dict[str, Any]) -> None:
        array = arrays.pop(name, arrays["starts"])
        if made:
            arrays[name] = made(array)

    return change


def _far(starts: NDArray[Any]) -> NDArray[Any]:
    return np.where(np.arange(len(starts))[:, None] == 3, np.int32(-(2**31)), starts)


def _wandering(steps: NDArray[Any]) -> NDArray[Any]:
    steps = steps.astype(np.int32)
    steps[2, 1, 40] = 2**30
    return steps


def _many(header: dict[str, Any], arrays: dict[str, Any]) -> None:
    """Repeat the fields of one motion for a motion more than there may be."""
    count = MAX_MOTIONS + 1
    header["motions"] = {name: [column[0]] * count for name, column in header["motions"].items()}
    header["motions"]["frames"] = [2] * count
    arrays["starts"] = np.zeros((count, 3), np.int32)
    arrays["positions"] = np.zeros((6, 3, 2 * count), np.int16)


def _long(header: dict[str, Any], _arrays: dict[str, Any]) -> None:
    """Say of each motion that it lasts as long as all may together."""
    header["motions"]["frames"] = [library_file.MAX_COORDINATES] * len(header["motions"]["frames"])


def _not_finite(array: NDArray[Any]) -> NDArray[Any]:
    return np.where(array == 5, np.float32("nan"), array)


KINDS: dict[str, Callable[[NDArray[Any]], NDArray[Any]]] = {
    "float": lambda array: array.astype(np.float64),
    "unsigned": lambda array: array.astype(np.uint16),
    "backwards": lambda array: array.astype(">i4"),
    "Fortran's": np.asfortranarray,
    "flat": np.ravel,
    "shorter": lambda array: array[..., :-1],
    "none": lambda array: array[:0],
    "complex": lambda array: array.astype(np.complex64),
    "records": lambda array: array.astype([("x", "<i4")]),
}
CRAFTED: list[tuple[Callable[..., None], str]] = [
    (_said("joints", to=[f"j{n}" for n in range(20_000)]), "of length <= 512 - at `$.joints`"),
    (_said("joints", to=list(STICK.joints[:5])), "parents: expected one per joint (5)"),
    (_said("joints", to=["a"] * 6), "joints: expected distinct"),
    *((_said("joints", to=to), "at `$.joints") for to in ([1, 2, 3, 4, 5, 6], "abcdef")),
    (_said("parents", to=[1, 2, 0, -1, 3, 3]), "parents: expected no joint above itself"),
    *((_said("parents", to=to), "parents: expected") for to in ([-1, 0, 10**400, 0, 0, 0], [-1, 0])),
    (_said("motions", "frames", 0, to=10**400), "Expected `int` <= 100000000 - at `$.motions.frames[0]`"),
    *((_said("motions", "frames", 0, to=to), "") for to in (0, 1, -24, 2.5, True, None, "24", float("nan"), 10**9)),
    (_long, "frames: expected at most 100000000 coordinates"),
    (_said("motions", "frames", 0, to=23), "positions: expected int16"),
    (_many, f"motions: expected 1 to {MAX_MOTIONS}, got {MAX_MOTIONS + 1}"),
    *(
        (_said("motions", "frame_rate", 0, to=to), "")
        for to in (0, -60.0, 0.5, 75.1, float("nan"), float("inf"), 10**400, "60", None)
    ),
    (_said("motions", "class_name", 0, to=""), "expected a class name"),
    *((_said("motions", name, 0, to="x" * 401), "length <= 400") for name in ("class_name", "actor", "take", "name")),
    (_said("origins", 0, to=["a", "b", "x" * 4001]), "length <= 4000"),
    (_said("motions", "take", to=["1"]), "take: expected 18, one for each motion, got 1"),
    (_said("motions", "origin", 0, to=1), "origin: expected 0 to 0"),
    *((_said(name, to=to), f"`$.{name}`") for name, to in (("origins", 7), ("motions", []), ("learned", ["weights"]))),
    *((_said(name, to=GONE), f"required field `{name}`") for name in ("joints", "parents", "origins", "learned")),
    *((_said("motions", name, to=GONE), f"required field `{name}`") for name in ("frames", "name")),
    *((_array(name, np.copy), "arrays: expected exactly the arrays") for name in ("further", "learned_more")),
    *((_array(name, None), "arrays: expected exactly the arrays") for name in ("positions", "learned_weights")),
    (_array("starts", _far), "positions: expected at most 1000 m"),
    (_array("positions", _wandering), "positions: expected at most 1000 m"),
    *((_array(name, made), f"{name}: expected") for name in ("positions", "starts") for made in KINDS.values()),
    (_array("learned_weights", _not_finite), "expected finite numbers"),
    (_array("learned_weights", np.transpose), "learned_weights: expected float32"),
    *(
        (_said("learned", to={"weights": to}), f"{told}: expected at most" if told else "at `$.learned[...]")
        for to, told in (([10**400], ""), ([-3, -4], ""), ([0, 2**62], ""), ([9**7, 9], "learned"))
    ),
]


@pytest.mark.parametrize(("change", "message"), CRAFTED, ids=range(len(CRAFTED)))
def test_a_crafted_file_is_refused(
    content: bytes, tmp_path: Path, change: Callable[..., None], message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file put together anew with anything missing, added, of another kind or absurd is refused by name."""
    monkeypatch.setattr(library_file, "MAX_MOTIONS", MAX_MOTIONS)
    header, arrays = _unpacked(content)
    change(header, arrays)
    _assert_refused(tmp_path / "crafted.npz", _packed(header, arrays), message)


def _with_member(content: bytes, name: str, member: bytes) -> bytes:
    """Give a file with one array's bytes replaced, or added."""
    file = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as good, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for each in good.namelist():
            if each != name:
                archive.writestr(each, good.read(each))
        archive.writestr(name, member)
    return file.getvalue()


#: A file of some kilobytes that unpacks to this many bytes: more than may be taken.
HUGE = 60_000_000


@pytest.mark.slow
@pytest.mark.parametrize("name", ["header.npy", "positions.npy", "further.npy"])
def test_an_array_that_claims_gigabytes_is_not_unpacked(content: bytes, tmp_path: Path, name: str) -> None:
    """An array larger in the zip than the header allows is refused before memory is taken."""
    bomb = _with_member(content, name, bytes(HUGE))
    assert len(bomb) < 1_000_000
    _assert_refused(tmp_path / "bomb.npz", bomb)


def test_an_arrays_header_that_asks_for_gigabytes_is_refused(content: bytes, tmp_path: Path) -> None:
    """An array's file whose header promises more than follows is refused before memory is taken."""
    for shape in ((10**10,), (10**400,), (6, 3, 10**9), (-1, 5), (2**62, 4)):
        file = io.BytesIO()
        np.lib.format.write_array_header_1_0(file, {"descr": "<i2", "fortran_order": False, "shape": shape})
        for name in ("header", "positions", "starts"):
            _assert_refused(tmp_path / "bomb.npz", _with_member(content, f"{name}.npy", file.getvalue() + bytes(64)))


def test_a_zip_of_very_many_files_is_refused(content: bytes, tmp_path: Path) -> None:
    """A zip whose directory is long is refused before it is read: each entry would take memory."""
    file = io.BytesIO(content)
    with zipfile.ZipFile(file, "a") as archive:
        for number in range(2000):
            archive.writestr(f"{number}.npy", b"")
    _assert_refused(tmp_path / "many.npz", file.getvalue(), "not a motion library")
