"""`kinespace completion`: prints a shell's completion of programs, options and files; made by shtab, an extra."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from kinespace.tools.cli.main import whole_parser

if TYPE_CHECKING:
    import argparse

_SHELLS = ("bash", "fish", "powershell", "tcsh", "zsh")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.description = (
        "Prints a script that completes programs, options and files. bash: kinespace completion bash > "
        "~/.local/share/bash-completion/completions/kinespace; zsh: kinespace completion zsh > a file _kinespace in a "
        "folder of $fpath."
    )
    parser.add_argument("shell", choices=_SHELLS, help="which shell")


def run(options: argparse.Namespace) -> int:
    """Run the program with these options; return the exit status."""
    print(script_for(options.shell))
    return 0


def script_for(shell: str) -> str:
    """Print the script for a shell.

    Raises
    ------
    ImportError
        shtab is not installed.
    """
    try:
        import shtab  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise ImportError("completion needs shtab: pip install 'kinespace[completion]'") from error
    parser = whole_parser()
    _complete_files(parser, shtab.FILE)
    script: str = shtab.complete(parser, shell)
    return script


def _complete_files(parser: argparse.ArgumentParser, way: object) -> None:
    """Mark the arguments that are files, of all programs."""
    for action in parser._actions:  # noqa: SLF001 - argparse lists its actions nowhere else
        if isinstance(action.choices, dict):
            for program in action.choices.values():
                _complete_files(program, way)
        elif action.type is Path:
            action.complete = way  # type: ignore[attr-defined]
