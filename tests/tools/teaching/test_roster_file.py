import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from programs import PATIENCE

from kinespace.library import Clip, MotionLibrary
from kinespace.library.skeleton import Skeleton
from kinespace.library.teaching.examples import Example, Roster
from kinespace.tools.teaching.roster_file import RosterFile

#: A program that changes a roster at random; it says each change before it hands it over, and the newest one that is
#: kept.
CHANGES = """
import sys, time
from itertools import count
from pathlib import Path
import numpy as np
from kinespace.library import MotionLibrary
from kinespace.library.teaching.examples import Example, Roster
from kinespace.tools.teaching.roster_file import RosterFile

generator = np.random.default_rng(int(sys.argv[2]))
file, motion = RosterFile(Path(sys.argv[1])), MotionLibrary.builtin().motions[0]
roster, first = Roster.of_library(file.library) if file.library else Roster(), int(sys.argv[2])
for change in count(first):
    kept = roster.examples[-4:] if generator.random() < 0.1 else roster.examples
    roster = Roster((*kept, Example(change, f"c{change}", motion, 0.0, 0.2)))
    print("changed", change, flush=True)
    file.save(roster)
    time.sleep(generator.choice((0.0, 0.02, 0.1)))
    if generator.random() < 0.2:
        while file.has_unsaved:
            time.sleep(0.01)
        print("kept", change, flush=True)
"""


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
    file, saved, poured_in, save = RosterFile(tmp_path / "mine.npz"), list[str](), threading.Event(), MotionLibrary.save

    def slowly(library: MotionLibrary, path: Path) -> None:
        saved.append(library.classes[0])
        assert poured_in.wait(PATIENCE)
        save(library, path)

    monkeypatch.setattr(MotionLibrary, "save", slowly)
    for count in range(1, 1001):
        file.save(_roster(motion, f"class {count}"))
    poured_in.set()
    file.close()
    assert not file.has_unsaved
    assert len(saved) <= 2
    assert MotionLibrary.load(tmp_path / "mine.npz").classes == ("class 1000",)
    assert [each.name for each in tmp_path.iterdir()] == ["mine.npz"]


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


def test_what_a_killed_program_left_is_deleted(tmp_path: Path) -> None:
    """A part of a save is deleted when it is old; a young one may be another program's."""
    for name, age in ((".mine.npz.a.part", 100.0), (".mine.npz.b.part", 1.0), (".other.npz.a.part", 100.0)):
        (tmp_path / name).write_bytes(b"")
        os.utime(tmp_path / name, (time.time() - age,) * 2)
    RosterFile(tmp_path / "mine.npz").close()
    assert sorted(each.name for each in tmp_path.iterdir()) == [".mine.npz.b.part", ".other.npz.a.part"]


@pytest.mark.slow
def test_a_richer_library_keeps_what_is_not_touched(tmp_path: Path, motion: Clip) -> None:
    """Further joints, names, and learned numbers stay; what is undone leaves it as it was."""
    path = tmp_path / "mine.npz"
    builtin = MotionLibrary.builtin()
    classes = ("squat1Reps", "kickLFront1Reps")
    rich = builtin.without(classes=[name for name in builtin.classes if name not in classes])
    skeleton = Skeleton((*rich.skeleton.joints, "prop"))
    tip = rich.skeleton.joints.index("rhand")
    motions = tuple(
        replace(
            each, skeleton=skeleton, positions=np.concatenate([each.positions, each.positions[:, [tip]] + 0.001], 1)
        )
        for each in rich.motions
    )
    assert rich.learned is not None
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
    assert {*after.learned.named} == {*before.learned.for_other_motions().named} if before.learned else False
    before.save(path)
    assert {*_saved(path, bare).learned.named} == {*before.learned.named} if before.learned else False


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGKILL")
def test_a_program_that_is_killed_loses_no_change_that_was_kept(tmp_path: Path) -> None:
    """At random moments among changes; the file is whole each time, and the next program opens it."""
    path, generator = tmp_path / "mine.npz", np.random.default_rng(31)
    first, last_kept = 1, 0
    for _ in range(int(os.environ.get("KINESPACE_KILLS", "4"))):
        program = subprocess.Popen(
            [sys.executable, "-c", CHANGES, str(path), str(first)], stdout=subprocess.PIPE, text=True
        )
        said = [program.stdout.readline() for _ in range(generator.integers(1, 40))]
        program.send_signal(signal.SIGKILL)
        said += program.stdout.readlines()
        program.stdout.close()
        program.wait()
        numbers = {
            what: [int(line.split()[1]) for line in said if line.startswith(what) and line.endswith("\n")]
            for what in ("changed", "kept")
        }
        there = [int(name[1:]) for name in MotionLibrary.load(path).classes] if path.exists() else []
        last_kept = max([last_kept, *numbers["kept"]])
        assert max(there, default=0) >= last_kept
        first = max(numbers["changed"]) + 1
    assert last_kept > 0
