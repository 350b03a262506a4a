"""The thin file in front of OpenCV and LiteRT: pictures opened and cut out, and networks run.

Nothing here decides anything; no other file needs either library (the extra `camera`).
"""

import os
from contextlib import contextmanager

# Both libraries write their own notes to the terminal, past ours, unless told otherwise before they are loaded.
os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
os.environ.setdefault("OPENCV_FFMPEG_CAPTURE_OPTIONS", "rtsp_transport;tcp")

from collections.abc import Iterator, Sequence

import cv2
import numpy as np
from ai_edge_litert.interpreter import Interpreter
from numpy.typing import NDArray

cv2.setNumThreads(1)


class Network:
    """A network: a square picture in, arrays out, found by their sizes because their order differs between files.

    Parameters
    ----------
    model
        The bytes of its file.
    side
        Pixels of its picture, on each side.
    sizes
        How many numbers each output has that is wanted, in the order in which they are given.

    Raises
    ------
    ValueError
        It is another network, or none.
    """

    def __init__(self, model: bytes, side: int, sizes: Sequence[int]) -> None:
        with _silent():
            self._network = Interpreter(model_content=model, num_threads=1)
            self._network.allocate_tensors()
        (taken,) = self._network.get_input_details()
        given = {int(np.prod(each["shape"])): each["index"] for each in self._network.get_output_details()}
        if taken["shape"].tolist() != [1, side, side, 3] or not given.keys() >= {*sizes}:
            raise ValueError("models: expected BlazePose's detector and landmark network, got another network")
        self._taken, self._given = taken["index"], [given[size] for size in sizes]

    def run(self, square: NDArray[np.float32]) -> list[NDArray[np.float32]]:
        """Give the flat outputs for a picture (side, side, 3)."""
        self._network.set_tensor(self._taken, square[None])
        self._network.invoke()
        return [self._network.get_tensor(index).ravel() for index in self._given]


@contextmanager
def _silent() -> Iterator[None]:
    """Let nothing be written to standard error by C: LiteRT says there how it calculates."""
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


def cut_out(picture: NDArray[np.uint8], matrix: NDArray[np.float64], side: int, *, black: bool) -> NDArray[np.float32]:
    """Cut a square (side, side, 3), red, green and blue, out of a picture, by the map from its pixels to the picture's.

    Beyond the picture's edge it is black, or goes on as at the edge.
    """
    flags, border = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, cv2.BORDER_CONSTANT if black else cv2.BORDER_REPLICATE
    square = cv2.warpAffine(picture, matrix, (side, side), flags=flags, borderMode=border)
    return np.asarray(cv2.cvtColor(square, cv2.COLOR_BGR2RGB), dtype=np.float32)


class Capture:
    """A camera (by its number), a film or a stream (by its address); `is_open` says whether there is one."""

    def __init__(self, source: str | int) -> None:
        self._capture = cv2.VideoCapture(source)
        if isinstance(source, int):
            # The newest picture only, and in a form that 30 a second get through a USB cable.
            self._capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        self.is_open = bool(self._capture.isOpened())
        self.rate = float(self._capture.get(cv2.CAP_PROP_FPS))

    def read(self) -> tuple[NDArray[np.uint8], float] | None:
        """Wait for the next picture (height, width, 3) and its time, seconds as the source says; None at the end."""
        there, picture = self._capture.read()
        if not there:
            return None
        return np.asarray(picture, dtype=np.uint8), float(self._capture.get(cv2.CAP_PROP_POS_MSEC)) / 1000

    def skip(self) -> bool:
        """Pass over the next picture, which is quicker than to read it; False at the end."""
        return bool(self._capture.grab())

    def close(self) -> None:
        """Give the camera back."""
        self._capture.release()
