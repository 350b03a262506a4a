from __future__ import annotations

from typing import TYPE_CHECKING

import naive_windows
import numpy as np
import pytest
from naive_windows import window

from kinespace.library.windows.index import measured_clips
from kinespace.library.windows.paper import PaperIndex, opened_by_paper

if TYPE_CHECKING:
    from kinespace.library import MotionLibrary

SECONDS = 1.0


@pytest.fixture(scope="module")
def paper(small_library: MotionLibrary) -> PaperIndex:
    """Give the small library's eigenvectors over a second."""
    return PaperIndex.of(small_library, SECONDS)


@pytest.mark.slow
def test_eigenvectors_by_definition(small_library: MotionLibrary, paper: PaperIndex) -> None:
    """They are the leading ones of the covariance of distances, but for their signs."""
    clips, ends, _ = measured_clips(small_library)
    products = []
    for clip, end in ((clip, end) for clip, own in zip(clips, ends, strict=True) for end in own):
        _, rows = window(clip, end, SECONDS)
        _, [leading] = naive_windows.leading(naive_windows.covariance(rows @ paper.basis.directions), 1)
        products.append(abs(paper.eigenvectors[len(products)] @ leading))
    assert products == pytest.approx([1.0] * len(paper.eigenvectors), abs=1e-4)


def test_scores_by_brute_force(small_library: MotionLibrary, paper: PaperIndex) -> None:
    """Each class has the mean of its two best people's best |inner products|."""
    clips, ends, _ = measured_clips(small_library)
    owners = [clip for clip, own in zip(clips, ends, strict=True) for _ in own]
    vectors = paper.eigenvectors
    for asking in (0, 40, len(vectors) - 1):
        negative = [-abs(float(vectors[asking] @ vector)) for vector in vectors]
        twin = naive_windows.nearest(negative, [clip.class_name for clip in owners], [clip.actor for clip in owners])
        assert tuple(twin) == paper.classes
        assert paper.scores(vectors[asking]) == pytest.approx([-each for each in twin.values()], abs=1e-4)
        assert np.array_equal(paper.scores(-vectors[asking]), paper.scores(vectors[asking]))


def test_eigenvectors_are_unit_vectors(paper: PaperIndex) -> None:
    """Their products are between 0 and 1."""
    assert np.linalg.norm(paper.eigenvectors, axis=1) == pytest.approx(np.ones(len(paper.eigenvectors)), abs=1e-5)


def test_the_basis_has_no_weights(paper: PaperIndex) -> None:
    """Inner products in an orthonormal basis equal those in distance space."""
    directions = paper.basis.directions
    assert np.allclose(directions.T @ directions, np.eye(directions.shape[1]))
    assert paper.basis.share > 0.98


def test_a_library_is_opened_once_for_each_length(small_library: MotionLibrary) -> None:
    """Several recognisers share its eigenvectors."""
    first = opened_by_paper(small_library, SECONDS)
    assert opened_by_paper(small_library, SECONDS) is first
    assert first.seconds == SECONDS
