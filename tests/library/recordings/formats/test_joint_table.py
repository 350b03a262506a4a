from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from kinespace.library.recordings.formats.joint_table import JointTableError, is_joint_table, read_clip

if TYPE_CHECKING:
    from pathlib import Path

HEADER = "time,a_x,a_y,a_z,b_x,b_y,b_z\n"


def _written(folder: Path, text: str, name: str = "take.csv") -> Path:
    file = folder / name
    file.write_text(text)
    return file


def _rows(times: list[float]) -> str:
    return "".join(f"{time},{time},0,1,0.5,{2 * time},2\n" for time in times)


def test_times_positions_and_names_are_read(tmp_path: Path) -> None:
    """A frame's index tells its time; columns may come in any order, and others are passed over."""
    text = "frame,b_z,b_x,b_y,a_x,a_y,a_z,time\n" + "".join(
        f"{n},2,0.5,{n / 25},{n / 50},0,1,{10 + n / 50}\n" for n in range(5)
    )
    clip = read_clip(_written(tmp_path, text))
    assert clip.skeleton.joints == ("b", "a")
    assert clip.frame_rate == 50
    assert clip.name == "take"
    np.testing.assert_allclose(clip.positions[3], [[0.5, 3 / 25, 2], [3 / 50, 0, 1]])


def test_semicolons_and_decimal_commas_are_read(tmp_path: Path) -> None:
    """A table as spreadsheets write it where the comma is decimal is the same table."""
    commas, semicolons = tmp_path / "a.csv", tmp_path / "b.csv"
    commas.write_text("time,a_x,a_y,a_z,b_x,b_y,b_z\n0,0,1.5,0,1,2,3\n0.1,0,1.25,0,1,2,3\n")
    semicolons.write_text(commas.read_text().replace(",", ";").replace(".", ","))
    assert is_joint_table(semicolons)
    assert np.array_equal(read_clip(semicolons).positions, read_clip(commas).positions)


def test_uneven_times_are_put_on_an_even_grid(tmp_path: Path) -> None:
    """Positions that grow with time grow with it on the grid too, whenever the frames came."""
    jitter = np.random.default_rng(1).uniform(-0.004, 0.004, 60)
    clip = read_clip(_written(tmp_path, HEADER + _rows((np.arange(60) / 30 + jitter).tolist())))
    assert clip.frame_rate == 30
    np.testing.assert_allclose(np.diff(clip.positions[:, 0, 0]), 1 / 30, atol=1e-9)


def test_milliseconds_are_detected_by_the_time_between_frames(tmp_path: Path) -> None:
    """A column of milliseconds is read as seconds: no body is filmed once in ten seconds."""
    clip = read_clip(_written(tmp_path, "timestamp" + HEADER[4:] + _rows([0, 20, 40, 60])))
    assert clip.frame_rate == 50


def test_freemocap_has_no_times_and_millimetres(tmp_path: Path) -> None:
    """Joints are named after the body's part, empty fields are joints not seen, on straight lines."""
    text = "body_nose_x,body_nose_y,body_nose_z,body_left_hip_x,body_left_hip_y,body_left_hip_z\n"
    text += "0,0,1600,0,0,900\n,,,0,0,900\n20,0,1600,0,0,900\n"
    clip = read_clip(_written(tmp_path, text))
    assert clip.skeleton.joints == ("nose", "left_hip")
    assert clip.frame_rate == 30
    assert clip.filled == 1
    np.testing.assert_allclose(clip.positions[1], [[0.01, 0, 1.6], [0, 0, 0.9]])


def test_a_gap_is_listed(tmp_path: Path) -> None:
    """During two seconds without frames the body stays where it was last seen, and the clip lists the gap."""
    times = [*np.arange(10) / 20, *(2.45 + np.arange(10) / 20)]
    clip = read_clip(_written(tmp_path, HEADER + _rows(times)))
    assert clip.gaps == (pytest.approx((0.45, 2.45)),)
    assert clip.positions[30, 0, 0] == pytest.approx(0.45)


def test_npz_as_convert_writes_it(tmp_path: Path) -> None:
    """An .npz as `convert` writes it is read back as the same clip."""
    positions = np.random.default_rng(0).normal(size=(6, 3, 3))
    np.savez(
        tmp_path / "take.npz",
        time=np.arange(6) / 60,
        positions=positions,
        joints=np.array(["a", "b", "c"]),
        parents=np.array([-1, 0, 1]),
        performer=np.array("ann"),
    )
    clip = read_clip(tmp_path / "take.npz", joints=("a", "c"))
    assert (clip.actor, clip.skeleton.joints, clip.skeleton.parents) == ("ann", ("a", "c"), (-1, 0))
    np.testing.assert_allclose(clip.positions, positions[:, [0, 2]])


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("start_s,end_s,label\n0,1,a\n", ":1: expected columns like head_x, head_y, head_z"),
        (HEADER + "0,1\n", ":2: expected 7 fields, got 2"),
        (HEADER + "0,1,2,3,4,5,six\n", ":2: expected a number, got 'six'"),
        (HEADER + "0,1,2,3,4,5,inf\n", ":2: expected a number, got 'inf'"),
        (HEADER + _rows([0]), "expected at least 2 frames, got 1"),
        (HEADER + _rows([1, 0]), "expected at least 2 finite times that do not fall"),
        (HEADER + _rows([1, 1]), "expected at least 2 different times"),
        (HEADER + "0,1,2,3,,,\n0.1,1,2,3,,,\n", "'b' is missing"),
        ("", ":1: expected columns"),
    ],
)
def test_an_unusable_table_is_refused_in_one_line(tmp_path: Path, text: str, told: str) -> None:
    """The error says what was expected."""
    with pytest.raises(JointTableError, match=told) as raised:
        read_clip(_written(tmp_path, text))
    assert "\n" not in str(raised.value)
    assert "take.csv" in str(raised.value)


def test_tables_labels_and_libraries_are_told_apart(tmp_path: Path) -> None:
    """A table of joints is told from a labels file and from a motion library."""
    assert is_joint_table(_written(tmp_path, HEADER))
    assert not is_joint_table(_written(tmp_path, "start_s,end_s,label\n", "labels.csv"))
    assert not is_joint_table(_written(tmp_path, "not a zip", "library.npz"))
    with pytest.raises(JointTableError, match="not a table of joints"):
        read_clip(tmp_path / "library.npz")
