"""Progress in takes: rounds are found in the body's movement alone, and compared with what is told."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from programs import SMALL_CLASSES

from kinespace.library.recordings.formats.labels import Segment
from kinespace.library.windows.index import opened
from kinespace.tools.cli.main import main
from kinespace.tools.evaluation.scoring.rounds import rounds_scored
from kinespace.tools.evaluation.takes import Take
from kinespace.tools.feeding.feed import resampled

if TYPE_CHECKING:
    from kinespace.library import MotionLibrary
    from kinespace.library.windows.index import WindowIndex

pytestmark = pytest.mark.slow

PAGE = Path(__file__).parents[3] / ".github/docs/json.md"
ARMS = "rotateArmsBothBackward1Reps"
ROUNDS = 4


@pytest.fixture(scope="module")
def others(builtin: MotionLibrary) -> WindowIndex:
    """Open some classes of the people who do not circle the arms in the take."""
    classes = [name for name in builtin.classes if name not in (ARMS, *SMALL_CLASSES)]
    return opened(builtin.without(actors=["mm"], classes=classes))


@pytest.fixture(scope="module")
def circles(builtin: MotionLibrary) -> Take:
    """Give a take in which a person circles the arms four times, each time as the first."""
    one = resampled(next(each for each in builtin.motions if (each.class_name, each.actor) == (ARMS, "mm")), 60.0)
    clip = replace(one, positions=np.concatenate([one.positions] * ROUNDS), name="circles")
    return Take(clip, (Segment(0.0, clip.duration, ARMS),))


def test_rounds_are_followed(others: WindowIndex, circles: Take) -> None:
    """Between the first turning point and the last there are two rounds or three; the progress goes round as often."""
    (score,) = rounds_scored([circles], others)
    assert (score["take"], score["class_name"]) == ("circles", ARMS)
    assert score["seconds"] == pytest.approx(circles.clip.duration)
    assert ROUNDS - 2.5 < score["rounds"] < ROUNDS
    assert score["rounds_told"] == pytest.approx(score["rounds"], abs=0.3)
    assert 0.4 < score["followed"] <= 1
    assert score["phase_error"] < 0.05
    assert score["within_tenth"] > 0.9
    assert [name for name in score if f"`{name}`" not in PAGE.read_text(encoding="utf-8")] == []


def test_less_than_a_round_and_other_labels_have_no_score(others: WindowIndex, circles: Take) -> None:
    """A segment shorter than a round has one turning point at most; a label that the library lacks is passed over."""
    short = Segment(0.0, circles.clip.duration / ROUNDS / 2, ARMS)
    segments = (short, replace(circles.segments[0], label="waving"))
    assert list(rounds_scored([replace(circles, segments=segments)], others)) == []


def test_takes_without_rounds_are_one_line(cmu_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """No label of the take is a class: the message says which option renames labels."""
    assert main(["evaluate", "progress", str(cmu_folder / "13_30.amc")]) == 2
    assert "expected a whole round of a known class, got none (--map renames labels)" in capsys.readouterr().err
