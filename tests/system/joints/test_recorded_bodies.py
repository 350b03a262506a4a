"""Bodies of other laboratories, sensors and cameras: their joints, what is believed of them, whom they are like."""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
import pytest

from kinespace.library import Reading
from kinespace.library.motion_library import MotionLibrary
from kinespace.library.naming import Naming
from kinespace.library.naming.convention import convention_named
from kinespace.library.windows.index import WindowIndex
from kinespace.library.windows.segments import Segments
from kinespace.stream.frame import Frame
from kinespace.stream.recognizer import Recognizer, Settings
from kinespace.tools.cli.main import main
from kinespace.tools.evaluation.harness import Sources, Take, read_takes

pytestmark = pytest.mark.slow


# --- named joints -----------------------------------------------------------------------------------------------------


#: Some takes of several persons, for each convention of which there are recordings.
RECORDED = {
    "plugingait": "uiprmd/takes/s0*_m01*.npz",
    "kinect1": "kindergator/takes/*_0[1-4].npz",
    "mediapipe": "camera/*_squat_1.npz",
}
#: Metres, on a body of HDM05's size, by which a joint's distance from the joint above it may differ. Marker sets and
#: sensors differ by up to 12 cm: hip markers lie above the joint, a camera's thumb is near the wrist.
WITHIN = 0.15


@pytest.mark.parametrize("convention", RECORDED)
def test_joints_lie_where_hdm05s_do(convention: str, data_folder: Path, builtin: MotionLibrary) -> None:
    """Each named joint is about as far from the one above as HDM05's, once bodies have one size."""
    differences = _differences(data_folder, convention, Naming(convention_named(convention)), builtin)
    assert {joint: by for joint, by in differences.items() if by > WITHIN} == {}


def _differences(data: Path, convention: str, naming: Naming, builtin: MotionLibrary) -> Mapping[str, float]:
    """Say by how many metres each joint's distance from the one above differs from HDM05's, at HDM05's size."""
    takes = read_takes(Sources(unknown=sorted(data.glob(RECORDED[convention]))), Reading(naming=naming))
    joints = [name for name in builtin.skeleton.joints if name in takes[0].clip.skeleton.joints]
    own = builtin.restricted_to(joints)
    body, lengths = Segments.of(own), list[np.ndarray]()
    for take in takes:
        found = np.median(body.lengths(take.clip.restricted_to(joints).as_of(own.skeleton).positions), axis=0)
        lengths.append(found * body.mean.sum() / found.sum())
    by = np.abs(np.median(lengths, axis=0) - body.mean)
    return {own.skeleton.joints[child]: round(float(each), 3) for child, each in zip(body.children, by, strict=True)}


# --- honest feeds -----------------------------------------------------------------------------------------------------


#: A depth sensor and films, each by one person or some; `make figures` measures the share doubted of every set.
FEEDS = {
    "uiprmd_kinect": ("uiprmd_kinect/takes/s04_*.npz", "--actor-in", "name"),
    "camera": (
        "camera/p[26]*_[rs]*.npz",
        "--actor-in",
        "name",
        "--map",
        "squat=squat1Reps",
        "run=jogLeftCircle4StepsRstart",
    ),
}


@pytest.mark.parametrize("feed", FEEDS)
def test_an_honest_feed_is_believed(feed: str, data_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """At most .5 % of the time is doubted."""
    pattern, *options = FEEDS[feed]
    takes = [str(each) for each in _some(sorted(data_folder.glob(pattern)), 4)]
    assert main(["evaluate", "stream", *takes, *options, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["doubted"] <= 0.005


def _some(places: list[Path], count: int) -> list[Path]:
    """Give so many of the recordings at most, from the whole list."""
    return places[:: -(-len(places) // count)]


# --- unlike bodies ----------------------------------------------------------------------------------------------------


#: Some takes of each set, and whether the built-in library names motions by its joints: by Kinect 1 and by films it
#: guesses less than half of the time right (measuring.md), and says so.
SETS = {
    "cmu_takes": ("[02]?_0[347].amc", False),
    "uiprmd": ("takes/*.npz", False),
    "uiprmd_kinect": ("takes/*.npz", False),
    "kindergator": ("takes/[ac]*_*3.npz", True),
    "utkinect": ("joints_s*_e01.txt", True),
    "camera": ("p[1-4]*_1.npz", True),
}
#: Seconds after which the line stands, at most, and seconds between answers.
SOON, HOP = 10.0, 1 / 6


@pytest.mark.parametrize("name", SETS)
def test_it_is_said_within_ten_seconds_whether_the_library_fits(
    name: str, data_folder: Path, builtin_index: WindowIndex
) -> None:
    """All but one of the takes that are long enough are judged as their whole set is."""
    pattern, unlike = SETS[name]
    places = _some(sorted((data_folder / name).glob(pattern)), 7)
    takes = read_takes(Sources(places) if name == "utkinect" else Sources(unknown=places), Reading())
    found = [each for take in takes if (each := _decided(take, builtin_index)) is not None]
    assert len(found) >= 5
    assert found.count(unlike) >= len(found) - 1


def _decided(take: Take, index: WindowIndex) -> bool | None:
    """Play the first seconds of a take; None where it is too short to decide."""
    shared = tuple(name for name in index.library.skeleton.joints if name in take.clip.skeleton.joints)
    view = index if len(shared) == len(index.library.skeleton.joints) else index.by_joints(shared)
    recognizer, clip = Recognizer(view, Settings(hop=HOP)), take.clip.restricted_to(shared).as_of(view.library.skeleton)
    shown = range(clip.frames) if take.delivered is None else take.delivered.tolist()
    step = max(1, round(clip.frame_rate / 60))
    some = [frame for frame in shown if clip.times[frame] < SOON][::step]
    _pushed(recognizer, clip.times[some], clip.positions[some])
    return recognizer.unlike


def _pushed(recognizer: Recognizer, times: Iterable[float], positions: Iterable[np.ndarray]) -> None:
    for time, each in zip(times, positions, strict=True):
        recognizer.push(Frame("p", float(time), each))
