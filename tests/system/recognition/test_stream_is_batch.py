"""The answers to a stream equal those computed from all frames again, at every hop and every rate."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import replace
from typing import NamedTuple

import naive
import naive_stream
import naive_windows
import numpy as np
import pytest
from naive_stream import NaiveFeed
from naive_windows import evidence, logit
from twins import Twin

from kinespace.library import Clip, MotionLibrary, WindowIndex, compiled
from kinespace.stream import Frame, Outcome, Recognition, Recognizer, Settings
from kinespace.stream.recognizer.decision import LEAD
from kinespace.stream.recognizer.window import NOISY
from kinespace.tools.feeding.feed import resampled

pytestmark = pytest.mark.slow

#: How far a log distance may be from the twin's: library and window are compared in single precision.
SAME = 1e-3
#: The same for a movement, relative to it.
SAME_MOVEMENT = 1e-8
HOP = 1 / 30
#: Share of unknown time that may be named.
SENSITIVITY = 0.1


@pytest.fixture(scope="module")
def twin(small_index: WindowIndex) -> Twin:
    """Give the slow twin of the small library's index."""
    return Twin(small_index)


@pytest.fixture(scope="module")
def clips(some_clips: tuple[Clip, ...]) -> list[Clip]:
    """Give a real motion of each class of the small library and of two others, the shorter first."""
    names = ("kickLFront1Reps", "lieDownFloor", "squat1Reps", "throwBasketball", "hopBothLegs1hops")
    return sorted((clip for clip in some_clips if clip.class_name in names), key=lambda clip: clip.frames)


def _frames(clip: Clip, indices: Iterable[int] | None = None, *, start: float = 3.0) -> list[Frame]:
    chosen = range(clip.frames) if indices is None else indices
    return [Frame("p", start + index / clip.frame_rate, clip.positions[index]) for index in chosen]


def _distances(answer: Recognition) -> np.ndarray:
    return np.log(1 / answer.scores - 1)


class Due(NamedTuple):
    """What is due at a hop, as the twin computes it: log distances for naming, and those by which it is judged."""

    time: float
    named: np.ndarray
    judged: np.ndarray
    noise: float
    movement: float


def _assert_alike(answer: Recognition, due: Due) -> None:
    """Hold one answer against the twin's: time, distances of all classes, evidence, and how much moves."""
    assert answer.time == due.time
    assert np.abs(_distances(answer) - due.named).max() <= SAME
    distances, leads = evidence(due.judged, answer.guess)
    assert answer.evidence.distances == pytest.approx(distances, abs=SAME)
    assert answer.evidence.leads == pytest.approx(leads, abs=2 * SAME)
    assert answer.evidence.noise == pytest.approx(due.noise, rel=1e-6, abs=1e-9)
    assert answer.movement == pytest.approx(due.movement, rel=SAME_MOVEMENT, abs=1e-9)


def _due(twin: Twin, frames: Sequence[Frame], settings: Settings) -> Iterator[Due | None]:
    """Show the twin frames; give for each what is due, if it is."""
    index, feed = twin.index, NaiveFeed(twin.body.segments, hop=settings.hop, longest_gap=settings.longest_gap)
    for frame in frames:
        hop = feed.push(frame.time, naive.distance_rows(frame.positions[None])[0])
        if hop is None:
            yield None
            continue
        numbers = twin.numbers(hop.time, hop.times, hop.rows)
        logs = twin.log_distances(numbers)
        by_groups = logs[len(index.comparison.weighing.blends) :]
        judged = twin.unlikelihoods(numbers) if index.rejection.by_likelihood else by_groups
        movement = naive_windows.moved(naive_windows.moments(*hop.last(1.0)))
        yield Due(hop.time, twin.named(numbers, logs), judged, hop.noise, movement)


def _compare(twin: Twin, frames: Sequence[Frame], settings: Settings | None = None) -> list[Recognition]:
    """Push frames to the twin, and to a recogniser of the compiled loops and one of numpy; give the last's answers."""
    settings = replace(settings or Settings(), sensitivity=SENSITIVITY, plausibility=False)
    due = list(_due(twin, frames, settings))
    for arithmetic in (nullcontext, compiled.left_aside):
        with arithmetic():
            recognizer, answers = Recognizer(twin.index, settings), list[Recognition]()
            for frame, expected in zip(frames, due, strict=True):
                answer = recognizer.push(frame)
                assert (answer is None) == (expected is None), frame.time
                if answer is not None and expected is not None:
                    _assert_alike(answer, expected)
                    answers.append(answer)
            assert recognizer.counts.hops == len(answers)
            _assert_decided_alike(answers, twin, settings)
    return answers


