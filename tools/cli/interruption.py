"""The end of a program that a user or the system asks for: Ctrl-C, SIGTERM, a terminal that was closed."""

from __future__ import annotations

import signal
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

#: Some systems have SIGHUP (the terminal was closed), Windows has SIGBREAK.
_NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")
_asked = False


def _signals() -> list[signal.Signals]:
    """List the signals that end a program; what the parent let us ignore (`nohup`) stays ignored."""
    here = [getattr(signal, name) for name in _NAMES if hasattr(signal, name)]
    return [number for number in here if signal.getsignal(number) is not signal.SIG_IGN]


def interrupt_on_signals() -> None:
    """Let every such signal raise KeyboardInterrupt in the main thread, and be remembered."""
    for number in _signals():
        signal.signal(number, _interrupt)


def stop_on_signals(stop: Callable[[], None]) -> None:
    """Let every such signal call `stop` in place of what it did before."""
    for number in _signals():
        signal.signal(number, lambda *_: stop())


def _interrupt(*_: object) -> None:
    global _asked  # noqa: PLW0603 - a signal reaches the whole process
    _asked = True
    raise KeyboardInterrupt


def check_interrupted() -> None:
    """Raise KeyboardInterrupt if the end was asked for.

    Python drops an exception that is raised while an abandoned generator is closed, and a signal may come just then.
    Loops that have to end therefore ask.
    """
    if _asked:
        raise KeyboardInterrupt
