"""The check of plausibility harms no honest feed: on recordings without a fault it costs no answer."""

from __future__ import annotations

import io
import json
from contextlib import redirect_stdout
from typing import TYPE_CHECKING, Any

import pytest

from kinespace.tools.cli.main import main

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.slow

#: Markers of another laboratory, three depth sensors and a camera, each by one person or some; `make figures` measures
#: the share doubted of more.
FEEDS = {
    "uiprmd": ("uiprmd/takes/s01_*.npz", "--actor-in", "name"),
    "uiprmd_kinect": ("uiprmd_kinect/takes/s04_*.npz", "--actor-in", "name"),
    "kindergator": ("kindergator/takes/a565_*.npz", "--actor-in", "name"),
    "camera": ("camera/p[26]*.npz", "--actor-in", "name", "--map", "squat=squat1Reps", "run=jogLeftCircle4StepsRstart"),
    "utkinect": ("utkinect/joints_s0[123]_*.txt", "--map", "throw=throwBasketball"),
}


@pytest.mark.parametrize("feed", FEEDS)
def test_an_honest_feed_is_believed(feed: str, data_folder: Path) -> None:
    """At most .5 % of the time is doubted, and believing everything guesses no more than .3 points better."""
    with_check, without = (_score(data_folder, FEEDS[feed], *more) for more in ((), ("--no-plausibility",)))
    assert with_check["doubted"] <= 0.005
    assert without["doubted"] == 0.0
    for figure in ("frame_accuracy", "segment_accuracy", "known_answered"):
        assert with_check[figure] >= without[figure] - 0.003, figure


def _score(data: Path, arguments: tuple[str, ...], *more: str) -> dict[str, Any]:
    printed, takes = io.StringIO(), map(str, sorted(data.glob(arguments[0])))
    with redirect_stdout(printed):
        assert main(["evaluate", "stream", *takes, *arguments[1:], *more, "--json"]) == 0
    return dict(json.loads(printed.getvalue()))
