"""Opened windows in the user's cache: the same numbers as computed ones, and only of the built-in library."""

import hashlib
import io
import os
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from kinespace.library import MotionLibrary, WindowIndex
from kinespace.library.windows import opening, remembered

pytestmark = pytest.mark.slow
SIXTEEN = MotionLibrary.builtin().skeleton.joints[:16]


@pytest.fixture
def folder(tmp_path: Path, small_library: MotionLibrary, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Use a cache of this test's own, and some motions of twenty joints in the built-in library's place."""
    few = small_library.restricted_to(small_library.skeleton.joints[:20])
    monkeypatch.setattr(remembered, "cache_folder", lambda: tmp_path)
    monkeypatch.setattr(MotionLibrary, "builtin", lambda: few)
    yield tmp_path / "windows"
    monkeypatch.undo()
    opening.opened.cache_clear()


def _opened() -> WindowIndex:
    opening.opened.cache_clear()
    return opening.opened(MotionLibrary.builtin())


def _numbers(opened: WindowIndex) -> list[np.ndarray[tuple[int, ...], np.dtype[np.generic]]]:
    courses, segments = opened.courses, opened.segments
    numbers = [*opened.vectors, opened.eigenvectors, opened.motions, opened.basis.directions]
    numbers += [metric.axes for metric in opened.comparison.parts.values()]
    numbers += [opened.rejection.typical, opened.rejection.weights, segments.mean, segments.builds]
    return [*numbers, courses.whole.courses, courses.begun.ways, courses.limits]


def test_remembered_windows_are_those_that_were_computed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second opening computes nothing, and gives the first one's numbers, bit for bit; by fewer joints, too."""
    computed, fewer = _opened(), opening.by_joints(_opened(), SIXTEEN)
    assert len(list(folder.iterdir())) == 2
    monkeypatch.setattr(WindowIndex, "of", None)
    again = _opened()
    for first, second in ((computed, again), (fewer, opening.by_joints(again, SIXTEEN))):
        assert first is not second
        assert first.classes == second.classes
        assert first.library.skeleton == second.library.skeleton
        for left, right in zip(_numbers(first), _numbers(second), strict=True):
            np.testing.assert_array_equal(left, right)


def _spoiled(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def _of_another_kind(path: Path) -> None:
    file = io.BytesIO()
    np.savez(file, described=np.array('{"Path": ["/"]}'))
    path.write_bytes(hashlib.sha256(file.getvalue()).digest() + file.getvalue())


@pytest.mark.parametrize(
    "spoil", [_spoiled, _of_another_kind, lambda path: path.write_bytes(b""), lambda path: path.chmod(0o666)]
)
def test_a_file_that_cannot_be_believed_is_made_again(folder: Path, spoil: Callable[[Path], object]) -> None:
    """A damaged file, one that would make other objects, an empty one, and one that others can write to."""
    computed = _opened()
    (path,) = folder.iterdir()
    good = path.read_bytes()
    spoil(path)
    np.testing.assert_array_equal(_opened().vectors[0], computed.vectors[0])
    assert path.read_bytes() == good
    assert not path.stat().st_mode & 0o022


@pytest.mark.parametrize("is_link", [False, True])
def test_nothing_but_our_own_files_is_deleted(folder: Path, tmp_path: Path, is_link: bool) -> None:  # noqa: FBT001 - a parameter
    """Old files of ours make room; letters stay, also where somebody has put a link to their folder."""
    letters = tmp_path / "letters" if is_link else folder
    letters.mkdir(mode=0o700)
    if is_link:
        folder.symlink_to(letters)
    names = [f"letter {number}" for number in range(30)] + ["a.txt", "new"]
    for name in (*names, *(f"{number}.windows" for number in range(30)), *(f"new-{number}" for number in range(3))):
        (letters / name).write_bytes(b"")
        os.utime(letters / name, (1e9, 1e9))
    _opened()
    left = {each.name for each in letters.iterdir()}
    assert left >= {*names}
    assert len(left) == len(names) + (33 if is_link else 12)


def test_other_peoples_motions_are_not_kept(folder: Path) -> None:
    """A library of other motions writes nothing."""
    builtin = MotionLibrary.builtin()
    others = MotionLibrary(builtin.skeleton, builtin.motions[:12])
    assert opening.opened(others).library is others
    assert not folder.exists()


def test_another_library_in_its_place_has_a_file_of_its_own(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The key names the motions: what a test or a fork puts there is never taken for the real windows."""
    real, builtin = len(_opened()), MotionLibrary.builtin()
    other = MotionLibrary(builtin.skeleton, builtin.motions[:12])
    monkeypatch.setattr(MotionLibrary, "builtin", lambda: other)
    assert len(_opened()) < real
    assert len(list(folder.iterdir())) == 2


def test_without_a_folder_windows_are_computed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A cache that cannot be written is no error."""
    monkeypatch.setattr(remembered, "cache_folder", lambda: folder / "file" / "below")
    folder.mkdir()
    (folder / "file").write_text("")
    assert len(_opened()) > 0
