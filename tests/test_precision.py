"""Loss of precision and nothing else: the rolling covariance, where running sums lose digits, against the true one."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pytest
from synthetic import stick_clips

from library.distances import distance_rows
from library.hdm05 import SKELETON
from library.motionlibrary import MotionLibrary
from library.recordings import find_recordings, read_recordings
from library.skeleton import Skeleton
from stream.covariance import RollingCovariance
from stream.frame import Frame
from stream.gram import RollingGram
from stream.recognition import Outcome
from stream.recognizer import LiveSignature, Recognizer, Settings
from stream.window import SlidingWindow

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from library.clip import Clip

#: Everything holds of the compiled loops and of numpy.
pytestmark = pytest.mark.usefixtures("arithmetic")

#: Promised while a performer moves: largest error, relative to the largest entry.
MOVING = 1e-9
#: The same in a window that is still after motion.
STILL = 1e-6


class Error(NamedTuple):
    """How far a rolling covariance is from the true one, relative to the largest entry."""

    worst: float
    hops: int


def _relative_error(rolling: RollingCovariance, window: np.ndarray) -> float:
    """Compare with the covariance of the raw rows, as numpy takes it."""
    exact = np.cov(window, rowvar=False)
    return float(np.abs(rolling.moments().covariance - exact).max() / np.abs(exact).max())


def _streamed(rows: np.ndarray, *, hop: int, truth: np.ndarray | None = None) -> Error:
    """Let rows at 120 per second run through a window of half a second, and compare after every hop.

    The truth is the same rows, better known: the rows themselves when not given.
    """
    truth = rows if truth is None else truth
    window, rolling = SlidingWindow(0.5, rows.shape[1]), RollingCovariance(rows.shape[1])
    worst, hops = 0.0, 0
    for end, row in enumerate(rows, start=1):
        window.push([end / 120], row[None])
        if end % hop == 0:
            rolling.update(*window.take_change(), window.rows)
            worst = max(worst, _relative_error(rolling, truth[max(0, end - 60) : end]))
            hops += 1
    return Error(worst, hops)


# --- real motion -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("share", "unit"), [(0, "m"), (1, "mm"), (2, "m"), (3, "mm")])
def test_all_clips_after_every_hop(hdm05_clips: tuple[Clip, ...], share: int, unit: str) -> None:
    """On each of the 288 clips, one after the other, in metres and millimetres, every hop's covariance is exact.

    The first share of the clips is compared over all 465 pairs, the others over every third.
    """
    pairs = SKELETON.pairs if share == 0 else SKELETON.pairs[share - 1 :: 3]
    columns = np.flatnonzero((SKELETON.pairs[:, None] == pairs).all(axis=2).any(axis=1))
    clips = hdm05_clips[share::4]
    hops = 0
    for clip in clips:
        rows = distance_rows(clip.positions, SKELETON)[:, columns] * (1.0 if unit == "m" else 1000.0)
        error = _streamed(rows, hop=4)
        assert error.worst <= MOVING, clip.name
        hops += error.hops
    assert len(clips) == 72
    assert hops == sum(clip.frames // 4 for clip in clips)


def test_all_clips_as_one_performance(hdm05_clips: tuple[Clip, ...]) -> None:
    """The 288 clips played without a break, a minute of motion after another, stay exact to the last hop."""
    positions = np.concatenate([clip.positions for clip in hdm05_clips])
    rows = distance_rows(positions, SKELETON)[:, ::15]
    error = _streamed(rows, hop=8)
    assert error.worst <= MOVING
    assert error.hops == len(rows) // 8


@pytest.mark.parametrize("distance", [0.0, 1e3, 1e4])
def test_far_from_the_origin(some_clips: tuple[Clip, ...], distance: float) -> None:
    """Where the body stands does not matter: kilometres away the covariance is that of the body at home."""
    offset = distance * np.array([1.0, -2.0, 0.5])
    for clip in some_clips[::2]:
        at_home, away = (
            distance_rows(positions, SKELETON)[:, ::15] for positions in (clip.positions, clip.positions + offset)
        )
        assert _streamed(away, hop=4, truth=at_home).worst <= MOVING


# --- ten million frames ------------------------------------------------------------------------------------------

LONG = 10_000_000
PIECE = 50_000
#: Rows in the window, and from hop to hop.
LENGTH, HOP = 150, 50


def _long_motion() -> Iterator[np.ndarray]:
    """Perform for 23 hours: eight joints swing, faster and slower, while the posture as a whole wanders."""
    generator = np.random.default_rng(8)
    pose = generator.normal(scale=0.6, size=(8, 3))
    swing, lean = generator.normal(scale=0.15, size=(8, 3)), generator.normal(scale=0.3, size=(8, 3))
    turn = generator.normal(scale=0.1, size=(8, 3))
    body = Skeleton.of_joints([f"joint{index}" for index in range(8)])
    for begin in range(0, LONG, PIECE):
        time = np.arange(begin, begin + PIECE) / 120
        phases = np.sin(7.0 * time + 3.0 * np.sin(0.05 * time)), np.sin(0.003 * time), np.cos(4.1 * time)
        positions = pose + sum(
            phase[:, None, None] * way for phase, way in zip(phases, (swing, lean, turn), strict=True)
        )
        yield distance_rows(positions, body)


def test_ten_million_frames() -> None:
    """After ten million frames of motion the covariance is as exact as at first, with few refreshes on the way."""
    rolling = RollingCovariance(28)
    rows = np.empty((0, 28))
    worst, hops = 0.0, 0
    for piece in _long_motion():
        if not len(rows):
            rolling.update(piece[:LENGTH], piece[:0], piece[:LENGTH])
        rows = np.concatenate([rows[-LENGTH:], piece])
        for end in range(LENGTH + HOP, len(rows) + 1, HOP):
            start = end - LENGTH
            rolling.update(rows[end - HOP : end], rows[start - HOP : start], rows[start:end])
            hops += 1
            if hops % 10 == 0:
                worst = max(worst, _relative_error(rolling, rows[start:end]))
    assert hops == LONG // HOP - LENGTH // HOP
    assert worst <= MOVING
    assert 1 < rolling.refreshes <= LONG / 10_000


def test_ten_million_frames_of_products() -> None:
    """After as many frames the window's Gram matrix is as exact as at first, without a refresh on the way."""
    rolling = RollingGram(28)
    rows = np.empty((0, 28))
    worst, hops = 0.0, 0
    for piece in _long_motion():
        if not len(rows):
            rolling.update(piece[:LENGTH], piece[:0], piece[:LENGTH])
        rows = np.concatenate([rows[-LENGTH:], piece])
        for end in range(LENGTH + HOP, len(rows) + 1, HOP):
            start = end - LENGTH
            rolling.update(rows[end - HOP : end], rows[start - HOP : start], rows[start:end])
            hops += 1
            if hops % 20 == 0:
                centred = rows[start:end] - rows[start:end].mean(axis=0)
                exact = centred @ centred.T
                dense = rolling.centred(rows[start:end]).dense()
                worst = max(worst, float(np.abs(dense - exact).max() / np.abs(exact).max()))
    assert hops == LONG // HOP - LENGTH // HOP
    assert worst <= MOVING
    assert rolling.refreshes == 1


