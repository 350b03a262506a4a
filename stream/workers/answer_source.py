"""Workers' answers as a source for the service: the part that `Crew` and the gateway share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from typing import TYPE_CHECKING, cast

from kinespace.stream.inputs.source import TENDING
from kinespace.stream.recognition import Recognition
from kinespace.stream.service.status import InputCounts

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.stream.frame import Admitted


class AnswerSource(ABC):
    """Keeps workers' answers until the service takes them; a subclass reads them.

    Attributes
    ----------
    waited
        Seconds since the frame of the last answer came.
    """

    def __init__(self) -> None:
        self.waited = 0.0
        self._answers = deque[tuple[Recognition, float]]()

    @property
    def tended_within(self) -> float:
        """Seconds within which `tend` has work to do even when no answer comes."""
        return TENDING

    @property
    @abstractmethod
    def pollable(self) -> object:
        """The object that is readable when answers have come."""

    @property
    @abstractmethod
    def notes(self) -> list[str]:
        """Notes for a person, a line each."""

    @property
    def has_put_aside(self) -> bool:
        """Whether answers were read and not taken yet."""
        return bool(self._answers)

    @property
    def counts(self) -> InputCounts:
        """No counts: answers are not input."""
        return InputCounts()

    def bring(self, news: Sequence[tuple[Recognition, float]]) -> None:
        """Keep answers, each with the arrival of its frame, until they are taken."""
        self._answers += news

    def take(self, arrival: float) -> Sequence[Admitted] | None:
        """Give the next answer as an event, which `Spread.push_all` gives back; None when none has come."""
        if not self._answers:
            self.read(arrival)
        if not self._answers:
            return None
        recognition, at = self._answers.popleft()
        self.waited = max(arrival - at, 0.0)
        return (cast("Admitted", recognition),)

    @abstractmethod
    def read(self, now: float) -> None:
        """Read the answers that have come."""

    @abstractmethod
    def tend(self, now: float) -> Sequence[Admitted]:
        """Look after the workers; give no events."""

    @abstractmethod
    def close(self) -> None:
        """End the workers, or the connection to them."""
