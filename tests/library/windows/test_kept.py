"""Basis and metrics in a library's file: as its motions teach them, and only for these motions."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from kinespace.library import MotionLibrary
from kinespace.library.motion_library.learned import TAUGHT, Learned
from kinespace.library.windows.index import WindowIndex, keeping_lessons
from kinespace.library.windows.kept import WEIGHINGS, kept_of

if TYPE_CHECKING:
    from pathlib import Path

    from kinespace.library.windows.comparison import Weighing

BOTH = pytest.mark.parametrize("weighing", WEIGHINGS.values(), ids=WEIGHINGS)


@pytest.fixture(scope="module")
def keeping(small_library: MotionLibrary) -> MotionLibrary:
    """Give a small library that keeps the numbers learned from its motions."""
    return keeping_lessons(small_library)


def _with(library: MotionLibrary, name: str, array: np.ndarray | None) -> MotionLibrary:
    """Change one of the arrays that a library keeps, or take it away."""
    assert library.learned is not None
    arrays = {each: kept for each, kept in library.learned.arrays().items() if each != f"{TAUGHT}{name}"}
    if array is not None:
        arrays[f"{TAUGHT}{name}"] = array.astype(np.float32)
    return replace(library, learned=Learned(arrays))


@BOTH
def test_kept_numbers_are_the_learned_ones(
    small_library: MotionLibrary, keeping: MotionLibrary, weighing: Weighing
) -> None:
    """A library that keeps its lessons has the same windows, number for number, as one that learns them again."""
    learned = WindowIndex.of(small_library, small_library, weighing)
    kept = WindowIndex.of(keeping, keeping, weighing)
    assert np.array_equal(kept.basis.directions, learned.basis.directions)
    assert np.array_equal(kept.basis.unweighted, learned.basis.unweighted)
    assert kept.basis.share == pytest.approx(learned.basis.share, abs=1e-7)
    assert all(np.array_equal(*both) for both in zip(kept.vectors, learned.vectors, strict=True))
    assert np.array_equal(kept.eigenvectors, learned.eigenvectors)


@pytest.mark.slow
@BOTH
def test_the_built_in_file_keeps_its_metrics(builtin: MotionLibrary, weighing: Weighing) -> None:
    """Its windows are as far from each other as in metrics learned here; processors round differently."""
    kept = WindowIndex.of(builtin, builtin, weighing)
    assert kept_of(builtin, weighing) is not None
    learned = WindowIndex.of(replace(builtin, learned=None), weighing=weighing)
    none = np.zeros(len(kept), dtype=np.bool_)
    for window in range(0, len(kept), 97):
        np.testing.assert_allclose(
            kept.own_distances(window, none), learned.own_distances(window, none), atol=0.05, err_msg=str(window)
        )


@pytest.mark.slow
def test_a_file_keeps_the_numbers(keeping: MotionLibrary, tmp_path: Path) -> None:
    """Written and read again, a library opens with the numbers in its file."""
    keeping.save(tmp_path / "kept.npz")
    again = MotionLibrary.load(tmp_path / "kept.npz")
    for weighing in WEIGHINGS.values():
        kept, before = kept_of(again, weighing), kept_of(keeping, weighing)
        assert kept is not None
        assert before is not None
        assert np.array_equal(kept.basis.directions, before.basis.directions)


def test_other_motions_teach_anew(keeping: MotionLibrary) -> None:
    """A library of other motions, classes, joints or weighing keeps nothing, nor does one with changed motions."""
    across = WEIGHINGS["across"]
    one = keeping.motions[0]
    others = (
        keeping.without(motions=[one]),
        keeping.with_motions([one]),
        keeping.renamed({one.class_name: "other"}),
        keeping.restricted_to(keeping.skeleton.joints[:20]),
        keeping.merged_with(keeping.without(motions=[one])),
        replace(keeping, motions=keeping.motions[1:]),
        replace(keeping, motions=(replace(one, actor="somebody"), *keeping.motions[1:])),
        replace(keeping, motions=(replace(one, positions=one.positions + 0.001), *keeping.motions[1:])),
    )
    assert all(kept_of(other, across) is None for other in others)
    assert kept_of(keeping, replace(across, first=1.0)) is None
    assert kept_of(replace(keeping, learned=None), across) is None


def test_derived_libraries_drop_numbers_of_other_motions(keeping: MotionLibrary) -> None:
    """Numbers that hold for other motions too stay; the file of a derived library is not made larger for nothing."""
    library = _with(keeping, "more", np.ones(1))
    assert library.learned is not None
    told = replace(library, learned=Learned({**library.learned.arrays(), "offset": np.ones(1, dtype=np.float32)}))
    derived = told.without(motions=[told.motions[0]])
    assert derived.learned is not None
    assert list(derived.learned.arrays()) == ["offset"]


@pytest.mark.parametrize(
    ("name", "array", "said"),
    [
        ("basis weights", None, "basis weights: expected an array, got none"),
        ("basis weights", np.ones(3), "at least 0 and one share, got"),
        ("basis weights", -np.ones(10), "at least 0 and one share, got"),
        ("basis directions", np.ones((3, 2)), "at most 32. directions, got"),
        ("basis directions", np.ones((10, 33)), "at most 32. directions, got"),
        ("basis directions", np.ones((10, 0)), "at most 32. directions, got"),
        ("basis directions", np.ones(10), "at most 32. directions, got"),
        ("across posture 0.25 s axes", np.ones((3, 2)), "across posture 0.25 s: expected an origin"),
        ("across posture 0.25 s axes", np.ones((10, 129)), "across posture 0.25 s: expected an origin"),
        ("across posture 0.25 s origin", np.ones(3), "across posture 0.25 s: expected an origin"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(
    keeping: MotionLibrary, name: str, array: np.ndarray | None, said: str
) -> None:
    """An array of another shape or type raises ValueError with its name, the expectation and the value found."""
    with pytest.raises(ValueError, match=said):
        kept_of(_with(keeping, name, array), WEIGHINGS["across"])


def test_lessons_do_not_set_the_limits_of_the_unknown(keeping: MotionLibrary, builtin: MotionLibrary) -> None:
    """A library that keeps only what its own motions teach is weighed and judged as one that keeps nothing."""
    assert builtin.judged_by_strangers
    assert not keeping.judged_by_strangers
    assert WindowIndex.of(keeping).comparison.weighing is WEIGHINGS["within"]
    assert builtin.learned is not None
    own = replace(builtin, learned=builtin.learned.of_these_motions())
    assert not own.judged_by_strangers
    assert kept_of(own, WEIGHINGS["within"]) is not None
