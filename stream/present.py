"""Who is here: performers who come, make room for others, fall silent and leave; in this process or in workers."""

from abc import ABC, abstractmethod
from typing import Generic, Protocol, TypeVar

from kinespace.stream.packet import remember
from kinespace.stream.recognition import Event
from kinespace.stream.status import PerformerCounts

#: Seconds without a frame after which a motion has ended: its performer may have done anything meanwhile.
MAX_PAUSE = 0.8
#: The joint names, and the like, of so many times the maximum number of performers are remembered.
MAX_REMEMBERED = 4
#: A performer that was not answered for so many seconds makes room for a newcomer that sent so many frames in them: an
#: answer needs a quarter of a second of feed, and names without a body behind them never get one.
STEADY_SECONDS = 1.0
STEADY_FRAMES = 12


class Followed(Protocol):
    """Follows one performer; its newest frame came at a time, seconds on our clock."""

    newest: float

    def end(self) -> Event | None:
        """End the motion that goes on."""

    def is_idle(self, now: float) -> bool:
        """Say whether it may make room for a newcomer."""


AnyFollowed = TypeVar("AnyFollowed", bound=Followed)


class Present(ABC, Generic[AnyFollowed]):
    """The performers who are here: who comes, makes room, falls silent and leaves.

    Parameters
    ----------
    most
        The number of performers at once.
    silence
        Seconds without a frame after which a performer is dropped.
    """

    def __init__(self, most: int, silence: float) -> None:
        self.most, self.silence = most, silence
        self._here: dict[str, AnyFollowed] = {}
        #: Counts of frames without room, of performers dropped, and the like.
        self._counts = PerformerCounts()
        #: Of newcomers without room since when each has sent, and how many frames.
        self._waiting: dict[str, tuple[float, int]] = {}
        #: Ends of motions of performers who were dropped, and performers who were dropped, not given out yet.
        self._ended, self._gone = list[Event](), list[str]()

    @property
    def names(self) -> tuple[str, ...]:
        """The performers now followed, in the order of their first frames."""
        return tuple(self._here)

    def drop_silent(self, now: float) -> list[Event]:
        """Forget performers that sent nothing for `silence` seconds; give the ends of their motions."""
        self._drop_silent(now)
        return self._take_ended()

    def end_paused(self, now: float) -> list[Event]:
        """Give the ends of the motions of performers who send nothing for now, as their next frames would show."""
        paused = (each for each in self._here.values() if now - each.newest > MAX_PAUSE)
        return [event for each in paused if (event := each.end())]

    def take_gone(self) -> list[str]:
        """Give the performers who were dropped since the last call."""
        gone, self._gone = self._gone, []
        return gone

    def end(self) -> list[Event]:
        """Give the ends of all motions going on, because nothing more will come."""
        return [*self._take_ended(), *(event for each in self._here.values() if (event := each.end()))]

    def _take_ended(self) -> list[Event]:
        ended, self._ended = self._ended, []
        return ended

    def _drop_silent(self, now: float) -> None:
        for name in [name for name, each in self._here.items() if now - each.newest > self.silence]:
            self._let_go(name)

    def _come(self, name: str, now: float) -> AnyFollowed | None:
        """Give what follows a performer who sends something now; None when there is no room."""
        followed = self._here.get(name)
        if followed is None:
            if len(self._here) >= self.most:
                self._drop_silent(now)
            if len(self._here) >= self.most and not self._make_room(name, now):
                return None
            self._waiting.pop(name, None)
            self._gone = [each for each in self._gone if each != name]
            followed = self._here[name] = self._begin(name, now)
        followed.newest = now
        return followed

    def _make_room(self, name: str, now: float) -> bool:
        """Drop a performer that is idle, for a newcomer that sends steadily; say whether there is room."""
        since, frames = self._waiting.get(name, (now, 0))
        if now - since > STEADY_SECONDS:
            since, frames = now, 0
        remember(self._waiting, name, (since, frames + 1), MAX_REMEMBERED * self.most)
        if frames + 1 < STEADY_FRAMES:
            return False
        idle = next((other for other, each in self._here.items() if each.is_idle(now)), None)
        if idle is not None:
            self._let_go(idle)
        return idle is not None

    @abstractmethod
    def _begin(self, name: str, now: float) -> AnyFollowed:
        """Follow a performer who comes now."""

    def _let_go(self, name: str) -> None:
        """Forget a performer who is told to be gone."""
        self._forget(name)
        self._gone = [*self._gone[-MAX_REMEMBERED * self.most :], name]

    def _forget(self, name: str) -> None:
        """Forget a performer; the end of its motion is given out with the ends of silent performers."""
        if followed := self._here.pop(name, None):
            self._counts.dropped += 1
            self._retire(followed)

    def _retire(self, followed: AnyFollowed) -> None:
        """Keep the end of a motion."""
        if ended := followed.end():
            self._ended.append(ended)
