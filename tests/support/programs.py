"""The programs as a person starts them: child processes that tests read while they run, and end."""

import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager, redirect_stderr, redirect_stdout
from functools import cache, partial
from io import StringIO
from itertools import product
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from kinespace.library import Clip, MotionLibrary
from kinespace.stream import Frame, osc
from kinespace.stream.recognition import Answer
from kinespace.stream.zeromq.keys import make_keys
from kinespace.tools.cli.main import main
from kinespace.tools.feeding.feed import Cue, OscFrameSender, without_pause
from kinespace.tools.feeding.service import Listener, answer_in

#: A line on what is odd about a body or a file that could be read (`library.recordings.remarks`, `Clip.notes`).
REMARK = re.compile(
    r"^[^:]*: (names not known|joints|flat|size|frame rate|"
    r"frames|times|units|left out|not seen|twice|parts|no positions|positions|parameters): "
)
#: The motions of the small library.
SMALL_CLASSES = ("kickLFront1Reps", "lieDownFloor", "squat1Reps")
SMALL_ACTORS = ("bd", "dg", "mm")
ROOT = Path(__file__).resolve().parents[2]
#: Where the recordings are, if they are anywhere.
DATA = Path(os.environ.get("KINESPACE_DATA") or ROOT.parent / "shared" / "data")
LOOPBACK = "127.0.0.1"
#: Seconds that a child may take for one step before the test fails; a busy machine is slow.
PATIENCE = 240.0
#: Warnings are errors in the children too; a child reports a leaked socket on its standard error.
_COMMAND = (sys.executable, "-W", "error", "-m", "kinespace")
_POLL = 0.01
_Reached = TypeVar("_Reached")


class Program:
    """A running `kinespace`: its output so far, and ways to end it."""

    def __init__(self, process: subprocess.Popen[bytes], folder: Path) -> None:
        self.process = process
        self._folder = folder

    @property
    def output(self) -> str:
        """Everything printed so far."""
        # The output may end in the middle of a character.
        return (self._folder / "output").read_text(encoding="utf-8", errors="replace")

    @property
    def errors(self) -> str:
        """Everything printed on standard error so far."""
        return (self._folder / "errors").read_text(encoding="utf-8")

    def expect(self, pattern: str) -> re.Match[str]:
        """Wait until the output matches."""
        until = time.monotonic() + PATIENCE
        while time.monotonic() < until:
            ended = self.process.poll() is not None
            if found := re.search(pattern, self.output):
                return found
            assert not ended, f"ended with {self.process.returncode} before {pattern!r}: {self.output}{self.errors}"
            time.sleep(_POLL)
        raise AssertionError(f"no {pattern!r} in time: {self.output}{self.errors}")

    def wait(self) -> int:
        """Wait until the program ends by itself; give its exit status."""
        return self.process.wait(PATIENCE)

    def interrupt(self) -> int:
        """Press Ctrl-C; give the exit status."""
        self.process.send_signal(signal.SIGINT)
        return self.wait()


@contextmanager
def started(*arguments: object, at: Path = ROOT, begins: Sequence[object] = _COMMAND) -> Iterator[Program]:
    """Start `kinespace` with some arguments; a program that still runs at the end is killed."""
    with tempfile.TemporaryDirectory() as folder:
        output, errors = Path(folder) / "output", Path(folder) / "errors"
        with output.open("wb") as out, errors.open("wb") as err:
            around = {**os.environ, "PYTHONUTF8": "1", "COLUMNS": "200"}
            command = [*map(str, begins), *map(str, arguments)]
            process = subprocess.Popen(command, cwd=at, env=around, stdin=subprocess.DEVNULL, stdout=out, stderr=err)
        try:
            yield Program(process, Path(folder))
        finally:
            process.kill()
            process.wait()


def ran(*arguments: object) -> tuple[int, str, str]:
    """Run `kinespace` in this process: exit status, standard output, standard error."""
    with redirect_stdout(StringIO()) as out, redirect_stderr(StringIO()) as err:
        try:
            status = main([*map(str, arguments)])
        except SystemExit as ended:
            status = ended.code  # type: ignore[assignment]  # argparse gives a number
    return status, out.getvalue(), err.getvalue()


def python(*arguments: object, **more: Any) -> subprocess.CompletedProcess[str]:  # noqa: ANN401 - as subprocess has it
    """Run Python to its end."""
    command = [sys.executable, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=PATIENCE, **more)


def until(reached: Callable[[], _Reached]) -> _Reached:
    """Ask until something is reached; give it."""
    end = time.monotonic() + PATIENCE
    while not (found := reached()):
        assert time.monotonic() < end
        time.sleep(_POLL)
    return found


