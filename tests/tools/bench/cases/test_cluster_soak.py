"""`kinespace bench cluster-soak`, small: what it counts while a worker is killed."""

from __future__ import annotations

import math
from collections import Counter
from typing import TYPE_CHECKING

import pytest

from kinespace.library import MotionLibrary
from kinespace.tools.bench.cases import cluster_soak
from kinespace.tools.feeding.feed import without_pause

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


def two_motions() -> NDArray[np.float32]:
    """Give two motions of the built-in library, four seconds of each."""
    library = MotionLibrary.builtin()
    motions = {motion.class_name: motion for motion in library.motions}
    chosen = (motions[name].as_of(library.skeleton) for name in ("squat1Reps", "rotateArmsBothBackward1Reps"))
    return without_pause(chosen, 120.0, 8.0)


@pytest.mark.slow
def test_a_worker_is_killed_and_no_event_is_missed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rounds after the first bring the events of one process, also when a worker dies among them."""
    pytest.importorskip("zenoh")
    monkeypatch.setattr(cluster_soak, "_KILLS", 1)
    positions = two_motions()
    seconds = 4 * len(positions) / 120
    endured = cluster_soak.measure(positions, minutes=seconds / 60, crowd=2)
    assert (endured.performers, endured.kills, endured.rounds) == (2, 1, 2)
    assert endured.lags.total() > 4 * seconds
    assert 0 < endured.percentile(50) <= endured.percentile(99)
    assert endured.events > 0


def test_percentiles_come_from_counts() -> None:
    """Lags are counted in tenths of a millisecond."""
    lags = Counter({5: 90, 20: 9, 1000: 1})
    endured = cluster_soak.Endured(1, 1.0, 0, lags, 1, 1, 0, 0, "none", (None, None))
    assert [endured.percentile(percent) for percent in (50, 90, 99, 99.9)] == [0.5, 0.5, 2.0, 100.0]
    assert math.isnan(cluster_soak.Endured(1, 1.0, 0, Counter(), 1, 1, 0, 0, "none", (None, None)).percentile(50))
