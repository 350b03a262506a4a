"""The quick figures are no worse than `figures.toml` says; `make figures` measures all, and changes them."""

from __future__ import annotations

import tomllib

import figures
import pytest
from figures import Figure

from kinespace.tools.cli.main import EXPERIMENTS

pytestmark = pytest.mark.slow


@pytest.mark.timeout(900)
@pytest.mark.parametrize("name", figures.QUICK)
def test_no_figure_falls(name: str, request: pytest.FixtureRequest) -> None:
    """Each new figure is within its tolerance of the expected one, or better."""
    arguments, entries = figures.RUNS[name], figures.expected()[name]
    needs_recordings = any("{data}" in argument for argument in arguments)
    data = request.getfixturevalue("data_folder") if needs_recordings else None
    told = figures.fallen(name, entries, figures.measured(arguments, entries, data))
    assert not told, "\n".join(told)


def test_every_evaluation_has_figures() -> None:
    """Every evaluation is written down, none beyond them; one of each experiment is measured by the tests."""
    written = figures.expected()
    assert list(written) == list(figures.RUNS)
    assert all(written.values())
    for figure in (each for entries in written.values() for each in entries.values()):
        assert figure.direction in {"higher", "lower"}
        assert 0 < figure.tolerance < (1.0 if figure.direction == "higher" else 10.0)
    assert {figures.RUNS[name][0] for name in figures.QUICK} == set(EXPERIMENTS)


def test_a_figure_is_measured_as_a_person_would() -> None:
    """Figures are numbers of the JSON object that the program prints, found by their place in it."""
    got = figures.measured(("retrieval", "--protocol", "split"), ("motions", "splits.worst", "nearest"), None)
    assert got["motions"] == 99
    assert 0.4 < got["splits.worst"] < got["nearest"] < 1


def test_a_program_that_fails_has_no_figures(capsys: pytest.CaptureFixture[str]) -> None:
    """An evaluation that ends with an error is no figure that fell."""
    with pytest.raises(RuntimeError, match="retrieval /absent: ended with 2"):
        figures.measured(("retrieval", "/absent"), ("nearest",), None)
    assert "no such file or folder" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("direction", "got", "holds"),
    [
        ("higher", 0.79, True),
        ("higher", 0.77, False),
        ("higher", 1.0, True),
        ("lower", 0.81, True),
        ("lower", 0.83, False),
        ("lower", 0.0, True),
        ("lower", None, False),
    ],
)
def test_a_figure_falls_one_way(direction: str, got: float | None, *, holds: bool) -> None:
    """A figure beyond its tolerance in its bad direction, or missing, has fallen; any better one has not."""
    assert Figure(0.8, 0.02, direction).holds(got) is holds


def test_figures_that_fell_are_named() -> None:
    """The failure lists evaluation, figure, expectation and new value, only for figures that fell."""
    entries = {name: Figure(0.8, 0.02, "higher") for name in ("one", "two", "three")}
    assert figures.fallen("run", entries, {"one": 0.7, "two": 0.8}) == [
        "run.one: expected 0.8000 (higher is better, tolerance 0.02), got 0.7000",
        "run.three: expected 0.8000 (higher is better, tolerance 0.02), got none",
    ]


def test_an_update_changes_values_alone() -> None:
    """The file reads back with the new values of what was measured, and with all else as it was."""
    before = {"run": {"frame_accuracy": Figure(0.5, 0.123, "higher"), "mean.x": Figure(0.5, 0.03, "lower")}}
    text = figures.written(before, {"run": {"frame_accuracy": 0.75}})
    assert tomllib.loads(text) == {
        "run": {
            "frame_accuracy": {"value": 0.75, "tolerance": 0.123, "direction": "higher"},
            "mean.x": {"value": 0.5, "tolerance": 0.03, "direction": "lower"},
        }
    }
