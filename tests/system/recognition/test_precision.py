"""Loss of precision: rolling sums at places where they lose digits, compared with exact sums."""

from collections.abc import Iterator

import naive_windows
import numpy as np
import pytest

from kinespace.library import Clip, Skeleton, distance_rows
from kinespace.library.naming.hdm05 import SKELETON
from kinespace.stream.recognizer.window import Window

#: Everything holds of the compiled loops and of numpy.
pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("arithmetic")]

#: Promised while a performer moves: largest error, relative to the largest entry.
MOVING = 1e-9
#: The same in a window that is still after motion.
STILL = 1e-6
#: Distances of which a covariance is taken here: as many as a basis has directions.
EVERY = 15


class Followed:
    """Rows that run through a window of half a second, 120 a second, and are their own points."""

    def __init__(self, width: int) -> None:
        self.length = 60
        self._window, self._pushed = Window([0.5], [0.5], np.eye(width)), 0

    def push(self, rows: np.ndarray) -> None:
        """Take in some rows and follow them."""
        times = (np.arange(self._pushed, self._pushed + len(rows)) / 120).tolist()
        self._pushed += len(rows)
        self._window.push(times, rows)
        self._window.moments(0.5)
        self._window.covariance(0.5)

    def error(self, rows: np.ndarray) -> float:
        """Compare with the textbook's covariance and variances of the rows that should be in the window."""
        exact = naive_windows.covariance(rows)
        covariance, variance = self._window.covariance(0.5), np.square(self._window.moments(0.5).deviation[0])
        largest = np.abs(exact).max()
        error = max(np.abs(covariance - exact).max(), np.abs(variance - exact.diagonal()).max())
        return float(error / largest) if largest > 0 else 0.0


# --- two hundred thousand frames -----------------------------------------------------------------------------------

LONG = 200_000
PIECE = 50_000
HOP = 50


def _long_motion() -> Iterator[np.ndarray]:
    """Perform for half an hour: eight joints swing, faster and slower, while the posture as a whole wanders."""
    generator = np.random.default_rng(8)
    pose = generator.normal(scale=0.6, size=(8, 3))
    swing, lean = generator.normal(scale=0.15, size=(8, 3)), generator.normal(scale=0.3, size=(8, 3))
    turn = generator.normal(scale=0.1, size=(8, 3))
    body = Skeleton(tuple(f"joint{index}" for index in range(8)))
    for begin in range(0, LONG, PIECE):
        time = np.arange(begin, begin + PIECE) / 120
        phases = np.sin(7.0 * time + 3.0 * np.sin(0.05 * time)), np.sin(0.003 * time), np.cos(4.1 * time)
        positions = pose + sum(
            phase[:, None, None] * way for phase, way in zip(phases, (swing, lean, turn), strict=True)
        )
        yield distance_rows(positions, body)


def test_two_hundred_thousand_frames() -> None:
    """After two hundred thousand frames of motion all sums are as exact as at first."""
    followed, rows, worst, hops = Followed(28), np.empty((0, 28)), 0.0, 0
    for piece in _long_motion():
        rows = np.concatenate([rows[-followed.length :], piece])
        for end in range(len(rows) - PIECE + HOP, len(rows) + 1, HOP):
            followed.push(rows[end - HOP : end])
            hops += 1
            if hops % 20 == 0:
                worst = max(worst, followed.error(rows[end - followed.length : end]))
    assert hops == LONG // HOP
    assert worst <= MOVING


# --- still after motion ------------------------------------------------------------------------------------------


def _stop(clip: Clip, noise: float, *, frames: int = 480) -> np.ndarray:
    """Let a performer move, then stand in the last pose, each coordinate wavering by a sensor's noise in metres."""
    pose = np.repeat(clip.positions[-1:], frames, axis=0)
    pose += noise * np.random.default_rng(len(clip.positions)).normal(size=pose.shape)
    return np.concatenate([clip.positions, pose])


@pytest.mark.parametrize("unit", [1.0, 1000.0], ids=["m", "mm"])
@pytest.mark.parametrize("noise", [1e-3, 1e-4, 1e-5])
def test_still_right_after_moving(some_clips: tuple[Clip, ...], noise: float, unit: float) -> None:
    """When a performer stops, down to a hundredth of a millimetre of noise, the still window's covariance is right."""
    for clip in some_clips[::4]:
        rows, followed = (
            distance_rows(_stop(clip, noise), SKELETON)[:, ::EVERY] * unit,
            Followed(len(SKELETON.pairs[::EVERY])),
        )
        for end in range(5, len(rows) + 1, 5):
            followed.push(rows[end - 5 : end])
            assert followed.error(rows[max(0, end - followed.length) : end]) <= STILL
