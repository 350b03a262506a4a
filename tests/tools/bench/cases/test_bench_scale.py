"""`kinespace bench scale`, small: what it counts, and a worker that is killed. No figure is held against a limit."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import pytest

from kinespace.stream.recognition import Event, EventKind
from kinespace.tools.bench import network
from kinespace.tools.bench.cases import scale

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

pytestmark = pytest.mark.slow


def test_a_feed_is_recognised_by_one_process_as_expected(played: NDArray[np.float32]) -> None:
    """In one process every answer comes, no event is lost or false, and each answer has its time."""
    feed = scale.Feed.of(played, 3, 1.0)
    run = scale.alone(feed)
    assert run.answered == run.expected == feed.due > 60
    assert (run.lost_events, run.false_events) == (0, 0)
    assert run.lags.shape == (feed.due,)
    assert run.core_us is None


def test_one_process_over_osc_tells_its_processor_time(played: NDArray[np.float32]) -> None:
    """What a core holds over OSC is told by the process's own time: more than a frame's recognition, less than all."""
    run = scale.over_osc(played, 2, 2.0)
    assert run.answered
    assert run.core_us is None or 10 < run.core_us < 1e6 / 240
    assert math.isnan(run.loop_us)


def test_takeovers_are_compared_with_an_uninterrupted_feed(
    played: NDArray[np.float32], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A worker that has seen all that the other has seen gives the same events; one that has seen nothing does not."""
    monkeypatch.setattr(scale, "_AFTER", 1200)
    monkeypatch.setattr(scale, "_EVERY", 2000)
    assert scale.takeovers(played[:1441], 2.0) == (1, 0)
    told, entries = Event("p", EventKind.START, "squat1Reps", 10, 1.0, 1.0), scale.Ledger.entries
    changed = lambda *given: [msgspec.structs.replace(each, going_on=told) for each in entries(*given)]  # noqa: E731
    monkeypatch.setattr(scale.Ledger, "entries", changed)
    assert scale.takeovers(played[:1441], 2.0) == (1, 1)


def test_a_worker_is_killed(played: NDArray[np.float32]) -> None:
    """Through real workers of which one is killed answers come to the end."""
    pytest.importorskip("zenoh")
    feed = scale.Feed.of(played, 2, 3.0)
    run = scale.play(feed, "kill")
    assert run.what == "kill"
    assert run.answered
    assert math.isfinite(run.gap)


def test_a_network_is_cut(played: NDArray[np.float32], monkeypatch: pytest.MonkeyPatch) -> None:
    """Behind a network that was cut a worker works again, and answers came to the end."""
    pytest.importorskip("zenoh")
    try:
        with network.Network():
            pass
    except OSError as error:
        pytest.skip(f"no network namespace can be made: {error}")
    monkeypatch.setattr(network, "_CUT", 1.5)
    cut = scale.network_cut(scale.Feed.of(played, 2, 3.0))
    assert cut
    run, healed = cut
    assert run.answered
    assert 0 < healed < math.inf
