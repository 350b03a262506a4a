"""Films for tests, written by OpenCV (the extra `camera`)."""

import os
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterable
from itertools import count
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


def write(path: Path, pictures: Iterable[NDArray[np.uint8]], rate: float) -> Path:
    """Write pictures of one size, whole or not at all."""
    import cv2  # noqa: PLC0415 - an extra

    writer, own = None, path.with_name(f"{os.getpid()}-{path.name}")
    for picture in pictures:
        writer = writer or cv2.VideoWriter(str(own), cv2.VideoWriter_fourcc(*"MJPG"), rate, picture.shape[1::-1])
        writer.write(picture)
    writer.release()
    return own.replace(path)


def grey(path: Path, lightness: Iterable[int], rate: float, size: tuple[int, int] = (640, 360)) -> Path:
    """Write a film of nothing but grey."""
    return write(path, (np.full((*size[::-1], 3), each, dtype=np.uint8) for each in lightness), rate)


def smaller(film: Path, path: Path) -> Path:
    """Write every second picture of a film of 30 a second, 640 pixels wide."""
    import cv2  # noqa: PLC0415 - as above

    capture = cv2.VideoCapture(str(film))

    def pictures() -> Iterable[NDArray[np.uint8]]:
        for number in count():
            there, picture = capture.read()
            if not there:
                return
            if number % 2 == 0:
                yield np.asarray(cv2.resize(picture, (640, 360), interpolation=cv2.INTER_AREA), dtype=np.uint8)

    return write(path, pictures(), 15.0)


def demo_film(models: Path) -> Path:
    """Give the place of a demonstration film beside the camera's models; it need not exist."""
    return models.with_name("demo-640.avi")


def fetched_demo(film: Path) -> Path:
    """Fetch Sports2D's demonstration film (BSD-3) by pip, unless it is there, and write it smaller.

    Raises
    ------
    subprocess.CalledProcessError
        Pip could not fetch it.
    """
    if not film.exists():
        with tempfile.TemporaryDirectory() as folder:
            command = [sys.executable, "-m", "pip", "download", "-q", "--no-deps", "-d", folder, "sports2d"]
            subprocess.run(command, check=True, capture_output=True)
            with zipfile.ZipFile(next(Path(folder).glob("*.whl"))) as wheel:
                smaller(Path(wheel.extract("Sports2D/Demo/demo.mp4", folder)), film)
    return film