def _assert_decided_alike(answers: Sequence[Recognition], twin: Twin, settings: Settings) -> None:
    """Compare the guess and its outcome with those computed from all distances and evidence."""
    index, times = twin.index, [answer.time for answer in answers]
    # Log distances of all classes at each hop, read off the scores.
    distances = np.array([_distances(answer) for answer in answers])
    assert [answer.guess for answer in answers] == naive_stream.guesses(times, distances, LEAD)
    movements = [answer.movement for answer in answers]
    assert [answer.so_far for answer in answers] == naive_stream.so_far(times, distances, movements)
    rejection, logits = index.rejection, list[float]()
    for answer in answers:
        name, known = answer.classes[answer.guess], (rejection.weights.tolist(), answer.evidence.compared)
        bias, slope = rejection.biases.get(name, 0.0), rejection.slopes.get(name, 0.0)
        usual = rejection.typical.tolist(), answer.evidence.noise
        logits.append(logit(*known, *usual, offset=rejection.offset, bias=bias, slope=slope))
    known = naive_stream.known(times, logits, rejection.threshold_at(SENSITIVITY), rejection.over, rejection.held)
    for answer, is_known in zip(answers, known, strict=True):
        moving = Outcome.NAMED if is_known else Outcome.UNKNOWN
        assert answer.outcome is (Outcome.STILL if answer.movement < settings.stillness else moving)


# --- real motions ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("rate", "hop"), [(120.0, HOP), (60.0, 0.05), (30.0, 0.0)])
def test_at_every_rate(clips: list[Clip], twin: Twin, rate: float, hop: float) -> None:
    """A real motion at 120, 60 and 30 frames a second is answered at any hop as the twin answers."""
    clip = clips[2]
    answers = _compare(twin, _frames(resampled(clip, rate)), Settings(hop=hop))
    assert len(answers) >= (clip.duration - 0.15) / max(hop, HOP) - 2
    assert Outcome.NAMED in {answer.outcome for answer in answers}


# --- hard feeds ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("noise", [0.0, 1e-5])
def test_a_stop_right_after_moving(clips: list[Clip], twin: Twin, noise: float) -> None:
    """A body that stops dead, wavering by a hundredth of a millimetre or not at all, is answered as by the twin."""
    clip = clips[0]
    pose = np.repeat(clip.positions[60:61], 150, axis=0)
    pose += noise * np.random.default_rng(16).normal(size=pose.shape)
    answers = _compare(twin, _frames(clip.moved_to(np.concatenate([clip.positions[:60], pose]))))
    assert answers[-1].outcome is Outcome.STILL
    assert answers[0].outcome is not Outcome.STILL


#: A second of trembling begins and ends; meanwhile the rows move back in memory.
MEANWHILE = slice(110, 140)


@pytest.mark.parametrize(
    ("noise", "clip", "when", "hop"),
    [(0.004, 1, slice(None), HOP), (0.02, 1, slice(None), HOP), (0.03, -1, MEANWHILE, 0.1)],
)
def test_a_trembling_sensor(  # noqa: PLR0913, PLR0917 - a feed has many sides
    clips: list[Clip], twin: Twin, noise: float, clip: int, when: slice, hop: float
) -> None:
    """With noise of some millimetres or of centimetres, all the time or for a second, the twin averages alike."""
    shown = resampled(clips[clip], 30.0)
    shaken, tremble = shown.positions.copy(), noise * np.random.default_rng(17).normal(size=shown.positions.shape)
    shaken[when] += tremble[when]
    answers = _compare(twin, _frames(shown.moved_to(shaken)), Settings(hop=hop))
    noisy = [answer.evidence.noise >= NOISY for answer in answers]
    assert len(noisy) > 20
    assert set(noisy) == {noise > NOISY, when is not MEANWHILE and noise > NOISY}


def test_another_library_and_its_weights(clips: list[Clip], builtin_index: WindowIndex) -> None:
    """With the built-in library, numbers learned from strangers and several views, the twin answers alike."""
    motions = builtin_index.library.motions
    kept = [place for place, motion in enumerate(motions) if motion.actor in ("bd", "tr") and motion.take < "004"]
    twin = Twin(builtin_index.of_some(kept))
    assert len(twin.index.comparison.weighing.blends) == 2
    assert len(_compare(twin, _frames(clips[0], range(0, clips[0].frames, 4)))) > 15


def test_one_example_of_each_class(clips: list[Clip], builtin: MotionLibrary) -> None:
    """A library that cannot learn what is unknown judges likelihood ratios, as the twin does by densities."""
    first = {motion.class_name: motion for motion in builtin.motions if motion.actor == "bd"}
    short = tuple(sorted(first.values(), key=lambda motion: motion.frames)[:3])
    twin = Twin(WindowIndex.of(replace(builtin, motions=short, learned={})))
    assert twin.index.rejection.by_likelihood
    assert len(_compare(twin, _frames(clips[0], range(0, clips[0].frames, 4)[:16]))) > 5
