import errno
import os
import sys
import threading
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from programs import PATIENCE, until

from kinespace.library import Clip, MotionLibrary, Skeleton, library_file
from kinespace.stream.teaching import Step
from kinespace.stream.teaching.examples import Example, Roster
from kinespace.tools.cli.console import require_place_for
from kinespace.tools.teaching.lessons import RosterFile


@pytest.fixture
def motion() -> Clip:
    """Give a short motion."""
    return MotionLibrary.builtin().motions[0]


def _roster(motion: Clip, *classes: str) -> Roster:
    return Roster(tuple(Example(place, name, motion, 0.0, 0.5) for place, name in enumerate(classes, start=1)))


def _saved(path: Path, roster: Roster) -> MotionLibrary:
    with closing(RosterFile(path)) as file:
        file.save(roster)
    return MotionLibrary.load(path)


def test_the_newest_roster_is_saved_at_the_end(tmp_path: Path, motion: Clip, monkeypatch: pytest.MonkeyPatch) -> None:
    """A thousand changes that pour in while one is saved are one further save, and the last one is in the file."""
    file, write = RosterFile(tmp_path / "mine.npz"), library_file.write
    saved, poured_in = list[str](), threading.Event()

    def slowly(path: Path, contents: library_file.Contents, *, compressed: bool) -> None:
        saved.append(contents[1][0].class_name)
        assert poured_in.wait(PATIENCE)
        write(path, contents, compressed=compressed)

    monkeypatch.setattr(library_file, "write", slowly)
    for count in range(1, 1001):
        file.save(_roster(motion, f"class {count}"))
    poured_in.set()
    file.close()
    assert not file.has_unsaved
    assert len(saved) <= 2
    assert MotionLibrary.load(tmp_path / "mine.npz").classes == ("class 1000",)
    assert sorted(each.name for each in tmp_path.iterdir()) == [".mine.npz.lock", "mine.npz"]


