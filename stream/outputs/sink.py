"""A sink: the service passes it answers, frames and state. Each kind of sink overrides the methods it uses."""

from collections.abc import Sequence
from importlib import import_module
from types import ModuleType

from kinespace.stream.frame import Frame
from kinespace.stream.recognition import Classes, Done, Event, Gone, Recognition
from kinespace.stream.status import Status
from kinespace.stream.teaching.commands import Notice, State, Taught

#: Whatever a service has to say.
Message = Recognition | Event | Done | Gone | Classes | Frame | Status | Notice


class Sink:
    """Takes everything and passes nothing on. No method of a sink may raise or wait."""

    #: Answers that could not be sent; calls that raised in spite of all, and what the last one raised.
    failed = raised = 0
    error = ""
    #: Notes for a person, a line each.
    notes: Sequence[str] = ()

    def send(self, message: Message) -> None:
        """Pass on a message; a sink overrides this, or the methods below of those messages that it has use for."""
        match message:
            case Recognition():
                self.publish(message)
            case Event():
                self.publish_event(message)
            case Done():
                self.publish_done(message)
            case Gone(performer):
                self.publish_gone(performer)
            case Classes(names):
                self.publish_classes(names)
            case Frame():
                self.publish_frame(message)
            case Status():
                self.publish_status(message)
            case State() | Taught():
                self.publish_notice(message)

    def publish(self, recognition: Recognition) -> None:
        """Pass on one recognition."""

    def publish_event(self, event: Event) -> None:
        """Pass on that a motion started or ended."""

    def publish_done(self, done: Done) -> None:
        """Pass on that a motion was done."""

    def publish_gone(self, performer: str) -> None:
        """Pass on that a performer has left: nothing more is answered."""

    def publish_frame(self, frame: Frame) -> None:
        """Pass on a frame that the recognisers have got; the service sends them to sinks that override this."""

    def publish_classes(self, classes: Sequence[str]) -> None:
        """Pass on the list of classes."""

    def publish_status(self, status: Status) -> None:
        """Pass on the service's counters."""

    def publish_notice(self, notice: Notice) -> None:
        """Pass on a notice of teaching."""

    def close(self) -> None:
        """Give sockets back."""


def extra(package: str, name: str) -> ModuleType:
    """Load a package of an extra; ImportError says how to get it."""
    try:
        return import_module(package)
    except (ImportError, RuntimeError) as error:
        # RuntimeError: pylsl is there without the library that it calls.
        raise ImportError(f"{package.partition('.')[0]} cannot be loaded: pip install 'kinespace[{name}]'") from error
