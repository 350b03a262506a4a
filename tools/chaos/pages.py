"""The tables of the trials in pages: all of them, and the worst of them."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.tools.chaos.trial import Outcome

HEADINGS = (
    *("what goes wrong", "answers / expected", "p99 before, ms", "p99, ms", "MB before / most / after", "s to recover"),
    "counted",
)
#: The place of a table in a page: a comment that says which, the table, and a comment that ends it.
_PLACE = re.compile(r"(<!-- chaos: (all|worst) -->\n).*?(<!-- end -->)", re.DOTALL)
#: The rows of the short table, and its columns.
_WORST, _SHORT = 4, (0, 1, 3, 4, 5)
#: The goals: the answers' 99th percentile, seconds; megabytes more than before; seconds to recover; and the share of
#: the answers that may be missing.
_P99, _MEGABYTES, _RECOVERED, _MISSING = 0.02, 50.0, 1.0, 0.01


def row(outcome: Outcome) -> list[str]:
    """Describe a trial, a text for each heading."""
    ended = "" if outcome.ended == 0 else f" ENDED with {outcome.ended}"
    noticed = "" if outcome.noticed is None else f" (noticed after {outcome.noticed:.2f} s)"
    return [
        outcome.name + noticed + ended,
        f"{outcome.answered} / {outcome.expected}",
        _milliseconds(outcome.p99_before),
        _milliseconds(outcome.p99),
        " / ".join(f"{megabytes:.0f}" for megabytes in outcome.memory),
        "never" if math.isinf(outcome.recovered) else f"{outcome.recovered:.1f}",
        outcome.told + (f"; {outcome.stale} answers came more than 1 s late" if outcome.stale else ""),
    ]


def with_tables(page: str, outcomes: Sequence[Outcome], machine: str) -> str:
    """Give a page with new tables in the places that its comments mark.

    Parameters
    ----------
    page
        The page's text.
    outcomes
        The results of the trials.
    machine
        Where they ran, in a line.

    Raises
    ------
    ValueError
        The page has no such place.
    """
    if not _PLACE.search(page):
        raise ValueError("--write: expected a page with <!-- chaos: all --> or <!-- chaos: worst -->, and <!-- end -->")

    def made(place: re.Match[str]) -> str:
        if place[2] == "all":
            return f"{place[1]}\n{_markdown(outcomes)}\n\n{machine}.\n\n{place[3]}"
        below = f"The worst of {len(outcomes)} attacks and faults (`make chaos`; {machine})."
        return f"{place[1]}{_markdown(worst(outcomes), _SHORT)}\n\n{below}\n{place[3]}"

    return _PLACE.sub(made, page)


def worst(outcomes: Sequence[Outcome]) -> list[Outcome]:
    """Choose the trials that come nearest to a goal, or are farthest beyond one, the worst first."""
    return sorted(outcomes, key=_badness, reverse=True)[:_WORST]


def _badness(outcome: Outcome) -> float:
    """Say how many times a goal was missed: the answers, their latency, the memory, or the recovery."""
    missing = 1 - outcome.answered / outcome.expected if outcome.expected else 1.0
    before, _, after = outcome.memory
    shares = (missing / _MISSING, outcome.p99 / _P99, (after - before) / _MEGABYTES, outcome.recovered / _RECOVERED)
    return max(share for share in shares if not math.isnan(share))


def _markdown(outcomes: Sequence[Outcome], columns: Sequence[int] = range(len(HEADINGS))) -> str:
    rows = [HEADINGS, ["---:" if 0 < k < len(HEADINGS) - 1 else "---" for k in range(len(HEADINGS))]]
    rows += map(row, outcomes)
    return "\n".join("| " + " | ".join(each[k] for k in columns) + " |" for each in rows)


def _milliseconds(seconds: float) -> str:
    return "-" if math.isnan(seconds) else f"{seconds * 1000:.1f}"
