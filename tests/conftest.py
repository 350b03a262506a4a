"""Fixtures for every test: recordings and other programs, found in one place; hypothesis made repeatable."""

import os
import shutil
import signal
from collections.abc import Iterator
from contextlib import closing, nullcontext
from pathlib import Path
from typing import NoReturn

import programs
import pytest
from films import demo_film as place_of_demo_film
from hypothesis import settings
from programs import DATA, LOOPBACK, builtin_library
from refused import refuse
from synthetic import stick_clips

from kinespace.library import Clip, MotionLibrary, WindowIndex, compiled, find_recordings, opened, read_recordings
from kinespace.stream.osc import OscReceiver
from kinespace.tools.camera import models
from kinespace.tools.camera.bodies import require_extra
from kinespace.tools.cli.console import console
from kinespace.tools.feeding.feed import resampled

# The same examples in every run, therefore few, and no deadline: a slow machine is not a failure.
settings.register_profile("kinespace", derandomize=True, deadline=None, max_examples=50)
settings.load_profile("kinespace")

#: A file system in memory. Some tests write a file a thousand times, and a disk would write out each.
_MEMORY = Path("/dev/shm")  # noqa: S108 - pytest makes a folder of its own there
if os.access(_MEMORY, os.W_OK) and shutil.disk_usage(_MEMORY).free > 2e9:
    os.environ.setdefault("PYTEST_DEBUG_TEMPROOT", str(_MEMORY))

# A shell starts a program in the background with SIGINT ignored, and nohup starts one with SIGHUP ignored. The programs
# that tests start and end would inherit that.
for _number, _usual in ((signal.SIGINT, signal.default_int_handler), (getattr(signal, "SIGHUP", 0), signal.SIG_DFL)):
    if _number and signal.getsignal(_number) is signal.SIG_IGN:
        signal.signal(_number, _usual)

# No test asks a network; the programs that tests start read `sitecustomize.py` as they start.
refuse()
_REFUSING = str(Path(__file__).parent / "support" / "network")
if _REFUSING not in os.environ.get("PYTHONPATH", "").split(os.pathsep):
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, (_REFUSING, os.environ.get("PYTHONPATH"))))

#: Set to 1 where no test may be skipped for want of recordings or of others' programs.
COMPLETE = "KINESPACE_COMPLETE"
#: Why tests of the compiled functions skip.
_NOT_COMPILED = "no compiled functions here: gcc or clang and Python's headers make them"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the visits to the page: they take a minute, and the other processes would wait for them at the end."""
    items.sort(key=lambda item: "test_page.py" not in item.nodeid)


def _without(reason: str, what: str) -> NoReturn:
    """Skip the asking test; fail it where all tests are to run, because there it would pass unseen."""
    if os.environ.get(COMPLETE) == "1":
        pytest.fail(f"{reason}, and {COMPLETE}=1 says that the tests run with {what}", pytrace=False)
    pytest.skip(reason)


def _folder(path: Path) -> Path:
    if not path.is_dir():
        _without(f"no folder {path}; KINESPACE_DATA may name the one that holds the recordings", "the recordings")
    return path


@pytest.fixture(scope="module", params=["compiled", "numpy"])
def arithmetic(request: pytest.FixtureRequest) -> Iterator[str]:
    """Do the arithmetic in the compiled functions, and then again in numpy."""
    if not compiled.in_use and request.param == "compiled":
        _without(_NOT_COMPILED, "the compiled functions")
    with compiled.left_aside() if request.param == "numpy" else nullcontext():
        yield request.param


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """Give the folder of the recordings."""
    return _folder(DATA)


@pytest.fixture(scope="session")
def hdm05_folder(data_folder: Path) -> Path:
    """Give the folder of HDM05's recordings."""
    return _folder(data_folder / "hdm05_cut_amc")


@pytest.fixture(scope="session")
def some_paths(hdm05_folder: Path) -> tuple[Path, ...]:
    """Give the first AMC file of each class."""
    return tuple(find_recordings([folder])[0] for folder in sorted(hdm05_folder.iterdir()) if folder.is_dir())


@pytest.fixture(scope="session")
def amc_clips(some_paths: tuple[Path, ...]) -> tuple[Clip, ...]:
    """Give the first clip of each class as its AMC file says it."""
    return tuple(read_recordings(some_paths))


@pytest.fixture(scope="session")
def camera_extra() -> None:
    """Be sure of OpenCV and LiteRT."""
    try:
        require_extra()
    except ImportError as error:
        _without(str(error), "the extra `camera`")


@pytest.fixture(scope="session")
def camera_models(camera_extra: None) -> Path:
    """Give the folder of BlazePose's models, which `make` fetches once for this user."""
    del camera_extra
    try:
        models.models_at(None, "full")
    except OSError as error:
        _without(str(error), "the models")
    return models.cache()


@pytest.fixture(scope="session")
def demo_film(camera_models: Path) -> Path:
    """Give every second picture of Sports2D's demonstration film (BSD-3), 640 pixels wide: 115 pictures in 7.7 s.

    One person stands on a box and jumps down, another walks past.
    """
    film = place_of_demo_film(camera_models)
    if not film.exists():
        _without(f"no {film}: make fetched", "Sports2D's film")
    return film


@pytest.fixture(scope="session")
def builtin() -> MotionLibrary:
    """Give the built-in library: one object, so that it is opened once."""
    return builtin_library()


@pytest.fixture(scope="session")
def builtin_index(builtin: MotionLibrary) -> WindowIndex:
    """Give the windows of the built-in library."""
    return opened(builtin)


@pytest.fixture(scope="session")
def some_clips(builtin: MotionLibrary) -> tuple[Clip, ...]:
    """Give the first motion of each class of the built-in library, at 120 frames a second."""
    first = {motion.class_name: motion for motion in reversed(builtin.motions)}
    return tuple(resampled(first[class_name], 120.0) for class_name in builtin.classes)


@pytest.fixture(scope="session")
def sticks() -> MotionLibrary:
    """Give a library of a body of six joints: three classes by two people."""
    return MotionLibrary.of_clips(stick_clips())


@pytest.fixture(scope="session")
def people() -> MotionLibrary:
    """Give a library of the same body that three people teach: one object, so that it is opened once."""
    return MotionLibrary.of_clips(stick_clips(actors=("aa", "bb", "cc")))


@pytest.fixture(scope="session")
def people_index(people: MotionLibrary) -> WindowIndex:
    """Give the windows of this library."""
    return WindowIndex.of(people)


@pytest.fixture(scope="session")
def small_library() -> MotionLibrary:
    """Give a library that opens fast: one object, so that it is opened once."""
    return programs.small_library()


@pytest.fixture(scope="session")
def small_index(small_library: MotionLibrary) -> WindowIndex:
    """Give the windows of the small library."""
    return opened(small_library)


@pytest.fixture(autouse=True)
def _environment_as_before() -> Iterator[None]:
    """Give the next test the environment that this one found: programs that tests start inherit it."""
    before = dict(os.environ)
    yield
    for name in os.environ.keys() - before.keys():
        del os.environ[name]
    os.environ.update(before)


@pytest.fixture
def receiver() -> Iterator[OscReceiver]:
    """Open a UDP port of the system's choice."""
    with closing(OscReceiver(LOOPBACK, 0)) as receiver:
        yield receiver


@pytest.fixture
def wide(monkeypatch: pytest.MonkeyPatch) -> None:
    """Give the tables that programs print 200 columns."""
    monkeypatch.setattr(console, "width", 200)
