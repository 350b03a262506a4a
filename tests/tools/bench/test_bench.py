"""`kinespace bench` as a person runs it, small. No figure is held against a limit here."""

import json
import math
from itertools import islice
from pathlib import Path

import against
import numpy as np
import pytest

from kinespace.tools.bench import sockets, stages
from kinespace.tools.bench.crowd import endless, rounded, shown
from kinespace.tools.bench.stages import in_turns
from kinespace.tools.cli.main import main

#: What receivers of `--json` rely on.
KEYS = {
    *("us_per_frame", "us_per_frame_numpy", "frames_per_second", "osc_decode_us", "osc_decode_python_osc_us"),
    *("latency_p99_ms", "echo_p99_ms", "lost_360", "performers_at_120hz"),
}


@pytest.fixture
def _short_rounds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Time each step once, for half a second of a feed."""
    monkeypatch.setattr(stages, "ROUNDS", 1)
    monkeypatch.setattr(stages, "WARM_UP", 60)
    monkeypatch.setattr(stages, "ROUND", 60)


@pytest.mark.slow
@pytest.mark.usefixtures("_short_rounds")
def test_one_part_prints_exactly_the_standard_figures(capsys: pytest.CaptureFixture[str]) -> None:
    """One part gives one JSON object: all names, its own figures, null for the others."""
    assert main(["bench", "stages", "--json"]) == 0
    output, errors = capsys.readouterr()
    assert (errors, output.count("\n")) == ("", 1)
    figures = json.loads(output)
    assert set(figures) == KEYS
    assert {name for name, figure in figures.items() if figure is not None} == set(stages.FIGURES)
    assert min(figures[name] for name in stages.FIGURES) > 0


@pytest.mark.slow
@pytest.mark.usefixtures("_short_rounds")
def test_the_tables_fit_a_narrow_terminal(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Stages and sockets print every step, rate and transport on 80 columns, and the machine last."""
    monkeypatch.setattr(sockets, "RATES", (120.0,))
    monkeypatch.setattr(sockets, "CROWD", 3)
    assert main(["bench", "stages"]) == 0
    assert main(["bench", "sockets", "--seconds", "1.5"]) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if line.strip()]
    assert max(map(len, lines)) <= 80
    begins = {line.split("  ")[0] for line in lines}
    steps = {"decode OSC", "decode OSC by python-osc", "encode ZeroMQ", *stages.RECOGNISING}
    assert steps | {"osc", "zmq echo", "zmq"} <= begins
    assert " cores" in lines[-1]


def test_another_version_is_measured_by_turns(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Each turn's own ratio counts, so that an hour in which the machine is slow meets both versions."""
    busy, order = [1.0, 1.0, 3.0, 3.0, 2.0, 2.0, 1.0, 1.0, 5.0, 5.0, 4.0, 4.0], list[bool]()

    def figures(place: Path | None) -> dict[str, float]:
        order.append(place is None)
        return {"us_per_frame": busy[len(order) - 1] * (40.0 if place else 30.0), "frames_per_second": 1.0}

    monkeypatch.setattr(against, "_installed", lambda *_: tmp_path)
    monkeypatch.setattr(against, "_figures", figures)
    assert against.measure("main").figures == {"us_per_frame_ratio": 0.75}
    assert order == [True, False] * against.TURNS


def test_figures_have_four_digits() -> None:
    """More would be noise; a whole number stays whole, and a figure that was not measured is null or a dash."""
    assert [rounded(value) for value in (1234.567, 0.00123456, 7, math.inf)] == [1235.0, 0.001235, 7, None]
    assert [shown(value, 1) for value in (1234.56, math.nan)] == ["1,234.6", "-"]


def test_jobs_take_turns_and_the_first_turn_does_not_count() -> None:
    """Every job runs once before the rounds and once in each; the first turn's cost is dropped."""
    order: list[str] = []

    def job(name: str) -> float:
        order.append(name)
        return float(order.count(name))

    costs = in_turns({name: lambda name=name: job(name) for name in "ab"}, 3, "Turns")  # type: ignore[misc]
    assert "".join(order) == "abababab"
    for name in "ab":
        np.testing.assert_array_equal(costs[name], [2.0, 3.0, 4.0])


def test_a_feed_goes_on_for_ever() -> None:
    """Frames come in their order, 1/120 s apart, and begin again after the last."""
    positions = np.arange(5 * 2 * 3, dtype=np.float32).reshape(5, 2, 3)
    frames = list(islice(endless(positions, "me", begin=3), 5))
    assert [frame.performer for frame in frames] == ["me"] * 5
    np.testing.assert_array_equal([frame.positions for frame in frames], positions[[3, 4, 0, 1, 2]])
    np.testing.assert_allclose(np.diff([frame.time for frame in frames]), 1 / 120)
    assert frames[0].time > 0
