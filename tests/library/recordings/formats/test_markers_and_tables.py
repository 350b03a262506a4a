"""C3D and tables of joints: the rules that no other format has; units, names and gaps."""

from pathlib import Path

import numpy as np
import pytest
from written import csv_table, write_c3d

from kinespace.library import Clip
from kinespace.library.recordings.formats import joint_table
from kinespace.library.recordings.formats.joint_choice import chosen, short_names
from kinespace.library.recordings.formats.markers import c3d
from kinespace.library.recordings.formats.units import guessed_metres, metres_of

LABELS = ("hip", "knee", "heel")
WALK = np.random.default_rng(3).uniform(0.0, 900.0, (40, 3, 3))


# --- C3D ---------------------------------------------------------------------------------------------------------


def test_results_that_are_no_positions_are_passed_over(tmp_path: Path) -> None:
    """Angles that the file lists as such and unlabelled markers are left out, unless they are named one by one."""
    positions = np.concatenate([WALK, WALK[:, :2]], axis=1)
    path = tmp_path / "walk.c3d"
    write_c3d(path, (*LABELS, "*12", "hipAngles"), positions, angles=["hipAngles"])
    assert c3d.read_clips(path)[0].skeleton.joints == LABELS
    assert c3d.read_clips(path, joints=("hip*", "knee"))[0].skeleton.joints == ("hip", "knee")
    assert c3d.read_clips(path, joints=("hipAngles", "knee"))[0].skeleton.joints == ("knee", "hipAngles")


def test_the_size_of_the_body_gives_the_unit_of_a_c3d(tmp_path: Path) -> None:
    """Where POINT:UNITS is empty the body's size tells millimetres from metres; nothing seen, nothing read."""
    for scale in (1.0, 0.001):
        write_c3d(tmp_path / "walk.c3d", LABELS, WALK * scale, unit="")
        np.testing.assert_allclose(c3d.read_clips(tmp_path / "walk.c3d")[0].positions, WALK / 1000, rtol=1e-5)
    write_c3d(tmp_path / "walk.c3d", LABELS, np.full_like(WALK, np.nan), unit="")
    with pytest.raises(ValueError, match="expected 2 markers or more that are seen, got 0 of 3"):
        c3d.read_clips(tmp_path / "walk.c3d")


# --- tables ------------------------------------------------------------------------------------------------------


def table(folder: Path, text: str, name: str = "take.csv") -> Clip:
    """Write a table and read it."""
    (folder / name).write_text(text)
    return joint_table.read_clips(folder / name)[0]


def test_uneven_times_are_put_on_an_even_grid(tmp_path: Path) -> None:
    """Positions that grow with time grow with it on the grid too, whenever the frames came; other columns go by."""
    times = np.arange(60) / 30 + np.random.default_rng(1).uniform(-0.004, 0.004, 60)
    rows = "".join(f"{n},{time},{time},0,1,2,0.5,{2 * time}\n" for n, time in enumerate(times))
    clip = table(tmp_path, "frame,time,a_x,a_y,a_z,b_z,b_x,b_y\n" + rows)
    assert clip.frame_rate == 30
    moved = np.diff(clip.positions, axis=0)
    np.testing.assert_allclose(moved, np.broadcast_to([[1 / 30, 0, 0], [0, 2 / 30, 0]], moved.shape), atol=1e-9)


def test_times_that_hardly_differ_are_none(tmp_path: Path) -> None:
    """Numbers that differ by the least a computer can tell count nothing."""
    rows = "".join(f"{number * 5e-324},0,1,{number},0,0,1\n" for number in range(5))
    assert table(tmp_path, "time,a_x,a_y,a_z,b_x,b_y,b_z\n" + rows).frame_rate == 30


def test_a_gap_is_listed(tmp_path: Path) -> None:
    """During two seconds without frames the body stays where it was last seen, and the clip lists the gap."""
    times = [*np.arange(10) / 20, *(2.45 + np.arange(10) / 20)]
    rows = "".join(f"{time},{time},0,1,0.5,{2 * time},2\n" for time in times)
    clip = table(tmp_path, "time,a_x,a_y,a_z,b_x,b_y,b_z\n" + rows)
    assert clip.gaps == (pytest.approx((0.45, 2.45)),)
    assert clip.positions[30, 0, 0] == pytest.approx(0.45)


def test_tables_labels_and_libraries_are_told_apart(tmp_path: Path) -> None:
    """A table of joints is told from a labels file and from a motion library."""
    (tmp_path / "a.csv").write_text(csv_table(("a", "b"), WALK[:, :2]))
    (tmp_path / "b.csv").write_text("start_s,end_s\n")
    np.savez(tmp_path / "library.npz", header=np.zeros(3))
    names = ("a.csv", "b.csv", "library.npz")
    assert [joint_table.is_joint_table(tmp_path / name) for name in names] == [True, False, False]


# --- the parts ---------------------------------------------------------------------------------------------------


def test_names_are_chosen_by_pattern_in_the_files_order() -> None:
    """Patterns fit whole labels or the part after the colon; the order is the file's; no match is an error."""
    labels = ["a:hip", "a:knee", "b:hip", "toe"]
    assert chosen(labels, ()) == [0, 1, 2, 3]
    assert chosen(labels, ("toe", "hip")) == [0, 2, 3]
    assert chosen(labels, ("a:*", "t?e")) == [0, 1, 3]
    with pytest.raises(ValueError, match="no joint is called 'nose'"):
        chosen(labels, ("hip", "nose"))
    assert short_names(labels[1:]) == (("knee", "hip", "toe"), [])


def test_units_are_known_by_name_and_by_number() -> None:
    """Names in any case and numbers of metres are units; all other texts are refused."""
    known = {"mm": 0.001, " CM ": 0.01, "Meters": 1.0, "0.0254": 0.0254, "feet": 0.3048, "mete": 1.0, "(mm)": 0.001}
    assert [metres_of(unit) for unit in known] == [*known.values()]
    assert [metres_of(unit) for unit in ("", "parsec", "-1", "nan", "0", "inf")] == [None] * 6
    guesses = {0.5: 1, 16.0: 1, 16.1: 0.01, 500.0: 0.01, 501.0: 0.001, 2500.0: 0.001}
    for size, metres in guesses.items():
        seen = np.array([[0.0, 0.0, 0.0], [0.0, size, 0.0], [np.nan] * 3])
        assert guessed_metres(np.stack([seen[[0, 2, 2]], seen, seen])) == metres
    assert guessed_metres(np.full((2, 3, 3), np.nan)) == 1.0
