"""The floor of a crowd's cost: a loop that receives and answers like the service, and recognises nothing."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from kinespace.library import MotionLibrary
from kinespace.stream import osc, zeromq
from kinespace.stream.recognizer import Recognizer
from kinespace.tools.bench.recorded import Feed

if TYPE_CHECKING:
    from collections.abc import Collection

    import numpy as np
    from numpy.typing import NDArray

    from kinespace.stream.recognition import Recognition
    from kinespace.stream.recognizer import Settings
    from kinespace.tools.feeding.feed import Packet


class EmptyRecognizer:
    """Takes a recogniser's place: finds a packet's performer, and sends the same answer whenever an answer is due.

    Parameters
    ----------
    due
        Indices of a performer's frames that are answered.
    recognition
        The answer, for every performer.
    joints
        Joints in each frame.
    """

    def __init__(self, due: Collection[int], recognition: Recognition, joints: int) -> None:
        self._due = frozenset(due)
        self._recognition = recognition
        #: Bytes of an OSC frame that change from frame to frame: the time and the positions.
        self._changing = 8 + 12 * joints
        self._seen: dict[bytes, int] = {}
        self._answers: dict[bytes, Packet] = {}

    def answer(self, packet: Packet) -> Packet | None:
        """Give a performer's answer when it is due; give a greeting back unchanged."""
        whose = packet[: -self._changing] if isinstance(packet, bytes) else packet[0]
        seen = self._seen.get(whose, 0)
        self._seen[whose] = seen + 1
        if whose not in self._answers:
            self._answers[whose] = self._made(packet)
        return self._answers[whose] if seen in self._due or whose == b"hello/" else None

    def _made(self, packet: Packet) -> Packet:
        if isinstance(packet, bytes):
            (frame,) = osc.decode(packet, 0.0).events
            return osc.encode_recognition(replace(self._recognition, performer=frame.performer))
        if not packet[0].startswith(b"frame/"):
            return packet
        frame = zeromq.decode(packet, 0.0).frame
        return zeromq.encode_recognition(replace(self._recognition, performer=frame.performer))


def answer_to(positions: NDArray[np.float32], settings: Settings) -> Recognition:
    """Give the last answer to recorded positions, shape (frames, joints, 3), metres.

    Raises
    ------
    ValueError
        The positions are too few for an answer.
    """
    recognizer = Recognizer(MotionLibrary.builtin(), settings)
    answers = [answer for frame in Feed(positions).take(len(positions)) if (answer := recognizer.push(frame))]
    if not answers:
        raise ValueError(f"positions: expected enough for an answer, got {len(positions)} frames")
    return answers[-1]
