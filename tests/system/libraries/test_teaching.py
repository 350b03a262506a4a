"""Teaching a running recogniser as a person does: liblo's oscsend sends commands, a performer moves, oscdump hears."""

from __future__ import annotations

import json
import time
from contextlib import closing, contextmanager
from itertools import groupby
from typing import TYPE_CHECKING, Self

import pytest
import zmq
from programs import LOOPBACK, PATIENCE, builtin_library, free_udp_port, started

from kinespace.library import MotionLibrary
from kinespace.stream.frame import Frame
from kinespace.stream.osc import OscSender
from kinespace.stream.osc.frames import encode_frame
from kinespace.stream.osc.packet import encode_message

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    import numpy as np
    from liblotools import Dump, Dumped, LibloTools
    from numpy.typing import NDArray
    from programs import Program

pytestmark = pytest.mark.slow

GESTURES = {"squat": "squat1Reps", "arms": "rotateArmsBothBackward1Reps", "kick": "kickLFront1Reps"}
STILL = 75


class Dancer:
    """Sends frames faster than they would come, each with its own time, so that no clock decides."""

    def __init__(self, port: int, performer: str = "ann") -> None:
        self._sender, self._performer, self._time = OscSender(LOOPBACK, port), performer, 10.0
        self._stand: NDArray[np.float64] | None = None

    def show(self, positions: NDArray[np.float64]) -> None:
        """Show a motion, standing still before and after."""
        for place, frame in enumerate((*[positions[0]] * STILL, *positions, *[positions[-1]] * STILL)):
            self._send(frame)
            if place % 10 == 0:
                time.sleep(0.005)
        self._stand = positions[-1]

    def stand(self, frames: int = 30) -> None:
        """Stand as before, or at the beginning of a squat."""
        if self._stand is None:
            self._stand = _takes("squat1Reps")[0][0]
        for _ in range(frames):
            self._send(self._stand)

    def _send(self, frame: NDArray[np.float64]) -> None:
        self._time += 1 / 60
        self._sender.send(encode_frame(Frame(self._performer, self._time, frame)))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._sender.close()


def _takes(class_name: str, actor: str = "bd") -> list[NDArray[np.float64]]:
    return [
        motion.positions
        for motion in builtin_library().motions
        if motion.class_name == class_name and motion.actor == actor
    ]


def _states(heard: list[Dumped]) -> list[tuple[object, ...]]:
    return [message.values for message in heard if message.address == "/motion/teach/state"]


def _starts(heard: list[Dumped]) -> list[str]:
    return [
        str(message.values[1])
        for message in heard
        if message.address == "/motion/ann/event" and message.values[0] == "start"
    ]


def _classes(heard: list[Dumped]) -> list[tuple[object, ...]]:
    return [message.values for message in heard if message.address == "/motion/classes"]


@contextmanager
def taught_live(file: Path, liblo_tools: LibloTools, *options: str) -> Iterator[tuple[int, Dump, Program, Dancer]]:
    """Start a recogniser that can be taught: give its port, the answers, the program and a performer."""
    port = free_udp_port()
    with (
        liblo_tools.dumping() as dump,
        started(
            *("live", *options, "--teach", file, "--plain"),
            *("--osc-in", f"{LOOPBACK}:{port}", "--osc-out", f"{LOOPBACK}:{dump.port}"),
        ) as live,
        Dancer(port) as dancer,
    ):
        live.expect("listening on")
        yield port, dump, live, dancer


@pytest.mark.timeout(400)
def test_three_gestures_are_taught_and_recognised(tmp_path: Path, liblo_tools: LibloTools) -> None:
    """From nothing: three gestures by oscsend, each shown once; other takes of them start the right events."""
    file = tmp_path / "mine.npz"
    with taught_live(file, liblo_tools, "--library", "none") as (port, dump, live, dancer):
        for count, (name, class_name) in enumerate(GESTURES.items(), start=1):
            dancer.stand()
            liblo_tools.send(port, "/motion/teach", "ssif", "ann", name, 1, 0)
            dump.wait_for(lambda heard: _states(heard) != [] and _states(heard)[-1][1] == "waiting")
            dancer.show(_takes(class_name)[0])
            heard = dump.wait_for(lambda heard, want=count: [s[1] for s in _states(heard)].count("done") == want)
            assert [each[1] for each in _states(heard)][-3:] == ["recording", "checking", "done"]
            assert _classes(heard)[-1] == tuple(GESTURES)[:count]
        taught = [message.values for message in heard if message.address == "/motion/teach/taught"]
        assert [each[0] for each in taught] == list(GESTURES)
        before = len(_starts(heard))
        for class_name in GESTURES.values():
            dancer.show(_takes(class_name)[1])
            dancer.stand(60)
        heard = dump.wait_for(lambda heard: len(set(_starts(heard)[before:])) == len(GESTURES))
        # A kick that halts may start twice.
        assert [name for name, _ in groupby(_starts(heard)[before:])] == list(GESTURES)
        assert live.interrupt() == 0
    assert set(MotionLibrary.load(file).classes) == set(GESTURES)


