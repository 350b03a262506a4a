"""The page about `--json` names every program with this option, and every key of programs that print a dataclass."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from kinespace.tools.chaos.trial import Outcome
from kinespace.tools.cli.main import EXPERIMENTS, PROGRAMS, whole_parser
from kinespace.tools.evaluation.evaluate_faults import FaultScore
from kinespace.tools.evaluation.evaluate_noise import NoiseScore
from kinespace.tools.evaluation.evaluate_progress import ProgressScore
from kinespace.tools.evaluation.evaluate_teach import TeachScore
from kinespace.tools.evaluation.scoring.stream_score import StreamScore

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


@pytest.mark.parametrize(
    ("program", "score"),
    [
        ("evaluate stream", StreamScore),
        ("evaluate noise", NoiseScore),
        ("evaluate faults", FaultScore),
        ("evaluate teach", TeachScore),
        ("evaluate progress", ProgressScore),
        ("chaos", Outcome),
    ],
)
def test_every_figure_is_in_its_row(program: str, score: type) -> None:
    """Each field of what a program prints stands in its row."""
    assert [each.name for each in fields(score) if f"`{each.name}`" not in ROWS[program]] == []
