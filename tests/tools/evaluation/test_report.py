"""An evaluation's page: what was performed and answered is in it, in one file that needs nothing else."""

import base64
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from synthetic import stick_clip

from kinespace.library.recordings.formats.labels import Segment
from kinespace.tools.evaluation.report import spans, write_report
from kinespace.tools.evaluation.scoring.timeline import Course

CLASSES = ("bow", "</script><b>wave")


def _course(values: list[int], rate: float) -> Course:
    array = np.array(values)
    return Course(
        name="a </script> take",
        times=np.arange(len(values)) / rate,
        segments=(Segment(0.0, 0.5, "bow"),),
        truth=array,
        segment=np.zeros_like(array),
        guess=array,
        published=array,
        event=array,
        score=np.full(len(values), 0.5),
        person="ann",
    )


def _taken(path: Path) -> dict[str, Any]:
    found = re.search(r'<script type="application/json" id="shown">(.*?)</script>', path.read_text(encoding="utf-8"))
    assert found
    read: dict[str, Any] = json.loads(found[1])
    return read


def test_everything_is_in_one_file(tmp_path: Path) -> None:
    """The page holds takes, truth, answers and bodies to the millimetre; no other file is asked for."""
    clip = stick_clip("bow", frames=120)
    write_report(tmp_path / "out.html", [(_course([-1] * 30 + [0] * 60 + [1] * 30, 120.0), clip)], CLASSES)
    page = _taken(tmp_path / "out.html")
    (take,) = page["takes"]
    assert tuple(page["classes"]) == CLASSES
    assert (take["performed"], take["person"]) == ([[0.0, 0.5, "bow"]], "ann")
    assert take["named"] == [[0.25, 0.75, 0], [0.75, pytest.approx(119 / 120), 1]]
    bodies = np.frombuffer(base64.b64decode(take["bodies"]), "<i2").reshape(-1, len(clip.skeleton.joints), 3) / 1000
    expected = clip.positions[::6] - clip.positions[0].mean(axis=0)
    assert take["rate"] == 20.0
    assert np.abs(bodies - expected).max() <= 0.0006
    text = (tmp_path / "out.html").read_text(encoding="utf-8")
    assert not re.search(r"(src|href)=", text)
    assert "<b>wave" not in text
    assert not re.search(r"/\* (page.css|draw.js|script|shown) \*/", text)


def test_spans_equal_a_loops() -> None:
    """Every frame from 0 on lies in the span of its value, frames below 0 in none."""
    values = np.random.default_rng(3).integers(-1, 3, 60)
    times = np.arange(60) / 10
    listed = spans(times, values)
    for moment, value in zip(times[:-1].tolist(), values[:-1].tolist(), strict=True):
        here = [each for begin, end, each in listed if begin <= moment < end]
        assert here == ([value] if value >= 0 else [])
    assert spans(times[:0], values[:0]) == []
