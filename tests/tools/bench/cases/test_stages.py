"""`kinespace bench stages`: every step has a cost, and the shares add up. No figure is held against a limit here."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from kinespace.library import MotionLibrary
from kinespace.library.kernels import compiled
from kinespace.stream.recognizer import LiveSignature, Recognizer, Settings
from kinespace.tools.bench.cases import stages
from kinespace.tools.bench.cases.stages import ROUND, STEPS, WARM_UP

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from kinespace.stream.frame import Frame
    from kinespace.stream.recognition import Recognition

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("signature", list(LiveSignature))
def test_every_step_has_its_cost_and_share(signature: LiveSignature, played: NDArray[np.float32]) -> None:
    """All steps from packet to answer are there, costs positive, the shares of each transport's way add up to one."""
    found = stages.measure(played, signatures=[signature], rounds=1)[signature]
    assert tuple(found.us) == STEPS
    assert min(found.us.values()) > 0
    for other in ("OSC", "ZeroMQ"):
        shares = [found.share(step) for step in STEPS if other not in step and step != "recognise"]
        way = found.us["recognise"] + sum(us for step, us in found.us.items() if other not in step and "cod" in step)
        assert sum(shares) == pytest.approx(1 - found.us["recognise"] / way)
    assert found.share("recognise") == pytest.approx(
        found.us["recognise"] / (found.us["decode OSC"] + found.us["recognise"] + found.us["encode OSC"])
    )
    assert found.us_per_frame == found.us["recognise"]
    assert found.frames_per_second == pytest.approx(1e6 / found.us_per_frame)
    assert found.us_per_frame_numpy > 0
    assert found.osc_decode_python_osc_us > 0


@pytest.mark.parametrize("by_numpy", [False, True])
def test_the_loops_are_left_aside_when_asked(
    by_numpy: bool,  # noqa: FBT001 - a parameter of the test
    played: NDArray[np.float32],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A job pushes each next frame once, in four seconds' rounds, with the arithmetic that was asked for."""
    seen: list[tuple[float, bool]] = []

    class Watched(Recognizer):
        def push(self, frame: Frame) -> Recognition | None:
            seen.append((frame.time, compiled.loops is None))
            return super().push(frame)

    monkeypatch.setattr(stages, "Recognizer", Watched)
    run = stages.pushing(MotionLibrary.builtin(), played, Settings(), by_numpy=by_numpy)
    assert len(seen) == WARM_UP
    assert min(run(), run()) > 0
    assert len(seen) == WARM_UP + 2 * ROUND
    assert [time for time, _ in seen] == sorted({time for time, _ in seen})
    assert {left_aside for _, left_aside in seen} == {by_numpy or compiled.loops is None}
