import os
import signal
import subprocess
import time
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from films import grey
from programs import LOOPBACK, finished, free_udp_port, live

from kinespace.library import MotionLibrary
from kinespace.library.signature.landmark_body import JOINTS
from kinespace.stream import osc
from kinespace.stream.frame import Announcement
from kinespace.stream.inputs import OscDecoder
from kinespace.tools.camera import bodies
from kinespace.tools.camera.bodies import Landmarks, Region
from kinespace.tools.cli.main import main

#: Seconds in which Ctrl-C must have ended a program, on a machine that has other work too.
_ENDING = 60.0


def test_joints_outside_of_the_picture_are_absent() -> None:
    """Others are where the network says, y up; presence below a half counts as outside."""
    places = np.tile([[320.0, 180.0, 0.0]], (33, 1))
    places[25], places[27] = (320.0, 360.0, 0.0), (-1.0, 180.0, 0.0)
    present = np.ones(33)
    present[31] = 0.4
    marks = Landmarks(places, np.full((33, 3), (1.0, 2.0, 3.0)), present, Region(0, 0, 1, 0))
    found = bodies.upright(marks, np.zeros((360, 640, 3), dtype=np.uint8))
    assert np.flatnonzero(np.isnan(found).any(axis=1)).tolist() == [25, 27, 31]
    np.testing.assert_array_equal(found[0], [1, -2, -3])


def test_without_the_extra_one_line_says_how_to_get_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nothing else is tried."""
    monkeypatch.setitem(__import__("sys").modules, "kinespace.tools.camera.vision", None)
    assert main(["camera", "none.mp4"]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert said.startswith("kinespace: a camera needs OpenCV and LiteRT")
    assert "pip install 'kinespace[camera]'" in said


@pytest.mark.slow
def test_bodies_of_a_film_are_sent(demo_film: Path) -> None:
    """The demo film: found nearly always, frames with the film's times, joints announced."""
    with closing(osc.OscReceiver(LOOPBACK, 0)) as receiver:
        place = f"{LOOPBACK}:{receiver.address[1]}"
        status, said, errors = finished("camera", demo_film, "--fast", "--osc", place)
        decoder, frames = OscDecoder(), []
        while packet := receiver.receive():
            frames += decoder.decode(packet, 0.0, ("", 0))
    assert (status, errors) == (0, "")
    assert "115 pictures" in said
    announced = [each for each in frames if isinstance(each, Announcement)]
    assert {(each.performer, each.joints) for each in announced} == {("camera", JOINTS)}
    sent = [each for each in frames if not isinstance(each, Announcement)]
    assert len(sent) >= 0.9 * 115
    times = np.array([each.time for each in sent])
    np.testing.assert_allclose(np.diff(times) * 15, np.round(np.diff(times) * 15), atol=1e-3)


@pytest.mark.slow
def test_a_film_without_a_body_is_one_line(
    camera_models: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """And status 2; a film that is broken, and models that are none, too."""
    film, broken = grey(tmp_path / "grey.avi", [128] * 5, 30.0), tmp_path / "broken.mp4"
    broken.write_bytes(b"\0" * 4000)
    models = tmp_path / "models"
    models.mkdir()
    for name in ("pose_detection.tflite", "pose_landmark_full.tflite"):
        (models / name).write_bytes((camera_models / "pose_detection.tflite").read_bytes())
    for arguments, words in (
        ((film, "--fast"), "grey.avi: no body in any of 5 pictures"),
        ((broken,), "broken.mp4: not a film that can be read"),
        ((film, "--models", models), "models: expected BlazePose's detector and landmark network"),
        ((film, "--models", tmp_path), "no models: `kinespace camera --get-models` fetches them"),
        ((film, "--people", "5"), "--people: expected 1 to 4, got 5"),
        (("98",), "camera 98: "),
    ):
        capfd.readouterr()
        status = main(["camera", *map(str, arguments)])
        errors = capfd.readouterr().err
        assert (status, errors.count("\n"), words in errors) == (2, 1, True), errors


@pytest.mark.slow
def test_one_command_watches_recognises_and_ends(demo_film: Path) -> None:
    """`live --camera` starts the camera, which ends with it: by Ctrl-C, and also if it is killed."""
    for end in (signal.SIGINT, signal.SIGKILL):
        with live("--camera", demo_film, "--osc-in", free_udp_port(), "--plain") as stage:
            program = stage.program
            program.expect(r"camera: .*demo-640.avi to 127.0.0.1:\d+")
            program.expect("performer camera|camera  ")
            children = _children(program.process.pid)
            assert children
            begun = time.monotonic()
            program.process.send_signal(end)
            program.wait()
            while any(map(_is_there, children)):
                time.sleep(0.02)
                assert time.monotonic() - begun < _ENDING


def _children(parent: int) -> list[int]:
    """Give the processes that a program started, without Python's own helper."""
    command = ["ps", "-o", "pid=,args=", "--ppid", str(parent)]
    listed = subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()
    return [int(each.split()[0]) for each in listed if "resource_tracker" not in each]


def _is_there(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.slow
def test_films_with_labels_become_a_library(demo_film: Path, tmp_path: Path) -> None:
    """The labels count from the film's beginning; with --either-side each motion is there mirrored, too."""
    film = tmp_path / "films" / "ann_1.avi"
    film.parent.mkdir()
    film.write_bytes(demo_film.read_bytes())
    film.with_suffix(".csv").write_text("start_s,end_s,label\n0.5,2.5,stand\n3,5,jump\n", encoding="utf-8")
    output = tmp_path / "mine.npz"
    assert main(["build", str(film.parent), "-o", str(output), "--actor-in", "name", "--either-side"]) == 0
    library = MotionLibrary.load(output)
    assert (library.classes, library.actors, len(library)) == (("jump", "stand"), ("ann",), 4)
    assert library.skeleton.joints == JOINTS
    assert {round(motion.duration) for motion in library.motions} == {2}
    jumps = [motion for motion in library.motions if motion.class_name == "jump"]
    first, other = sorted(jumps, key=lambda motion: "mirrored" in motion.take)
    left, right = (JOINTS.index(name) for name in ("lradius", "rradius"))
    np.testing.assert_allclose(first.positions[:, left] * [-1, 1, 1], other.positions[:, right], atol=2e-3)
