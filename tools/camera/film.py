"""A camera's, a film's or a stream's pictures and their times, read in a thread so that nothing ever hangs."""

import atexit
import math
import os
import queue
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinespace.tools.camera.vision import Capture

#: Seconds in which a source must be open, and after which a camera or a stream without a picture is given up.
_MAX_OPENING, _MAX_SILENCE = 15.0, 5.0
#: Seconds that the end waits for a picture that is being read.
_MAX_CLOSING = 0.5
#: Seconds between two questions whether to end.
_LOOK_EVERY = 0.1
#: Seconds by which a camera's time may differ from the system's clock and still be the time of capture.
_SAME_CLOCK = 1.0
#: Pictures a second where a film does not say it.
_USUAL_RATE = 30.0
#: Time 0 would mean "on arrival".
FIRST = 1.0


class Picture(NamedTuple):
    """A picture (height, width, 3) and when it was taken, seconds: on the system's clock, or from a film's begin."""

    pixels: NDArray[np.uint8]
    time: float


class Film:
    """The pictures of a source, from its opening on.

    Parameters
    ----------
    source
        A camera's number, a file or an address with `://`.
    wants_end
        Is asked some times a second.
    paced
        Whether a file's pictures come at their own pace; those that come too late are left out, as from a camera.

    Attributes
    ----------
    is_live
        Whether it is a camera or a stream: then the newest picture counts, and pictures that nobody took are lost.
    taken, lost
        Pictures given out, and left out because they came too fast.

    Raises
    ------
    OSError
        There is no such camera, file or stream, or it cannot be opened.
    """

    def __init__(self, source: str, wants_end: Callable[[], bool], *, paced: bool) -> None:
        self._source, self._wants_end = source, wants_end
        self.is_live = source.isdecimal() or "://" in source
        self._drops = self.is_live or paced
        self._paced = paced and not self.is_live
        self.taken = self.lost = 0
        self._pictures: queue.Queue[Picture | None] = queue.Queue(maxsize=1)
        self._ended = threading.Event()
        self._capture: Capture | None = None
        opened = threading.Event()
        self._reader = threading.Thread(target=self._read, args=(opened,), name="kinespace pictures", daemon=True)
        self._reader.start()
        try:
            self._wait_for(opened)
        except OSError:
            self.close()
            raise

    def _wait_for(self, opened: threading.Event) -> None:
        until = time.monotonic() + _MAX_OPENING
        while not opened.wait(_LOOK_EVERY) and not self._wants_end():
            if time.monotonic() > until:
                raise TimeoutError(f"{_named(self._source)}: not open within {_MAX_OPENING:g} s")
        if self._capture is None and not self._wants_end():
            raise _why_closed(self._source)

    def __iter__(self) -> Iterator[Picture]:
        """Give the pictures, until the end is reached or wanted.

        Raises
        ------
        OSError
            A camera or a stream has stopped to give pictures.
        """
        heard = time.monotonic()
        while not self._wants_end():
            try:
                picture = self._pictures.get(timeout=_LOOK_EVERY)
            except queue.Empty:
                if self.is_live and time.monotonic() - heard > _MAX_SILENCE:
                    raise TimeoutError(f"{_named(self._source)}: no picture for {_MAX_SILENCE:g} s") from None
                continue
            if picture is None:
                if self.is_live:
                    raise OSError(f"{_named(self._source)}: has stopped; unplugged, or ended by its sender?")
                return
            self.taken += 1
            heard = time.monotonic()
            yield picture

    def close(self) -> None:
        """Stop reading, and give the camera back."""
        self._ended.set()
        self._reader.join(_MAX_CLOSING)
        if self._reader.is_alive():
            # Python cannot end beside a thread that hangs in a driver: C++ would abort it.
            atexit.register(os._exit, 2)

    def _read(self, opened: threading.Event) -> None:
        capture = Capture(int(self._source) if self._source.isdecimal() else self._source)
        try:
            first = capture.read() if capture.is_open else None
            self._capture = capture if first else None
            opened.set()
            begun, last, read = time.monotonic(), -math.inf, first
            rate = capture.rate if 1 <= capture.rate <= 1000 else _USUAL_RATE
            while read and not self._ended.is_set():
                last = self._moment(read[1], last, rate)
                if self._paced:
                    self._ended.wait(max(begun + last - FIRST - time.monotonic(), 0.0))
                self._put(Picture(read[0], last))
                # Reading may be slower than the film: what is late already need not be read.
                late = int((time.monotonic() - begun - (last - FIRST)) * rate) - 1 if self._paced else 0
                skipped = sum(capture.skip() for _ in range(late))
                self.lost, last = self.lost + skipped, last + skipped / rate
                read = capture.read()
            self._put(None)
        finally:
            opened.set()
            capture.close()

    def _moment(self, told: float, last: float, rate: float) -> float:
        """Give a picture's time: of capture, where a camera says it by our clock; a film's; else by its rate."""
        now = time.monotonic()
        if self.is_live:
            moment = told if abs(now - told) < _SAME_CLOCK else now
            return max(moment, math.nextafter(last, math.inf))
        if math.isinf(last):
            return FIRST
        return told + FIRST if told + FIRST > last else last + 1 / rate

    def _put(self, picture: Picture | None) -> None:
        """Hand a picture over: in place of one that nobody took, or when that one was taken; the end always waits."""
        if self._drops and picture is not None:
            with suppress(queue.Empty):
                self._pictures.get_nowait()
                self.lost += 1
        while not self._ended.is_set():
            with suppress(queue.Full):
                self._pictures.put(picture, timeout=_LOOK_EVERY)
                return


def _named(source: str) -> str:
    return f"camera {source}" if source.isdecimal() else source


def _why_closed(source: str) -> OSError:
    """Say why a source cannot be opened."""
    path = Path(source)
    if source.isdecimal():
        return _why_no_camera(source, Path(f"/dev/video{source}"))
    if "://" in source:
        return OSError(f"{source}: cannot be opened")
    if path.is_dir() or not path.exists():
        got = "a folder" if path.is_dir() else "no such file or folder"
        return FileNotFoundError(f"{source}: expected a film, got {got}")
    if not os.access(path, os.R_OK):
        return PermissionError(f"{source}: this user may not read it")
    return OSError(f"{source}: not a film that can be read")


def _why_no_camera(source: str, device: Path) -> OSError:
    if sys.platform == "linux" and not device.exists():
        there = ", ".join(sorted(each.name.removeprefix("video") for each in Path("/dev").glob("video[0-9]*")))
        return FileNotFoundError(f"camera {source}: not there; cameras: {there or 'none'}")
    if sys.platform == "linux" and not os.access(device, os.R_OK | os.W_OK):
        return PermissionError(f"camera {source}: this user may not use it; add the user to the group of {device}")
    why = "another program may have taken it, or this one may not use it"
    return OSError(f"camera {source}: gives no picture; {why}")
