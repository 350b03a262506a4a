"""The paper's experiment: its figures, and its counting against loops and sorted lists."""

from dataclasses import replace

import naive
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kinespace.library import Clip, distance_rows
from kinespace.tools.evaluation import evaluate_retrieval as paper
from kinespace.tools.evaluation.evaluate_retrieval import Labels, Protocol, candidates, retrieve


@pytest.mark.parametrize("space", list(paper.Space))
def test_axes_equal_the_papers_svd(some_clips: tuple[Clip, ...], space: paper.Space) -> None:
    """In each space a motion's axis is the first of the SVD of its numbers, centred or raw, whatever its sign."""
    generator = np.random.default_rng(3)
    turning = [replace(clip, rotations=generator.normal(size=(clip.frames, 59))) for clip in some_clips[:4]]
    ways = (paper.signatures_of(turning, space, kind) for kind in paper.SignatureKind)
    for clip, axis, raw in zip(turning, *ways, strict=True):
        numbers = {
            paper.Space.DISTANCES: distance_rows(clip.positions, clip.skeleton),
            paper.Space.POSITIONS: clip.positions.reshape(clip.frames, 93),
            paper.Space.ROTATIONS: clip.rotations,
        }
        _, expected = naive.first_axis_by_svd(numbers[space])
        assert abs(axis @ expected) == pytest.approx(1.0, abs=1e-9)
        assert abs(raw @ np.linalg.svd(numbers[space])[2][0]) == pytest.approx(1.0, abs=1e-9)


@given(st.integers(0, 2**32 - 1), st.integers(3, 14), st.sampled_from(list(Protocol)))
def test_any_outcome_equals_sorted_lists(seed: int, motions: int, protocol: Protocol) -> None:
    """For any scores, with ties, and any labels the outcome equals a count over sorted Python lists."""
    generator = np.random.default_rng(seed)
    scores = generator.integers(0, 5, size=(motions, motions)) / 4.0
    actors = np.array(["bd", "bk", "tr", *generator.choice(["bd", "bk", "tr"], motions - 3)])
    labels = Labels(generator.choice(["bow", "jump", "wave"], motions), actors)
    found = retrieve(scores, labels, candidates(labels, protocol))
    tally = naive.retrieval(scores, labels.classes.tolist(), actors.tolist(), protocol)
    assert len(found.asking) == len(tally)
    assert (found.nearest, found.shares["two_nearest"].value()) == pytest.approx(tuple(np.mean(tally, axis=0)))


@pytest.mark.parametrize("protocol", [Protocol.ACTOR_HELD_OUT, Protocol.SPLIT])
def test_a_protocol_in_which_nobody_asks_is_refused(protocol: Protocol) -> None:
    """With one actor alone no motion has another to be compared with."""
    labels = Labels(np.array(["bow", "bow", "jump"]), np.array(["bd"] * 3))
    with pytest.raises(ValueError, match="--protocol: expected a motion that may be compared with two others"):
        retrieve(np.eye(3), labels, candidates(labels, protocol))
