"""A stream is answered as if everything were computed again from all frames, at every hop, at every rate."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from typing import TYPE_CHECKING

import naive
import numpy as np
import pytest
from naive_stream import NaiveRecognition, NaiveRecognizer, reaches

from library.clip import Clip
from library.distances import distance_rows
from library.eigen import RESIDUAL_TOLERANCE, Leading, LeadingAxis, leading_axis_from
from library.motionlibrary import MotionLibrary
from library.recordings import find_recordings, read_recordings
from library.signature import Moments, signature_of
from library.skeleton import Skeleton
from stream.frame import Frame
from stream.leading import RollingAxis, WindowAxis
from stream.performers import Performers
from stream.recognition import Outcome, Recognition
from stream.recognizer import LiveSignature, Recognizer, Settings

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

#: Everything holds of the compiled loops and of numpy.
pytestmark = pytest.mark.usefixtures("arithmetic")

#: How far a class score may be from the twin's; library and window are compared in single precision.
SAME_SCORE = 1e-5
#: How far the told gap between eigenvalues may stay below the true one, for windows that are not still.
UNDERSTATED = 1e-3
#: The built-in library keeps windows as well; the twin here is the eigenvector's.
BY_EIGENVECTOR = Settings(signature=LiveSignature.EIGENVECTOR)
#: Every other joint of HDM05's: 120 pairs, whose twin is solved in a hundredth of the time of 465.
EVERY_OTHER = slice(0, 31, 2)


def _fewer_joints(clips: Iterable[Clip]) -> list[Clip]:
    """Take every other joint of some clips."""
    return [
        Clip(
            Skeleton.of_joints(clip.skeleton.joints[EVERY_OTHER]),
            clip.positions[:, EVERY_OTHER],
            clip.frame_rate,
            clip.name,
            clip.class_name,
            clip.actor,
            clip.take,
        )
        for clip in clips
    ]


@pytest.fixture(scope="module")
def small_clips(some_clips: tuple[Clip, ...]) -> list[Clip]:
    return _fewer_joints(some_clips)


@pytest.fixture(scope="module")
def small_library(small_clips: list[Clip]) -> MotionLibrary:
    return MotionLibrary.of_clips(small_clips)


def _frames(clip: Clip, indices: Iterable[int] | None = None, *, start: float = 3.0) -> list[Frame]:
    chosen = range(clip.frames) if indices is None else indices
    return [Frame("p", start + index / clip.frame_rate, clip.positions[index]) for index in chosen]


def _twin(library: MotionLibrary, settings: Settings) -> NaiveRecognizer:
    return NaiveRecognizer(
        pairs=[(int(first), int(second)) for first, second in library.skeleton.pairs],
        axes=library.axes.astype(np.float64),
        class_names=[motion.class_name for motion in library.motions],
        window=settings.window,
        hop=settings.hop,
        longest_gap=settings.longest_gap,
        stillness=settings.stillness,
        smallest_gap=settings.smallest_gap,
        patience=settings.patience,
    )


def _assert_alike(answer: Recognition, naive_answer: NaiveRecognition) -> None:
    """Hold one answer against the twin's: time, scores, what the axis is worth, and the label."""
    assert answer.time == naive_answer.time
    assert answer.movement == pytest.approx(naive_answer.movement, rel=1e-6)
    assert answer.share == pytest.approx(naive_answer.share, rel=1e-6)
    # A warm start tells a bound: never a larger gap than there is.
    assert answer.gap <= naive_answer.gap + 1e-9
    if answer.outcome is not Outcome.STILL:
        assert answer.gap >= naive_answer.gap - UNDERSTATED
    if naive_answer.gap >= 0.02:
        expected = [naive_answer.scores[name] for name in answer.classes]
        assert np.abs(answer.scores - expected).max() <= SAME_SCORE
    close = naive_answer.margin <= 2 * SAME_SCORE or 0.02 <= naive_answer.gap <= 0.02 + UNDERSTATED
    assert answer.label == naive_answer.label or close


