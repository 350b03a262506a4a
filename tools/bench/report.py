"""What a part of the bench is asked for and gives: a plan; figures by name, and tables."""

from __future__ import annotations

import math
from typing import NamedTuple

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
    """Write a number with some digits after the point; a dash for a number that was not measured."""
    return "-" if math.isnan(value) else f"{value:,.{digits}f}"
