"""`make chaos`: attacks and faults, one after the other, and their effect on a performer."""

import argparse
import sys
from collections.abc import Sequence

from chaos.trial import Outcome, tried
from chaos.trials import TRIALS

from kinespace.tools.cli.console import progress
from kinespace.tools.programs import bench
from kinespace.tools.programs.bench import machine

_HEADINGS = (
    *("what goes wrong", "answers / expected", "p99 before, ms", "p99, ms", "MB before / most / after", "s to recover"),
    "counted",
)


def table(outcomes: Sequence[Outcome]) -> str:
    """Give a row for each trial, in Markdown."""
    rule = ["---", *["---:"] * (len(_HEADINGS) - 2), "---"]
    return "\n".join("| " + " | ".join(each) + " |" for each in (_HEADINGS, rule, *(each.row for each in outcomes)))


def main() -> int:
    """Run the trials; return the exit status: 1 when the recogniser ended by itself."""
    parser = argparse.ArgumentParser(
        prog="make chaos",
        description="Runs kinespace live and an innocent performer, attacks them in one way after the other, and "
        "prints the effect on the performer's answers and on the program. Takes eight minutes and loads the machine.",
    )
    parser.add_argument("--seconds", type=float, default=5.0, help="seconds of each attack (default %(default)s)")
    parser.add_argument("--only", default="", metavar="TEXT,...", help="only trials whose names contain one of these")
    options = parser.parse_args()
    wanted = [each for each in TRIALS if any(text in each.name for text in options.only.split(","))]
    positions = bench.positions()
    outcomes = [tried(each, options.seconds, positions) for each in progress(wanted, "Trials", len(wanted))]
    print(f"{table(outcomes)}\n\n{machine()}")  # noqa: T201 - a program's output
    return 0 if all(each.ended == 0 for each in outcomes) else 1


if __name__ == "__main__":
    sys.exit(main())
