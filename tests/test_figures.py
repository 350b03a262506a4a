"""The figures of live recognition on real takes are no worse than `figures.toml` says; see `figures` to change them."""

from __future__ import annotations

import tomllib
from typing import TYPE_CHECKING

import figures
import pytest
from figures import Figure

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.parametrize("run", figures.RUNS)
def test_no_figure_falls(run: str, cmu_folder: Path) -> None:
    """What is measured anew is within its tolerance of what was written, or better."""
    told = figures.fallen(run, figures.expected()[run], figures.measured(run, cmu_folder))
    assert not told, "\n".join(told)


def test_every_figure_has_a_value_and_a_direction() -> None:
    """Every evaluation is written down, none beyond them, and each figure of each that its takes can have."""
    written = figures.expected()
    assert set(written) == set(figures.RUNS)
    of_unknown = {"false_per_minute", "unknown_answered", "auc_unknown"}
    for run, entries in written.items():
        expected = set(figures.KINDS) - (of_unknown if run.startswith("own_takes") else set())
        assert set(entries) == expected, run
        for name, figure in entries.items():
            assert figure.direction == figures.KINDS[name][0]
            assert 0 < figure.tolerance < max(1.0, figure.value)


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


def test_what_has_fallen_is_named() -> None:
    """The failure says evaluation and figure, what was expected and what came out, of the fallen ones alone."""
    entries = {name: Figure(0.8, 0.02, "higher") for name in ("one", "two", "three")}
    assert figures.fallen("run", entries, {"one": 0.7, "two": 0.8}) == [
        "run.one: expected 0.8000 (higher is better, tolerance 0.02), got 0.7000",
        "run.three: expected 0.8000 (higher is better, tolerance 0.02), got none",
    ]


def test_an_update_changes_values_alone() -> None:
    """What is written reads back with the new values, edited tolerances kept, and a new figure's usual ones."""
    before = {"run": {"frame_accuracy": Figure(0.5, 0.123, "higher")}}
    text = figures.written(before, {"run": {"frame_accuracy": 0.75, "p90_delay_s": 1.25}})
    assert tomllib.loads(text) == {
        "run": {
            "frame_accuracy": {"value": 0.75, "tolerance": 0.123, "direction": "higher"},
            "p90_delay_s": {"value": 1.25, "tolerance": 0.2, "direction": "lower"},
        }
    }
