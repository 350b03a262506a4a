"""`kinespace bench soak`: counters, memory and the eigenvector of a long feed, here a short one."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from stream.recognizer import LiveSignature, Settings
from tools.bench import soak
from tools.bench.inner import last_axis

if TYPE_CHECKING:
    from library.eigen import LeadingAxis
    from stream.recognizer import Recognizer
    from tools.bench.recorded import Recorded

SETTINGS = Settings(signature=LiveSignature.EIGENVECTOR)


def test_a_long_feed_is_accounted_for(recordings: Recorded, monkeypatch: pytest.MonkeyPatch) -> None:
    """All frames are pushed and counted, memory is looked at three times, the eigenvector is checked and right."""
    monkeypatch.setattr(soak, "_CHECK_EVERY", 97)
    day = soak.pushed(recordings.positions, SETTINGS, 2500)
    assert day.frames == day.counts.frames == 2500
    # The first window is full with frame 121; from then on every fourth frame is answered.
    assert day.answers == day.counts.hops == 595
    assert day.consistent
    assert day.checked > 20
    assert day.max_error is not None
    assert 0 < day.max_error < 1e-4
    assert all(megabytes is None or megabytes > 10 for megabytes in day.resident_mb)
    for wrong in ({"frames": 2499}, {"answers": 1}, {"counts": replace(day.counts, restarts=1)}):
        assert not replace(day, **wrong).consistent  # type: ignore[arg-type]


def test_a_wrong_eigenvector_is_seen(recordings: Recorded, monkeypatch: pytest.MonkeyPatch) -> None:
    """A recogniser whose axis is off by a hundredth, of either sign, is found out."""

    def turned(recognizer: Recognizer) -> LeadingAxis | None:
        axis = last_axis(recognizer)
        assert axis is not None
        # A direction square to the axis.
        other = np.roll(axis.vector, 1)
        other -= (other @ axis.vector) * axis.vector
        other = axis.vector + 0.01 * other / np.linalg.norm(other)
        return replace(axis, vector=-other / np.linalg.norm(other))

    monkeypatch.setattr(soak, "last_axis", turned)
    day = soak.pushed(recordings.positions, SETTINGS, 400)
    assert day.max_error == pytest.approx(0.01, rel=0.05)


def test_windows_have_no_eigenvector_to_check(recordings: Recorded) -> None:
    """The other signature runs as long, with nothing to compare."""
    found = soak.measure(recordings.positions, signature=LiveSignature.WINDOWS, frames=300, minutes=0.0)
    assert found.over_sockets is None
    assert (found.day.checked, found.day.max_error) == (0, None)
    assert found.day.consistent


def test_the_same_goes_over_sockets(recordings: Recorded) -> None:
    """For as long as asked some performers are fed over UDP, everything counted."""
    found = soak.measure(recordings.positions, signature=LiveSignature.EIGENVECTOR, frames=200, minutes=0.03)
    crowd = found.over_sockets
    assert crowd is not None
    assert crowd.sent == 216 * crowd.performers
    assert crowd.expected == 24 * crowd.performers
    assert crowd.answered + crowd.lost >= crowd.expected
