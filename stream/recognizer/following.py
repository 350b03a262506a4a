"""Who is followed: at most so many performers at once, each from its first frame until it is silent or makes room."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

from kinespace.stream.recognizer.recognizer import MAX_PAUSE

if TYPE_CHECKING:
    from kinespace.stream.frame import Announcement
    from kinespace.stream.recognition import Event

#: Performers at once that may be asked for.
MAX_PERFORMERS = 10_000
#: The joint names, and the like, of so many times the maximum number of performers are remembered.
_MAX_REMEMBERED = 4
#: A performer that was not answered for so many seconds makes room for a newcomer that sent so many frames in them: an
#: answer needs a quarter of a second of feed, and names without a body behind them never get one.
_STEADY_SECONDS = 1.0
_STEADY_FRAMES = 12


class Followed(Protocol):
    """A performer who is followed.

    Attributes
    ----------
    begun, newest
        When the first and the newest frame came, seconds on our clock.
    """

    begun: float
    newest: float

    @property
    def frames_and_answers(self) -> tuple[int, int]:
        """How many frames were taken in, and how many of them were answered."""

    def end(self) -> Event | None:
        """End the motion that goes on; None when none does."""


_One = TypeVar("_One", bound=Followed)
_Value = TypeVar("_Value")


class Following(ABC, Generic[_One]):
    """Keeps the performers; a subclass begins with each of them, and retires them.

    Parameters
    ----------
    most
        The number of performers at once; a further one gets no room until another falls silent.
    silence
        Seconds without a frame after which a performer is dropped.

    Raises
    ------
    ValueError
        Fewer than one performer, too many, or no time of silence.
    """

    def __init__(self, most: int, silence: float) -> None:
        if not 1 <= most <= MAX_PERFORMERS:
            raise ValueError(f"most: expected 1 to {MAX_PERFORMERS} performers, got {most}")
        if not (math.isfinite(silence) and silence > 0):
            raise ValueError(f"silence: expected a positive number of seconds, got {silence}")
        self.most, self.silence = most, silence
        self._performers: dict[str, _One] = {}
        #: Frames without room, and performers dropped.
        self._no_room = self._dropped = 0
        #: Ends of motions of performers who were dropped to make room, not given out yet.
        self._ended: list[Event] = []
        #: Performers who were dropped, not given out yet.
        self._gone: list[str] = []
        #: Performers for whom there was no room: since when, and how many frames they have sent.
        self._waiting: dict[str, tuple[float, int]] = {}
        # A sender may announce its joints once, so announcements are kept through a silence.
        self._announced: dict[str, Announcement] = {}

    @abstractmethod
    def _begin(self, name: str, now: float) -> _One:
        """Begin with a performer."""

    def _retire(self, performer: _One) -> None:
        """Keep the end of the motion of a performer who is no longer followed."""
        if ended := performer.end():
            self._ended.append(ended)

    @property
    def names(self) -> tuple[str, ...]:
        """The performers now followed, in the order of their first frames."""
        return tuple(self._performers)

    def drop_silent(self, now: float) -> list[Event]:
        """Forget performers that sent nothing for `silence` seconds; give the ends of their motions."""
        self._drop_silent(now)
        return self._take_ended()

    def end_paused(self, now: float) -> list[Event]:
        """Give the ends of the motions of performers who send nothing for now, as their next frames would show."""
        paused = (each for each in self._performers.values() if now - each.newest > MAX_PAUSE)
        return [event for each in paused if (event := each.end())]

    def take_gone(self) -> list[str]:
        """Give the performers who were dropped since the last call."""
        gone, self._gone = self._gone, []
        return gone

    def end(self) -> list[Event]:
        """Give the ends of all motions going on, because nothing more will come."""
        return [*self._take_ended(), *(event for each in self._performers.values() if (event := each.end()))]

    def _take_ended(self) -> list[Event]:
        ended, self._ended = self._ended, []
        return ended

    def _remember(self, known: dict[str, _Value], name: str, value: _Value) -> None:
        """Remember a value by a performer's name; of too many the oldest is forgotten."""
        if name not in known and len(known) >= _MAX_REMEMBERED * self.most:
            del known[next(iter(known))]
        known[name] = value

    def _forget(self, name: str) -> None:
        """Forget a performer; the end of its motion is given out with the ends of silent performers."""
        if performer := self._performers.pop(name, None):
            self._retire(performer)
            self._dropped += 1

    def _drop_silent(self, now: float) -> None:
        for name in [name for name, each in self._performers.items() if now - each.newest > self.silence]:
            self._forget(name)
            self._gone = [*self._gone[-_MAX_REMEMBERED * self.most :], name]

    def _performer(self, name: str, now: float) -> _One | None:
        """Give a performer who sends something now; None when there is no room."""
        performer = self._performers.get(name)
        if performer is None:
            if len(self._performers) >= self.most:
                self._drop_silent(now)
            if len(self._performers) >= self.most and not self._make_room(name, now):
                return None
            self._waiting.pop(name, None)
            self._gone = [each for each in self._gone if each != name]
            performer = self._performers[name] = self._begin(name, now)
        performer.newest = now
        return performer

    def _make_room(self, name: str, now: float) -> bool:
        """Drop a performer that is idle, for a newcomer that sends steadily; say whether there is room."""
        since, frames = self._waiting.get(name, (now, 0))
        if now - since > _STEADY_SECONDS:
            since, frames = now, 0
        self._remember(self._waiting, name, (since, frames + 1))
        if frames + 1 < _STEADY_FRAMES:
            return False
        idle = next((other for other, each in self._performers.items() if _is_idle(each, now)), None)
        if idle is not None:
            self._forget(idle)
        return idle is not None


def _is_idle(performer: Followed, now: float) -> bool:
    """Say whether a performer was never answered, or sends fewer frames a second than any feed has."""
    seconds, (frames, answers) = now - performer.begun, performer.frames_and_answers
    return seconds > _STEADY_SECONDS and (not answers or frames * _STEADY_SECONDS < _STEADY_FRAMES * seconds)
