"""`kinespace feeds`: lists the products whose messages kinespace understands, and their settings."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.text import Text

from kinespace.stream.feeds import PresetError, builtin_names, builtin_preset
from kinespace.tools.cli.preset import preset_named
from kinespace.tools.terminal.console import console

if TYPE_CHECKING:
    import argparse

    from kinespace.stream.feeds import Preset


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.add_argument(
        "name", nargs="?", metavar="NAME", help="check this preset, or file, and print it, to be copied and edited"
    )


def run(options: argparse.Namespace) -> int:
    """List the presets, or check one and print it as a file to be copied and edited; return the exit status.

    Raises
    ------
    PresetError
        A preset is wrong; the others are listed before.
    """
    name = options.name
    if name is not None:
        print(preset_named(name).text, end="")
        return 0
    broken = []
    for each in builtin_names():
        try:
            preset = builtin_preset(each)
        except PresetError as error:
            broken.append(str(error))
            continue
        console.print(Text.assemble((each, "bold"), f"  {described(preset)}"), soft_wrap=True)
        console.print(f"    {preset.sender}", soft_wrap=True)
    console.print(
        "\nkinespace live --feed NAME uses one; kinespace feeds NAME > my.toml copies it for --feed my.toml.\n"
        "A sender on another machine: --osc-in 0.0.0.0:PORT. No packets: kinespace listen PORT.",
        soft_wrap=True,
    )
    if broken:
        raise PresetError("; ".join(broken))
    return 0


def described(preset: Preset) -> str:
    """Describe a preset in a line: its port, its number of joints, its rate and its product."""
    return f"port {preset.port}, {len(preset.joints)} joints, some {preset.rate:g} Hz: {preset.product}"
