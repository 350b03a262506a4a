"""UTKinect's takes: frames that a depth camera skipped, wrote twice or left empty, and labels by frame numbers."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
import pytest

from kinespace.library.recordings import Reading, find_recordings, read_recordings, segments_beside
from kinespace.library.recordings.formats import utkinect
from kinespace.library.recordings.formats.labels import Segment, cut
from kinespace.library.recordings.formats.utkinect import UTKinectError
from kinespace.tools.feeding.joint_sets import joints_of

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

#: Frame numbers as the sensor gives them: every second, one twice, some left out.
NUMBERS = (10, 12, 12, 14, 20, 22)


def _line(number: object, values: Sequence[float]) -> str:
    return f"{number}   {'  '.join(f'{value:.6f}' for value in values)}  "


def _values(seed: int) -> list[float]:
    return np.round(np.random.default_rng(seed).normal(size=60), 6).tolist()


def _write(folder: Path, lines: Sequence[str], name: str = "joints_s01_e02.txt") -> Path:
    path = folder / name
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def _take(folder: Path) -> Path:
    return _write(folder, [_line(number, _values(index)) for index, number in enumerate(NUMBERS)])


def _labels(folder: Path, text: str) -> None:
    (folder / "actionLabel.txt").write_text(text, encoding="utf-8")


# --- frames ------------------------------------------------------------------------------------------------------


def test_frames_are_read_once_each(tmp_path: Path) -> None:
    """A number that stands there again is left out, the first of the two stays; x, y, z follow joint by joint."""
    frames = utkinect.read_frames(_take(tmp_path))
    assert frames.numbers.tolist() == [10, 12, 14, 20, 22]
    for positions, seed in zip(frames.positions, (0, 1, 3, 4, 5), strict=True):
        assert positions.reshape(-1).tolist() == _values(seed)


def test_a_frame_of_zeros_is_left_out(tmp_path: Path) -> None:
    """Zeros mean that nobody is in sight. An empty line is ignored."""
    lines = [_line(8, [0.0] * 60), _line(10, _values(1)), "", _line(12, [0.0] * 60), _line(14, _values(2))]
    assert utkinect.read_frames(_write(tmp_path, lines)).numbers.tolist() == [10, 14]


def test_a_clip_has_every_frame(tmp_path: Path) -> None:
    """Skipped frames are on straight lines between their neighbours, at 30 a second; actor and take are in the name."""
    clip = utkinect.read_clip(_take(tmp_path))
    assert (clip.frames, clip.frame_rate, clip.filled) == (13, 30.0, 8 * 20)
    frames = utkinect.read_frames(tmp_path / "joints_s01_e02.txt").positions
    np.testing.assert_array_equal(clip.positions[[0, 2, 4, 10, 12]], frames)
    np.testing.assert_allclose(clip.positions[6], frames[2] + (frames[3] - frames[2]) / 3)
    assert (clip.name, clip.actor, clip.take, clip.class_name) == ("joints_s01_e02", "s01", "e02", "")
    assert (clip.source, clip.licence) == ("UTKinect-Action3D", "research use, not to be passed on")
    assert "CVPRW 2012" in clip.attribution


def test_a_take_is_a_recording(tmp_path: Path) -> None:
    """Takes are found among other files by their names and read as every recording is, options and all."""
    path = _take(tmp_path)
    for name in ("actionLabel.txt", "joints.txt", "joints_s01.txt", "notes.txt"):
        (tmp_path / name).write_text("")
    assert find_recordings([tmp_path]) == [path]
    (clip,) = read_recordings([path], Reading(joints=("head", "l*"), unit="cm", frame_rate=60.0))
    left = ("lclavicle", "lhumerus", "lradius", "lhand", "lhipjoint", "lfemur", "ltibia", "ltoes")
    assert clip.skeleton.joints == ("lowerneck", "head", *left)
    assert clip.frame_rate == 60.0
    np.testing.assert_allclose(clip.positions[0, 1], np.array(_values(0)[9:12]) / 100)


def test_labels_beside_a_take_are_found(tmp_path: Path) -> None:
    """The labels of all takes count as labels beside each; a file with the take's own name goes before."""
    take = _take(tmp_path)
    assert segments_beside(take) is None
    _labels(tmp_path, "s01_e02\nwalk: 12 20\n")
    assert [each.label for each in segments_beside(take) or ()] == ["walk"]
    take.with_suffix(".csv").write_text("start_s,end_s,label\n0,1,run\n")
    assert [each.label for each in segments_beside(take) or ()] == ["run"]


