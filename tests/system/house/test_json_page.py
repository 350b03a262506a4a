"""The page about `--json` names every program with this option; `test_experiments` compares the evaluations' keys."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from kinespace.tools.cli.main import EXPERIMENTS, PROGRAMS, whole_parser

if TYPE_CHECKING:
    import argparse

PAGE = (Path(__file__).parents[3] / ".github/docs/json.md").read_text(encoding="utf-8")
ROWS = {line.split("|")[1].strip().strip("`"): line for line in PAGE.splitlines() if line.startswith("| `")}


def _programs(parser: argparse.ArgumentParser, before: str = "") -> dict[str, argparse.ArgumentParser]:
    found = {}
    for action in parser._actions:  # noqa: SLF001 - argparse lists its actions nowhere else
        for name, program in (action.choices or {}).items() if isinstance(action.choices, dict) else ():
            found |= {before + name: program} | _programs(program, f"{before}{name} ")
    return found


def test_every_program_with_json_has_a_row() -> None:
    """The rows are those of the programs that take `--json`, no more and no less."""
    programs = _programs(whole_parser())
    assert len(programs) == len(PROGRAMS) + len(EXPERIMENTS)
    assert {name for name, each in programs.items() if "--json" in each.format_help()} == set(ROWS)
