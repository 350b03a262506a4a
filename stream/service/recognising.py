"""The performers as the service, the sinks and the teacher ask for them, wherever they are recognised."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, runtime_checkable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.library.motion_library import MotionLibrary
    from kinespace.library.skeleton import Skeleton
    from kinespace.library.windows.index import WindowIndex
    from kinespace.stream.frame import Admitted, Frame
    from kinespace.stream.recognition import Event, Recognition
    from kinespace.stream.recognizer import Settings
    from kinespace.stream.recognizer.joints.carried import Carried
    from kinespace.stream.recognizer.performers import PerformerCounts


class Recognising(Protocol):
    """The recognisers, as the service and the sinks see them; `kinespace.stream.recognizer.Performers` says more."""

    @property
    def classes(self) -> tuple[str, ...]:
        """The classes that are answered."""

    @property
    def names(self) -> tuple[str, ...]:
        """The performers now followed."""

    @property
    def counts(self) -> PerformerCounts:
        """Counts of what happened to all frames so far."""

    @property
    def refused(self) -> dict[str, str]:
        """Performers whose frames are refused for their joints, with the reason."""

    @property
    def doubted(self) -> dict[str, str]:
        """Performers with joints that cannot be believed, and the reason."""

    @property
    def compared(self) -> dict[str, str]:
        """The joints by which performers are compared, if these are not all."""

    @property
    def silence(self) -> float:
        """Seconds without a frame after which a performer is dropped."""

    def push_all(self, events: Sequence[Admitted], arrival: float) -> list[Recognition | None]:
        """Take in events that came together; give for each a recognition when one is due, else None."""

    def drop_silent(self, now: float) -> list[Event]:
        """Forget silent performers; give the ends of their motions."""

    def end_paused(self, now: float) -> list[Event]:
        """Give the ends of the motions of performers who send nothing for now."""

    def take_gone(self) -> list[str]:
        """Give the performers who were dropped since the last call."""

    def end(self) -> list[Event]:
        """Give the ends of all motions going on."""

    def skeleton_of(self, name: str) -> Skeleton | None:
        """Give the joints of a performer's frames; None for an unknown performer."""

    def carried(self, name: str) -> Carried | None:
        """Say which joints carry the last answer to a performer; None where it is not known."""


@runtime_checkable
class Teachable(Recognising, Protocol):
    """Recognisers whose library can be exchanged, as teaching needs them."""

    @property
    def settings(self) -> Settings:
        """The settings of all recognisers."""

    @property
    def sensitivity(self) -> float:
        """The sensitivity of all recognisers."""

    def set_sensitivity(self, share: float) -> None:
        """Recognise all performers with another sensitivity from the next hop on."""

    def ordered(self, frame: Frame) -> Frame | None:
        """Give a frame that was pushed in the order of the library's joints; None for one that was refused."""

    def exchange(self, library: MotionLibrary | WindowIndex, order: Sequence[str] = ()) -> list[Event]:
        """Compare all performers with another library from now on; end the motions whose class it lacks."""