def _compare(library: MotionLibrary, frames: Sequence[Frame], settings: Settings | None = None) -> int:
    """Push frames to the recogniser and to its twin, compare at every frame, and say how many answers there were."""
    recognizer, twin = Recognizer(library, settings), _twin(library, settings or Settings())
    answers = 0
    for frame in frames:
        answer, naive_answer = recognizer.push(frame), twin.push(frame.time, frame.positions)
        assert (answer is None) == (naive_answer is None), frame.time
        if answer is not None and naive_answer is not None:
            _assert_alike(answer, naive_answer)
            answers += 1
    assert recognizer.counts.out_of_order == twin.out_of_order
    assert recognizer.counts.restarts == twin.restarts
    assert recognizer.counts.hops == answers
    return answers


# --- against the twin --------------------------------------------------------------------------------------------


def test_the_whole_body_against_the_built_in_library(some_clips: tuple[Clip, ...]) -> None:
    """Over all 465 distances and 288 motions, on real clips at 120 Hz, every hop is answered as the twin answers."""
    library = MotionLibrary.builtin()
    answers = sum(_compare(library, _frames(clip), BY_EIGENVECTOR) for clip in some_clips if clip.frames < 290)
    assert answers > 100


@pytest.mark.parametrize("every", [1, 2, 4], ids=["120Hz", "60Hz", "30Hz"])
@pytest.mark.parametrize("window", [0.4, 1.0])
def test_at_every_rate(small_clips: list[Clip], small_library: MotionLibrary, every: int, window: float) -> None:
    """At 120, 60 and 30 frames per second every hop is answered as the twin answers."""
    settings = Settings(window=window)
    answers = sum(
        _compare(small_library, _frames(clip, range(0, clip.frames, every)), settings) for clip in small_clips
    )
    assert answers > 300


@pytest.mark.parametrize("hop", [0.0, 0.05, 0.3])
def test_at_every_hop(small_clips: list[Clip], small_library: MotionLibrary, hop: float) -> None:
    """Whatever the distance of hops, down to every frame and up to a third of the window, the twin answers alike."""
    answers = sum(_compare(small_library, _frames(clip), Settings(hop=hop)) for clip in small_clips[::2])
    assert answers >= {0.0: 500, 0.05: 100, 0.3: 15}[hop]


@pytest.mark.parametrize("share", [0.05, 0.5])
def test_with_dropped_frames(small_clips: list[Clip], small_library: MotionLibrary, share: float) -> None:
    """With frames lost by chance every hop is answered as the twin answers."""
    generator = np.random.default_rng(12)
    answers = 0
    for clip in small_clips:
        kept = np.flatnonzero(generator.random(clip.frames) >= share)
        answers += _compare(small_library, _frames(clip, kept.tolist()), Settings(window=0.5))
    assert answers > 300


def test_with_everything_that_goes_wrong(small_clips: list[Clip], small_library: MotionLibrary) -> None:
    """With jitter, losses, swaps, repeats, gaps and restarted clocks the twin refuses, restarts and answers alike."""
    generator = np.random.default_rng(13)
    feed, begin = list[Frame](), 0.0
    for clip in small_clips:
        frames = _frames(clip, np.flatnonzero(generator.random(clip.frames) > 0.1).tolist(), start=begin)
        frames = [Frame("p", frame.time + generator.uniform(0, 0.02), frame.positions) for frame in frames]
        repeated = [frame for frame in frames for _ in range(1 + int(generator.random() < 0.05))]
        feed += repeated
        # Go on, after a gap or not, or start anew a little or far in the past.
        begin = feed[-1].time + float(generator.choice([0.01, 0.3, 0.8, 30.0, -0.05, -0.4, -5.0, -1e4]))
    settings = Settings(window=0.4, hop=0.02, longest_gap=0.4, patience=4)
    assert _compare(small_library, feed, settings) > 400
    recognizer = Recognizer(small_library, settings)
    for frame in feed:
        recognizer.push(frame)
    assert min(recognizer.counts.out_of_order, recognizer.counts.restarts) > 2


def test_a_long_performance(cmu_folder: Path, small_library: MotionLibrary) -> None:
    """A continuous take of another archive, half a minute without a break, is answered as the twin answers."""
    paths = find_recordings([cmu_folder])[:1]
    (clip,) = _fewer_joints(read_recordings(paths))
    assert _compare(small_library, _frames(clip), Settings(hop=0.1)) > 350


