"""The bench's report: the standard figures, tables and the picture of made-up results."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
import pytest

from kinespace.stream.recognizer import LiveSignature, RecognizerCounts
from kinespace.tools.bench import picture
from kinespace.tools.bench.cases.capacity import Crowd
from kinespace.tools.bench.cases.cluster_soak import Endured
from kinespace.tools.bench.cases.peers import Peer, Peers
from kinespace.tools.bench.cases.scale import Run, Scale
from kinespace.tools.bench.cases.scaling import Growth
from kinespace.tools.bench.cases.soak import Day, Soak
from kinespace.tools.bench.cases.sockets import Sockets
from kinespace.tools.bench.cases.stages import Stages
from kinespace.tools.bench.cases.startup import Running
from kinespace.tools.bench.report import Report
from kinespace.tools.programs.latency import Latency
from kinespace.tools.terminal.console import console

if TYPE_CHECKING:
    from pathlib import Path

KEYS = (
    *("us_per_frame", "us_per_frame_numpy", "frames_per_second", "osc_decode_us", "osc_decode_python_osc_us"),
    *("ratio_svd", "ratio_eigh", "ratio_dtw", "accuracy", "accuracy_svd", "accuracy_eigh", "accuracy_dtw"),
    *("latency_p99_ms", "echo_p99_ms", "lost_360"),
    *("performers_at_120hz", "floor_performers_at_120hz", "performers_share_of_floor"),
    *("pairs_exponent", "match_200k_ms", "rss_mb", "rss_100_mb", "startup_s", "max_eigenvector_error"),
    *("added_p50_ms", "added_p99_ms", "performers_per_core_ratio", "kill_gap_s", "hang_gap_s", "gateway_gap_s"),
    *("lost_events", "false_events", "workers_speedup", "leave_gap_s", "join_gap_s"),
)


def made_up(signature: LiveSignature = LiveSignature.PAPER) -> Report:
    """Make a report of round numbers."""
    steps = {"decode OSC": 4.0, "decode ZeroMQ": 9.0, "recognise": 40.0, "encode OSC": 6.0, "encode ZeroMQ": 11.0}
    names = (*LiveSignature, "SVD of the window", "np.cov + eigh", "DTW")
    ratios = {
        name: dict(zip(LiveSignature, (place + 1.0, 2 * place + 1.0), strict=True)) for place, name in enumerate(names)
    }
    seconds = np.arange(1001) / 1e6
    latencies = tuple(
        Latency(transport, rate, 100, 90, lost, seconds * rate / 120, seconds / 10)
        for transport, lost in (("osc", 1), ("zmq", 2))
        for rate in (120.0, 360.0)
    )
    crowd = Crowd(64, 1000, 250, 250, 0, seconds, 0.0, (80.0, 81.0, 82.0), 0.53, None)
    floor = replace(crowd, performers=320)
    return Report(
        signature,
        stages={
            LiveSignature.WINDOWS: Stages({**steps, "recognise": 50.0, "decode OSC": 4.5}, 100.0, 36.0),
            LiveSignature.PAPER: Stages(steps, 60.0, 37.0),
        },
        peers=Peers(
            tuple(Peer(name, 40.0, ratios[name], 0.9 - place / 10) for place, name in enumerate(names)),
            *("somebody", 58, 2400),
        ),
        growth=(
            Growth("joints", "a frame", ("15", "31"), (105.0, 465.0), (10.0, 40.0), 0.93),
            Growth("library", "an answer", ("288", "200000"), (288.0, 200000.0), (20.0, 1900.0), 0.7),
        ),
        sockets=Sockets(
            latencies, {"osc": crowd, "zmq": None}, {"osc": floor, "zmq": crowd}, Running(0.75, 100.0, None)
        ),
        soak=Soak(
            Day(1000, 2.0, (90.0, 91.0, 92.0), 7, 3e-7, 250, RecognizerCounts(frames=1000, hops=250)),
            crowd,
        ),
        scale=Scale(
            130,
            one := Run("one process", np.full(9, 1e-3), 0.03, 9, 9, 0, 0, 30.0),
            replace(one, what="live --workers 2", core_us=32.0),
            {
                "nothing": replace(one, what="nothing", lags=np.full(9, 1.5e-3), loop_us=5.0, core_us=40.0),
                "kill": replace(one, what="kill", gap=0.25, lost_events=1),
                "hang": replace(one, what="hang", gap=1.25, false_events=2),
                "leave": replace(one, what="leave", gap=0.05),
                "join": replace(one, what="join", gap=0.0625),
            },
            (one, replace(one, what="two, all at once", core_us=32.0)),
            (replace(one, loop_us=float("nan"), core_us=45.0), replace(one, what="three, busier", core_us=60.0)),
            1.5,
            0.75,
            (98, 1),
            25.0,
        ),
        cluster_soak=Endured(
            *(30, 20.0, 12, Counter({7: 980, 91: 10, 500: 10}), 14, 500, 3, 4),
            "18 frames dropped because workers were busy",
            (70.0, 71.0),
        ),
    )


def test_the_standard_figures_come_from_the_results() -> None:
    """Every figure stands under its name, taken from its part, and is valid JSON."""
    figures = made_up().figures()
    assert tuple(sorted(figures)) == tuple(sorted(KEYS))
    assert figures == {
        "us_per_frame": 40.0,
        "us_per_frame_numpy": 60.0,
        "frames_per_second": 25000.0,
        "ratio_svd": 5.0,
        "ratio_eigh": 7.0,
        "ratio_dtw": 9.0,
        "accuracy": 0.8,
        "accuracy_svd": 0.7,
        "accuracy_eigh": 0.6,
        "accuracy_dtw": 0.5,
        "osc_decode_us": 4.0,
        "osc_decode_python_osc_us": 37.0,
        "latency_p99_ms": 0.99,
        "echo_p99_ms": 0.099,
        "lost_360": 3,
        "performers_at_120hz": 64,
        "floor_performers_at_120hz": 320,
        "performers_share_of_floor": 0.2,
        "pairs_exponent": 0.93,
        "match_200k_ms": 1.9,
        "rss_mb": 100.0,
        "rss_100_mb": None,
        "startup_s": 0.75,
        "max_eigenvector_error": 3e-7,
        "added_p50_ms": 0.5,
        "added_p99_ms": 0.5,
        "performers_per_core_ratio": 0.75,
        "workers_speedup": 1.875,
        "kill_gap_s": 0.25,
        "hang_gap_s": 1.25,
        "leave_gap_s": 0.05,
        "join_gap_s": 0.0625,
        "gateway_gap_s": 1.5,
        "lost_events": 1,
        "false_events": 2,
    }
    assert json.loads(json.dumps(figures, allow_nan=False)) == figures


def test_the_figures_describe_the_chosen_signature() -> None:
    """With the signature windows, cost and ratios describe that signature."""
    figures = made_up(LiveSignature.WINDOWS).figures()
    assert (figures["us_per_frame"], figures["ratio_svd"], figures["osc_decode_us"]) == (50.0, 3.0, 4.5)
    assert figures["accuracy"] == 0.9


def test_parts_that_did_not_run_are_null() -> None:
    """Every name is always there; without any part every figure is null, and there is no table."""
    report = Report(LiveSignature.PAPER)
    assert report.figures() == dict.fromkeys(KEYS)
    assert list(report.tables()) == []
    report.sockets = Sockets((), {"osc": None, "zmq": None}, {"osc": None, "zmq": None}, Running(0.5, None, None))
    assert report.figures()["performers_at_120hz"] == 0
    assert report.figures()["floor_performers_at_120hz"] == 0
    assert report.figures()["performers_share_of_floor"] is None
    assert report.figures()["latency_p99_ms"] is None
    assert report.figures()["lost_360"] is None


def test_the_tables_name_everything(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Each part has its table, with every step, peer, size, rate and counter in it."""
    monkeypatch.setattr(console, "width", 200)
    for table in made_up().tables():
        console.print(table)
    printed = capsys.readouterr().out
    told = (
        *(
            "From packet to answer, windows",
            "recognised frames a second",
            "20,000",
            "ours, paper",
            "58 motions of somebody",
        ),
        *(
            "200000",
            "0.93",
            "zmq echo",
            "360",
            "first answer",
            "0.75 s",
            "100.0 MB",
            "90.0 MB, 91.0 MB, 92.0 MB",
        ),
        *(
            "a loop that recognises nothing",
            "320",
            "20.0%",
            "3.00e-07 in 7 answers",
            ": consistent",
            "over UDP, 64 performers",
            "80.0 MB, 81.0 MB, 82.0 MB",
        ),
        *(
            "130 performers; three workers",
            "kill",
            "hang",
            "gateway is started again",
            "of 98 takeovers by themselves",
            "two, all at once",
            "three, busier",
            "20 minutes of 30 performers, three workers, 12 killed",
            "0.7, 9.1, 50.0",
            "3, 4 of 500",
            "18 frames dropped",
            "70.0 MB, 71.0 MB",
        ),
    )
    for text in told:
        assert text in printed


