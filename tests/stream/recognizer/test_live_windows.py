"""The last seconds: rows in a sliding window, averaged where a feed trembles, and the parts read off them."""

from dataclasses import replace
from functools import cache

import naive_windows
import numpy as np
import pytest
from naive_stream import NaiveSmoother
from twins import Twin

from kinespace.library import Clip, MotionLibrary, WindowIndex, distance_rows
from kinespace.library.signature.body import Body
from kinespace.library.signature.parts import Kind, Signature
from kinespace.library.windows.comparison import by_paper
from kinespace.stream.recognizer.window import NOISY, RowSmoother, Window

# --- smoothing --------------------------------------------------------------------------------------------------------


@cache
def _trembling_rows(noise: float, rate: float = 30.0) -> tuple[list[float], np.ndarray, np.ndarray]:
    """Give times, clean rows and noisy rows of a real motion; noise in metres on every coordinate."""
    clip = max(MotionLibrary.builtin().motions, key=lambda each: each.frames)
    step = max(1, round(clip.frame_rate / rate))
    positions = clip.positions[::step]
    shaken = positions + np.random.default_rng(3).normal(0, noise, positions.shape)
    times = (np.arange(len(positions)) * step / clip.frame_rate).tolist()
    return times, distance_rows(positions, clip.skeleton), distance_rows(shaken, clip.skeleton)


@pytest.mark.parametrize("together", [1, 3, 4])
@pytest.mark.parametrize("begins", [50, 120])
def test_a_feed_that_begins_to_tremble_is_smoothed_as_by_the_twin(begins: int, together: int) -> None:
    """At every hop the rows and the noise are the twin's: before, while and after, also as the memory moves back."""
    times, clean, shaken = _trembling_rows(0.03)
    rows = np.concatenate([clean[:begins], shaken[begins : begins + 30], clean[begins + 30 :]])
    segments = Body.of(MotionLibrary.builtin().skeleton).segments
    smoother, twin = RowSmoother(segments, rows.shape[1]), NaiveSmoother(segments.tolist())
    was_noisy = list[bool]()
    for begin in range(0, len(rows), together):
        some = rows[begin : begin + together].copy()
        when = times[begin : begin + len(some)]
        expected = twin.smoothed([*zip(when, some.copy(), strict=True)])
        smoother.smooth(when, some)
        np.testing.assert_allclose(some, [row for _, row in expected], rtol=0, atol=1e-12)
        assert smoother.noise == pytest.approx(twin.noise, rel=1e-9)
        was_noisy.append(smoother.noise >= NOISY)
    assert (was_noisy[0], any(was_noisy), was_noisy[-1]) == (False, True, False)
    smoother.clear()
    assert smoother.noise == 0


# --- live windows -----------------------------------------------------------------------------------------------------

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


def _assert_by_definition(
    live: Window, signature: Signature | None, index: WindowIndex, times: np.ndarray, rows: np.ndarray
) -> None:
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
    seconds = 1.0 if index.comparison.weighing.judges else live.seconds
    moved = naive_windows.moved(
        naive_windows.moments(*(each[times > times[-1] - seconds + 1e-6] for each in (times, rows)))
    )
    assert signature.movement == pytest.approx(moved)
    weights = index.basis.directions @ vector
    centred = rows[inside] - rows[inside].mean(axis=0)
    given = [weight * sum(each * (centred @ weights)) for weight, each in zip(weights, centred.T, strict=True)]
    assert live.contributions() == pytest.approx(given, abs=1e-9)
    assert live.place() == pytest.approx(rows[-1] @ index.basis.directions / index.body.size(rows[-1]))
    assert np.array_equal(live.recent()[1], rows[inside])


@pytest.mark.slow
@pytest.mark.usefixtures("arithmetic")
@pytest.mark.parametrize("start", [0.0, 1.7e9])
@pytest.mark.parametrize("evenly", [True, False])
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
            _assert_by_definition(live, live.read(), index, times[:end], rows[kept[:end]])
            read += 1
    assert read > 3


@pytest.mark.usefixtures("arithmetic")
def test_in_another_library_the_rows_stay(small_index: WindowIndex, index: WindowIndex, rows: np.ndarray) -> None:
    """In the same basis at once, in another one by following all rows anew."""
    live, times = Window(small_index), np.arange(len(rows)) / 120
    live.push(times.tolist(), rows)
    live.exchange(small_index.of_some([0, 1, 2]))
    _assert_by_definition(live, live.read(), small_index.of_some([0, 1, 2]), times, rows)
    live.exchange(index)
    assert live.seconds == (2.0 if index is small_index else 0.75)
    _assert_by_definition(live, live.read(), index, times, rows)
