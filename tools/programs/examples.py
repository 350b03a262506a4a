"""`kinespace examples`: lists the programs to copy, which send frames or receive answers, or prints one."""

from __future__ import annotations

from importlib import resources
from typing import TYPE_CHECKING

from kinespace.tools.cli.choice import one_of
from kinespace.tools.terminal.console import say

if TYPE_CHECKING:
    import argparse

#: The page that says what each needs.
PAGE = ".github/docs/examples.md"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.add_argument("name", nargs="?", metavar="NAME", help="print this example, to be kept in a file")


def run(options: argparse.Namespace) -> int:
    """List the examples, or print one; return the exit status."""
    with resources.as_file(resources.files("kinespace.tools") / "examples") as folder:
        files = {path.name: path for path in sorted(folder.rglob("*.*")) if "node_modules" not in path.parts}
        files = {name: path for name, path in files.items() if path.is_file() and path.suffix != ".pyc"}
        if options.name is not None:
            print(files[one_of("NAME", options.name, files)].read_text(encoding="utf-8"), end="")
            return 0
    for name in files:
        say(name)
    say(f"\nkinespace examples NAME > NAME keeps one; {PAGE} in the sources says what each needs.")
    return 0