def test_what_cannot_be_deleted_is_said_and_tried_again(
    tmp_path: Path, motion: Clip, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The thread that writes goes on when the file of no examples cannot be deleted, and it is deleted later."""
    path = tmp_path / "mine.npz"
    _saved(path, _roster(motion, "first"))
    file, unlink, refused = RosterFile(path), Path.unlink, list[Path]()

    def unwilling(path: Path, missing_ok: bool = False) -> None:  # noqa: FBT001, FBT002 - as Path's own
        if path.name == "mine.npz" and not refused:
            refused.append(path)
            raise PermissionError(errno.EACCES, "Permission denied")
        unlink(path, missing_ok=missing_ok)

    monkeypatch.setattr(Path, "unlink", unwilling)
    file.save(Roster(), asked=True)
    file.close()
    assert refused
    assert [state.step for state in file.states()] == [Step.REFUSED, Step.DONE]
    assert not path.exists()
    assert not file.has_unsaved


def test_a_second_program_is_refused(tmp_path: Path, motion: Clip) -> None:
    """One file is taught by one program at a time, also by way of a link; afterwards by another."""
    path = tmp_path / "mine.npz"
    (tmp_path / "link.npz").symlink_to(path)
    with closing(RosterFile(path)) as file:
        for name in ("mine.npz", "link.npz"):
            with pytest.raises(ValueError, match=f"{name}: another kinespace teaches there"):
                RosterFile(tmp_path / name)
        file.save(_roster(motion, "bow"))
    assert _saved(tmp_path / "link.npz", _roster(motion, "bow", "wave")).classes == ("bow", "wave")
    assert (tmp_path / "link.npz").is_symlink()


@pytest.mark.skipif(sys.platform == "win32", reason="there is no such lock")
@pytest.mark.parametrize("kind", ["link", "dangling link", "pipe", "folder"])
def test_whatever_lies_where_the_lock_is_to_be_stays_as_it_is(tmp_path: Path, kind: str) -> None:
    """In a folder where others write: nothing is followed, waited for, emptied or deleted; no program starts."""
    lock, important = tmp_path / ".mine.npz.lock", tmp_path / "important.txt"
    important.write_text("text", encoding="utf-8")
    if kind == "pipe":
        os.mkfifo(lock)
    elif kind == "folder":
        lock.mkdir()
    else:
        lock.symlink_to(important if kind == "link" else tmp_path / "nothing")
    with pytest.raises((OSError, ValueError), match=r"mine\.npz\.lock"):
        RosterFile(tmp_path / "mine.npz")
    assert important.read_text(encoding="utf-8") == "text"
    assert lock.is_symlink() or lock.exists()
    assert not (tmp_path / "nothing").exists()
    # An important file of another name is not emptied, either.
    lock.rmdir() if kind == "folder" else lock.unlink()
    os.link(important, lock)
    RosterFile(tmp_path / "mine.npz").close()
    assert important.read_text(encoding="utf-8") == "text"


def test_other_programs_that_write_a_library_ask_the_lock(tmp_path: Path, motion: Clip) -> None:
    """`build` and `learn` save a library, and every program looks first whether its output has room."""
    path, other = tmp_path / "mine.npz", MotionLibrary.of_clips([replace(motion, class_name="built")])
    with closing(RosterFile(path)) as file:
        file.save(_roster(motion, "bow"))
        with pytest.raises(ValueError, match=r"mine\.npz: another kinespace teaches there"):
            other.save(path)
        with pytest.raises(ValueError, match=r"mine\.npz: another kinespace teaches there"):
            require_place_for(path)
    assert MotionLibrary.load(path).classes == ("bow",)
    other.save(path)
    assert MotionLibrary.load(path).classes == ("built",)


def test_a_new_example_is_in_the_file_at_once(tmp_path: Path, motion: Clip, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody waits until it is quiet for what a program that is killed would lose; then the file is packed."""
    path = tmp_path / "mine.npz"
    _saved(path, _roster(motion, "bow", "wave"))
    packed = path.stat().st_size
    with closing(RosterFile(path)) as file:
        assert file.library is not None
        roster = Roster.of_library(file.library).with_example(Example(3, "kick", motion, 0.0, 0.5))
        file.save(roster)
        until(lambda: not file.has_unsaved)
        assert len(MotionLibrary.load(path)) == 3
        assert path.stat().st_size > 2 * packed
        monkeypatch.setattr("kinespace.tools.teaching.lessons._QUIET", 0.0)
        file.save(roster.renamed("bow", "dip"))
        until(lambda: path.stat().st_size < 2 * packed)
        assert MotionLibrary.load(path).classes == ("dip", "kick", "wave")
    assert sorted(each.name for each in tmp_path.iterdir()) == [".mine.npz.lock", "mine.npz"]


def test_a_file_that_loses_examples_is_kept(tmp_path: Path, motion: Clip) -> None:
    """Forgetting leaves the file as it was beside the new one, and a smaller loss does not take its place."""
    path, before = tmp_path / "mine.npz", tmp_path / "mine.before.npz"
    _saved(path, _roster(motion, "bow", "wave", "kick"))
    with closing(RosterFile(path)) as file:
        file.save(Roster())
    assert not path.exists()
    assert MotionLibrary.load(before).classes == ("bow", "kick", "wave")
    with closing(RosterFile(path)) as file:
        assert file.library is None


@pytest.mark.slow
def test_a_richer_library_keeps_what_is_not_touched(tmp_path: Path, motion: Clip) -> None:
    """Further joints, names, and learned numbers stay; what is undone leaves it as it was."""
    path = tmp_path / "mine.npz"
    builtin = MotionLibrary.builtin()
    classes = ("squat1Reps", "kickLFront1Reps")
    rich = builtin.without(classes=[name for name in builtin.classes if name not in classes])
    skeleton = Skeleton((*rich.skeleton.joints, "prop"))
    tip = rich.skeleton.joints.index("rhand")
    longer = [np.concatenate([each.positions, each.positions[:, [tip]] + 0.001], 1) for each in rich.motions]
    both = zip(rich.motions, longer, strict=True)
    motions = tuple(replace(each, skeleton=skeleton, positions=positions) for each, positions in both)
    assert rich.learned
    MotionLibrary(skeleton, motions, rich.learned).save(path)
    before = MotionLibrary.load(path)
    bare = Roster.of_library(before.restricted_to(rich.skeleton.joints))
    taught = Example(bare.next_number, "bow", motion, 0.0, 0.5)
    after = _saved(path, bare.renamed("squat1Reps", "dip").with_example(taught))
    assert after.classes == ("bow", "dip", "kickLFront1Reps")
    assert after.skeleton.joints == skeleton.joints
    kept = {each.name: each for each in after.motions if each.class_name != "bow"}
    assert kept.keys() == {each.name for each in before.motions}
    for old in before.motions:
        assert np.array_equal(old.positions, kept[old.name].positions)
        assert old.take == kept[old.name].take
    (bow,) = (each for each in after.motions if each.class_name == "bow")
    assert np.array_equal(bow.positions[:, -1], bow.positions[:, tip])
    assert {*after.learned} == {*library_file.for_other_motions(before.learned)}
    before.save(path)
    assert {*_saved(path, bare).learned} == {*before.learned}
