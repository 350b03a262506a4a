"""Where `kinespace` starts: before numpy is loaded, so that Ctrl-C ends it without a word then too."""

from __future__ import annotations


def main() -> int:
    """Run the program; the exit status."""
    try:
        from tools.cli import main as run  # noqa: PLC0415 - it takes half a second, in which somebody may change their mind

        return run()
    except KeyboardInterrupt:
        return 1
