"""HDM05: its file names, its body, and properties of its 288 clips."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import naive
import numpy as np
import pytest

from kinespace.library.naming import hdm05
from kinespace.library.recordings.formats.acclaim import read_clip

if TYPE_CHECKING:
    from kinespace.library.clip import Clip

ACTORS = ("bd", "bk", "dg", "mm", "tr")


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("HDM_bd_squat1Reps_001_120.amc", ("bd", "squat1Reps", "001", 120.0)),
        ("hdm_DG_grabHighR_003_120.AMC", ("DG", "grabHighR", "003", 120.0)),
        ("HDM_mm_jog_on_place_002_60.amc", ("mm", "jog_on_place", "002", 60.0)),
        ("HDM_bd_03-03_01_120.amc", ("bd", "", "03-03_01", 120.0)),
    ],
)
def test_a_file_name_holds_actor_class_and_take(name: str, expected: tuple[str, str, str, float]) -> None:
    """Actor, class, take and frame rate are read off a cut clip's name; the name of an uncut take holds no class."""
    assert hdm05.read_clip_name(Path(name)) == expected


@pytest.mark.parametrize(
    "name",
    [
        "13_29.amc",
        "HDM_bd.asf",
        "HDM_bd_01-01_01.amc",
        "HDM_bd_1-1_01_120.amc",
        "HDM_bd_squat1Reps_001_000.amc",
        "HDM_bd_squat1Reps_001_120_cut.amc",
        "my_HDM_bd_squat1Reps_001_120.amc",
        "HDM_bastian_squat1Reps_001_120.amc",
    ],
)
def test_other_names_say_nothing(name: str) -> None:
    """A name of another form, and one of no frames per second, is not taken for HDM05's."""
    assert hdm05.read_clip_name(Path(name)) is None


def test_all_288_clips_are_read(hdm05_clips: tuple[Clip, ...]) -> None:
    """There are 288 clips of 11 classes by 5 actors, each of 31 joints at 120 frames per second, and none twice."""
    assert len(hdm05_clips) == 288
    assert len({clip.class_name for clip in hdm05_clips}) == 11
    assert {clip.actor for clip in hdm05_clips} == set(ACTORS)
    assert len({(clip.class_name, clip.actor, clip.take) for clip in hdm05_clips}) == 288
    for clip in hdm05_clips:
        assert clip.skeleton == hdm05.SKELETON
        assert clip.frame_rate == 120.0
        assert clip.rotations.shape == (clip.frames, 59)


@pytest.mark.slow
def test_cmus_takes_are_read_with_the_same_body(cmu_folder: Path) -> None:
    """A CMU take has HDM05's 31 joints, an upright body of human height, and no labels of HDM05's."""
    clip = read_clip(cmu_folder / "13_30.amc")
    assert clip.skeleton == hdm05.SKELETON
    assert (clip.class_name, clip.actor, clip.take) == ("", "", "")
    assert clip.frame_rate == 120.0
    assert clip.frames == len(naive.read_amc(cmu_folder / "13_30.amc", naive.read_asf(cmu_folder / "13.asf")).frames)
    height = clip.positions[..., 1].max(axis=1) - clip.positions[..., 1].min(axis=1)
    assert 1.3 < np.median(height) < 2.1
