"""The figures of live recognition on real takes, kept in `figures.toml` and measured anew by its test.

After a change that is meant to move them:

    python tests/figures.py --update

runs every evaluation and writes what came out in place of the old values; tolerances and directions stay as they are.
Without `--update` it says what has fallen. The takes are found as the tests find them: in `shared/data/cmu` beside the
repository, or where KINESPACE_DATA says. Look at the difference before you commit it: it is the change's price.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import sys
import tomllib
from contextlib import redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Mapping

FILE = Path(__file__).with_name("figures.toml")
_OWN_TAKES = ("13_29.amc", "13_30.amc", "13_31.amc")
_NAMES = ("Squat=squat1Reps", "ArmCircle=rotateArmsBothBackward1Reps", "Jog=jogLeftCircle4StepsRstart")
#: Takes and options of each evaluation.
RUNS: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    f"{name}_{signature}": (takes, ("--signature", signature, *options))
    for signature in ("windows", "eigenvector")
    for name, takes, options in (
        ("own_takes", _OWN_TAKES, ("--protocol", "leave-one-take-out")),
        ("builtin", (*_OWN_TAKES, "86_01.amc"), ("--map", *_NAMES)),
    )
} | {
    f"builtin_{skeleton}": ((*_OWN_TAKES, "86_01.amc"), ("--map", *_NAMES, "--skeleton", skeleton))
    for skeleton in ("qtm", "osceleton", "vrchat")
}
#: Which way is better, and how far the other way a figure may go: less than a listener would notice, more than another
#: processor's rounding moves it.
KINDS: Mapping[str, tuple[str, float]] = {
    "frame_accuracy": ("higher", 0.02),
    "segment_accuracy": ("higher", 0.02),
    "known_answered": ("higher", 0.03),
    "segments_found": ("higher", 0.05),
    "median_delay_s": ("lower", 0.1),
    "p90_delay_s": ("lower", 0.2),
    "median_seen": ("lower", 0.05),
    "median_event_delay_s": ("lower", 0.1),
    "false_per_minute": ("lower", 3.0),
    "unknown_answered": ("lower", 0.03),
    "changes_per_minute": ("lower", 2.0),
    "auc_unknown": ("higher", 0.02),
}


class Figure(NamedTuple):
    """What a figure was, how far it may fall, and which way is better: higher or lower."""

    value: float
    tolerance: float
    direction: str

    def holds(self, got: float | None) -> bool:
        """Say whether what came out is no worse than it may be; no figure at all is worse."""
        if got is None:
            return False
        worse = self.value - got if self.direction == "higher" else got - self.value
        return worse <= self.tolerance


Figures = dict[str, dict[str, Figure]]


def measured(run: str, folder: Path) -> dict[str, float]:
    """Run one evaluation as a person would, on the takes of a folder; the figures that there are."""
    from tools.cli import main  # noqa: PLC0415 - as a script this file first has to find the project

    takes, options = RUNS[run]
    printed = io.StringIO()
    with redirect_stdout(printed):
        status = main(["evaluate", "stream", *(str(folder / take) for take in takes), *options, "--json"])
    if status:
        raise RuntimeError(f"{run}: ended with {status}")
    score = json.loads(printed.getvalue())
    return {name: score[name] for name in KINDS if score[name] is not None}


def expected() -> Figures:
    """Read what the figures were."""
    with FILE.open("rb") as file:
        runs = tomllib.load(file)
    return {run: {name: Figure(**entry) for name, entry in figures.items()} for run, figures in runs.items()}


def fallen(run: str, figures: Mapping[str, Figure], got: Mapping[str, float]) -> list[str]:
    """Say of each figure that is worse than it may be its name, what was expected and what came out."""
    return [
        f"{run}.{name}: expected {figure.value:.4f} ({figure.direction} is better, tolerance {figure.tolerance}), "
        f"got {f'{got[name]:.4f}' if name in got else 'none'}"
        for name, figure in figures.items()
        if not figure.holds(got.get(name))
    ]


def written(before: Figures, got: Mapping[str, Mapping[str, float]]) -> str:
    """Write new values as TOML, with the tolerances and directions there were, or a new figure's usual ones."""
    lines = ["# Written by `python tests/figures.py --update`; tolerances and directions may be edited by hand."]
    for run, figures in got.items():
        lines += ["", f"[{run}]"]
        for name, value in figures.items():
            old = before.get(run, {}).get(name)
            direction, tolerance = (old.direction, old.tolerance) if old else KINDS[name]
            lines.append(f'{name} = {{ value = {value:.6f}, tolerance = {tolerance}, direction = "{direction}" }}')
    return "\n".join(lines) + "\n"


def _main() -> int:
    root = FILE.parents[1]
    sys.path.insert(0, str(root))
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--update", action="store_true", help="write what comes out to figures.toml")
    update = parser.parse_args().update
    folder = Path(os.environ.get("KINESPACE_DATA") or root.parent / "shared" / "data") / "cmu"
    before = expected() if FILE.exists() else {}
    got = {run: measured(run, folder) for run in RUNS}
    told = [line for run in RUNS for line in fallen(run, before.get(run, {}), got[run])]
    print("\n".join(told) or "no figure has fallen")  # noqa: T201 - it is asked for
    if update:
        FILE.write_text(written(before, got), encoding="utf-8")
        return 0
    return 1 if told else 0


if __name__ == "__main__":
    sys.exit(_main())