def free_udp_port() -> int:
    """Give a UDP port that nobody listens on, chosen by the system."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((LOOPBACK, 0))
        port: int = probe.getsockname()[1]
        return port


def key_folders(place: Path, *names: str) -> list[Path]:
    """Make a folder of keys for each name; the first knows all, the others know the first."""
    made = [place / name for name in names]
    publics = [make_keys(folder, folder.name)[0] for folder in made]
    for folder, public in zip(made[1:], publics[1:], strict=True):
        shutil.copy(public, made[0])
        shutil.copy(publics[0], folder)
    return made


_OF_INPUT = ("received", "malformed", "foreign", "overrun", "missing", "out of order", "other joints", "no room")


def summary_counts(output: str) -> dict[str, int]:
    """Read the counts out of the last lines of `kinespace live`."""
    said = re.findall(r"\breceived \d+.*", output)
    told = re.search(r"(\d+) answers of (\d+) frames[^,]*, (\d+) windows started again, (\d+) answers not sent", output)
    # A count of zero is not said.
    found = {name: re.search(rf"\b{name} (\d+)", said[-1]) for name in _OF_INPUT}
    of_input = {name: int(each[1]) if each else 0 for name, each in found.items()}
    return of_input | dict(zip(("answers", "frames", "restarts", "unsent"), map(int, told.groups()), strict=True))


def motion_cues(class_name: str, seconds: float, *, performer: str = "dancer", begin: float = 1.0) -> list[Cue]:
    """Cue the first seconds of the built-in library's shortest motion that lasts long enough, at 120 Hz."""
    positions = _motion_positions(class_name, seconds)
    frames = [Frame(performer, begin + index / 120, joints) for index, joints in enumerate(positions)]
    return [Cue(index / 120, frame, class_name) for index, frame in enumerate(frames)]


ghost_cues = partial(motion_cues, performer="ghost")


@cache
def builtin_library() -> MotionLibrary:
    """Give the built-in library: always the same object, so that it is opened once."""
    return MotionLibrary.builtin()


def motions_of(class_name: str, actor: str = "bd") -> list[Clip]:
    """Choose motions of the built-in library."""
    return [each for each in builtin_library().motions if (each.class_name, each.actor) == (class_name, actor)]


def two_of_each(classes: Sequence[str], actors: Sequence[str]) -> tuple[Clip, ...]:
    """Choose two motions of each class by each actor."""
    return tuple(each for both in product(classes, actors) for each in motions_of(*both)[:2])


@cache
def small_library() -> MotionLibrary:
    """Give a library that opens fast: two motions of each of three classes by each of three people, its teachers."""
    return MotionLibrary.of_clips(two_of_each(SMALL_CLASSES, SMALL_ACTORS))


@cache
def _motion_positions(class_name: str, seconds: float) -> NDArray[np.float32]:
    motions = (motion for motion in builtin_library().motions if motion.class_name == class_name)
    # The last frame at 60 a second has no frame at 120 after it.
    enough = [motion for motion in motions if motion.duration > seconds]
    positions = without_pause([min(enough, key=lambda motion: motion.duration)], 120.0)[: round(seconds * 120.0)]
    positions.setflags(write=False)
    return positions


def wait_until_read(port: int) -> None:
    """Wait until nothing waits on a UDP port, as Linux tells; elsewhere for some milliseconds."""
    waiting = Path("/proc/net/udp")
    time.sleep(0.005)

    def read() -> bool:
        # The local address, and the bytes that wait to be sent and to be read, all in hexadecimal.
        rows = [line.split() for line in waiting.read_text(encoding="ascii").splitlines()[1:]]
        return all(int(row[4].partition(":")[2], 16) == 0 for row in rows if row[1].endswith(f":{port:04X}"))

    until(lambda: not waiting.exists() or read())


class Stage:
    """A running `kinespace live`, a sender of frames to it and a receiver of its OSC answers."""

    def __init__(self, program: Program, port: int, sender: OscFrameSender, listener: Listener) -> None:
        self.program = program
        #: The UDP port on which frames come in.
        self.port = port
        self.sender = sender
        self._listener = listener

    def play(self, cues: Sequence[Cue]) -> None:
        """Send frames in pieces; the next piece waits until the one before is read, so that no socket overflows."""
        for index, cue in enumerate(cues):
            self.sender.send(self.sender.encode(cue.frame))
            if index % 40 == 39:
                wait_until_read(self.port)

    def answers(self, count: int) -> list[Answer]:
        """Wait for some answers."""
        answers: list[Answer] = []

        def enough() -> bool:
            heard = self._listener.listen_until(time.perf_counter() + 0.02)
            answers.extend(answer for each in heard if (answer := answer_in(each.packet)))
            return len(answers) >= count

        until(enough)
        return answers

    def stopped(self) -> dict[str, int]:
        """Press Ctrl-C; give the counts that the program ends with."""
        assert (self.program.interrupt(), self.program.errors) == (0, "")
        return summary_counts(self.program.output)


@contextmanager
def live(*options: object) -> Iterator[Stage]:
    """Run `kinespace live` on ports chosen by the system: frames in and answers out by OSC."""
    with closing(osc.OscReceiver(LOOPBACK, 0)) as receiver:
        ends = ("--osc-in", f"{LOOPBACK}:0", "--osc-out", f"{LOOPBACK}:{receiver.address[1]}")
        with started("live", *ends, *options) as program:
            port = int(program.expect(r"listening on OSC 127\.0\.0\.1:(\d+)")[1])
            with closing(OscFrameSender(LOOPBACK, port)) as sender:
                yield Stage(program, port, sender, Listener(receiver))
