import hashlib
import math
import subprocess
import sys
import threading
import time
import zipfile
from collections.abc import Callable, Sequence
from contextlib import closing, suppress
from pathlib import Path
from types import SimpleNamespace

import naive_camera
import numpy as np
import pytest
from films import grey
from programs import LOOPBACK, free_udp_port, live, ran, until

from kinespace.library import MotionLibrary
from kinespace.library.signature.landmark_body import JOINTS
from kinespace.stream import Announcement, osc
from kinespace.stream.inputs import OwnDecoder
from kinespace.tools.camera import bodies, models
from kinespace.tools.camera.bodies import Bodies, Landmarks, Region, landmarks_in
from kinespace.tools.cli.main import main

pytest.importorskip("ai_edge_litert", reason="LiteRT is not here: Python 3.14 has no wheel of it")
from kinespace.tools.camera.networks import anchors, decoded, one_for_each_body  # loads LiteRT

_PICTURE = np.zeros((360, 640, 3), dtype=np.uint8)


class _Stage:
    """Bodies at places that the test moves; counts the looks at whole pictures and at regions."""

    def __init__(self, **people: tuple[float, float, float]) -> None:
        self.people = {name: Region(*place, 0.0) for name, place in people.items()}
        self.wholes = self.regions = 0

    def put(self, **people: tuple[float, float, float] | None) -> None:
        for name, place in people.items():
            if place is None:
                del self.people[name]
            else:
                self.people[name] = Region(*place, 0.0)

    def bodies(self, picture: np.ndarray) -> list[Region]:
        assert picture is _PICTURE
        self.wholes += 1
        return [*self.people.values()]

    def landmarks(self, picture: np.ndarray, where: Region) -> Landmarks | None:
        assert picture is _PICTURE
        self.regions += 1
        near = [each for each in self.people.values() if abs(each.x - where.x) + abs(each.y - where.y) < where.size / 2]
        if not near:
            return None
        place = np.full((33, 3), near[0].x)
        return Landmarks(place, place, np.ones(33), near[0])


def _seen(bodies: Bodies, time: float) -> dict[str, float]:
    return {name: float(each.picture[0, 0]) for name, each in bodies.seen(_PICTURE, time).items()}


def test_the_detector_looks_while_the_body_is_lost_alone() -> None:
    """A body that was found is followed by its landmarks; once it is lost every picture is looked at as a whole."""
    stage = _Stage(ann=(100, 180, 200))
    bodies = Bodies(stage, 1, "camera")
    for count in range(10):
        stage.put(ann=(100 + 30 * count, 180, 200))
        assert _seen(bodies, count / 30) == {"camera": 100 + 30 * count}
    assert (stage.wholes, stage.regions) == (1, 10)
    stage.put(ann=None)
    assert [_seen(bodies, 1 + count / 30) for count in range(3)] == [{}] * 3
    assert stage.wholes == 4


def test_one_body_is_the_largest() -> None:
    """Nobody else takes its place while it is there, and it keeps its place after it was lost for a moment."""
    stage = _Stage(ann=(100, 180, 150), bob=(500, 180, 250))
    bodies = Bodies(stage, 1, "camera")
    assert _seen(bodies, 0.0) == {"camera": 500}
    stage.put(ann=(100, 180, 400))
    assert _seen(bodies, 0.1) == {"camera": 500}
    stage.put(bob=None)
    assert _seen(bodies, 0.2) == {"camera": 100}


def test_a_body_lost_for_a_moment_comes_before_a_larger_one() -> None:
    """The detector finds both; the one near the place of the lost one is taken."""
    stage = _Stage(bob=(500, 180, 200))
    bodies = Bodies(stage, 1, "camera")
    _seen(bodies, 0.0)
    stage.put(bob=None)
    assert _seen(bodies, 0.1) == {}
    stage.put(ann=(100, 180, 280), bob=(520, 180, 200))
    assert _seen(bodies, 0.2) == {"camera": 520}
    # After a while nobody waits for it.
    stage.put(ann=None, bob=None)
    _seen(bodies, 0.3)
    stage.put(ann=(100, 180, 280), bob=(520, 180, 200))
    assert _seen(bodies, 9.0) == {"camera": 100}