# --- against the library -----------------------------------------------------------------------------------------


def test_a_window_as_long_as_a_clip_is_the_clip(hdm05_clips: tuple[Clip, ...]) -> None:
    """A window that holds just one clip's frames scores as the clip's signature scores, and finds the clip itself."""
    library = MotionLibrary.builtin()
    for clip in hdm05_clips[::24]:
        recognizer = Recognizer(library, replace(BY_EIGENVECTOR, window=clip.duration, hop=0.0))
        # One frame before the clip: the window is first full when the frame after its length has come.
        lead_in = Frame("p", -1 / clip.frame_rate, clip.positions[0] * 0.9)
        recognition = [recognizer.push(frame) for frame in (lead_in, *_frames(clip, start=0.0))][-1]
        assert recognition is not None
        signature = signature_of(Moments.of_rows(distance_rows(clip.positions, clip.skeleton)))
        assert np.abs(recognition.scores - library.match(signature).class_scores).max() <= SAME_SCORE
        assert recognition.movement == pytest.approx(signature.movement)
        assert recognition.share == pytest.approx(signature.axis.share)
        assert recognition.class_name == clip.class_name
        assert recognition.score == pytest.approx(1.0, abs=SAME_SCORE)


def test_a_clip_in_a_loop_is_recognised_everywhere(some_clips: tuple[Clip, ...]) -> None:
    """Played again and again, a clip of the library fills every window of its length with its own class."""
    library = MotionLibrary.builtin()
    for clip in some_clips[1::3]:
        looped = clip.moved_to(np.concatenate([clip.positions] * 2))
        recognizer = Recognizer(library, replace(BY_EIGENVECTOR, window=clip.duration, hop=0.1))
        answers = [answer for frame in _frames(looped) if (answer := recognizer.push(frame)) is not None]
        assert len(answers) >= 5
        assert {answer.class_name for answer in answers} == {clip.class_name}
        assert min(answer.score for answer in answers) > 1.0 - SAME_SCORE


# --- again, and with others --------------------------------------------------------------------------------------


def _run(recognizer: Recognizer, frames: Iterable[Frame]) -> list[Recognition]:
    return [answer for frame in frames if (answer := recognizer.push(frame)) is not None]


def _assert_identical(first: Sequence[Recognition], second: Sequence[Recognition]) -> None:
    """Demand the same answers, bit for bit."""
    assert len(first) == len(second) > 0
    for one, other in zip(first, second, strict=True):
        assert one.scores.tobytes() == other.scores.tobytes()
        assert (one.time, one.outcome, one.movement, one.share, one.gap, one.residual) == (
            *(other.time, other.outcome, other.movement),
            *(other.share, other.gap, other.residual),
        )


@pytest.mark.parametrize("signature", LiveSignature)
def test_again_after_reset_every_answer_is_identical(some_clips: tuple[Clip, ...], signature: LiveSignature) -> None:
    """The same feed after a reset gets the same answers to the last bit; without one it does not."""
    library = MotionLibrary.builtin()
    recognizer = Recognizer(library, Settings(signature=signature))
    for clip in some_clips[::4]:
        frames = _frames(clip)
        recognizer.reset()
        first = _run(recognizer, frames)
        recognizer.reset()
        _assert_identical(_run(recognizer, frames), first)
        later = [Frame("p", frame.time + clip.duration, frame.positions) for frame in frames]
        assert len(_run(recognizer, later)) > len(first)


def test_interleaved_performers_get_the_answers_they_get_alone(
    small_clips: list[Clip], small_library: MotionLibrary
) -> None:
    """Eleven people on one feed, their frames mixed by chance, are answered to the last bit as each would be alone."""
    settings = Settings(window=0.5)
    feeds = {clip.class_name: deque(_frames(clip)) for clip in small_clips}
    alone = {name: _run(Recognizer(small_library, settings), feed) for name, feed in feeds.items()}
    turns = np.repeat(list(feeds), [len(feed) for feed in feeds.values()])
    performers = Performers(small_library, settings)
    mixed: dict[str, list[Recognition]] = {name: [] for name in feeds}
    for name in np.random.default_rng(14).permutation(turns).tolist():
        frame = feeds[name].popleft()
        answer = performers.push(Frame(name, frame.time, frame.positions), arrival=0.0)
        if answer is not None:
            mixed[answer.performer].append(answer)
    for name, answers in mixed.items():
        _assert_identical(answers, alone[name])


