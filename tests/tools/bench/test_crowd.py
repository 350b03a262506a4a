"""`kinespace bench sockets` and `scale`, small: what they count. No figure is held against a limit here."""

import math
import os
import sys
import time

import numpy as np
import pytest
from numpy.typing import NDArray

from kinespace.stream import zeromq
from kinespace.stream.recognition import Event, EventKind
from kinespace.stream.recognizer import Settings
from kinespace.stream.zeromq import answers as zeromq_answers
from kinespace.tools.bench import scale
from kinespace.tools.bench.crowd import Feed, Played, core_seconds, performers_a_core
from kinespace.tools.loopback.answers import Received


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux is asked")
def test_time_on_a_core_is_of_the_process_asked_for() -> None:
    """A busy process's time agrees with its own count; the time of a missing process is unknown."""
    before, begun = core_seconds(os.getpid()), time.process_time()
    while time.process_time() < begun + 0.3:
        pass
    # The system counts hundredths of a second.
    assert core_seconds(os.getpid()) - before == pytest.approx(time.process_time() - begun, abs=0.1)
    assert math.isnan(core_seconds(2**22 + 1))
    assert performers_a_core(100.0) == pytest.approx(83.3, abs=0.1)


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
@pytest.mark.parametrize("what", ["nothing", "kill"])
def test_answers_come_to_the_end(what: str, played: NDArray[np.float32]) -> None:
    """From `live`, and past a worker that is killed."""
    feed = Feed.of(played, 2, 2.0)
    run = scale.run_with(feed) if what == "nothing" else scale.run_with(feed, 3, happen=scale.HAPPENINGS[what])
    assert run.lags.size
    assert math.isfinite(run.gap)


def test_the_figures_of_scale_follow_from_its_runs() -> None:
    """Every figure has its name."""
    names = ["live", "two workers", *scale.HAPPENINGS]
    names += ["live, at once", "two workers, at once"]
    runs = {name: scale.Run(np.full(9, 0.001 * k), k / 10, 0, 1, 2, 10.0 * k, 5.0) for k, name in enumerate(names, 1)}
    figures = scale._figures(runs)  # noqa: SLF001 - the published figures
    assert set(figures) == set(scale.FIGURES)
    assert figures["added_p99_ms"] == pytest.approx(1.0)
    assert (figures["kill_gap_s"], figures["hang_gap_s"]) == (0.3, 0.4)
    assert figures["workers_speedup"] == pytest.approx(5 / 6)
    assert (figures["lost_events"], figures["false_events"]) == (6, 12)
    drawn = scale._table(runs, 12)  # noqa: SLF001 - as above
    assert drawn.row_count == len(names)
