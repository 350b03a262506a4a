"""Teaching a running recogniser as people do: commands come by OSC, from Wekinator's controllers, and by ZeroMQ."""

from __future__ import annotations

import json
import time
from contextlib import closing
from typing import TYPE_CHECKING

import pytest
import zmq
from programs import LOOPBACK, PATIENCE, builtin_library, started

from kinespace.library import MotionLibrary
from kinespace.stream.frame import Frame
from kinespace.stream.osc import OscReceiver, OscSender
from kinespace.stream.osc.frames import encode_frame
from kinespace.stream.osc.packet import decode_packet, encode_message

if TYPE_CHECKING:
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

pytestmark = pytest.mark.slow

GESTURES = {"squat": "squat1Reps", "arms": "rotateArmsBothBackward1Reps", "kick": "kickLFront1Reps"}
STILL = 75


class Dancer:
    """Sends frames faster than they would come, each with its own time, so that no clock decides."""

    def __init__(self, sender: OscSender) -> None:
        self._sender, self._time = sender, 10.0

    def stand(self, posture: NDArray[np.float64], frames: int = STILL) -> None:
        """Show one posture for some frames."""
        self._show([posture] * frames)

    def perform(self, gesture: str, take: int) -> None:
        """Show a motion, standing still before and after."""
        positions = _takes(gesture)[take]
        self.stand(positions[0])
        self._show(positions)
        self.stand(positions[-1])

    def _show(self, postures: NDArray[np.float64] | list[NDArray[np.float64]]) -> None:
        for place, posture in enumerate(postures):
            self._time += 1 / 60
            self._sender.send(encode_frame(Frame("ann", self._time, posture)))
            if place % 10 == 0:
                time.sleep(0.005)


def _takes(gesture: str) -> list[NDArray[np.float64]]:
    motions = (each for each in builtin_library().motions if each.actor == "bd")
    return [motion.positions for motion in motions if motion.class_name == GESTURES[gesture]]


@pytest.mark.timeout(400)
def test_three_gestures_are_taught_and_recognised(tmp_path: Path) -> None:
    """From nothing, each shown once and asked for in another way; other takes of them start the right events."""
    file = tmp_path / "mine.npz"
    with (
        closing(OscReceiver(LOOPBACK, 0)) as answers,
        started(
            *("live", "--library", "none", "--teach", file, "--plain", "--osc-in", f"{LOOPBACK}:0"),
            *("--osc-out", f"{LOOPBACK}:{answers.address[1]}"),
            *("--control", "tcp://127.0.0.1:*"),
        ) as live,
        closing(OscSender(LOOPBACK, int(live.expect(r"listening on OSC [\d.]+:(\d+)")[1]))) as sender,
        zmq.Context() as context,
        context.socket(zmq.REQ) as asking,
    ):
        asking.rcvtimeo, asking.linger = round(PATIENCE * 1000), 0
        asking.connect(live.expect(r"ZeroMQ (tcp://\S+) \(control\)")[1])

        def replied(**request: object) -> str:
            asking.send(json.dumps(request).encode())
            return str(json.loads(asking.recv())["states"][0].get("reason"))

        dancer = Dancer(sender)
        dancer.stand(_takes("squat")[0][0])
        sender.send(encode_message("/motion/teach", "bo", "wave"))
        live.expect("no such performer")
        for number, gesture in enumerate(GESTURES, start=1):
            if gesture == "squat":
                sender.send(encode_message("/motion/teach", "ann", "squat", 1, 0.0))
            else:
                replied(do="teach", performer="ann", **{"class": gesture}, countdown=0)
            live.expect(rf"(?s)(teaching ann: waiting\n.*){{{number}}}")
            dancer.perform(gesture, 0)
            live.expect(f"taught {gesture}: good so far: .*; examples: 1")
        for gesture in GESTURES:
            dancer.perform(gesture, 1)
            live.expect(f"start: {gesture}")
        assert replied(do="rename", **{"class": "kick"}, to="high kick") == "kick is high kick"
        assert replied(do="undo") == "3 examples of 3 classes"
        assert "expected one of" in replied(do="jump")
        assert (live.interrupt(), live.errors) == (0, "")
        heard = [each for packet in iter(answers.receive, None) for each in decode_packet(packet)]
    states = [each.arguments[1] for each in heard if each.address == "/motion/teach/state"]
    assert states[:1] == ["refused"]
    assert {"waiting", "recording", "checking", "done"} <= {*states}
    assert tuple(GESTURES) in [tuple(each.arguments) for each in heard if each.address == "/motion/classes"]
    assert set(MotionLibrary.load(file).classes) == set(GESTURES)
