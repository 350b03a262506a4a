"""`kinespace bench soak`: counters, memory and the share of variance of a long feed, here a short one."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from kinespace.stream.recognizer import LiveSignature, Recognizer, Settings
from kinespace.tools.bench.cases import soak

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from kinespace.stream.frame import Frame
    from kinespace.stream.recognition import Recognition

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("signature", list(LiveSignature))
def test_a_long_feed_is_accounted_for(
    signature: LiveSignature, played: NDArray[np.float32], monkeypatch: pytest.MonkeyPatch
) -> None:
    """All frames are pushed and counted, memory is looked at three times, the eigenvector checked and right."""
    monkeypatch.setattr(soak, "_CHECK_EVERY", 397)
    day = soak.pushed(played, Settings(signature=signature, plausibility=False), 2500)
    assert day.frames == day.counts.frames == 2500
    # The first window is full with frame 19; from then on every fourth frame is answered.
    assert day.answers == day.counts.hops == 621
    assert day.consistent
    assert day.checked == 6
    assert day.max_error is not None
    assert 0 < day.max_error < 1e-6
    assert all(megabytes is None or megabytes > 10 for megabytes in day.resident_mb)
    for wrong in ({"frames": 2499}, {"answers": 1}, {"counts": replace(day.counts, restarts=1)}):
        assert not replace(day, **wrong).consistent  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["share", "gap", "eigenvector_score"])
def test_drift_is_detected(name: str, played: NDArray[np.float32], monkeypatch: pytest.MonkeyPatch) -> None:
    """A recogniser whose numbers drift by a millionth with each frame is detected."""

    class Drifting(Recognizer):
        def push(self, frame: Frame) -> Recognition | None:
            answer = super().push(frame)
            return answer and replace(answer, **{name: getattr(answer, name) + 1e-6 * self.counts.frames})

    monkeypatch.setattr(soak, "Recognizer", Drifting)
    monkeypatch.setattr(soak, "_CHECK_EVERY", 100)
    # The other one has seen 360 frames of the 799 before the last answer.
    assert soak.pushed(played, Settings(), 800).max_error == pytest.approx(439e-6, abs=60e-6)


def test_a_short_feed_is_not_checked(played: NDArray[np.float32]) -> None:
    """A feed shorter than three seconds is not checked; without minutes there is no feed over sockets."""
    found = soak.measure(played, signature=LiveSignature.WINDOWS, frames=300, minutes=0.0)
    assert found.over_sockets is None
    assert (found.day.checked, found.day.max_error) == (0, None)
    assert found.day.consistent


def test_the_same_goes_over_sockets(played: NDArray[np.float32]) -> None:
    """For as long as asked some performers are fed over UDP, everything counted."""
    found = soak.measure(played, signature=LiveSignature.PAPER, frames=200, minutes=0.03)
    crowd = found.over_sockets
    assert crowd is not None
    assert crowd.sent == 216 * crowd.performers
    # The first window is full with frame 19; from then on every fourth frame is answered.
    assert crowd.expected == 50 * crowd.performers
    assert crowd.answered + crowd.lost >= crowd.expected