def test_names_stay_with_their_bodies() -> None:
    """A further body is looked for twice a second; one that comes back where it left has its name again."""
    stage = _Stage(ann=(100, 180, 120))
    bodies = Bodies(stage, 3, "stage")
    assert _seen(bodies, 0.0) == {"stage": 100}
    stage.put(bob=(400, 180, 150))
    assert _seen(bodies, 0.1) == {"stage": 100}
    assert _seen(bodies, 0.6) == {"stage": 100, "stage-2": 400}
    stage.put(ann=None)
    assert _seen(bodies, 0.7) == {"stage-2": 400}
    stage.put(cyd=(600, 180, 100))
    assert _seen(bodies, 1.2) == {"stage-2": 400, "stage-3": 600}
    stage.put(ann=(130, 180, 120))
    assert _seen(bodies, 1.8) == {"stage": 130, "stage-2": 400, "stage-3": 600}


def test_a_body_found_twice_is_one() -> None:
    """Two names whose bodies run into each other are one body; the detector's second region of it is none."""
    stage = _Stage(ann=(100, 180, 120), bob=(400, 180, 120))
    bodies = Bodies(stage, 2, "camera")
    assert len(_seen(bodies, 0.0)) == 2
    stage.put(bob=None)
    stage.put(ann=(390, 180, 120))
    assert _seen(bodies, 0.1) == {"camera-2": 390}
    stage.put(twin=(395, 180, 120))
    assert len(_seen(bodies, 1.0)) == 1


@pytest.mark.parametrize("seed", range(20))
def test_landmarks_are_brought_back_as_by_the_textbook(seed: int) -> None:
    """Places in the picture, metres, likelihoods and the next region agree with the loop."""
    generator = np.random.default_rng(seed)
    marks = generator.normal(0, 3, (39, 5)).astype(np.float32)
    marks[:, :2] = generator.uniform(-20, 280, (39, 2))
    world = generator.normal(0, 0.5, (39, 3)).astype(np.float32)
    heat = generator.normal(-4, 3, (64, 64, 39)).astype(np.float32)
    where = Region(*generator.uniform(100, 500, 3), float(generator.uniform(-3, 3)))
    ours = landmarks_in(marks, world, heat, where)
    flat = [naive_camera.refined(marks[place, :2], heat[:, :, place]) for place in range(39)]
    placed = [naive_camera.projected(each, where, 256) for each in flat]
    np.testing.assert_allclose(ours.picture[:, :2], placed[:33], rtol=1e-6)
    np.testing.assert_allclose(ours.picture[:, 2], marks[:33, 2] * where.size / 256, rtol=1e-6)
    np.testing.assert_allclose(ours.world, [naive_camera.turned(each, where.angle) for each in world[:33]], atol=1e-6)
    np.testing.assert_allclose(ours.present, 1 / (1 + np.exp(-marks[:33, 4].astype(float))), rtol=1e-6)
    region = naive_camera.region(placed[33], placed[34])
    np.testing.assert_allclose(ours.next_region[:3], region[:3], rtol=1e-6)
    assert math.remainder(ours.next_region.angle - region[3], math.tau) == pytest.approx(0, abs=1e-6)


