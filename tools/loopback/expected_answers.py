"""The answers to a feed, computed beforehand; by them a received answer finds its frame."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

from kinespace.stream import osc
from kinespace.stream.recognizer import Recognizer, Settings

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.library import MotionLibrary
    from kinespace.stream.recognition import Answer
    from kinespace.tools.feeding.feed import Cue

#: Scores agree to the digits that every transport carries.
_SAME_SCORE = 1e-5


@dataclass(frozen=True, slots=True)
class Expected:
    """An answer that is to come: the index of its cue, and its content."""

    cue: int
    label: str
    score: float


def expected_answers(cues: Sequence[Cue], library: MotionLibrary, settings: Settings) -> list[Expected]:
    """Recognise a feed of one performer like the service, positions rounded as in packets."""
    recognizer = Recognizer(library, settings)
    expected = list[Expected]()
    for index, cue in enumerate(cues):
        (frame,) = osc.decode(osc.encode_frame(cue.frame), 0.0).events
        recognition = recognizer.push(frame)  # type: ignore[arg-type]  # a frame was encoded
        if recognition is not None:
            expected.append(Expected(index, recognition.label, recognition.score))
    return expected


class AnswerMatcher:
    """Pairs answers with their frames, in order; answers that were skipped are lost.

    An answer names neither its frame nor its number. But its content is known beforehand, so it is paired with the next
    expected answer of the same content.
    """

    def __init__(self, expected: Sequence[Expected]) -> None:
        self._waiting = deque(expected)
        self.lost = 0

    def match(self, answer: Answer) -> Expected | None:
        """Give the expected answer that this answer is; None for an unexpected answer."""
        for skipped, expected in enumerate(self._waiting):
            if expected.label == answer.label and abs(expected.score - answer.score) < _SAME_SCORE:
                for _ in range(skipped + 1):
                    self._waiting.popleft()
                self.lost += skipped
                return expected
        return None

    @property
    def waiting(self) -> int:
        """How many expected answers have not come."""
        return len(self._waiting)
