"""`kinespace latency`: frame sent to answer received, and of a bare echo. No figure is held against a limit here."""

import numpy as np
import pytest

from kinespace.stream import Settings
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
