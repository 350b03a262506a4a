"""`kinespace bench sockets` and `scale`, small: what they count. No figure is held against a limit here."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from kinespace.stream import zeromq
from kinespace.stream.recognition import Event, EventKind
from kinespace.stream.recognizer import Settings
from kinespace.stream.zeromq import answers as zeromq_answers
from kinespace.tools.bench import scale
from kinespace.tools.bench.crowd import Feed, Played
from kinespace.tools.loopback.answers import Received


@pytest.mark.slow
def test_answers_are_compared_with_one_process(played: NDArray[np.float32]) -> None:
    """Lags, the longest gap beyond one process's own, and what is missing or false come from what was received."""
    feed = Feed.of(played, 2, 4.0)
    sent = {(frame.performer, frame.time): frame.time for together in feed.frames for frame in together}
    one = next(each for each in feed.answers if each.events)
    answered_at = [(each, each.time + 0.01) for each in feed.answers]
    packets = [(zeromq.encode_recognition(each), at) for each, at in answered_at]
    packets += [(zeromq_answers.encode_event(event), at) for each, at in answered_at for event in each.events]
    packets_back = [Received(None, packet, at) for packet, at in sorted(packets, key=lambda each: each[1])]  # type: ignore[arg-type]
    run = scale.run_of(feed, Played(0.0, sent, packets_back), 0.0, [20.0, 30.0])
    np.testing.assert_allclose(run.lags, 0.01)
    assert run.percentile(50) == pytest.approx(10)
    assert run.gap == pytest.approx(Settings().hop, abs=1 / 100)
    assert run[2:] == (0, 0, 0, 30.0, 20.0)
    silent = [each for each in packets_back if one.time <= each.arrival < one.time + 1 or each.packet[0] == b"status/"]
    fewer = [each for each in packets_back if each not in silent]
    strange = zeromq_answers.encode_event(Event("p0", EventKind.START, "nobody's", 0, 1.0, 1.0))
    run = scale.run_of(feed, Played(0.0, sent, [*fewer, Received(None, strange, 9.0)]), 0.0, [math.nan])  # type: ignore[arg-type]
    assert run.missing > 25
    assert run.gap == pytest.approx(1, abs=0.1)
    assert (run.lost_events >= 1, run.false_events, math.isnan(run.core_us)) == (True, 1, True)


@pytest.mark.slow
def test_answers_come_to_the_end(played: NDArray[np.float32]) -> None:
    """Past a worker that is killed."""
    pytest.importorskip("zenoh")
    run = scale.run_with(Feed.of(played, 2, 2.0), "gateway", workers=3, happen=scale.HAPPENINGS["kill"])
    assert run.lags.size
    assert math.isfinite(run.gap)
