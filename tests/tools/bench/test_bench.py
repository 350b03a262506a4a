"""`kinespace bench` as a person runs it, small. No figure is held against a limit here."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
from programs import finished
from test_bench_report import KEYS

from kinespace.library import MotionLibrary
from kinespace.stream.recognizer import LiveSignature
from kinespace.tools.bench import run
from kinespace.tools.bench.cases import capacity, sockets
from kinespace.tools.bench.cases.scaling import Sizes
from kinespace.tools.cli.main import main

if TYPE_CHECKING:
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

pytestmark = pytest.mark.slow


def test_one_part_prints_exactly_the_standard_figures() -> None:
    """As a command of its own, one part gives one JSON object: all names, its own figures, null for the others."""
    status, output, errors = finished("bench", "stages", "--rounds", 1, "--json")
    assert (status, errors) == (0, "")
    assert output.count("\n") == 1
    figures = json.loads(output)
    assert sorted(figures) == sorted(KEYS)
    measured = {name for name, figure in figures.items() if figure is not None}
    assert measured == STAGES
    assert min(figures[name] for name in measured) > 0


STAGES = {"us_per_frame", "us_per_frame_numpy", "frames_per_second", "osc_decode_us", "osc_decode_python_osc_us"}
PEERS = {name for name in KEYS if name.startswith(("ratio_", "accuracy"))}
#: Nothing is grown to 200,000 here.
GROWTH = {"pairs_exponent"}
EFFORT = run.Effort(
    rounds=1,
    seconds=1.2,
    frames=600,
    minutes=0.0,
    sizes=Sizes((15, 20), (20, 100)),
    rates=(120.0, 360.0),
    most=1,
    starts=1,
)


def figures_of(parts: tuple[run.Part, ...], played: NDArray[np.float32]) -> set[str]:
    """Run some parts, small; give the names of the figures there are then."""
    report = run.measured(parts, played, signature=None, effort=EFFORT)
    return {name for name, figure in report.figures().items() if figure is not None}


def test_peers_and_growth_fill_their_figures(played: NDArray[np.float32], monkeypatch: pytest.MonkeyPatch) -> None:
    """Run small, the two together give every figure that is theirs and no other."""
    whole = MotionLibrary.builtin()
    few = MotionLibrary(whole.skeleton, tuple(each for each in whole.motions if each.actor in {"bd", "mm"})[::6])
    monkeypatch.setattr(run.MotionLibrary, "builtin", lambda: few)
    assert figures_of(("peers", "growth"), played) == PEERS | GROWTH


def test_sockets_and_soak_fill_their_figures(played: NDArray[np.float32], monkeypatch: pytest.MonkeyPatch) -> None:
    """Run small, the two together give every figure that is theirs and no other."""
    monkeypatch.setattr(sockets, "_CROWD_SECONDS", 1.0)
    monkeypatch.setattr(capacity, "_TRIES", 1)
    # Not every system tells about memory, and on a busy machine a crowd of one may not be held: it has no share then.
    maybe = {"rss_mb", "rss_100_mb", "performers_share_of_floor"}
    expected = set(KEYS) - STAGES - PEERS - GROWTH - {"match_200k_ms"}
    assert figures_of(("sockets", "soak"), played) | maybe == expected


def test_the_table_says_on_what_it_was_measured(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Without --json tables are printed, then the machine; the picture asked for is drawn."""
    path = tmp_path / "bench.png"
    arguments = ["bench", "stages", "--rounds", "1", "--picture", str(path)]
    assert main(arguments) == 0
    printed = capsys.readouterr().out
    for signature in LiveSignature:
        assert f"From packet to answer, {signature}" in printed
    assert " cores" in printed.splitlines()[-1]
    assert path.read_bytes().startswith(b"\x89PNG")


def test_a_folder_without_recordings_is_told_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Asked to play a folder that holds no recording, one line names it."""
    assert main(["bench", "stages", "--data", str(tmp_path)]) == 2
    errors = capsys.readouterr().err
    assert errors.startswith(f"kinespace: {tmp_path}: no recording")
    assert errors.count("\n") == 1


@pytest.mark.parametrize(
    "arguments", [["speed"], ["stages", "--rounds", "0"], ["soak", "--frames", "1.5"], ["soak", "--minutes", "-1"]]
)
def test_what_cannot_be_asked_for_is_refused(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    """Unknown parts, no rounds, half frames and negative minutes end with status 2."""
    with pytest.raises(SystemExit) as refused:
        main(["bench", *arguments])
    assert refused.value.code == 2
    assert "error: argument" in capsys.readouterr().err
