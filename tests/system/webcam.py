"""A film in a webcam's place: how late answers are, and how long it takes from a clone to a gesture of one's own.

    python tests/system/webcam.py latency    # from a picture's capture to its answer; all programs on one core
    python tests/system/webcam.py clone      # clone, install, fetch the models, teach a gesture, and see it named

The film is Sports2D's demonstration (BSD-3), fetched by pip as the tests do: a man stands on a box, raises his arms and
jumps down. `clone` needs git, and pip's and npm's registries.
"""

import json
import os
import re
import subprocess
import sys
import tempfile
import threading
import time
import venv
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import zmq
from numpy.typing import NDArray

from kinespace.tools.camera import film, models
from kinespace.tools.programs import camera as session
from kinespace.tools.terminal.console import say

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))
from films import demo_film, fetched_demo, write

Picture = NDArray[np.uint8]

#: Pictures a second of the webcam; seconds that are measured, and that do not count before.
_RATE, _SECONDS, _WARM_UP = 25.0, 30.0, 5.0
#: Pictures of the film (15 a second) in which the man is whole and moves: arms up, the jump.
_MOVES = slice(16, 70)
#: Seconds for which he stands still before and after, and how often he does it.
_STILL, _TIMES = 3.0, 8
#: Seconds after which a step has failed.
_PATIENCE = 300.0


def _pictures() -> list[Picture]:
    capture = cv2.VideoCapture(str(fetched_demo(demo_film(models.cache()))))
    pictures: list[Picture] = []
    while (read := capture.read())[0]:
        pictures.append(np.asarray(read[1], dtype=np.uint8))
    return pictures[_MOVES]


class _Webcam:
    """A camera in OpenCV's place, which says by our clock when it took each picture."""

    is_open, rate, pictures = True, _RATE, -1
    shown: list[Picture]

    def __init__(self, _: object) -> None:
        self._count, self._begun = 0, time.monotonic()

    def read(self) -> tuple[Picture, float]:
        """Wait for the next picture; the film goes forth and back."""
        self._count += 1
        time.sleep(max(self._begun + self._count / _RATE - time.monotonic(), 0.0))
        return self.shown[self._count % len(self.shown)].copy(), time.monotonic()

    def close(self) -> None:
        """Be closed."""


@contextmanager
def _live(program: Path, *options: object) -> Iterator[subprocess.Popen[str]]:
    command = [str(program), "live", "--plain", *map(str, options)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        try:
            yield process
        finally:
            process.terminate()


def _until(process: subprocess.Popen[str], pattern: str) -> None:
    """Read a program's lines until one fits."""
    assert process.stdout
    begun = time.monotonic()
    for line in process.stdout:
        if re.search(pattern, line):
            return
        if time.monotonic() > begun + _PATIENCE:
            break
    raise TimeoutError(f"no line {pattern!r} within {_PATIENCE:g} s")


def latency() -> None:
    """Print the time from the picture's capture to its answer's arrival, with all programs on one core."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    there_and_back = _pictures()
    _Webcam.shown = there_and_back + there_and_back[::-1]
    film.Capture, film._require = _Webcam, lambda _: None  # type: ignore[assignment,misc]  # noqa: SLF001 - no device
    ends = {"--osc-in": "127.0.0.1:9720", "--zmq-out": "tcp://127.0.0.1:9721"}
    with _live(
        Path(sys.executable).with_name("kinespace"), *(part for each in ends.items() for part in each)
    ) as process:
        _until(process, "listening on")
        threading.Thread(target=process.communicate, daemon=True).start()
        late, ended = list[float](), threading.Event()
        listening = threading.Thread(target=_listen, args=(ends["--zmq-out"], late, ended))
        listening.start()
        until = time.monotonic() + _SECONDS + _WARM_UP
        watched = session.watch(session.CameraPlan("0", osc=ends["--osc-in"]), say, lambda: time.monotonic() > until)
        ended.set()
        listening.join()
    counted = np.array(late[round(_RATE * _WARM_UP) :]) * 1e3
    say(str(watched))
    say(
        f"captured to answered, {len(counted)} answers: p50 {np.percentile(counted, 50):.1f} ms, "
        f"p90 {np.percentile(counted, 90):.1f} ms; load {os.getloadavg()[0]:.1f}"
    )


def _listen(endpoint: str, late: list[float], ended: threading.Event) -> None:
    with zmq.Context() as context, context.socket(zmq.SUB) as socket:
        socket.connect(endpoint)
        socket.subscribe(b"class/")
        while not ended.is_set():
            if socket.poll(100):
                answer = json.loads(socket.recv_multipart()[1])
                late.append(time.monotonic() - answer["t"])


def clone() -> None:
    """Print the seconds from a clean clone to a gesture that was taught before a webcam and is named."""
    pictures, rate = _pictures(), 15.0
    begun = time.monotonic()

    def step(said: str) -> None:
        say(f"{time.monotonic() - begun:6.1f} s  {said}")

    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        still = round(_STILL * rate)
        shown = [*[pictures[0]] * still, *pictures, *[pictures[-1]] * still]
        webcam = write(place / "webcam.avi", (picture for _ in range(_TIMES) for picture in shown), rate)
        begun = time.monotonic()
        environment = os.environ | {"XDG_CACHE_HOME": str(place / "cache")}

        def run(*command: object) -> None:
            subprocess.run([*map(str, command)], cwd=place, env=environment, check=True, stdout=subprocess.DEVNULL)

        run("git", "clone", "--quiet", Path(__file__).parents[2], "kinespace")
        step("cloned")
        venv.create(place / "venv", with_pip=True)
        program = place / "venv" / "bin"
        run(program / "pip", "install", "--quiet", "./kinespace[camera,page]")
        step("installed")
        run(program / "kinespace", "camera", "--get-models")
        step("models fetched")
        os.environ |= environment
        control = "tcp://127.0.0.1:9722"
        options = ("--camera", webcam, "--page", "127.0.0.1:0", "--teach", place / "mine.npz", "--control", control)
        with _live(program / "kinespace", *options, "--osc-in", "127.0.0.1:9720") as process:
            _until(process, "camera  ")
            step("the webcam's body is seen")
            _ask(control, {"do": "teach", "performer": "camera", "class": "jump", "countdown": 1})
            _until(process, r"taught jump: .*examples: 1")
            step("taught")
            _until(process, "start: jump")
            step("named")


def _ask(endpoint: str, command: dict[str, Any]) -> None:
    with zmq.Context() as context, context.socket(zmq.REQ) as socket:
        socket.connect(endpoint)
        socket.send_json(command)
        say(str(socket.recv_json()["states"]))


if __name__ == "__main__":
    {"latency": latency, "clone": clone}[sys.argv[1]]()
