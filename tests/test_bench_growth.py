"""`kinespace bench growth`: what is grown is what it says. No figure is held against a limit here."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from library import MotionLibrary
from library.distances import distance_rows
from stream.recognizer import LiveSignature
from tools.bench import growth
from tools.bench.growth import Sizes, enlarged, with_joints
from tools.bench.timing import exponent

if TYPE_CHECKING:
    from tools.bench.recorded import Recorded


@pytest.mark.parametrize("count", [15, 20, 31, 55])
def test_a_body_of_any_number_of_joints_moves_as_recorded(count: int, recordings: Recorded) -> None:
    """Joints that stay keep their positions; those added lie half way along a bone, and no two are alike."""
    clip = recordings.examples[3]
    other = with_joints(clip, count)
    joints = other.skeleton.joints
    assert len(joints) == count
    assert other.class_name == clip.class_name
    for place, name in enumerate(joints):
        if name in clip.skeleton.joints:
            there = clip.positions[:, clip.skeleton.joints.index(name)]
        else:
            joint = clip.skeleton.joints.index(name.removeprefix("above "))
            parent = clip.skeleton.parents[joint]
            there = (clip.positions[:, joint] + clip.positions[:, parent]) / 2
        np.testing.assert_allclose(other.positions[:, place], there)
    assert distance_rows(other.positions[0], other.skeleton).std() > 0.05


@pytest.mark.parametrize("count", [0, 1, 25, 62])
def test_a_number_of_joints_nobody_knows_is_refused(count: int, recordings: Recorded) -> None:
    """Between 20 and 31 and above 61 there is no body."""
    with pytest.raises(ValueError, match="joints: expected"):
        with_joints(recordings.examples[0], count)


@pytest.mark.parametrize("count", [288, 300, 1000])
def test_a_larger_library_holds_the_real_motions_and_perturbed_copies(count: int) -> None:
    """All real axes are in it, copies are near them but not they, all of unit length, classes as before."""
    real = MotionLibrary.builtin()
    large = enlarged(real, count)
    assert len(large) == count
    assert large.classes == real.classes
    np.testing.assert_allclose(np.linalg.norm(large.axes, axis=1), 1.0, rtol=1e-5)
    nearest = np.abs(large.axes @ real.axes.T).max(axis=1)
    exact = np.isclose(nearest, 1.0, atol=1e-5)
    assert exact.sum() == 288
    assert nearest.min() > 0.8
    for axis in real.axes[::50]:
        assert np.abs(large.axes @ axis).max() == pytest.approx(1.0, abs=1e-5)
    originals = [motion.class_name for motion in large.motions]
    assert originals == sorted(originals)


def test_everything_is_grown_and_its_exponent_fitted(recordings: Recorded) -> None:
    """Each growth has a cost for each size, in order, and the exponent is the fit of just those."""
    sizes = Sizes(joints=(15, 20), seconds=(0.25, 0.5), motions=(288, 600), performers=(1, 2))
    found = growth.measure(recordings, sizes=sizes, rounds=1)
    names = ["joints", "window", "library", "library, 8 together", *(f"performers, {s}" for s in LiveSignature)]
    assert [each.of for each in found] == names
    by_name = {each.of: each for each in found}
    assert by_name["joints"].sizes == (105, 190)
    assert by_name["joints"].labels == ("15", "20")
    assert by_name["window"].sizes == (0.25, 0.5)
    assert by_name["library"].sizes == (288, 600)
    assert [each.recall for each in found] == [None, None, 1.0, 1.0, None, None]
    for each in found:
        assert len(each.us) == len(each.sizes) == len(each.labels) == 2
        assert min(each.us) > 0
        assert each.exponent == pytest.approx(exponent(each.sizes, each.us))


def test_what_a_search_misses_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """The recall is the share of the classes' best scores that the search finds, windows and classes alike."""
    library = enlarged(MotionLibrary.builtin(), 2500)
    asked = library.axes[::100].astype(np.float64)
    assert growth.recall(library, asked) == 1.0
    found = library.class_scores(asked)
    found[:5, :10] -= 1e-3
    monkeypatch.setattr(MotionLibrary, "class_scores", lambda *_: found)
    assert growth.recall(library, asked) == pytest.approx(1 - 50 / found.size)


def test_every_performer_of_a_tick_is_pushed(recordings: Recorded, monkeypatch: pytest.MonkeyPatch) -> None:
    """After all have come in, a tick is one frame of each performer, at places of their own."""
    pushed: list[str] = []
    many = growth.Performers.push
    monkeypatch.setattr(growth.Performers, "push", lambda *of: (pushed.append(of[1].performer), many(*of))[1])
    growth.by_performers(recordings, (5, 6), LiveSignature.WINDOWS, 1)
    last = pushed[-6 * 12 :]
    assert {name: last.count(name) for name in last} == {f"performer {index}": 12 for index in range(6)}
