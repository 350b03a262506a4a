"""A worker that takes a performer over knows what the performer's last seconds do not show."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np
import pytest

from kinespace.library.windows.index import opened
from kinespace.library.windows.segments import mirrored_places
from kinespace.stream.frame import Frame
from kinespace.stream.recognizer import Performers, Recognizer, Settings
from kinespace.stream.recognizer.decision import Decision
from kinespace.stream.recognizer.joints.mending import LongAgo
from kinespace.stream.recognizer.limits import needed_lead
from kinespace.stream.workers.track import Track
from kinespace.stream.workers.wire import Orders, decode_orders, encode
from kinespace.stream.workers.worker import Worker

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from kinespace.library import MotionLibrary
    from kinespace.stream.recognition import Event
    from kinespace.stream.workers.wire import Answered, SentFrame

RATE = 60
#: Frames before the takeover, frames that the new worker sees first, and frames after it.
BEFORE, SEEN, AFTER = 300, 151, 60
#: The frame at which a body jumps.
JUMP = 200


def pushed(worker: Worker, frames: Sequence[SentFrame]) -> list[Answered]:
    """Send frames to a worker; give its answers."""
    return [
        answer
        for each in frames
        for answer in worker.push(decode_orders(encode(Orders(frames=[each]))).frames, each.at)
    ]


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


def trembling(positions: NDArray[np.float64], _: MotionLibrary) -> NDArray[np.float64]:
    """Let segments tremble before the frames that the new worker sees, and the body jump after them."""
    changed = positions.copy()
    changed[:60] += np.random.default_rng(0).normal(0, 0.02, changed[:60].shape)
    rows = np.abs(positions - positions[:1]).sum(axis=(1, 2))
    changed[260:280] = positions[rows.argmax()]
    return changed


def _guess(answer: Answered) -> tuple[str, int | None]:
    return answer.recognition.outcome, answer.recognition.guess


@pytest.mark.parametrize("change", [exchanged, in_millimetres, jumping, trembling])
def test_a_takeover_changes_no_answer(
    change: Callable[[NDArray[np.float64], MotionLibrary], NDArray[np.float64]], builtin: MotionLibrary
) -> None:
    """What was noticed before the frames that the new worker sees holds on, and both workers answer the same frames."""
    positions = feed(builtin)
    positions[60:] = change(positions[60:], builtin)
    former, track = Worker(Performers(opened(builtin))), Track(0.0, 0.0, 0, Decision(0.1))
    frames = [track.send(Frame("ann", 1.0 + k / RATE, each), k + 1, k / RATE, None) for k, each in enumerate(positions)]
    for answer in pushed(former, frames[:BEFORE]):
        track.accept(answer, builtin.classes)
    new = Worker(Performers(opened(builtin)))
    done, due = track.recent(None)
    assert pushed(new, done) == []
    due[0] = msgspec.structs.replace(due[0], go_on=track.past)
    found = pushed(new, due)
    assert new.report(due[-1].at).counts.recognizers.frames == len(due)
    expected = pushed(former, frames[BEFORE:])
    assert [each.seq for each in found] == [each.seq for each in expected]
    assert [_guess(each) for each in found] == [_guess(each) for each in expected]
    known, usual = ([each.long_ago or LongAgo() for each in answers] for answers in (found, expected))
    assert [each[:-1] for each in known] == [each[:-1] for each in usual]
    # Spans of a third of a second are judged, and the new worker's may begin elsewhere.
    assert [each.tremble for each in known] == pytest.approx([each.tremble for each in usual], rel=0.05)


def test_what_is_asked_once_is_told_once(builtin: MotionLibrary) -> None:
    """The answer after a question says which joints carry it; no other answer does."""
    worker, track = Worker(Performers(opened(builtin))), Track(0.0, 0.0, 0, Decision(0.1))
    frames = [track.send(Frame("ann", k / RATE, each), k + 1, k / RATE, None) for k, each in enumerate(feed(builtin))]
    frames[90].asks = True
    assert [each.seq > 90 for each in pushed(worker, frames[:120]) if each.carried] == [True]
    # Who is silent is forgotten with the next report.
    assert [worker.report(now).counts.dropped for now in (2.0, 100.0)] == [0, 1]


@pytest.mark.parametrize("taken", [BEFORE, JUMP + 5])
def test_the_motion_of_a_body_that_jumps_elsewhere_ends_as_in_one_process(taken: int, builtin: MotionLibrary) -> None:
    """The gateway's events equal one recogniser's, whether a worker takes over before the jump is answered or after."""
    index, positions = opened(builtin), feed(builtin)
    positions[JUMP:] += (3.0, 0.0, 0.0)
    recognizer, track = Recognizer(index), Track(0.0, 0.0, 0, Decision(needed_lead(builtin, Settings())))
    frames = [Frame("ann", 1.0 + k / RATE, each) for k, each in enumerate(positions)]
    expected = [event for each in frames if (answer := recognizer.push(each)) for event in answer.events]
    assert [event.kind for event in expected] == ["start", "end", "start"]
    worker, found = Worker(Performers(index)), list["Event"]()
    for number, each in enumerate(frames):
        sent = [track.send(each, number + 1, each.time, None)]
        if number == taken:
            worker, (done, due) = Worker(Performers(index)), track.recent(None)
            sent = [*done, msgspec.structs.replace(due[0], go_on=track.past), *due[1:]]
        found += [event for answer in pushed(worker, sent) for event in track.accept(answer, builtin.classes) or ()]
    assert found == expected
