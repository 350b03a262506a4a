"""`kinespace bench stages`: every step has a cost, and the costs add up. No figure is held against a limit here."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from library import MotionLibrary
from library.distances import distance_rows
from library.signature import Moments, signature_of
from stream.recognizer import LiveSignature, Recognizer, Settings
from tools.bench import stages
from tools.bench.inner import EigenvectorSteps, WindowSteps, last_axis, steps_of
from tools.bench.recorded import Feed

if TYPE_CHECKING:
    from stream.frame import Frame
    from stream.recognition import Recognition
    from tools.bench.recorded import Recorded

INNER = {
    LiveSignature.EIGENVECTOR: ["distances", "window", "covariance", "eigenvector", "match"],
    LiveSignature.WINDOWS: ["distances", "window", "covariance", "match"],
}


@pytest.mark.parametrize("signature", list(LiveSignature))
def test_every_step_has_its_cost_and_share(signature: LiveSignature, recordings: Recorded) -> None:
    """All steps from packet to answer are there, costs positive, the shares of each transport's way add up to one."""
    found = stages.measure(recordings.positions, signatures=[signature], rounds=1)[signature]
    by_name = {stage.name: stage for stage in found.stages}
    transports = ["decode OSC", "decode ZeroMQ", "encode OSC", "encode ZeroMQ"]
    assert sorted(by_name) == sorted([*INNER[signature], *transports, "recogniser's own"])
    for stage in found.stages:
        assert stage.us_per_frame > 0 or stage.name == "recogniser's own"
        # An answer comes every fourth frame.
        assert stage.us == pytest.approx(stage.us_per_frame * (4 if stage.per == "hop" else 1))
    assert {stage.per for stage in found.stages if stage.name in {"covariance", "eigenvector", "match"}} == {"hop"}
    own = by_name["recogniser's own"]
    whole = by_name["decode OSC"].us_per_frame + found.us_per_frame + by_name["encode OSC"].us_per_frame
    shares = sum(stage.share for stage in found.stages if "ZeroMQ" not in stage.name)
    # When the steps alone took longer than the recogniser did, nothing is left as its own.
    assert shares == pytest.approx(1.0) if own.us_per_frame > 0 else shares >= 1.0
    assert own.share == pytest.approx(own.us_per_frame / whole)
    assert found.frames_per_second == pytest.approx(1e6 / found.us_per_frame)
    assert found.osc_decode_us == by_name["decode OSC"].us_per_frame
    assert found.osc_decode_python_osc_us > 0
    assert found.us_per_frame_numpy > 0


def test_what_is_kept_is_seen(recordings: Recorded, monkeypatch: pytest.MonkeyPatch) -> None:
    """A recogniser that keeps a kilobyte of every frame is found out; ours keeps nothing to speak of."""
    library = MotionLibrary.builtin()
    settings = Settings(signature=LiveSignature.EIGENVECTOR)
    honest = stages.memory_left(library, recordings.positions, settings)
    assert honest.kept < 16
    assert 0 < honest.frame < honest.hop
    hoard = []

    class Hoarder(Recognizer):
        def push(self, frame: Frame) -> Recognition | None:
            hoard.append(np.zeros(128))
            return super().push(frame)

    monkeypatch.setattr(stages, "Recognizer", Hoarder)
    assert stages.memory_left(library, recordings.positions, settings).kept > 1024


@pytest.mark.parametrize("signature", list(LiveSignature))
def test_the_steps_are_what_the_recogniser_does(signature: LiveSignature, recordings: Recorded) -> None:
    """Stepped through by its parts, a second of real feed comes to the very numbers that the recogniser comes to."""
    library, settings = MotionLibrary.builtin(), Settings(signature=signature)
    recognizer, steps, feed = Recognizer(library, settings), steps_of(library, settings), Feed(recordings.positions)
    compared, last = 0, 0.0
    averaged: np.ndarray | None = None
    for _ in range(300):
        frame = feed.next()
        recognition = recognizer.push(frame)
        steps.push([frame.time], distance_rows(frame.positions[None], library.skeleton))
        if recognition is None:
            continue
        assert steps.ready
        for step in steps.steps.values():
            step()
        compared += 1
        if isinstance(steps, EigenvectorSteps):
            axis, ours = last_axis(recognizer), steps.axis
            assert axis is not None
            assert ours is not None
            assert abs(ours.vector @ axis.vector) == pytest.approx(1.0, abs=1e-9)
            rows = distance_rows(feed.last(120), library.skeleton)
            exact = signature_of(Moments.of_rows(rows)).axis
            assert abs(exact.vector @ axis.vector) == pytest.approx(1.0, abs=1e-6)
        else:
            assert isinstance(steps, WindowSteps)
            assert last_axis(recognizer) is None
            assert steps.distances is not None
            # The recogniser averages over a tenth of a second what a step finds at a moment.
            before, averaged = averaged, steps.distances
            if before is not None:
                averaged = before - np.expm1(-(frame.time - last) / 0.1) * (steps.distances - before)
            last = frame.time
            np.testing.assert_allclose(1 / (1 + np.exp(averaged)), recognition.scores, rtol=1e-6)
    assert compared > 20
