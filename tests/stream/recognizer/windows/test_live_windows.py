"""The signature of a live window: every part equals its definition, with any rows between two readings."""

from __future__ import annotations

from typing import TYPE_CHECKING

import naive_windows
import numpy as np
import pytest
from naive_windows import body_of

from kinespace.library.distances import distance_rows
from kinespace.library.skeleton import Skeleton
from kinespace.library.windows.basis import Basis
from kinespace.library.windows.body import Body
from kinespace.library.windows.index import learned_basis
from kinespace.library.windows.parts import PARTS, POSTURE, Kind
from kinespace.stream.recognizer.windows.live_windows import LiveWindows, PaperWindow
from kinespace.stream.recognizer.windows.sliding_window import MAX_PENDING

if TYPE_CHECKING:
    from collections.abc import Iterator

    from kinespace.library.clip import Clip
    from kinespace.library.motion_library import MotionLibrary
    from kinespace.library.windows.index import WindowIndex
    from kinespace.stream.recognizer.windows.live_windows import LiveSignature

#: Everything holds of the compiled loops and of numpy.
pytestmark = pytest.mark.usefixtures("arithmetic")

#: Largest error of a part of the distances, and of the matrix of scaled eigenvectors. A rigid distance's deviation is
#: the root of a variance that is right to nine digits of the largest, so its spread is not.
SAME, SAME_MATRIX = 1e-7, 1e-6


@pytest.fixture(scope="module")
def clip(some_clips: tuple[Clip, ...]) -> Clip:
    """Give the longest motion: of more than two seconds."""
    return max(some_clips, key=lambda clip: clip.frames)


@pytest.fixture(scope="module")
def rows(clip: Clip) -> np.ndarray:
    """Give a clip's distance rows."""
    return distance_rows(clip.positions, clip.skeleton)


@pytest.fixture
def windows(small_index: WindowIndex) -> LiveWindows:
    """Give live windows in the small library's basis."""
    return LiveWindows(small_index.body, small_index.basis)


def _assert_by_definition(read: LiveSignature, index: WindowIndex, times: np.ndarray, rows: np.ndarray) -> None:
    """Compare all numbers of a reading with those computed from the rows up to now."""
    parts = [(str(part.kind), part.seconds) for part in PARTS]
    body = body_of(index.library.skeleton)
    expected = naive_windows.numbers_of(parts, times[-1], times, rows, index.basis.directions, body)
    for part in PARTS:
        numbers, twin = read.numbers[part], expected[str(part.kind), part.seconds]
        if part.kind is Kind.EIGEN:
            assert np.abs(numbers.T @ numbers - twin).max() <= SAME_MATRIX
        else:
            assert np.abs(numbers - twin).max() <= SAME
    longest = rows[times > times[-1] - 2.0 + 1e-6] @ index.basis.directions
    matrix = naive_windows.covariance(longest)
    values = np.linalg.eigvalsh(matrix)[::-1]
    assert read.share == pytest.approx(values[0] / values.sum(), rel=1e-6)
    assert read.gap == pytest.approx(1 - values[1] / values[0], abs=1e-6)
    assert np.linalg.norm(matrix @ read.eigenvector - values[0] * read.eigenvector) <= 1e-6 * values[0]


def _batches(count: int, seed: int) -> Iterator[slice]:
    """Cut so many frames into batches of 1 to 30."""
    generator, end = np.random.default_rng(seed), 0
    while end < count:
        begin, end = end, min(end + int(generator.integers(1, 31)), count)
        yield slice(begin, end)


@pytest.mark.slow
@pytest.mark.parametrize("start", [0.0, 1.7e9])
def test_every_part_by_definition(
    windows: LiveWindows, small_index: WindowIndex, rows: np.ndarray, start: float
) -> None:
    """With frames in any batches and on any clock, all parts equal those of the window's rows."""
    times = start + np.arange(len(rows)) / 120
    for batch in _batches(len(rows), 3):
        windows.push(times[batch].tolist(), rows[batch])
        if batch.stop > 2:
            _assert_by_definition(windows.read(), small_index, times[: batch.stop], rows[: batch.stop])


