"""`kinespace bench` as a person runs it, small. No figure is held against a limit here."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
from programs import finished
from test_bench_report import KEYS

from stream.recognizer import LiveSignature
from tools.bench import run, sockets
from tools.bench.growth import Sizes
from tools.cli import main

if TYPE_CHECKING:
    from pathlib import Path

    from tools.bench.recorded import Recorded


def test_one_part_prints_exactly_the_standard_figures(data_folder: Path) -> None:
    """As a command of its own, one part gives one JSON object: all names, its own figures, null for the others."""
    status, output, errors = finished("bench", "stages", "--rounds", 1, "--data", data_folder, "--json")
    assert (status, errors) == (0, "")
    assert output.count("\n") == 1
    figures = json.loads(output)
    assert sorted(figures) == sorted(KEYS)
    measured = {name for name, figure in figures.items() if figure is not None}
    assert measured == {
        "us_per_frame",
        "us_per_frame_numpy",
        "frames_per_second",
        "osc_decode_us",
        "osc_decode_python_osc_us",
    }
    assert min(figures[name] for name in measured) > 0


def test_parts_fill_their_figures(recordings: Recorded, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run small, growth, sockets and soak together give every figure that is theirs."""
    monkeypatch.setattr(sockets, "_CROWD_SECONDS", 1.5)
    effort = run.Effort(
        rounds=1,
        seconds=1.8,
        frames=600,
        minutes=0.0,
        sizes=Sizes((15, 20), (0.5, 1.0), (288, 200_000), (1, 2)),
        rates=(120.0, 360.0),
        most=1,
        starts=1,
    )
    report = run.measured(("growth", "sockets", "soak"), recordings, signature=None, effort=effort)
    figures = report.figures()
    theirs = {name for name, figure in figures.items() if figure is not None}
    memory = {"rss_mb", "rss_100_mb"}
    assert theirs | memory == {
        *("pairs_exponent", "match_200k_ms", "latency_p99_ms", "echo_p99_ms", "lost_360", "performers_at_120hz"),
        *(
            "startup_s",
            "max_eigenvector_error",
            "floor_performers_at_120hz",
            *("match_200k_together_ms", "match_200k_recall"),
            "rss_mb",
            "rss_100_mb",
        ),
    }
    assert report.soak is not None
    assert report.soak.day.frames == 600


def test_the_table_says_on_what_it_was_measured(
    data_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without --json tables are printed, then the machine; the picture asked for is drawn."""
    path = tmp_path / "bench.png"
    arguments = ["bench", "stages", "--rounds", "1", "--data", str(data_folder), "--picture", str(path)]
    assert main(arguments) == 0
    printed = capsys.readouterr().out
    for signature in LiveSignature:
        assert f"From packet to answer, {signature}" in printed
    assert " cores" in printed.splitlines()[-1]
    assert path.read_bytes().startswith(b"\x89PNG")


def test_missing_recordings_are_told_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without recordings, named, in the environment or in the usual place, one line says what is expected."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("KINESPACE_DATA", raising=False)
    asked = (["--data", str(tmp_path)], [])
    for options in asked:
        assert main(["bench", "stages", *options]) == 2
        errors = capsys.readouterr().err
        assert errors.startswith("kinespace: --data: expected a folder with hdm05_cut_amc/ and cmu/ in it, got ")
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
