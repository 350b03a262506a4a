"""`kinespace latency`: frame sent to answer received, and of a bare echo. No figure is held against a limit here."""

import multiprocessing

import numpy as np
import pytest

from kinespace.stream import Settings
from kinespace.tools.cli.main import main
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


@pytest.mark.parametrize(("seconds", "hop"), [("0.5", "0.03"), ("1.1", "1")])
def test_too_short_a_run_is_refused(seconds: str, hop: str, capsys: pytest.CaptureFixture[str]) -> None:
    """A run without an answer after the warm-up ends with one line and status 2, and starts no process."""
    assert main(["latency", "--seconds", seconds, "--hop", hop]) == 2
    assert capsys.readouterr().err == (
        f"kinespace: --seconds: expected enough for an answer after the first 0.5 s, got {seconds}\n"
    )
    assert multiprocessing.active_children() == []
