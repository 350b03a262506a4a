"""The short list: the same best scores as the comparison with every motion, whatever the motions are like."""

from __future__ import annotations

from typing import TYPE_CHECKING

import naive
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic import STICK, stick_clip

from library.distances import distance_rows
from library.motionlibrary import Motion, MotionLibrary
from library.shortlist import DIRECTIONS, FEWEST_MOTIONS, Shortlist
from library.signature import Moments, signature_of

if TYPE_CHECKING:
    from library.clip import Clip

#: Everything holds of the compiled loops and of numpy.
pytestmark = pytest.mark.usefixtures("arithmetic")

#: Two products in single precision, summed in another order.
SAME = 1e-6


def _axes(generator: np.random.Generator, motions: int, pairs: int, spread: float) -> np.ndarray:
    """Make unit vectors near a few directions, as far from them as the spread says."""
    few = generator.normal(size=(6, pairs))
    axes = generator.normal(size=(motions, 6)) @ few + spread * generator.normal(size=(motions, pairs))
    return (axes / np.linalg.norm(axes, axis=1, keepdims=True)).astype(np.float32)


def _assert_same(axes: np.ndarray, classes: np.ndarray, asked: np.ndarray) -> None:
    """Hold the short list's scores of some axes, together and one by one, against those of every motion."""
    names = [str(index) for index in classes]
    starts = np.unique(classes, return_index=True)[1]
    shortlist = Shortlist(axes, starts)
    together = shortlist.class_scores(asked)
    for axis, found in zip(asked, together, strict=True):
        _, best = naive.match(axes.astype(np.float64), names, axis.astype(np.float64))
        expected = [best[str(index)] for index in np.unique(classes)]
        assert np.abs(found - expected).max() <= SAME
        assert np.abs(shortlist.class_scores(axis[None])[0] - expected).max() <= SAME


@given(
    seed=st.integers(0, 2**32 - 1),
    motions=st.integers(1, 300),
    pairs=st.sampled_from([1, 5, 50, 120, 230, *DIRECTIONS]),
    spread=st.sampled_from([0.0, 1e-3, 0.1, 10.0]),
)
@settings(max_examples=60)
def test_the_best_of_each_class_is_never_missed(seed: int, motions: int, pairs: int, spread: float) -> None:
    """Clustered or spread out in all directions, more directions than pairs or fewer, the scores are those of all."""
    generator = np.random.default_rng(seed)
    axes = _axes(generator, motions, pairs, spread)
    classes = np.sort(generator.integers(0, 9, size=motions))
    asked = np.concatenate([_axes(generator, 2, pairs, 1.0), axes[[int(generator.integers(motions))]]])
    _assert_same(axes, classes, asked)


def test_what_one_look_cannot_tell_the_next_does() -> None:
    """Motions alike along the first directions, unlike along the next: each is found when it is asked for."""
    generator = np.random.default_rng(7)
    first, _, last = DIRECTIONS
    axes = np.zeros((3000, 300), dtype=np.float32)
    axes[:, :first] = 1.0 + 1e-3 * generator.normal(size=(3000, first))
    axes[:, first:last] = 0.3 * generator.normal(size=(3000, last - first))
    axes[:, last:] = 0.02 * generator.normal(size=(3000, 300 - last))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    _assert_same(axes, np.arange(3000) // 1000, np.concatenate([axes[::500], -axes[1:2]]))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_motion_outside_all_directions_is_found(sign: float) -> None:
    """A motion that no kept direction knows of, in a library of others, is the best of its class when asked for."""
    generator = np.random.default_rng(1)
    axes = np.zeros((3000, 60), dtype=np.float32)
    axes[:, :20] = _axes(generator, 3000, 20, 1.0)
    axes[1500] = 0.0
    axes[1500, 55] = 1.0
    classes = np.arange(3000) // 1000
    asked = sign * axes[[1500]]
    (scores,) = Shortlist(axes, np.array([0, 1000, 2000])).class_scores(asked)
    assert scores == pytest.approx([0.0, 1.0, 0.0], abs=SAME)
    _assert_same(axes, classes, asked)


def test_equal_motions_are_all_listed() -> None:
    """A library of one motion many times over scores 1 in every class."""
    axes = np.repeat(_axes(np.random.default_rng(2), 1, 40, 1.0), 500, axis=0)
    (scores,) = Shortlist(axes, np.arange(0, 500, 50)).class_scores(axes[:1])
    assert scores == pytest.approx(np.ones(10), abs=SAME)


def test_windows_of_real_motion(some_clips: tuple[Clip, ...]) -> None:
    """Asked about real windows, thousands of real windows' axes give the scores of the whole comparison."""
    axes, classes = [], []
    for index, clip in enumerate(some_clips):
        rows = distance_rows(clip.positions, clip.skeleton)[:, ::6]
        for start in range(0, len(rows) - 40, 9):
            axes.append(signature_of(Moments.of_rows(rows[start : start + 40])).axis.vector.astype(np.float32))
            classes.append(index)
    together, labels = np.array(axes), np.array(classes)
    starts = np.unique(labels, return_index=True)[1]
    shortlist = Shortlist(together, starts)
    for axis in together[::25]:
        expected = np.maximum.reduceat(np.abs(together @ axis), starts)
        assert np.abs(shortlist.class_scores(axis[None]) - expected).max() <= SAME


@pytest.mark.parametrize("motions", [FEWEST_MOTIONS - 1, FEWEST_MOTIONS, 3 * FEWEST_MOTIONS])
def test_large_libraries_score_as_they_match(motions: int) -> None:
    """Above the size from which a short list is kept and below, class scores are those of the match in full."""
    generator = np.random.default_rng(3)
    pairs = len(STICK.pairs)
    axes = _axes(generator, motions, pairs, 0.3)
    others = np.ones((motions, pairs), dtype=np.float32)
    named = [f"class{index}" for index in generator.integers(0, 30, size=motions)]
    library = MotionLibrary(
        skeleton=STICK,
        motions=tuple(Motion(name, "a", "1", 100, 120.0, 1.0, 0.5) for name in named),
        means=others,
        axes=axes,
        deviations=others,
    )
    rows = [distance_rows(stick_clip("wave", seed=seed).positions, STICK) for seed in range(5)]
    signatures = [signature_of(Moments.of_rows(each)) for each in rows]
    together = library.class_scores(np.array([signature.axis.vector for signature in signatures]))
    for signature, scores in zip(signatures, together, strict=True):
        expected = library.match(signature).class_scores
        assert np.abs(scores - expected).max() <= SAME
        assert np.abs(library.class_scores(signature.axis.vector) - expected).max() <= SAME
