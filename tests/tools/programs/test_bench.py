"""`kinespace latency`, `bench` and `demo`, small. No figure is held against a limit here."""

import json
import math
from functools import partial

import numpy as np
import pytest
from programs import ran

from kinespace.library import MotionLibrary
from kinespace.stream import Settings
from kinespace.tools.feeding.service import background_service
from kinespace.tools.programs import bench, demo
from kinespace.tools.programs.latency import measure

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("wide")]


def test_every_frame_and_answer_is_accounted_for() -> None:
    """A run sends every frame, every answer due is answered or lost, each latency is a positive time."""
    latency = measure("zmq", rate_hz=100.0, seconds=1.2, settings=Settings(hop=0.05))
    assert latency.sent == 120
    # The first window is full with frame 16; from then on every fifth is answered.
    assert latency.answered + latency.lost == 21
    assert latency.answered > 0
    assert len(latency.seconds) <= latency.answered
    # The first half second warms up and is not counted.
    assert 0 < len(latency.echo_seconds) <= 70
    for seconds in (latency.seconds, latency.echo_seconds):
        assert np.isfinite(seconds).all()
        assert (seconds > 0).all()


# --- bench -----------------------------------------------------------------------------------------------------------

#: What receivers of `--json` rely on.
KEYS = {
    *("us_per_frame", "us_per_frame_numpy", "frames_per_second", "osc_decode_us", "osc_decode_python_osc_us"),
    *("latency_p99_ms", "echo_p99_ms", "lost_360", "performers_at_120hz"),
}


@pytest.mark.slow
def test_one_part_prints_exactly_the_standard_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """One part gives one JSON object: all names, its own figures, null for the others."""
    # Each step is timed once, for half a second of a feed.
    for name, number in (("ROUNDS", 1), ("WARM_UP", 60), ("ROUND", 60)):
        monkeypatch.setattr(bench, name, number)
    status, output, errors = ran("bench", "stages", "--json")
    assert (status, errors, output.count("\n")) == (0, "", 1)
    figures = json.loads(output)
    assert set(figures) == KEYS
    assert {name for name, figure in figures.items() if figure is not None} == set(bench.STAGES)
    assert min(figures[name] for name in bench.STAGES) > 0


# --- demo: motions played into a recogniser on this machine -----------------------------------------------------------


#: How many times faster than a person sees it the demo plays; the frames' own times stay the same.
SPEED = 8.0


@pytest.fixture
def fast(monkeypatch: pytest.MonkeyPatch) -> None:
    """Play fast."""
    monkeypatch.setattr(demo, "clip_cues", partial(demo.clip_cues, speed=SPEED))


@pytest.mark.usefixtures("fast")
def test_the_demo_names_every_motion() -> None:
    """It prints exactly one JSON object in which every class was played, answered and right."""
    status, printed, errors = ran("demo", "--json")
    assert (status, printed.count("\n"), errors) == (0, 1, "")
    described = json.loads(printed)
    assert set(described) == {"played", "answered", "right", "late", "p99_ms"}
    assert described["right"] == described["played"] == described["answered"] == 11
    assert 0 < described["p99_ms"] < math.inf


@pytest.mark.usefixtures("fast")
def test_a_recogniser_of_other_names_is_wrong(small_library: MotionLibrary, monkeypatch: pytest.MonkeyPatch) -> None:
    """Answers other than the expected ones do not count: no motion is right, and the status is 1."""
    other = small_library.renamed({name: f"not {name}" for name in small_library.classes})
    monkeypatch.setattr(MotionLibrary, "builtin", lambda: small_library)
    monkeypatch.setattr(
        demo.service, "background_service", lambda *of, **more: background_service(*of, **{**more, "library": other})
    )
    status, printed, _ = ran("demo", "--json")
    assert (status, json.loads(printed)) == (1, {"played": 3, "answered": 0, "right": 0, "late": 0, "p99_ms": None})