def test_the_joints_are_kinects() -> None:
    """The body has the joints of the set `kinect20`: one tree from the hips, left and right hanging alike."""
    skeleton = utkinect.SKELETON
    assert skeleton.joints == joints_of("kinect20")
    parents = {name: skeleton.joints[parent] for name, parent in zip(skeleton.joints, skeleton.parents, strict=True)}
    assert skeleton.parents.count(-1) == 1
    for left in skeleton.joints:
        if left.startswith("l") and left != "lowerneck":
            above = parents[left]
            assert parents[f"r{left[1:]}"] in (above, f"r{above[1:]}")
    assert (parents["head"], parents["lclavicle"], parents["lhipjoint"]) == ("lowerneck", "lowerneck", "root")


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ([_line(1, [1.0] * 59)], ":1: expected a frame's number and 60 numbers, got '1   1.0"),
        ([_line(1, [1.0] * 60), _line(2, [1.0] * 61)], ":2: expected a frame's number and 60 numbers"),
        ([_line("one", [1.0] * 60)], ":1: expected a frame's number"),
        ([_line(1.5, [1.0] * 60)], ":1: expected a frame's number"),
        ([_line(-1, [1.0] * 60)], ":1: expected a frame's number"),
        ([_line(10**7, [1.0] * 60)], ":1: expected a frame's number"),
        ([_line("nan", [1.0] * 60)], ":1: expected a frame's number"),
        ([_line(1, [float("nan")] * 60)], ":1: expected a frame's number"),
        ([_line(4, [1.0] * 60), _line(3, [1.0] * 60)], ":2: expected a frame after 4, got 3"),
        ([_line(4, [1.0] * 60), _line(5, [0.0] * 60)], ": expected at least 2 frames with a person, got 1"),
        ([], ": expected at least 2 frames"),
    ],
)
def test_a_broken_take_is_refused(lines: list[str], message: str, tmp_path: Path) -> None:
    """A malformed frame is reported with file and line."""
    path = _write(tmp_path, lines)
    with pytest.raises(UTKinectError, match=re.escape(f"{path}{message}"[:100])):
        utkinect.read_clip(path)


def test_joints_that_kinect_lacks_are_refused(tmp_path: Path) -> None:
    """The error names a joint that Kinect 1 does not track."""
    with pytest.raises(UTKinectError, match="no joint is called 'lthumb'"):
        utkinect.read_clip(_take(tmp_path), joints=("lthumb",))


# --- labels ------------------------------------------------------------------------------------------------------


def test_labels_are_seconds_since_the_first_frame(tmp_path: Path) -> None:
    """Frame numbers become seconds; other takes' actions and actions of unknown time are left out."""
    _labels(
        tmp_path, "s01_e01\nwalk: 10 14\ns01_e02\nwalk: 10 16 \ncarry:  NaN NaN\nthrow: 19 22\ns02_e01\npush: 1 2\n"
    )
    assert utkinect.read_segments(_take(tmp_path)) == (Segment(0.0, 0.2, "walk"), Segment(0.3, 0.4, "throw"))


def test_segments_do_not_overlap(tmp_path: Path) -> None:
    """Actions are sorted by start and do not overlap; actions before the first frame are left out."""
    _labels(tmp_path, "S01_e02\npush: 16 22\npull: 10 19\nthrow: 4 8\nclap: 7 13\n")
    found = utkinect.read_segments(_take(tmp_path))
    assert [(round(30 * each.start), round(30 * each.end), each.label) for each in found] == [
        (0, 6, "pull"),
        (6, 12, "push"),
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("s01_e01\nwalk: 10 14\n", ": expected actions of s01_e02, got none"),
        ("s01_e02\ncarry: NaN NaN\n", ": expected actions of s01_e02, got none"),
        ("s01_e02\nwalk: 10\n", ":2: expected the numbers of two frames, the first before the second, got '10'"),
        ("s01_e02\nwalk: 10 9\n", ":2: expected the numbers of two frames"),
        ("s01_e02\nwalk: 1.5 9\n", ":2: expected the numbers of two frames"),
    ],
)
def test_broken_labels_are_refused(text: str, message: str, tmp_path: Path) -> None:
    """A malformed label is reported with file and line."""
    _labels(tmp_path, text)
    with pytest.raises(UTKinectError, match=re.escape(f"{tmp_path / 'actionLabel.txt'}{message}")):
        utkinect.read_segments(_take(tmp_path))


def test_a_take_without_labels_names_their_file(tmp_path: Path) -> None:
    """Without the file beside the take its name is in the error."""
    with pytest.raises(FileNotFoundError, match="actionLabel"):
        utkinect.read_segments(_take(tmp_path))


# --- the takes themselves ----------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_takes_are_read_and_cut(data_folder: Path) -> None:
    """All 20 takes are of ten persons, with ten actions each but one; each is cut out of its take whole."""
    paths = find_recordings([data_folder / "utkinect"])
    assert len(paths) == 20
    clips, labels = list(read_recordings(paths)), [utkinect.read_segments(path) for path in paths]
    assert len({clip.actor for clip in clips}) == 10
    assert [len(each) for each in labels] == [10] * 19 + [9]
    motions = [motion for clip, each in zip(clips, labels, strict=True) for motion in cut(clip, each)]
    assert len(motions) == 199
    assert {len([each for each in motions if each.class_name == name]) for name in ("walk", "pull")} == {20}
    assert min(motion.duration for motion in motions) > 0.7
    assert max(motion.duration for motion in motions) < 40
    reach = [np.linalg.norm(np.ptp(clip.positions[0], axis=0)) for clip in clips]
    assert 1.0 < min(reach) < max(reach) < 3.0


def test_the_misprinted_label_is_put_right(data_folder: Path) -> None:
    """The push of s03_e01 follows its throw and lasts two seconds, as all others do."""
    found = {each.label: each for each in utkinect.read_segments(data_folder / "utkinect" / "joints_s03_e01.txt")}
    assert found["throw"].end < found["push"].start < found["pull"].start
    assert found["push"].duration == pytest.approx(66 / 30)
