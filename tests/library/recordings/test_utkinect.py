"""UTKinect's takes: frames that a depth camera skipped, wrote twice or left empty, and labels by frame numbers."""

import re
from pathlib import Path

import numpy as np
import pytest
from programs import ran

from kinespace.library import Reading, find_recordings, read_recordings
from kinespace.library.recordings import RecordingError, segments_beside
from kinespace.library.recordings.formats.labels import Segment
from kinespace.tools.evaluation.harness import Sources, read_takes

POSTURES = np.random.default_rng(3).normal(size=(4, 20, 3))
#: The camera skipped frames 11 and 13, wrote frame 12 twice, and saw nobody in frame 15.
NUMBERS = (10, 12, 12, 14, 15)
ROWS = [*POSTURES, np.zeros((20, 3))]
TEXT = "".join(f"{n} {' '.join(map(str, row.ravel()))}\n" for n, row in zip(NUMBERS, ROWS, strict=True))
LABELS = "s01_e01\nwalk: 1 20\ns01_e02\nwalk: 9 12\nsit down: 11 14\ncarry: NaN NaN\n"


def _written(folder: Path, text: str = TEXT, labels: str = LABELS) -> Path:
    (folder / "joints_s01_e02.txt").write_text(text)
    (folder / "actionLabel.txt").write_text(labels)
    return folder / "joints_s01_e02.txt"


def test_a_take_is_read_with_its_labels(tmp_path: Path) -> None:
    """Frames between are on straight lines; of two actions that overlap the earlier ends where the later begins."""
    path = _written(tmp_path)
    assert find_recordings(tmp_path) == [path]
    assert "joints_s01_e02" in ran("info", path)[1]
    (take,) = read_takes(Sources([tmp_path]), Reading())
    assert (take.person, take.delivered.tolist()) == ("s01", [0, 2, 4])  # type: ignore[union-attr]  # a sensor's
    (clip,), segments = read_recordings(path), segments_beside(path)
    assert (clip.frames, clip.actor, clip.take, clip.frame_rate, clip.filled) == (5, "s01", "e02", 30.0, 2 * 20)
    np.testing.assert_allclose(clip.positions[[0, 2, 4]], POSTURES[[0, 1, 3]])
    np.testing.assert_allclose(clip.positions[1], POSTURES[:2].mean(axis=0))
    assert segments == (Segment(0.0, 1 / 30, "walk"), Segment(1 / 30, 4 / 30, "sit down"))


@pytest.mark.parametrize(
    ("text", "labels", "message"),
    [
        (TEXT.replace("14 ", "9 "), LABELS, "expected on each line a frame's number, that does not fall"),
        (TEXT.replace("\n12 ", "\nnan ", 1), LABELS, "expected on each line a frame's number, that does not fall"),
        (re.sub(r" \S+\n", "\n", TEXT), LABELS, "expected on each line a frame's number, that does not fall"),
        (TEXT + "16 1 2\n", LABELS, "the number of columns changed"),
        (TEXT.partition("\n")[0], LABELS, "expected at least 2 frames with a person, got 1"),
        (TEXT, "s01_e01\nwalk: 1 20\n", "expected actions of s01_e02, got none"),
    ],
)
def test_a_take_that_makes_no_sense_is_refused(tmp_path: Path, text: str, labels: str, message: str) -> None:
    """The file is named, and the mistake."""
    path = _written(tmp_path, text, labels)
    with pytest.raises(RecordingError, match=f"^{re.escape(str(tmp_path))}.*: {message}"):
        read_takes(Sources([path]), Reading())


def test_all_of_utkinect_is_read(data_folder: Path) -> None:
    """The 20 takes have 199 actions of ten kinds; a misprinted number is put right."""
    takes = [segments_beside(path) for path in find_recordings(data_folder / "utkinect")]
    labels = [each.label for segments in takes for each in segments or ()]
    assert (len(takes), len(labels), len(set(labels))) == (20, 199, 10)
    (push,) = (each for each in takes[4] or () if each.label == "push")
    assert 0 < push.duration < 5
