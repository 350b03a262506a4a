"""`kinespace examples`: lists programs that send frames or receive answers, and tables of joint names; prints one."""

import argparse
from importlib import resources

from kinespace.tools.cli.console import say
from kinespace.tools.cli.values import meant

#: Folders and endings of files that are no examples.
_PASSED_OVER = {"node_modules", "__pycache__", ".pyc", ".meta"}
#: The page that says what each needs.
PAGE = ".github/docs/examples.md"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.add_argument("name", nargs="?", metavar="NAME", help="print this example, to be kept in a file")


def run(options: argparse.Namespace) -> None:
    """List the examples, or print one."""
    files = _files("tools", "examples") | _files("library", "naming/conventions")
    if options.name is not None:
        if options.name not in files:
            wrong = f"{options.name!r}{meant(options.name, files)}"
            raise ValueError(f"NAME: expected an example that `kinespace examples` lists, got {wrong}")
        print(files[options.name], end="")
        return
    for name in files:
        say(f"{name}  (joint names)" if name.endswith(".toml") else name)
    say("")
    say(f"kinespace examples NAME > NAME keeps one; {PAGE} in the sources says what each needs.")


def _files(room: str, folder: str) -> dict[str, str]:
    """Read the files of a folder and the folders in it, by their names."""
    with resources.as_file(resources.files(f"kinespace.{room}") / folder) as place:
        found = [each for each in sorted(place.rglob("*.*")) if not _PASSED_OVER & {*each.parts, each.suffix}]
        return {each.name: each.read_text(encoding="utf-8") for each in found if each.is_file()}