def _outputs(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Give outputs of a detector that sees three bodies, each by several anchors, and nothing at all elsewhere."""
    generator = np.random.default_rng(seed)
    boxes = generator.normal(0, 8, (2254, 12)).astype(np.float32)
    boxes[:, 2:4] = generator.uniform(30, 90, (2254, 2))
    scores = generator.normal(-6, 1, 2254).astype(np.float32)
    scores[generator.choice(2254, 40, replace=False)] = generator.normal(1, 2, 40)
    scores[:2] = 500.0, -500.0
    return boxes, scores


@pytest.mark.parametrize("seed", range(8))
def test_bodies_are_decoded_and_averaged_as_by_the_textbook(seed: int) -> None:
    """Scores, boxes and points agree with the loop, and the points also after the averaging."""
    boxes, scores = _outputs(seed)
    found, expected = decoded(boxes, scores, anchors()), naive_camera.decoded(boxes, scores)
    averaged = naive_camera.weighted(expected)
    assert 1 < len(averaged) < len(expected)
    np.testing.assert_allclose(found.scores, [each[0] for each in expected])
    np.testing.assert_allclose(found.boxes, [each[1] for each in expected], atol=1e-6)
    np.testing.assert_allclose(found.points, [each[2] for each in expected], atol=1e-6)
    np.testing.assert_allclose(one_for_each_body(found), [each[2] for each in averaged], atol=1e-6)


_DETECTOR, _FULL = "pose_detection.tflite", "pose_landmark_full.tflite"


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Give this user another cache, and small files in place of the models."""
    for variable in ("XDG_CACHE_HOME", "LOCALAPPDATA", "HOME"):
        monkeypatch.setenv(variable, str(tmp_path / "home"))
    known = {hashlib.sha256(content).hexdigest(): name for name, content in _files().items()}
    monkeypatch.setattr(models, "_KNOWN", known)
    return models.cache()


def _files() -> dict[str, bytes]:
    return {_DETECTOR: b"detector", _FULL: b"landmarks"}


def test_models_are_fetched_checked_kept_and_read(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without npm pip fetches the wheel; the line names the folder, the files, the source and the licence."""
    monkeypatch.setattr("shutil.which", lambda _: None)
    commands: list[Sequence[str]] = []

    def run(command: Sequence[str], *, cwd: Path, **_: object) -> None:
        commands.append(command)
        with zipfile.ZipFile(cwd / "mediapipe.whl", "w") as wheel:
            for number, content in enumerate([b"other", *_files().values()]):
                wheel.writestr(f"mediapipe/{number}.tflite", content)

    monkeypatch.setattr(subprocess, "run", run)
    said: list[str] = []
    assert models.fetched(said.append) == place
    assert commands[0][:4] == [sys.executable, "-m", "pip", "download"]
    assert commands[0][-1] == "mediapipe==0.10.21"
    assert said == [f"{place}: {_DETECTOR}, {_FULL}; from mediapipe==0.10.21 (pip), {models.LICENCE}"]
    assert models.models_at(None, "full") == models.Models(b"detector", b"landmarks")
    (place / _FULL).write_bytes(b"changed")
    with pytest.raises(ValueError, match=r"pose_landmark_full.tflite: damaged; `kinespace camera --get-models`"):
        models.models_at(None, "full")
    with pytest.raises(NotADirectoryError, match="expected a folder of models"):
        models.models_at(place / _FULL, "full")


def test_clients_that_fail_are_named(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One line says why each failed, and what else can be done."""
    monkeypatch.setattr("shutil.which", lambda _: "npm")

    def run(command: Sequence[str], **_: object) -> None:
        raise subprocess.CalledProcessError(1, command, stderr=f"much\n{Path(command[0]).name[:3]} is offline\n")

    monkeypatch.setattr(subprocess, "run", run)
    status, _, said = ran("camera", "--get-models")
    assert said.startswith("kinespace: models: not fetched (npm: npm is offline; pip: pyt is offline); --models takes")
    assert (status, said.count("\n")) == (2, 1)
    assert not place.exists()


with suppress(ImportError):
    from kinespace.tools.camera import film


_COUNT, _RATE = 20, 20.0


def _never() -> bool:
    return False


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Write a film whose pictures become lighter."""
    return grey(tmp_path / "light.avi", range(0, 10 * _COUNT, 10), _RATE, (64, 48))


@pytest.mark.usefixtures("camera_extra")
def test_every_picture_of_a_film_in_order_with_its_time(path: Path) -> None:
    """As fast as they are read, none is lost; the first one's time is not 0, which would mean "on arrival"."""
    read = film.Film(str(path), _never, paced=False)
    pictures = list(read)
    assert [round(float(each.pixels.mean()) / 10) for each in pictures] == list(range(_COUNT))
    assert [each.time for each in pictures] == pytest.approx([1 + count / _RATE for count in range(_COUNT)])
    assert (read.taken, read.lost, pictures[0].pixels.shape) == (_COUNT, 0, (48, 64, 3))


@pytest.mark.usefixtures("camera_extra")
@pytest.mark.slow
def test_pictures_that_nobody_took_in_time_are_counted(path: Path) -> None:
    """At its own pace a film does not wait for a slow reader."""
    read, taken = film.Film(str(path), _never, paced=True), []
    for picture in read:
        taken.append(picture.time)
        time.sleep(3 / _RATE)
    assert read.lost > 0
    assert read.taken + read.lost == _COUNT
    assert taken == sorted(taken)


class _Camera:
    """A camera in place of OpenCV's: `read` is the test's."""

    is_open, rate, pictures = True, 30.0, -1
    read: Callable[[], tuple[np.ndarray, float] | None]

    def __init__(self, _: object) -> None:
        pass

    def close(self) -> None:
        pass


def _with_camera(monkeypatch: pytest.MonkeyPatch, read: Callable[[], object], **changed: object) -> None:
    monkeypatch.setattr(film, "Capture", type("Camera", (_Camera,), {"read": lambda _: read(), **changed}))


@pytest.mark.usefixtures("camera_extra")
def test_a_cameras_time_is_that_of_capture_where_it_says_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """A time on the system's clock counts; without one the picture's arrival does."""
    pixels, late, now, moments = np.zeros((2, 2, 3), dtype=np.uint8), [0.0], [1000.0], set[float]()

    def read() -> tuple[np.ndarray, float]:
        time.sleep(0.001)
        now[0] += 1 / 30
        moments.add(now[0] - late[0])
        return pixels, late[0] and now[0] - late[0]

    _with_camera(monkeypatch, read)
    monkeypatch.setattr(film, "time", SimpleNamespace(monotonic=lambda: now[0]))
    for late[0] in (0.0, 0.5):
        moments.clear()
        with closing(film.Film("0", _never, paced=True)) as pictures:
            taken = [picture.time for picture, _ in zip(pictures, range(5), strict=False)]
        assert set(taken) <= moments
        assert taken == sorted(set(taken))


@pytest.mark.usefixtures("camera_extra")
@pytest.mark.parametrize("hangs", ["opening", "reading"])
def test_nothing_hangs(monkeypatch: pytest.MonkeyPatch, hangs: str) -> None:
    """A camera that hangs, as it is opened or later, is given up; and the end is not waited for."""
    released, hanging, now = threading.Event(), threading.Event(), [1000.0]
    first = [(np.zeros((2, 2, 3), dtype=np.uint8), 0.0)]

    def read() -> object:
        if hangs == "reading" and first:
            return first.pop()
        hanging.set()
        return released.wait() and None

    def monotonic() -> float:
        """Let the time stand still until the camera hangs."""
        now[0] += hanging.is_set()
        return now[0]

    _with_camera(monkeypatch, read)
    registered: list[tuple[object, int]] = []
    monkeypatch.setattr(film.atexit, "register", lambda *call: registered.append(call))
    monkeypatch.setattr(film, "time", SimpleNamespace(monotonic=monotonic))
    monkeypatch.setattr(film, "_MAX_OPENING", 1.5)
    monkeypatch.setattr(film, "_MAX_SILENCE", 1.5)
    monkeypatch.setattr(film, "_MAX_CLOSING", 0.05)
    words = {"opening": "^camera 0: not open within 1.5 s", "reading": "^camera 0: no picture for 1.5 s"}[hangs]
    with pytest.raises(TimeoutError, match=words), closing(film.Film("0", _never, paced=True)) as pictures:
        list(pictures)
    first.append((np.zeros((2, 2, 3), dtype=np.uint8), 0.0))
    hanging.clear()
    with closing(film.Film("0", hanging.is_set, paced=True)) as pictures:
        assert len(list(pictures)) <= 1
    # The reader's thread hangs: the program must end without it.
    assert len(registered) == 2
    assert {status for _, status in registered} == {2}
    released.set()


@pytest.mark.usefixtures("camera_extra")
def test_sources_that_cannot_be_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One line each says what is wrong."""
    text = tmp_path / "film.mp4"
    text.write_text("no film")
    for source, said in (
        (tmp_path, "expected a film, got a folder"),
        (tmp_path / "none.mp4", "expected a film, got no such file"),
        (text, "not a film that can be read"),
        ("rtsp://127.0.0.1:9/none", "cannot be opened"),
    ):
        with pytest.raises(OSError, match=f"{source}: {said}"):
            film.Film(str(source), _never, paced=True)
    monkeypatch.setattr("os.access", lambda *_: False)
    with pytest.raises(PermissionError, match="this user may not read it"):
        film.Film(str(text), _never, paced=True)


@pytest.mark.usefixtures("camera_extra")
@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not list their cameras")
def test_cameras_that_cannot_be_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """There is none; this user may not use it; another program has it."""
    with pytest.raises(FileNotFoundError, match=r"camera 98: not there; cameras: "):
        film.Film("98", _never, paced=True)
    device = tmp_path / "video"
    device.touch()
    monkeypatch.setattr(film, "Path", lambda _: device)
    monkeypatch.setattr("os.access", lambda *_: False)
    with pytest.raises(PermissionError, match="camera 0: this user may not use it"):
        film.Film("0", _never, paced=True)
    monkeypatch.undo()
    monkeypatch.setattr(film, "Path", lambda _: device)
    _with_camera(monkeypatch, lambda: None, is_open=False)
    with pytest.raises(OSError, match="camera 0: gives no picture; another program may have taken it"):
        film.Film("0", _never, paced=True)


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


def test_without_the_extra_one_line_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing else is tried."""
    monkeypatch.setitem(sys.modules, "kinespace.tools.camera.vision", None)
    status, _, said = ran("camera", "none.mp4")
    assert (status, said.count("\n")) == (2, 1)
    assert said.startswith("kinespace: a camera needs OpenCV and LiteRT")
    assert "pip install 'kinespace[camera]'" in said


@pytest.mark.slow
def test_bodies_of_a_film_are_sent(demo_film: Path) -> None:
    """The demo film: found nearly always, frames with the film's times, joints announced."""
    with closing(osc.OscReceiver(LOOPBACK, 0)) as receiver:
        status, said, errors = ran("camera", demo_film, "--fast", "--osc", f"{LOOPBACK}:{receiver.address[1]}")
        decoder, frames = OwnDecoder(), []
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
def test_a_film_of_nobody_is_one_line(camera_models: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """And status 2; so are models that are none."""
    film, models = grey(tmp_path / "grey.avi", [128] * 5, 30.0), tmp_path / "models"
    models.mkdir()
    for name in ("pose_detection.tflite", "pose_landmark_full.tflite"):
        (models / name).write_bytes((camera_models / "pose_detection.tflite").read_bytes())
    for arguments, words in (
        ((film, "--fast"), "grey.avi: no body in any of 5 pictures"),
        ((film, "--models", models), "models: expected BlazePose's detector and landmark network"),
        ((film, "--models", tmp_path), "no models: `kinespace camera --get-models` fetches them"),
        ((film, "--people", "5"), "--people: expected 1 to 4, got 5"),
    ):
        capfd.readouterr()
        status = main(["camera", *map(str, arguments)])
        errors = capfd.readouterr().err
        assert (status, errors.count("\n"), words in errors) == (2, 1, True), errors


@pytest.mark.slow
def test_one_command_watches_recognises_and_ends(demo_film: Path) -> None:
    """`live --camera` starts the camera, which ends with it, even if it is killed."""
    with live("--camera", demo_film, "--osc-in", free_udp_port(), "--plain") as stage:
        program = stage.program
        program.expect(r"camera: .*demo-640.avi to 127.0.0.1:\d+")
        program.expect("performer camera|camera  ")
        children = _children(program.process.pid)
        assert children
        program.process.kill()
        program.wait()
        until(lambda: not any(Path(f"/proc/{each}").exists() for each in children))


def _children(parent: int) -> list[int]:
    """Give the processes that a program started, without Python's own helper."""
    command = ["ps", "-o", "pid=,args=", "--ppid", str(parent)]
    listed = subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()
    return [int(each.split()[0]) for each in listed if "resource_tracker" not in each]


@pytest.mark.slow
def test_films_with_labels_become_a_library(demo_film: Path, tmp_path: Path) -> None:
    """The labels count from the film's beginning; with --either-side each motion is there mirrored, too."""
    film = tmp_path / "films" / "ann_1.avi"
    film.parent.mkdir()
    film.write_bytes(demo_film.read_bytes())
    film.with_suffix(".csv").write_text("start_s,end_s,label\n0.5,2.5,stand\n3,5,jump\n", encoding="utf-8")
    output = tmp_path / "mine.npz"
    assert ran("build", film.parent, "-o", output, "--actor-in", "name", "--either-side")[0] == 0
    library = MotionLibrary.load(output)
    assert (library.classes, library.actors, len(library)) == (("jump", "stand"), ("ann",), 4)
    assert library.skeleton.joints == JOINTS
    assert {round(motion.duration) for motion in library.motions} == {2}
    jumps = [motion for motion in library.motions if motion.class_name == "jump"]
    first, other = sorted(jumps, key=lambda motion: "mirrored" in motion.take)
    left, right = (JOINTS.index(name) for name in ("lradius", "rradius"))
    np.testing.assert_allclose(first.positions[:, left] * [-1, 1, 1], other.positions[:, right], atol=2e-3)
