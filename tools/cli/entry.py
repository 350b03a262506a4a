"""Where `kinespace` starts: before numpy is loaded, so that Ctrl-C ends it without a word then too."""

from __future__ import annotations

import os

#: A window's matrices are small: threads of the linear algebra would only fight with the feed for the cores.
_THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")


def main() -> int:
    """Run the program; the exit status.

    Linear algebra is kept to one thread, unless the environment says otherwise. numpy reads that when it is loaded, so
    the program sets it here: importing kinespace sets nothing.
    """
    for name in _THREADS:
        os.environ.setdefault(name, "1")
    try:
        from kinespace.tools.cli.interruption import interrupt_on_signals  # noqa: PLC0415 - as below

        interrupt_on_signals()
        from kinespace.tools.cli.main import main as run  # noqa: PLC0415 - loading it takes time, in which Ctrl-C is heard

        return run()
    except KeyboardInterrupt:
        return 1
