"""Basis and metrics in a library's file: as its motions teach them, and only for these motions."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic import stick_clips

from kinespace.library import MotionLibrary, WindowIndex
from kinespace.library.library_file import TAUGHT
from kinespace.library.windows.comparison import Weighing
from kinespace.library.windows.taught import WEIGHINGS, keeping_lessons, kept_of

BOTH = pytest.mark.parametrize("weighing", WEIGHINGS.values(), ids=WEIGHINGS)


@pytest.fixture(scope="module")
def people(tmp_path_factory: pytest.TempPathFactory) -> MotionLibrary:
    """Give a library that three people teach, rounded as a file rounds it."""
    path = tmp_path_factory.mktemp("people") / "people.npz"
    MotionLibrary.of_clips(stick_clips(actors=("aa", "bb", "cc"))).save(path)
    return MotionLibrary.load(path)


@pytest.fixture(scope="module")
def keeping(people: MotionLibrary) -> MotionLibrary:
    """Give this library with the numbers learned from its motions."""
    return keeping_lessons(people)


@BOTH
def test_kept_numbers_are_the_learned_ones(
    people: MotionLibrary, keeping: MotionLibrary, weighing: Weighing, tmp_path: Path
) -> None:
    """A library that keeps its lessons, also in a file, has the windows, number for number, that it would learn."""
    keeping.save(tmp_path / "kept.npz")
    read = MotionLibrary.load(tmp_path / "kept.npz")
    assert kept_of(read, weighing) is not None
    learned = WindowIndex.of(people, people, weighing)
    for library in (keeping, read):
        kept = WindowIndex.of(library, library, weighing)
        for name in ("directions", "weights"):
            assert np.array_equal(getattr(kept.basis, name), getattr(learned.basis, name))
        assert kept.basis.share == pytest.approx(learned.basis.share, abs=1e-7)
        assert all(np.array_equal(*both) for both in zip(kept.vectors, learned.vectors, strict=True))
        assert np.array_equal(kept.eigenvectors, learned.eigenvectors)


@pytest.mark.slow
@BOTH
def test_the_built_in_file_keeps_its_metrics(builtin: MotionLibrary, weighing: Weighing) -> None:
    """Its windows are as far from each other as in metrics learned here; processors round differently."""
    kept = WindowIndex.of(builtin, builtin, weighing)
    learned = WindowIndex.of(replace(builtin, learned={}), weighing=weighing)
    assert kept_of(builtin, weighing) is not None
    none, ask, again = np.zeros(len(kept), dtype=np.bool_), kept.asked_by, learned.asked_by
    for window in range(0, len(kept), 197):
        np.testing.assert_allclose(ask(window, none), again(window, none), atol=0.05, err_msg=str(window))


def test_other_motions_teach_anew(keeping: MotionLibrary) -> None:
    """A library of other motions, classes, joints or weighing keeps nothing, nor does one with changed motions."""
    across = WEIGHINGS["across"]
    one, *others = keeping.motions
    without, some = (
        keeping.without(motions=[one]),
        ((), (replace(one, actor="somebody"),), (one.moved_to(one.positions + 0.001),)),
    )
    changed = [without, keeping.with_motions([one]), keeping.renamed({one.class_name: "other"})]
    changed += [keeping.restricted_to(keeping.skeleton.joints[:5]), keeping.merged_with(without)]
    changed += [replace(keeping, motions=(*each, *others)) for each in some]
    assert all(kept_of(each, across) is None for each in changed)
    assert kept_of(keeping, replace(across, first=1.0)) is None
    assert kept_of(replace(keeping, learned={}), across) is None
    # Numbers that hold for other motions too stay; the file of a derived library is not made larger for nothing.
    numbers = {**keeping.learned, "offset": np.ones(1, dtype=np.float32)}
    derived = replace(keeping, learned=numbers).without(motions=[one])
    assert list(derived.learned) == ["offset"]


DIRECTIONS, AXES = (rf"\(15, at most {most}\) numbers, got \(" for most in (32, 128))


@pytest.mark.parametrize(
    ("name", "array", "said"),
    [
        ("basis weights", None, r"\(15,\) numbers, got none"),
        ("basis weights", np.ones(3), r"\(15,\) numbers, got \(3,\)"),
        ("basis share", np.ones(2), r"\(1,\) numbers, got \(2,\)"),
        *(("basis directions", np.ones(shape), DIRECTIONS) for shape in ((3, 2), (15, 33), (15, 0), 15, (15, 2, 2))),
        ("basis directions", None, r"\(15, at most 32\) numbers, got none"),
        *(("across posture 0.25 s axes", np.ones(shape), AXES) for shape in ((3, 2), (15, 129), (15, 0))),
        ("across posture 0.25 s origin", np.ones(3), r"\(15,\) numbers, got \(3,\)"),
        ("across posture 0.25 s origin", np.ones((1, 15)), r"\(15,\) numbers, got \(1, 15\)"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(
    keeping: MotionLibrary, name: str, array: np.ndarray | None, said: str
) -> None:
    """An array of another shape raises ValueError with its name, the expectation and the value found."""
    arrays = {each: kept for each, kept in keeping.learned.items() if each != f"{TAUGHT}{name}"}
    if array is not None:
        arrays[f"{TAUGHT}{name}"] = array.astype(np.float32)
    with pytest.raises(ValueError, match=f"{TAUGHT}{name}: expected {said}"):
        kept_of(replace(keeping, learned=arrays), WEIGHINGS["across"])
