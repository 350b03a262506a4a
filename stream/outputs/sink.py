"""A sink: the service passes it answers, frames and state. Each kind of sink has methods for the messages it uses."""

from collections.abc import Sequence
from importlib import import_module
from types import ModuleType

from kinespace.stream.frame import Frame
from kinespace.stream.recognition import Classes, Done, Event, Gone, Recognition
from kinespace.stream.status import Status
from kinespace.stream.teaching.commands import Notice

#: Whatever a service has to say.
Message = Recognition | Event | Done | Gone | Classes | Frame | Status | Notice


class Sink:
    """Takes everything and passes nothing on. No method of a sink may raise or wait.

    A sink that has `publish_frame` gets every frame that the recognisers have got.
    """

    #: Answers that could not be sent; calls that raised in spite of all, and what the last one raised.
    failed = raised = 0
    error = ""
    #: Notes for a person, a line each.
    notes: Sequence[str] = ()

    def send(self, message: Message) -> None:
        """Pass on a message: by the method that has its class's name, like `publish_event`, if there is one."""
        if publish := getattr(self, f"publish_{type(message).__name__.lower()}", None):
            publish(message)

    def close(self) -> None:
        """Give sockets back."""


def extra(package: str, name: str) -> ModuleType:
    """Load a package of an extra; ImportError says how to get it."""
    try:
        return import_module(package)
    except (ImportError, RuntimeError) as error:
        # RuntimeError: pylsl is there without the library that it calls.
        raise ImportError(f"{package.partition('.')[0]} cannot be loaded: pip install 'kinespace[{name}]'") from error