@pytest.mark.slow
def test_at_uneven_times_and_after_gaps(windows: LiveWindows, small_index: WindowIndex, rows: np.ndarray) -> None:
    """With frames lost at random and gaps of up to half a second, all parts equal those of the rows."""
    generator = np.random.default_rng(4)
    kept = np.flatnonzero(generator.random(len(rows)) > 0.4)
    times = kept / 120 + np.cumsum(
        generator.choice([0.0, 0.0, 0.0, 0.3], size=len(kept)) * (np.arange(len(kept)) % 9 == 0)
    )
    for end in range(1, len(kept) + 1):
        windows.push(times[end - 1 : end].tolist(), rows[kept[end - 1 : end]])
        if end > 3 and end % 7 == 0:
            _assert_by_definition(windows.read(), small_index, times[:end], rows[kept[:end]])


def test_many_frames_without_a_reading(windows: LiveWindows, small_index: WindowIndex, rows: np.ndarray) -> None:
    """More frames than a window may hold back are followed without being asked for."""
    times = np.arange(len(rows)) / 120
    for begin in range(0, len(rows), 16):
        windows.push(times[begin : begin + 16].tolist(), rows[begin : begin + 16])
    assert len(rows) > 3 * MAX_PENDING
    _assert_by_definition(windows.read(), small_index, times, rows)


def test_cleared_windows_begin_anew(windows: LiveWindows, small_index: WindowIndex, rows: np.ndarray) -> None:
    """After a clear the rows before have no influence, and times may begin anywhere."""
    windows.push((100 + np.arange(60) / 120).tolist(), rows[:60])
    windows.read()
    windows.clear()
    times = np.arange(40) / 120
    windows.push(times.tolist(), rows[80:120])
    _assert_by_definition(windows.read(), small_index, times, rows[80:120])


def test_a_body_in_one_point_has_no_part(windows: LiveWindows, rows: np.ndarray) -> None:
    """Without any length there are no movement, share or gap, and every number is finite."""
    windows.push((np.arange(30) / 120).tolist(), np.zeros((30, rows.shape[1])))
    read = windows.read()
    assert (read.movement, read.share, read.gap) == (0.0, 0.0, 0.0)
    for part, numbers in read.numbers.items():
        assert np.isfinite(numbers).all()
        assert part.kind is Kind.SPREAD or not numbers.any()


@pytest.mark.parametrize("seconds", [0.3, 1.0])
def test_the_papers_window(small_library: MotionLibrary, rows: np.ndarray, seconds: float) -> None:
    """Its eigenvector is the leading one of the window's rows in the orthonormal basis, at every reading."""
    basis = learned_basis(small_library, weighted=False)
    window = PaperWindow(basis, seconds)
    for end in range(10, len(rows) + 1, 10):
        window.push((np.arange(end - 10, end) / 120).tolist(), rows[end - 10 : end])
        leading, moved = window.read()
        inside = rows[max(0, end - round(seconds * 120)) : end]
        values, vectors = naive_windows.leading(naive_windows.covariance(inside @ basis.directions))
        assert abs(float(leading.eigenvector @ vectors[0])) == pytest.approx(1.0, abs=1e-6)
        assert leading.gap == pytest.approx(1 - values[1] / values[0], abs=1e-6)
        assert moved == pytest.approx(naive_windows.moved(naive_windows.moments(np.arange(len(inside)), inside)))


def test_windows_of_a_body_without_parents(small_library: MotionLibrary, rows: np.ndarray) -> None:
    """Where no segments are known the numbers are finite, and postures are relative to the mean distance."""
    plain = Skeleton(small_library.skeleton.joints)
    windows = LiveWindows(Body.of(plain), learned_basis(small_library))
    windows.push((np.arange(60) / 120).tolist(), rows[:60])
    numbers = windows.read().numbers
    posture = next(part for part in PARTS if part.kind is Kind.POSTURE)
    mean = rows[60 - 30 : 60].mean(axis=0)
    assert numbers[posture] == pytest.approx(mean / mean.mean(), rel=1e-9)
    assert all(np.isfinite(each).all() for each in numbers.values())


def test_a_body_of_many_joints_has_postures() -> None:
    """In a stretched chain of more joints than the compiled loops take each distance is the segments between."""
    chain = Skeleton(tuple(f"joint{place}" for place in range(260)), tuple(range(-1, 259)))
    rows = distance_rows(np.arange(260.0)[None, :, None] * (1.0, 0.0, 0.0), chain)
    live = LiveWindows(Body.of(chain), Basis(np.zeros((len(chain.pairs), 1)), *np.zeros((2, len(chain.pairs))), 1.0))
    live.push([0.0], rows)
    np.testing.assert_allclose(live.read().numbers[POSTURE], 1.0)