@pytest.mark.slow
def test_the_picture_shows_every_part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An SVG contains, as text, every peer, step and growth; of two parts it shows only those."""
    monkeypatch.setitem(mpl.rcParams, "svg.fonttype", "none")
    picture.draw(tmp_path / "all.svg", made_up())
    drawn = (tmp_path / "all.svg").read_text(encoding="utf-8")
    for text in (
        *(
            "kinespace, windows",
            "DTW",
            "decode OSC",
            "recognise",
            "joints, 15 to 31: exponent 0.93 of their pairs",
        ),
        *("OSC, p99", "ZeroMQ echo, p50", "Speed and accuracy on the same feed"),
    ):
        assert f">{text}</text>" in drawn
    report = made_up()
    report.peers = report.sockets = None
    picture.draw(tmp_path / "some.svg", report)
    some = (tmp_path / "some.svg").read_text(encoding="utf-8")
    assert "DTW" not in some
    assert "exponent 0.93" in some


def test_a_picture_of_nothing_is_refused(tmp_path: Path) -> None:
    """Without a part that can be drawn no file is written, and the error lists the parts."""
    with pytest.raises(ValueError, match="--picture: expected stages, peers, growth or sockets"):
        picture.draw(tmp_path / "none.png", Report(LiveSignature.PAPER))
    assert not list(tmp_path.iterdir())
