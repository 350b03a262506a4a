"""`kinespace feeds`: lists the products whose messages are understood, and their settings."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rich.text import Text

from kinespace.stream.feeds import Preset, builtin_names, builtin_preset, builtin_text, load_preset
from kinespace.tools.cli.choice import one_of
from kinespace.tools.terminal.console import console

if TYPE_CHECKING:
    import argparse

_ENDING = ".toml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.add_argument("name", nargs="?", metavar="NAME", help="print this preset, to be copied and edited")


def run(options: argparse.Namespace) -> int:
    """Run the program with these options; return the exit status."""
    return tell(options.name)


def tell(name: str | None) -> int:
    """List the presets, or print one as a file to be copied and edited."""
    if name is not None:
        print(builtin_text(one_of("feeds", name, builtin_names())), end="")
        return 0
    for each in builtin_names():
        preset = builtin_preset(each)
        console.print(Text.assemble((each, "bold"), f"  {described(preset)}"), soft_wrap=True)
        console.print(f"    {preset.sender}", soft_wrap=True)
    console.print(
        f"\nkinespace live --feed NAME uses one; kinespace feeds NAME > my{_ENDING} copies it for --feed my{_ENDING}.\n"
        "A sender on another machine: --osc-in 0.0.0.0:PORT. No packets: kinespace listen PORT.",
        soft_wrap=True,
    )
    return 0


def described(preset: Preset) -> str:
    """Describe a preset in a line: its port, its number of joints, its rate and its product."""
    return f"port {preset.port}, {len(preset.joints)} joints, some {preset.rate:g} Hz: {preset.product}"


def preset_named(text: str) -> Preset:
    """Load a preset by its name, or from a user's file, which ends in .toml.

    Raises
    ------
    ValueError
        There is none of that name, or something in the file is wrong; the message begins with `--feed` or the file.
    OSError
        The file cannot be read.
    """
    if text.casefold().endswith(_ENDING):
        return load_preset(Path(text))
    return builtin_preset(one_of("--feed", text, builtin_names(), f" or a {_ENDING} file"))
