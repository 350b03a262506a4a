"""A program's end, when the user or the system asks for it: Ctrl-C, SIGTERM, a closed terminal."""

from __future__ import annotations

import signal
from collections.abc import Callable

#: Some systems have SIGHUP (the terminal was closed), Windows has SIGBREAK.
_NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")
_asked = False


def _signals() -> list[signal.Signals]:
    """List the signals that end a program; signals that the parent made us ignore (`nohup`) stay ignored."""
    here = [getattr(signal, name) for name in _NAMES if hasattr(signal, name)]
    return [number for number in here if signal.getsignal(number) is not signal.SIG_IGN]


def interrupt_on_signals() -> None:
    """Let every such signal raise KeyboardInterrupt in the main thread, and note it."""
    for number in _signals():
        signal.signal(number, _interrupt)


def stop_on_signals(stop: Callable[[], None]) -> None:
    """Let every such signal call `stop` instead of its former action; raise KeyboardInterrupt if one came before."""
    for number in _signals():
        signal.signal(number, lambda *_: stop())
    check_interrupted()


def _interrupt(*_: object) -> None:
    global _asked  # noqa: PLW0603 - a signal reaches the whole process
    _asked = True
    raise KeyboardInterrupt


def check_interrupted() -> None:
    """Raise KeyboardInterrupt if the end was asked for.

    Python drops an exception that is raised while an abandoned generator is closed, and a signal may come just then.
    Loops that must end therefore ask.
    """
    if _asked:
        raise KeyboardInterrupt