@pytest.mark.timeout(400)
def test_impossible_commands_are_refused_and_nothing_is_lost(tmp_path: Path, liblo_tools: LibloTools) -> None:
    """Names, numbers and performers that cannot be, two at once, still throughout: a refusal each; then it works."""
    file = tmp_path / "mine.npz"
    with taught_live(file, liblo_tools) as (port, dump, live, dancer):
        refused = 0

        def is_refused(types: str, *values: object, address: str = "/motion/teach") -> str:
            nonlocal refused
            refused += 1
            dancer.stand(3)
            liblo_tools.send(port, address, types, *values)
            heard = dump.wait_for(lambda heard: [each[1] for each in _states(heard)].count("refused") == refused)
            return str([each for each in _states(heard) if each[1] == "refused"][-1][3])

        assert "1 to 64 characters, got 300" in is_refused("ss", "ann", "x" * 300)
        assert "without /" in is_refused("ss", "ann", "a/b")
        assert "no such performer" in is_refused("ss", "bo", "wave")
        assert "expected performer, class" in is_refused("s", "ann")
        assert "repetitions: expected 1 to 50" in is_refused("ssi", "ann", "wave", 1000)
        assert "not a taught class" in is_refused("ss", "squat1Reps", "s", address="/motion/teach/rename")
        assert "nothing to undo" in is_refused("", address="/motion/teach/undo")
        assert "expected one of" in is_refused("", address="/motion/teach/fly")
        liblo_tools.send(port, "/motion/teach", "ssif", "ann", "wave", 1, 0)
        dump.wait_for(lambda heard: "waiting" in [each[1] for each in _states(heard)])
        assert "is being taught wave" in is_refused("ssif", "ann", "bow", 1, 0)
        dancer.stand(16 * 60)
        refused += 1
        heard = dump.wait_for(lambda heard: [each[1] for each in _states(heard)].count("refused") == refused)
        assert _states(heard)[-1][3] == "stood still for 15 s"
        dancer.show(_takes("kickLFront1Reps")[0])
        dump.wait_for(lambda heard: "kickLFront1Reps" in _starts(heard))
        assert live.interrupt() == 0
        assert live.errors == ""
    assert not file.exists()


@pytest.mark.timeout(400)
def test_wekinator_and_requests(tmp_path: Path) -> None:
    """A controller made for Wekinator teaches, and a ZeroMQ request is replied to."""
    port, control, file = free_udp_port(), free_udp_port(), tmp_path / "mine.npz"
    with (
        started(
            *("live", "--library", "none", "--teach", file, "--plain", "--osc-in", f"{LOOPBACK}:{port}"),
            *("--control", f"wekinator={LOOPBACK}:{control}", "--control", "tcp://127.0.0.1:*"),
        ) as live,
        Dancer(port) as dancer,
        closing(OscSender(LOOPBACK, control)) as controller,
    ):
        endpoint = live.expect(r"ZeroMQ (tcp://\S+) \(control\)").group(1)
        dancer.stand()
        time.sleep(0.2)
        controller.send(encode_message("/wekinator/control/setOutputNames", "squat", "kick"))
        controller.send(encode_message("/wekinator/control/startDtwRecording", 2))
        live.expect("teaching ann: waiting")
        dancer.show(_takes("kickLFront1Reps")[0])
        live.expect("taught kick: good; examples: 1")
        with zmq.Context() as context, context.socket(zmq.REQ) as asking:
            asking.rcvtimeo = round(PATIENCE * 1000)
            asking.linger = 0
            asking.connect(endpoint)
            for request, told in (
                ({"do": "rename", "class": "kick", "to": "high kick"}, "kick is high kick"),
                ({"do": "undo"}, "1 example of 1 class"),
                ({"do": "enable", "class": "kick", "on": False}, "kick off"),
                ({"do": "jump"}, "expected one of"),
                (["nonsense"], "expected JSON"),
            ):
                asking.send(json.dumps(request).encode())
                assert told in json.loads(asking.recv())["states"][0]["reason"]
        assert live.interrupt() == 0
    assert MotionLibrary.load(file).classes == ("kick",)
