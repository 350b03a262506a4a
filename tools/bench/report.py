"""What a part of the bench is asked for and gives: a plan; figures by name, and tables."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from kinespace.tools.terminal.tables import narrow_table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.table import Table


class Plan(NamedTuple):
    """How long and how much is played: seconds of each run over sockets, and the number of performers of scale."""

    seconds: float
    crowd: int


class Measured(NamedTuple):
    """The results of a part: its figures by name, NaN for a figure that was not measured, and its tables."""

    figures: dict[str, float]
    tables: list[Table]


def rounded(value: float) -> float | int | None:
    """Keep four digits, because more would be noise; None for NaN and infinity."""
    if isinstance(value, int):
        return value
    return float(f"{value:.4g}") if math.isfinite(value) else None


def shown(value: float, digits: int = 0) -> str:
    """Write a number with so many digits after the point; a dash for a number that was not measured."""
    return "-" if math.isnan(value) else f"{value:,.{digits}f}"


def table(title: str, names: Sequence[str], figures: Sequence[str]) -> Table:
    """Make a table for 80 characters: where it does not fit, names break into lines, figures never."""
    made = narrow_table(title)
    for name in names:
        made.add_column(name)
    for figure in figures:
        made.add_column(figure, justify="right", no_wrap=True)
    return made
