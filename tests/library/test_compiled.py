"""The compiled functions compute what the numpy ones beside them do, and refuse arrays that do not fit."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from numpy.random import Generator

from kinespace.library import Skeleton, compiled
from kinespace.library.signature.body import Body
from kinespace.library.signature.parts import LEVEL_REMOVED, NOISE_FLOOR
from kinespace.stream.recognizer.window import NEAR, read_distances, read_points, slide

pytestmark = pytest.mark.skipif(not compiled.in_use, reason="nothing is compiled here")


def _sums(generator: Generator, width: int, shape: Sequence[int]) -> list[np.ndarray]:
    """Give the sums of some rows near a reference."""
    rows, since = generator.normal(size=(40, width)), np.sort(generator.uniform(-1, 0, 40))
    second = rows.T @ rows if len(shape) == 2 else np.square(rows).sum(axis=0)
    clock = np.array([9.0, 40.0, since.sum(), since @ since])
    return [2.0 + generator.uniform(size=width), clock, np.array([rows.sum(axis=0), since @ rows]), second]


def _slide(generator: Generator) -> list[Any]:
    width, count = int(generator.integers(1, 40)), int(generator.integers(20, 60))
    shape = (width, width) if generator.integers(2) else (width,)
    times, rows = 9.0 + np.arange(count) / 60, 2.0 + generator.normal(size=(count, width))
    return [*_sums(generator, width, shape), times, rows, count - int(generator.integers(9)), count, 0, 5]


def _read_distances(generator: Generator) -> list[Any]:
    joints, known = int(generator.integers(2, 13)), bool(generator.integers(4))
    parents = (-1, *(int(generator.integers(0, joint)) for joint in range(1, joints))) if known else ()
    body = Body.of(Skeleton(tuple(f"joint{place}" for place in range(joints)), parents))
    width = len(body.sizing)
    sums = _sums(generator, width, (width,))
    if not generator.integers(4):
        sums = [np.zeros(width), np.array([0.0, 9.0, 0.0, 0.0]), np.zeros((2, width)), np.zeros(width)]
    return [*sums, body.sizing, body.segments, body.between, NOISE_FLOOR, LEVEL_REMOVED]


def _read_points(generator: Generator) -> list[Any]:
    size = int(generator.integers(2 * NEAR, 33))
    sums = _sums(generator, size, (size, size))[1:]
    swing = np.diag(0.7 ** np.arange(size))
    sums[1][0] = 0.0
    sums[2] = swing @ sums[2] @ swing
    near = np.linalg.eigh(sums[2])[1].T[: -NEAR - 1 : -1] + 1e-3 * generator.normal(size=(NEAR, size))
    return [*sums, 0.0, near, int(generator.integers(1, 5))]


CASES: dict[Callable[..., Any], Callable[[Generator], list[Any]]] = {
    slide: _slide,
    read_distances: _read_distances,
    read_points: _read_points,
}
FUNCTIONS = pytest.mark.parametrize("function", CASES, ids=lambda each: each.__name__)


def _copied(arguments: list[Any]) -> list[Any]:
    return [each.copy() if isinstance(each, np.ndarray) else each for each in arguments]


def _flat(given: Any) -> list[np.ndarray]:  # noqa: ANN401 - what a function gives
    return [np.asarray(each) for each in (given if isinstance(given, tuple) else (given,))]


@FUNCTIONS
@pytest.mark.parametrize("seed", range(12))
def test_it_computes_what_numpy_computes(function: Callable[..., Any], seed: int) -> None:
    """It gives the same numbers, and leaves the same in its arguments."""
    arguments = CASES[function](np.random.default_rng(seed))
    ours, theirs = _copied(arguments), _copied(arguments)
    found, expected = function(*ours), compiled.by_numpy[function.__name__](*theirs)
    if function is read_points:
        # Eigenvectors may have either sign, and those after the fourth are only on the way.
        (values, vectors, scaled, trace), (theirs_values, theirs_vectors, theirs_scaled, theirs_trace) = found, expected
        assert [*values[:4], trace] == pytest.approx([*theirs_values[:4], theirs_trace])
        assert np.abs((vectors[:4] * theirs_vectors[:4]).sum(axis=1)) == pytest.approx(1.0)
        assert np.abs(scaled.T @ scaled - theirs_scaled.T @ theirs_scaled).max() < 1e-7
        return
    for one, other in zip((*_flat(found), *ours), (*_flat(expected), *theirs), strict=True):
        if isinstance(other, np.ndarray):
            np.testing.assert_allclose(one, other, rtol=1e-7, atol=1e-7)


@FUNCTIONS
def test_it_refuses_what_does_not_fit(function: Callable[..., Any]) -> None:
    """An array of another type, shape or layout is refused, and nothing beyond an array is read."""
    arguments = CASES[function](np.random.default_rng(1))
    for place, each in enumerate(arguments):
        if not isinstance(each, np.ndarray) or not each.size:
            continue
        for wrong in (each.astype(np.int8), each[..., None], np.concatenate([each, each], axis=-1)[..., ::2]):
            with pytest.raises(ValueError, match=r"expected|contiguous"):
                function(*arguments[:place], wrong, *arguments[place + 1 :])
    with pytest.raises(TypeError):
        function(*arguments[1:])


def test_it_refuses_places_that_are_not_there() -> None:
    """Indices must lie in the array that they point into."""
    arguments = CASES[read_distances](np.random.default_rng(4))
    arguments[5] = np.full_like(arguments[5], -1)
    assert arguments[5].size
    with pytest.raises(ValueError, match="fit each other"):
        read_distances(*arguments)


def test_numpy_takes_what_is_too_large() -> None:
    """A covariance of more directions than there is room for is left to numpy, as is one unlike the last."""
    by_numpy = compiled.by_numpy["read_points"]
    for size, near in ((40, 1.0), (20, 0.0)):
        sums = _sums(np.random.default_rng(0), size, (size, size))[1:]
        arguments = *sums, 0.0, np.full((NEAR, size), near), 4
        assert read_points(*arguments) is None
        values, vectors, *_ = by_numpy(*arguments)
        assert values.shape == (NEAR,)
        assert vectors.shape == (NEAR, size)
