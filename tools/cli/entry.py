"""Where `kinespace` starts: before numpy is loaded, so that Ctrl-C ends it silently while it loads."""

from __future__ import annotations

import os

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
        from kinespace.tools.cli.interruption import interrupt_on_signals  # noqa: PLC0415 - as below

        interrupt_on_signals()
        from kinespace.tools.cli.main import main as run  # noqa: PLC0415 - Ctrl-C must end the program while this loads

        return run()
    except KeyboardInterrupt:
        return 1
