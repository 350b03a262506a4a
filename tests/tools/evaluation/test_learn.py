import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from programs import SMALL_CLASSES, ran, small_library
from written import trc_text

from kinespace.library import MotionLibrary
from kinespace.library.windows.rejection import Evidence
from kinespace.tools.evaluation.learn import Lesson, fitted

pytestmark = pytest.mark.slow

_CLASSES = ("squat1Reps", "kickLFront1Reps")
#: The typical distance and lead of one group of parts.
_TYPICAL = np.array([2.0, 3.0])


def _windows(leads: Sequence[float], guess: str = "a") -> list[tuple[Evidence, str]]:
    """Make windows of one guess with these leads above the typical one."""
    return [(Evidence((2.0,), (3.0 + float(lead),)), guess) for lead in leads]


def test_the_fit_tells_two_kinds_of_windows_apart() -> None:
    """Windows with a clear lead are known, windows with none are not; a class often guessed wrongly gets a malus."""
    generator = np.random.default_rng(1)
    known, unknown = _windows(1.0 + generator.normal(0, 0.1, 50)), _windows(generator.normal(0, 0.1, 50), "b")
    lessons = [Lesson(known, is_known=True, weight=1.0), Lesson(unknown, is_known=False, weight=1.0)]
    rejection = fitted(lessons, ("a", "b"), _TYPICAL)
    assert all(rejection.logit(*window) > 0 for window in known)
    assert all(rejection.logit(*window) < 0 for window in unknown)
    assert rejection.biases["a"] > rejection.biases["b"]


@pytest.fixture(scope="module")
def small_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two motions of two classes by each of three persons."""
    path = tmp_path_factory.mktemp("learn") / "small.npz"
    small_library().without(classes=[name for name in SMALL_CLASSES if name not in _CLASSES]).save(path)
    return path


@pytest.fixture(scope="module")
def takes_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Motions of two persons as takes: squats are known, sneaking is not."""
    folder = tmp_path_factory.mktemp("takes")
    library = MotionLibrary.builtin()
    table = "file,subject,contains,perhaps\n"
    for name, contains in (("squat1Reps", "squat1Reps"), ("sneak2StepsLStart", "")):
        for actor in ("mm", "tr"):
            clip = next(each for each in library.motions if (each.class_name, each.actor) == (name, actor))
            text = trc_text(clip.skeleton.joints, clip.positions, rate=clip.frame_rate, unit="m")
            (folder / f"{name}_{actor}.trc").write_text(text, encoding="utf-8")
            table += f"{name}_{actor}.trc,{actor},{contains},\n"
    (folder / "takes.csv").write_text(table, encoding="utf-8")
    return folder / "takes.csv"


def test_a_library_of_one_person_is_taught_by_its_other_motions(
    small_file: Path, takes_file: Path, tmp_path: Path
) -> None:
    """Its own motions are named, strangers' sneaking is named as seldom as a rate says; single examples are refused."""
    several = MotionLibrary.load(small_file)
    own = several.without(actors=several.actors[1:])
    arguments = ["learn", tmp_path / "own.npz", "--takes", takes_file, "--json", "-o"]
    own.save(tmp_path / "own.npz")
    printed = json.loads(ran(*arguments, tmp_path / "learned.npz")[1])
    assert all(each["unknown_named"] <= each["rate"] + 1e-9 for each in printed)
    learned = MotionLibrary.load(tmp_path / "learned.npz")
    assert learned.actors == several.actors[:1]
    assert learned.learned
    assert printed[-1]["takes_found"] == 1
    single = own.without(motions=[each for each in own.motions if each.class_name == _CLASSES[0]][1:])
    single.save(tmp_path / "own.npz")
    status, _, said = ran(*arguments, tmp_path / "single.npz")
    assert (status, f"got one of {_CLASSES[0]}" in said) == (2, True)