# --- the certificate ---------------------------------------------------------------------------------------------


class Axes:
    """Keeps every axis that is found."""

    def __init__(self, library: MotionLibrary, monkeypatch: pytest.MonkeyPatch) -> None:
        self.kept: list[LeadingAxis] = []
        leading = RollingAxis.leading

        def watched(rolling: RollingAxis, window: np.ndarray) -> WindowAxis:
            found = leading(rolling, window)
            self.kept.append(found.axis)
            return found

        monkeypatch.setattr(RollingAxis, "leading", watched)
        self.library = library


@pytest.mark.parametrize("settings", [Settings(), Settings(window=0.3, hop=0.0), Settings(window=0.4, hop=0.15)])
def test_every_answers_axis_is_an_eigenvector(
    small_clips: list[Clip], small_library: MotionLibrary, monkeypatch: pytest.MonkeyPatch, settings: Settings
) -> None:
    """For every answer ‖Cv − λv‖ ≤ 1e-6·λ holds for the covariance of the window's raw rows, and nothing lies above λ.

    The rows are those of the frames of the last seconds, and the residual told is not below the true one.
    """
    axes = Axes(small_library, monkeypatch)
    checked = 0
    for clip in small_clips:
        rows = naive.distance_rows(clip.positions, [(int(a), int(b)) for a, b in small_library.skeleton.pairs])
        recognizer = Recognizer(small_library, settings)
        for index, frame in enumerate(_frames(clip)):
            answer = recognizer.push(frame)
            if answer is None:
                continue
            held = [each for each in range(index + 1) if not reaches((index - each) / 120, settings.window)]
            matrix = naive.covariance(rows[held])
            axis = axes.kept[-1]
            residual = np.linalg.norm(matrix @ axis.vector - axis.value * axis.vector) / axis.value
            assert residual <= RESIDUAL_TOLERANCE
            assert answer.residual <= RESIDUAL_TOLERANCE
            assert residual <= answer.residual + 1e-9
            assert np.linalg.norm(axis.vector) == pytest.approx(1.0, abs=1e-12)
            checked += 1
            if checked % 5 == 0:
                assert axis.value == pytest.approx(np.linalg.eigvalsh(matrix)[-1], rel=1e-9)
    assert checked == len(axes.kept) > 50


