"""Where `kinespace` starts, before numpy is loaded: Ctrl-C ends it silently meanwhile; and how a program ends."""

import os
import signal
import threading
from collections.abc import Callable

#: Some systems have SIGHUP (the terminal was closed), Windows has SIGBREAK.
_NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")
_asked = False


def _signals() -> list[signal.Signals]:
    """List the signals that end a program; signals that the parent made us ignore (`nohup`) stay ignored."""
    here = [getattr(signal, name) for name in _NAMES if hasattr(signal, name)]
    return [number for number in here if signal.getsignal(number) is not signal.SIG_IGN]


def stop_on_signals(stop: Callable[[], None]) -> None:
    """Let every such signal call `stop` instead of its former action; raise KeyboardInterrupt if one came before."""
    for number in _signals():
        signal.signal(number, lambda *_: stop())
    check_interrupted()


def end_wanted() -> Callable[[], bool]:
    """Let every such signal end the program at its next question: give the question, whether one has come."""
    ended = threading.Event()
    stop_on_signals(ended.set)
    return ended.is_set


def _interrupt(*_: object) -> None:
    """Note that the end was asked for, and raise KeyboardInterrupt in the main thread."""
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


#: A window's matrices are small: threads of the linear algebra would only take cores from the feed.
_THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")


def main() -> int:
    """Run the program; return the exit status.

    Linear algebra uses one thread, unless the environment sets another number. numpy reads these variables when it is
    loaded, so the program sets them here. Importing kinespace sets nothing.
    """
    for name in _THREADS:
        os.environ.setdefault(name, "1")
    # No process that this one starts imports what lies in the current folder: a stranger's recordings, say.
    os.environ["PYTHONSAFEPATH"] = "1"
    try:
        for number in _signals():
            signal.signal(number, _interrupt)
        from kinespace.tools.cli.main import main as run  # noqa: PLC0415 - Ctrl-C must end the program while this loads

        return run()
    except KeyboardInterrupt:
        return 1
