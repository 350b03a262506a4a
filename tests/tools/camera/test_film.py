import sys
import threading
import time
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from films import grey

with suppress(ImportError):
    from kinespace.tools.camera import film

pytestmark = pytest.mark.usefixtures("camera_extra")


_COUNT, _RATE = 20, 20.0


def _never() -> bool:
    return False


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Write a film whose pictures become lighter."""
    return grey(tmp_path / "light.avi", range(0, 10 * _COUNT, 10), _RATE, (64, 48))


def test_every_picture_of_a_film_in_order_with_its_time(path: Path) -> None:
    """As fast as they are read, none is lost; the first one's time is not 0, which would mean "on arrival"."""
    read = film.Film(str(path), _never, paced=False)
    pictures = list(read)
    assert [round(float(each.pixels.mean()) / 10) for each in pictures] == list(range(_COUNT))
    assert [each.time for each in pictures] == pytest.approx([1 + count / _RATE for count in range(_COUNT)])
    assert (read.taken, read.lost, pictures[0].pixels.shape) == (_COUNT, 0, (48, 64, 3))


@pytest.mark.slow
def test_at_its_own_pace_a_slow_reader_loses_pictures(path: Path) -> None:
    """The film lasts as long as it should; what nobody took in time is counted."""
    begun, read = time.monotonic(), film.Film(str(path), _never, paced=True)
    taken = []
    for picture in read:
        taken.append(picture.time)
        time.sleep(3 / _RATE)
    assert time.monotonic() - begun > (_COUNT - 1) / _RATE
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
    monkeypatch.setattr(film, "_require", lambda _: None)


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
    _with_camera(monkeypatch, lambda: None, is_open=False)
    with pytest.raises(OSError, match="camera 0: gives no picture; another program may have taken it"):
        film.Film("0", _never, paced=True)
