"""A performer who leaves: every sink is told once, after the silence or when the service ends."""

from __future__ import annotations

from typing import TYPE_CHECKING

from synthetic import STICK, stick_clip

from kinespace.stream import Frame
from kinespace.stream.outputs import Sink
from kinespace.stream.recognizer import LiveSignature, Performers, Settings
from kinespace.stream.service.loop import Service

if TYPE_CHECKING:
    from kinespace.library.motion_library import MotionLibrary


class _Leavers(Sink):
    def __init__(self) -> None:
        self.gone: list[str] = []

    def publish_gone(self, performer: str) -> None:
        self.gone.append(performer)


def test_a_silent_performer_is_reported_gone_once(sticks: MotionLibrary) -> None:
    """A performer is reported gone after five seconds without a frame, unless frames come before the next status."""
    now = [0.0]
    performers = Performers(sticks, Settings(signature=LiveSignature.PAPER))
    leavers = _Leavers()
    positions = stick_clip("bow").positions[0]
    with Service(performers, [], [leavers], clock=lambda: now[0]) as service:
        for name in ("ann", "bob"):
            performers.push(Frame(name, 0.0, positions), now[0])
        service.step(0.0)
        now[0] = 4.0
        performers.push(Frame("bob", 4.0, positions), now[0])
        now[0] = 5.5
        service.step(0.0)
        assert leavers.gone == ["ann"]
        now[0] = 6.6
        service.step(0.0)
        assert leavers.gone == ["ann"]
        service.stop()
        service.run()
    assert leavers.gone == ["ann", "bob"]
    assert len(STICK.joints) == len(positions)