# --- still after motion ------------------------------------------------------------------------------------------


def _stop(clip: Clip, noise: float, *, frames: int = 480) -> np.ndarray:
    """Let a performer move, then stand in the last pose, each coordinate wavering by a sensor's noise in metres."""
    pose = np.repeat(clip.positions[-1:], frames, axis=0)
    pose += noise * np.random.default_rng(len(clip.positions)).normal(size=pose.shape)
    return np.concatenate([clip.positions, pose])


@pytest.mark.parametrize("unit", [1.0, 1000.0], ids=["m", "mm"])
@pytest.mark.parametrize("noise", [1e-3, 1e-4, 1e-5, 1e-6])
def test_still_right_after_moving(some_clips: tuple[Clip, ...], noise: float, unit: float) -> None:
    """When a performer stops, down to a thousandth of a millimetre of noise, the still window's covariance is right."""
    for clip in some_clips[::2]:
        rows = distance_rows(_stop(clip, noise), SKELETON)[:, ::12] * unit
        assert _streamed(rows, hop=5).worst <= STILL


@pytest.mark.parametrize("unit", [1.0, 1000.0], ids=["m", "mm"])
@pytest.mark.parametrize("noise", [1e-3, 1e-5, 1e-6, 1e-9, 0.0])
@pytest.mark.parametrize("signature", LiveSignature)
def test_who_stands_still_is_never_a_class(
    some_clips: tuple[Clip, ...], signature: LiveSignature, noise: float, unit: float
) -> None:
    """When all of a second is still it is answered still, either way, at any noise down to a frozen tracker's none."""
    library = MotionLibrary.builtin()
    for clip in some_clips[1::2]:
        recognizer = Recognizer(library, Settings(signature=signature, hop=0.1))
        answers = {}
        for index, positions in enumerate(_stop(clip, noise, frames=240) * unit):
            recognition = recognizer.push(Frame("p", index / 120, positions))
            if recognition is not None:
                answers[index] = recognition
        still = [recognition for index, recognition in answers.items() if index >= clip.frames + 120]
        assert len(still) >= 10
        assert {recognition.outcome for recognition in still} == {Outcome.STILL}
        assert {recognition.class_name for recognition in still} == {None}
        residuals = [recognition.residual for recognition in answers.values()]
        assert all(None is residual or residual <= 1e-6 for residual in residuals)
        assert (None in residuals) == (signature is LiveSignature.WINDOWS)
        assert all(0.0 <= recognition.movement < 0.01 for recognition in still)