def test_answers_do_not_depend_on_the_eigenvectors_sign(
    small_clips: list[Clip], small_library: MotionLibrary, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Turned around after each hop by chance, the axis the next hop starts from changes no label and no score."""
    generator = np.random.default_rng(15)

    def turned(matrix: np.ndarray, block: np.ndarray | None) -> Leading:
        axis = leading_axis_from(matrix, block)
        sign = float(generator.choice([-1.0, 1.0]))
        turned_block = axis.block * generator.choice([-1.0, 1.0], size=axis.block.shape[1])
        return axis._replace(vector=sign * axis.vector, block=turned_block)

    clip = small_clips[0]
    expected = _run(Recognizer(small_library), _frames(clip))
    monkeypatch.setattr("stream.leading.leading_axis_from", turned)
    answers = _run(Recognizer(small_library), _frames(clip))
    assert [answer.label for answer in answers] == [answer.label for answer in expected]
    for answer, other in zip(answers, expected, strict=True):
        assert np.abs(answer.scores - other.scores).max() <= SAME_SCORE


# --- outcomes ----------------------------------------------------------------------------------------------------

#: A body of three joints: its three sides may swing as they like.
TRIANGLE = Skeleton(("a", "b", "c"))


def _triangle(imbalance: float, *, frames: int = 240) -> Clip:
    """Let the sides of a triangle swing a third of a turn apart, the first by some share more than the others.

    In balance, over whole turns, no direction of swinging has more variance than another: λ₁ = λ₂.
    """
    turn = 2 * np.pi * (2 * np.arange(frames) / 120)
    ab, bc, ca = (1.0 + 0.1 * np.sin(turn + third * 2 * np.pi / 3) for third in range(3))
    ab = 1.0 + (1.0 + imbalance) * (ab - 1.0)
    positions = np.zeros((frames, 3, 3))
    positions[:, 1, 0] = ab
    positions[:, 2, 0] = (ab**2 + ca**2 - bc**2) / (2 * ab)
    positions[:, 2, 1] = np.sqrt(ca**2 - positions[:, 2, 0] ** 2)
    return Clip(TRIANGLE, positions, 120.0, class_name="swing")


@pytest.fixture(scope="module")
def triangles() -> MotionLibrary:
    return MotionLibrary.of_clips([_triangle(0.5)])


@pytest.mark.parametrize("imbalance", [0.0, 1e-6, 1e-3, 0.01])
def test_equal_eigenvalues_are_ambiguous(triangles: MotionLibrary, imbalance: float) -> None:
    """When the two leading eigenvalues are as good as equal no class is named, and the gap says why."""
    answers = _run(Recognizer(triangles), _frames(_triangle(imbalance)))
    assert len(answers) > 20
    for answer in answers:
        assert answer.outcome is Outcome.AMBIGUOUS
        assert (answer.class_name, answer.class_index, answer.label) == (None, -1, "ambiguous")
        assert answer.gap == pytest.approx(4 / 3 * imbalance, abs=1e-4 + imbalance**2)
        assert answer.residual <= RESIDUAL_TOLERANCE


@pytest.mark.parametrize("imbalance", [0.03, 0.5])
def test_unequal_eigenvalues_are_not(triangles: MotionLibrary, imbalance: float) -> None:
    """When one eigenvalue leads the class is named, also when it does not lead by much."""
    answers = _run(Recognizer(triangles), _frames(_triangle(imbalance)))
    assert {answer.outcome for answer in answers} == {Outcome.NAMED}
    assert min(answer.score for answer in answers) > 0.98


@pytest.mark.parametrize("imbalance", [0.0, 0.01, 0.03, 0.5])
def test_balance_against_the_twin(triangles: MotionLibrary, imbalance: float) -> None:
    """Around the smallest gap each hop has the outcome that the twin gives it."""
    two = MotionLibrary.of_clips(
        [_triangle(0.5), Clip(TRIANGLE, _triangle(-0.5).positions, 120.0, class_name="other swing")]
    )
    assert triangles.skeleton == two.skeleton
    assert _compare(two, _frames(_triangle(imbalance)), Settings(hop=0.0)) == 120


@pytest.mark.parametrize("noise", [1e-6, 1e-4, 1e-3])
def test_a_frozen_pose_with_noise_is_still(small_clips: list[Clip], small_library: MotionLibrary, noise: float) -> None:
    """A pose held, each coordinate wavering by up to a millimetre, is still, and its movement is the twin's."""
    generator = np.random.default_rng(16)
    for clip in small_clips[::4]:
        pose = clip.positions[0] + noise * generator.normal(size=(180, *clip.positions[0].shape))
        frames = _frames(clip.moved_to(pose))
        answers = _run(Recognizer(small_library), frames)
        assert {answer.outcome for answer in answers} == {Outcome.STILL}
        assert {(answer.class_name, answer.class_index, answer.label) for answer in answers} == {(None, -1, "still")}
        assert _compare(small_library, frames) == len(answers) > 10


def test_slowing_down_to_a_stop_against_the_twin(small_clips: list[Clip], small_library: MotionLibrary) -> None:
    """From full movement to none, each hop is named, ambiguous or still as the twin says, in between too."""
    outcomes = set[Outcome]()
    for clip in small_clips[::3]:
        slower = 10.0 ** (-4.0 * np.linspace(0.0, 1.0, clip.frames))[:, None, None]
        fading = clip.positions.mean(axis=0) + slower * (clip.positions - clip.positions.mean(axis=0))
        frames = _frames(clip.moved_to(fading))
        assert _compare(small_library, frames, Settings(window=0.3)) > 5
        outcomes |= {answer.outcome for answer in _run(Recognizer(small_library, Settings(window=0.3)), frames)}
    assert {Outcome.NAMED, Outcome.STILL} <= outcomes
