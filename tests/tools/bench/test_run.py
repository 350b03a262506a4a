"""`kinespace bench` as a person runs it, small. No figure is held against a limit here."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from test_bench_report import KEYS

from kinespace.stream.recognizer import LiveSignature
from kinespace.tools.bench import run
from kinespace.tools.bench.cases import cluster_soak, peers, scale, scaling, soak, sockets, stages
from kinespace.tools.bench.cases.scaling import Sizes
from kinespace.tools.cli.main import main

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def measured(played: NDArray[np.float32]) -> dict[str, stages.Stages]:
    """Measure the stages once."""
    return stages.measure(played, signatures=list(LiveSignature), rounds=1)


@pytest.fixture
def _measured_once(measured: dict[str, stages.Stages], monkeypatch: pytest.MonkeyPatch) -> None:
    """Give the measured stages to the program."""
    monkeypatch.setattr(stages, "measure", lambda *_, **__: measured)


@pytest.mark.usefixtures("_measured_once")
def test_one_part_prints_exactly_the_standard_figures(capsys: pytest.CaptureFixture[str]) -> None:
    """One part gives one JSON object: all names, its own figures, null for the others."""
    assert main(["bench", "stages", "--rounds", "1", "--json"]) == 0
    output, errors = capsys.readouterr()
    assert errors == ""
    assert output.count("\n") == 1
    figures = json.loads(output)
    assert sorted(figures) == sorted(KEYS)
    measured = {name for name, figure in figures.items() if figure is not None}
    assert measured == STAGES
    assert min(figures[name] for name in measured) > 0


STAGES = {"us_per_frame", "us_per_frame_numpy", "frames_per_second", "osc_decode_us", "osc_decode_python_osc_us"}
#: Unlike the usual one in everything.
EFFORT = run.Effort(
    rounds=2, seconds=3.0, person="mm", frames=4, minutes=5.0, sizes=Sizes((6,), (7,)), rates=(8.0,), most=9, starts=10
)


@pytest.mark.parametrize("parts", [("soak", "stages"), ("sockets",), ("growth", "peers"), run.PARTS])
def test_parts_are_measured_as_asked(parts: tuple[run.Part, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    """Each part asked for, and no other, is measured once, in the usual order, with the effort asked for."""
    asked = dict[str, dict[str, object]]()
    modules = {"stages": stages, "peers": peers, "growth": scaling, "sockets": sockets, "soak": soak, "scale": scale}
    modules["cluster-soak"] = cluster_soak
    for name, module in modules.items():
        monkeypatch.setattr(
            module, "measure", lambda *_, name=name, **options: asked.setdefault(name, options) and name
        )
    played = np.zeros((1, 31, 3), np.float32)
    report = run.measured(parts, played, signature=LiveSignature.PAPER, effort=EFFORT)
    assert list(asked) == [name for name in modules if name in parts]
    for name, options in asked.items():
        assert getattr(report, name.replace("-", "_")) == name
        for option, value in options.items():
            of_effort = getattr(EFFORT, option, None)
            assert value == of_effort or option in {"signature", "signatures"}, option
        if "signature" in options:
            assert options["signature"] is LiveSignature.PAPER


@pytest.mark.usefixtures("_measured_once")
def test_the_table_names_the_machine(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Without --json tables are printed, then the machine; the picture asked for is drawn."""
    path = tmp_path / "bench.png"
    arguments = ["bench", "stages", "--rounds", "1", "--picture", str(path)]
    assert main(arguments) == 0
    printed = capsys.readouterr().out
    for signature in LiveSignature:
        assert f"From packet to answer, {signature}" in printed
    assert " cores" in printed.splitlines()[-1]
    assert path.read_bytes().startswith(b"\x89PNG")


def test_a_folder_without_recordings_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Asked to play a folder that holds no recording, one line names it."""
    assert main(["bench", "stages", "--data", str(tmp_path)]) == 2
    errors = capsys.readouterr().err
    assert errors.startswith(f"kinespace: {tmp_path}: no recording")
    assert errors.count("\n") == 1


@pytest.mark.parametrize(
    "arguments", [["speed"], ["stages", "--rounds", "0"], ["soak", "--frames", "1.5"], ["soak", "--minutes", "-1"]]
)
def test_impossible_benchmarks_are_refused(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    """Unknown parts, no rounds, half frames and negative minutes end with status 2."""
    with pytest.raises(SystemExit) as refused:
        main(["bench", *arguments])
    assert refused.value.code == 2
    assert "error: argument" in capsys.readouterr().err
