"""`kinespace feeds`: lists the products whose messages kinespace understands, and their settings."""

import argparse

from rich.text import Text

from kinespace.stream.feeds import builtin_names, builtin_preset
from kinespace.tools.cli.arguments import preset_named
from kinespace.tools.cli.console import say


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.add_argument("name", nargs="?", metavar="NAME", help="check this preset, or file, and print it for a copy")


def run(options: argparse.Namespace) -> None:
    """List the presets, or check one and print it as a file to be copied and edited."""
    if options.name is not None:
        print(preset_named(options.name).text, end="")
        return
    for each in builtin_names():
        preset = builtin_preset(each)
        described = f"port {preset.port}, {len(preset.joints)} joints, some {preset.rate:g} Hz: {preset.product}"
        say(Text.assemble((each, "bold"), f"  {described}"))
        say(f"    {preset.sender}")
    say(
        "\nkinespace live --feed NAME uses one; kinespace feeds NAME > my.toml copies it for --feed my.toml.\n"
        "A sender on another machine: --osc-in 0.0.0.0:PORT. No packets: kinespace listen PORT."
    )
