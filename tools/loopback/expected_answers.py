"""What a recogniser will answer to a feed, known beforehand: how a received answer finds the frame it answers."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

from kinespace.stream import osc
from kinespace.stream.recognizer import Recognizer, Settings

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.library import MotionLibrary
    from kinespace.stream.answer import Answer
    from kinespace.tools.feeding.feed import Cue

#: Scores agree to the digits that every transport carries.
_SAME_SCORE = 1e-5


@dataclass(frozen=True, slots=True)
class Expected:
    """An answer that is to come: which cue (by index) it answers, and what it will say."""

    cue: int
    label: str
    score: float


def expected_answers(cues: Sequence[Cue], library: MotionLibrary, settings: Settings) -> list[Expected]:
    """Recognise a feed of one performer as it will be recognised, positions rounded as the wire rounds them."""
    recognizer = Recognizer(library, settings)
    expected = list[Expected]()
    for index, cue in enumerate(cues):
        (frame,) = osc.decode(osc.encode_frame(cue.frame), 0.0).events
        recognition = recognizer.push(frame)  # type: ignore[arg-type]  # a frame was encoded
        if recognition is not None:
            expected.append(Expected(index, recognition.label, recognition.score))
    return expected


class AnswerMatcher:
    """Pairs answers with the frames they answer, in order; those skipped were lost.

    An answer says neither its frame nor its number. What it says is known beforehand, though, so the next expected
    answer that says the same is it.
    """

    def __init__(self, expected: Sequence[Expected]) -> None:
        self._waiting = deque(expected)
        self.lost = 0
        self.unexpected = 0

    def match(self, answer: Answer) -> Expected | None:
        """Give what this answer was expected as; None for one that was not."""
        for skipped, expected in enumerate(self._waiting):
            if expected.label == answer.label and abs(expected.score - answer.score) < _SAME_SCORE:
                for _ in range(skipped + 1):
                    self._waiting.popleft()
                self.lost += skipped
                return expected
        self.unexpected += 1
        return None

    @property
    def waiting(self) -> int:
        """How many expected answers have not come."""
        return len(self._waiting)
