"""The last seconds: rows in a sliding window, and the parts read off them."""

from dataclasses import replace

import naive_windows
import numpy as np
import pytest
from synthetic import plain_index
from twins import Twin

from kinespace.library import Clip, MotionLibrary, WindowIndex, distance_rows
from kinespace.library.signature.parts import Kind, Signature
from kinespace.library.windows.paper import by_paper
from kinespace.stream.recognizer.window import MAX_FEED_RATE, NOISY, RowSmoother, Window

#: Largest error of a part of the distances, and of the matrix of scaled eigenvectors. A rigid distance's deviation is
#: the root of a variance that is right to nine digits of the largest, so its spread is not.
SAME, SAME_MATRIX = 1e-7, 1e-6


@pytest.fixture(scope="module")
def rows(some_clips: tuple[Clip, ...]) -> np.ndarray:
    """Give the distance rows of the longest motion: of more than two seconds."""
    clip = max(some_clips, key=lambda clip: clip.frames)
    return distance_rows(clip.positions, clip.skeleton)


@pytest.fixture(scope="module", params=["windows", "paper"])
def index(request: pytest.FixtureRequest, small_index: WindowIndex, sticks: MotionLibrary) -> WindowIndex:
    """Give an index of either signature, with windows of three quarters of a second for the paper's."""
    if request.param == "windows":
        return small_index
    paper = WindowIndex.of(sticks, weighing=by_paper(0.75))
    directions = np.linalg.qr(np.random.default_rng(1).normal(size=(465, 15)))[0]
    return replace(paper, body=small_index.body, basis=replace(small_index.basis, directions=directions))


def _check(live: Window, signature: Signature | None, index: WindowIndex, times: np.ndarray, rows: np.ndarray) -> None:
    """Compare all that was read with numbers computed from the rows up to now."""
    assert live.signature is signature
    expected = Twin(index).numbers(times[-1], times, rows)
    for part, numbers in signature.parts.items():
        twin = expected[str(part.kind), part.seconds]
        if part.kind is Kind.EIGEN:
            twin = twin if len(numbers) > 1 else naive_windows.leading(twin, 1)[1].T @ naive_windows.leading(twin, 1)[1]
            assert np.abs(numbers.T @ numbers - twin).max() <= SAME_MATRIX
        else:
            assert np.abs(numbers - twin).max() <= SAME
    inside = times > times[-1] - live.seconds + 1e-6
    matrix = naive_windows.covariance(rows[inside] @ index.basis.directions)
    values, vector = np.linalg.eigvalsh(matrix)[::-1], signature.leading
    assert signature.share == pytest.approx(values[0] / values.sum(), rel=1e-6)
    assert signature.gap == pytest.approx(1 - values[1] / values[0], abs=1e-6)
    assert np.linalg.norm(matrix @ vector - values[0] * vector) <= 1e-6 * values[0]
    # Movement is read off the longest window of distances.
    seconds = live.seconds if index.comparison.weighing.as_in_paper else 1.0
    last = times > times[-1] - seconds + 1e-6
    moved = naive_windows.moved(naive_windows.moments(times[last], rows[last]))
    assert signature.movement == pytest.approx(moved)
    weights = index.basis.directions @ vector
    centred = rows[inside] - rows[inside].mean(axis=0)
    given = [weight * sum(each * (centred @ weights)) for weight, each in zip(weights, centred.T, strict=True)]
    assert live.contributions() == pytest.approx(given, abs=1e-9)
    assert live.place() == pytest.approx(rows[-1] @ index.basis.directions / index.body.size(rows[-1]))
    assert np.array_equal(live.recent()[1], rows[inside])


@pytest.mark.slow
@pytest.mark.usefixtures("arithmetic")
@pytest.mark.parametrize(("start", "evenly"), [(0.0, True), (1.7e9, False)])
def test_every_part_by_definition(index: WindowIndex, rows: np.ndarray, start: float, *, evenly: bool) -> None:
    """With frames in any batches, on any clock, at uneven times and after gaps, all are as the rows say."""
    generator, end, live, read = np.random.default_rng(3), 0, Window(index), 0
    kept = np.arange(len(rows)) if evenly else np.flatnonzero(generator.random(len(rows)) > 0.4)
    gaps = generator.choice([0.0, 0.0, 0.0, 0.3], size=len(kept)) * (np.arange(len(kept)) % 9 == 0) * (not evenly)
    times = start + kept / 120 + np.cumsum(gaps)
    while end < len(kept):
        begin, end = end, min(end + int(generator.integers(1, 31)), len(kept))
        live.push(times[begin:end].tolist(), rows[kept[begin:end]])
        if times[end - 1] - times[0] >= 0.15 and generator.random() < 0.4:
            _check(live, live.read(), index, times[:end], rows[kept[:end]])
            read += 1
    assert read > 3


@pytest.mark.usefixtures("arithmetic")
def test_in_another_library_the_rows_stay(small_index: WindowIndex, index: WindowIndex, rows: np.ndarray) -> None:
    """In the same basis at once, in another one by following all rows anew."""
    live, times = Window(small_index), np.arange(len(rows)) / 120
    live.push(times.tolist(), rows)
    live.exchange(small_index.of_some([0, 1, 2]))
    _check(live, live.read(), small_index.of_some([0, 1, 2]), times, rows)
    live.exchange(index)
    assert live.seconds == (2.0 if index is small_index else 0.75)
    _check(live, live.read(), index, times, rows)


def test_the_noise_of_one_performer_is_not_the_next_ones() -> None:
    """Cleared, rows are averaged no longer; `test_a_trembling_sensor` compares the averages with the twin's."""
    smoother = RowSmoother(np.arange(3), 3)
    smoother.smooth((np.arange(30) / 30).tolist(), np.random.default_rng(1).normal(size=(30, 3)))
    assert smoother.noise >= NOISY
    smoother.clear()
    assert smoother.noise == 0.0


def test_a_feed_that_is_too_fast_shortens_the_window() -> None:
    """It holds the newest rows, as many as the fastest feed has in its seconds, also as rows move back in memory."""
    window, most = Window(plain_index(0.5, 4)), round(0.5 * MAX_FEED_RATE)
    for number in range(3 * most):
        window.push([number / MAX_FEED_RATE / 2], np.full((1, 6), 1.0 + number))
        kept = range(max(number + 1 - most, 0) + 1, number + 2)
        assert window.recent()[1].tolist() == [[each] * 6 for each in kept]
    found = window.moments(0.5)
    np.testing.assert_allclose(found.mean[0], [np.mean(kept)] * 6)
    np.testing.assert_allclose(found.deviation[0], [np.std(kept)] * 6)
    window.clear()
    assert not len(window.recent()[0])
