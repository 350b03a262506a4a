"""The kind of feed that taught a library, and that asks: told by the limbs alone."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from kinespace.library import Clip, MotionLibrary, Skeleton
from kinespace.library.signature.landmark_body import JOINTS, LandmarkBody
from kinespace.stream import Announcement, Frame, Performers
from kinespace.stream.recognizer.joints.fitting import NOTES, TITLES, kind_of, kinds_of
from kinespace.stream.recognizer.settings import usual_sensitivity
from kinespace.tools.cli.main import main

pytestmark = pytest.mark.slow


def _before_a_camera(clip: Clip) -> Clip:
    """Give a motion as a camera's body: the same directions, its own lengths."""
    some = [joint for joint in clip.skeleton.joints if joint in JOINTS]
    body, seen = LandmarkBody(some), clip.restricted_to(some).positions
    positions = np.array([body.of(landmarks) for landmarks in seen])
    return replace(clip, positions=positions, skeleton=Skeleton(JOINTS), rotations=np.zeros((len(positions), 0)))


@pytest.fixture(scope="module")
def films(small_library: MotionLibrary) -> MotionLibrary:
    """Give the library as cameras would have taught it."""
    return MotionLibrary.of_clips(map(_before_a_camera, small_library.motions))


def test_a_cameras_bodies_are_told_from_measured_ones(builtin: MotionLibrary, films: MotionLibrary) -> None:
    """By every motion of either; a library of both has both kinds; some joints may be absent, too few tell nothing."""
    assert kinds_of(builtin) == {"measured"}
    assert kinds_of(films) == {"guessed"}
    own = builtin.restricted_to(JOINTS).motions
    assert kinds_of(MotionLibrary.of_clips([*films.motions, *own[:3]])) == {"guessed", "measured"}
    assert {kind_of(each.skeleton.joints, each.positions) for each in own} == {"measured"}
    hidden = films.motions[0].positions.copy()
    hidden[:, [JOINTS.index(name) for name in ("ltoes", "rtoes", "lthumb")]] = np.nan
    assert kind_of(JOINTS, hidden) == "guessed"
    assert kind_of(JOINTS, np.full_like(hidden, np.nan)) == "measured"
    assert kind_of(JOINTS[:8], hidden[:, :8]) == "measured"


def test_kept_and_between_pictures_it_is_still_a_cameras(films: MotionLibrary) -> None:
    """Whole millimetres, and every second body on a line between its neighbours."""
    for motion in films.motions:
        evened = motion.positions.round(3)
        evened[1:-1:2] = (evened[:-2:2] + evened[2::2])[: len(evened[1:-1:2])] / 2
        assert kind_of(JOINTS, evened) == "guessed"


def _asks(library: MotionLibrary, positions: NDArray[np.float64], joints: tuple[str, ...]) -> str:
    performers = Performers(library)
    performers.announce(Announcement("p", joints), 0.0)
    there_and_back = np.concatenate([positions, positions[::-1]])
    for index in range(200):
        performers.push(Frame("p", 1 + index / 30, there_and_back[index % len(there_and_back)]), index / 30)
    return performers.compared.get("p", "")


def test_another_kind_of_feed_is_said_in_one_line(small_library: MotionLibrary, films: MotionLibrary) -> None:
    """Either way round; the kind that taught the library is not spoken of."""
    measured, seen = small_library.restricted_to(JOINTS), films.motions[0].positions
    body = measured.motions[0].positions
    assert NOTES["guessed"] in _asks(measured, seen, JOINTS)
    assert NOTES["measured"] in _asks(films, body, measured.skeleton.joints)
    for text in (_asks(films, seen, JOINTS), _asks(measured, body, measured.skeleton.joints)):
        assert not any(note in text for note in NOTES.values())


def test_a_library_of_several_before_cameras_names_less(films: MotionLibrary) -> None:
    """One person's does not, and neither does one of both kinds."""
    assert len(films.actors) > 1
    assert usual_sensitivity(films) == 0.025
    assert usual_sensitivity(films.restricted_to(JOINTS[:8])) == 0.2
    one = films.without(actors=films.actors[1:])
    assert usual_sensitivity(one) > 0.1


def test_info_says_what_taught_a_library(
    films: MotionLibrary, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Also after it was kept in a file."""
    path = tmp_path / "films.npz"
    films.save(path)
    assert main(["info", str(path)]) == 0
    assert f"taught by: {TITLES['guessed']}\n" in capsys.readouterr().out
    assert main(["info", str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["feeds"] == ["guessed"]