def test_a_frozen_feed_is_never_a_class() -> None:
    """Whatever the motion before, a tracker that repeats its last frame digit for digit is answered still."""
    library = MotionLibrary.of_clips(stick_clips())
    for seed in range(30):
        generator = np.random.default_rng(seed)
        pose = generator.normal(size=(6, 3))
        recognizer = Recognizer(library, Settings(window=0.3, hop=0.0))
        for index in range(150):
            if index < 60:
                positions = pose + 10.0 ** -generator.integers(0, 4) * generator.normal(size=(6, 3))
            recognition = recognizer.push(Frame("p", index / 120, positions))
            if index >= 60 + 36:
                assert recognition is not None
                assert recognition.outcome is Outcome.STILL
                assert recognition.residual <= 1e-6


# --- refreshes ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("hop", [1, 4, 16])
def test_refreshes_are_rare_while_moving(cmu_folder: Path, hop: int) -> None:
    """While people exercise and walk about, everything is computed afresh less than once in five hundred frames."""
    for clip in read_recordings(find_recordings([cmu_folder])):
        rows = distance_rows(clip.positions, SKELETON)[:, ::40]
        rolling = RollingCovariance(rows.shape[1])
        rolling.update(rows[:LENGTH], rows[:0], rows[:LENGTH])
        for end in range(LENGTH + hop, len(rows) + 1, hop):
            start = end - LENGTH
            rolling.update(rows[end - hop : end], rows[start - hop : start], rows[start:end])
        assert rolling.refreshes <= len(rows) / 500


def test_refreshes_end_soon_after_a_stop(some_clips: tuple[Clip, ...]) -> None:
    """A stop costs some refreshes while the motion leaves the window, and none once all is still."""
    clip = some_clips[0]
    rows = distance_rows(_stop(clip, 1e-5, frames=3000), SKELETON)[:, ::40]
    rolling = RollingCovariance(rows.shape[1])
    counted = {}
    rolling.update(rows[:60], rows[:0], rows[:60])
    for end in range(61, len(rows) + 1):
        rolling.update(rows[end - 1 : end], rows[end - 61 : end - 60], rows[end - 60 : end])
        counted[end] = rolling.refreshes
    stopped, all_still = counted[clip.frames], counted[clip.frames + 60]
    assert stopped <= 2
    assert stopped < all_still <= stopped + 30
    assert counted[len(rows)] <= all_still + 1
