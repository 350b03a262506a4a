"""The quick figures are no worse than `figures.toml` says; `make figures` measures all, and changes them."""

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
    worse = figures.fallen(name, entries, figures.measured(arguments, entries, data))
    assert not worse, "\n".join(worse)


def test_every_evaluation_has_figures() -> None:
    """Every evaluation is written down, none beyond them; at least one of each experiment."""
    written = figures.expected()
    assert list(written) == list(figures.RUNS)
    assert all(written.values())
    for figure in (each for entries in written.values() for each in entries.values()):
        assert figure.direction in {"higher", "lower"}
        assert 0 < figure.tolerance < (1.0 if figure.direction == "higher" else 10.0)
    assert {arguments[0] for arguments in figures.RUNS.values()} == set(EXPERIMENTS)
    assert set(figures.QUICK) < set(figures.RUNS)


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
