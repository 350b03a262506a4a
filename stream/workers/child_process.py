"""Child processes whose end is their parent's business: the user's signals do not disturb them."""

from __future__ import annotations

import signal
from contextlib import contextmanager
from multiprocessing import resource_tracker
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

#: Ctrl-C and a closed terminal reach every process of the terminal. Some systems have SIGHUP, Windows has SIGBREAK.
_TERMINAL = ("SIGINT", "SIGHUP", "SIGBREAK")


@contextmanager
def signals_held() -> Iterator[None]:
    """Hold this thread's signals back while a process is started that calls `leave_signals_to_parent` first.

    A signal that cut the start short would leave the child with half of its orders, or with a parent that does not know
    of it. A signal that reached the child while it imports would end it with a traceback.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    # It would let signals through when it starts its own process.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _numbers((*_TERMINAL, "SIGTERM")))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def leave_signals_to_parent(*, termination: bool = False) -> None:
    """Ignore a terminal's signals in this process, and SIGTERM if `termination`."""
    for number in _numbers((*_TERMINAL, "SIGTERM") if termination else _TERMINAL):
        signal.signal(number, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _numbers((*_TERMINAL, "SIGTERM")))


def _numbers(names: tuple[str, ...]) -> list[signal.Signals]:
    return [getattr(signal, name) for name in names if hasattr(signal, name)]
