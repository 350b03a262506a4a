"""A worker that takes a performer over knows what the performer's last seconds do not show."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np
import pytest

from kinespace.library.windows.index import opened
from kinespace.stream.frame import Frame
from kinespace.stream.recognizer import Performers
from kinespace.stream.recognizer.joints.plausibility import mirrored_places
from kinespace.stream.workers.ledger import Ledger
from kinespace.stream.workers.partition import PARTITIONS
from kinespace.stream.workers.wire import decode_frames, encode_frames
from kinespace.stream.workers.worker import Worker

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from kinespace.library import MotionLibrary
    from kinespace.stream.workers.wire import Answered, SentFrame

RATE = 60
#: Frames before the takeover, frames that the new worker sees first, and frames after it.
BEFORE, SEEN, AFTER = 300, 151, 60


def pushed(worker: Worker, frames: Sequence[SentFrame]) -> list[Answered]:
    """Send frames to a worker; give its answers."""
    return [answer for each in frames for answer in worker.push(decode_frames(encode_frames([each])), each.at)]


def feed(library: MotionLibrary) -> NDArray[np.float64]:
    """Play squats, forwards and backwards by turns so that the body never jumps."""
    squat = next(motion.positions[::2] for motion in library.motions if motion.class_name == "squat1Reps")
    return np.resize(np.concatenate([squat, squat[::-1]]), (BEFORE + AFTER, *squat.shape[1:])).astype(np.float64)


def exchanged(positions: NDArray[np.float64], library: MotionLibrary) -> NDArray[np.float64]:
    """Exchange left and right."""
    return positions[:, mirrored_places(library.skeleton.joints)]


def in_millimetres(positions: NDArray[np.float64], _: MotionLibrary) -> NDArray[np.float64]:
    """Change the unit."""
    return positions * 1000.0


def jumping(positions: NDArray[np.float64], _: MotionLibrary) -> NDArray[np.float64]:
    """Let the body jump to another posture before the frames that the new worker sees, and back among them."""
    changed = positions.copy()
    rows = np.abs(positions - positions[:1]).sum(axis=(1, 2))
    changed[80:135] = positions[rows.argmax()]
    return changed


@pytest.mark.slow
@pytest.mark.parametrize("change", [exchanged, in_millimetres, jumping])
def test_a_takeover_changes_no_answer(
    change: Callable[[NDArray[np.float64], MotionLibrary], NDArray[np.float64]], builtin: MotionLibrary
) -> None:
    """What was noticed before the frames that the new worker sees holds on, and both workers answer the same frames."""
    positions = feed(builtin)
    positions[60:] = change(positions[60:], builtin)
    former, ledger = Worker(Performers(opened(builtin))), Ledger(most=1, silence=math.inf)
    frames = []
    for k, each in enumerate(positions):
        numbered = ledger.send(Frame("ann", 1.0 + k / RATE, each), k / RATE)
        assert numbered
        frames.append(numbered[1])
    for answer in pushed(former, frames[:BEFORE]):
        ledger.note(answer)
    entries = ledger.entries(range(PARTITIONS))
    new = Worker(Performers(opened(builtin)))
    new.take_over(entries, 0.0)
    found = pushed(new, frames[entries[0].answered - SEEN :])
    expected = pushed(former, frames[BEFORE:])
    assert [each.seq for each in found] == [each.seq for each in expected]
    assert [(each.outcome, each.guess) for each in found] == [(each.outcome, each.guess) for each in expected]
    assert [each.long_ago for each in found] == [each.long_ago for each in expected]


@pytest.mark.slow
def test_a_start_that_both_workers_told_too_late_is_told_after_all(builtin: MotionLibrary) -> None:
    """The new worker, asked which motion goes on, knows of the start although its own word for it came second."""
    former, new, ledger = (
        Worker(Performers(opened(builtin))),
        Worker(Performers(opened(builtin))),
        Ledger(most=1, silence=math.inf),
    )
    frames: list[SentFrame] = []

    def send(count: int) -> list[SentFrame]:
        for each in feed(builtin)[len(frames) : len(frames) + count]:
            numbered = ledger.send(Frame("ann", 1.0 + len(frames) / RATE, each), len(frames) / RATE)
            assert numbered
            frames.append(numbered[1])
        return frames[-count:]

    assert [event for answer in pushed(former, send(12)) for event in ledger.note(answer) or ()] == []
    entries = ledger.entries(range(PARTITIONS))
    new.take_over(entries, 0.0)
    pushed(new, frames)
    late = [event for answer in pushed(new, send(200)) for event in answer.events]
    for answer in pushed(former, frames):
        ledger.note(msgspec.structs.replace(answer, events=()))
    for partition in range(PARTITIONS):
        ledger.settle(partition)
    told = [event for answer in pushed(new, send(100)) for event in ledger.note(answer) or ()]
    assert [(event.kind, event.label) for event in told] == [(late[-1].kind, late[-1].label)]
    assert ledger.end()[0].label == "squat1Reps"
