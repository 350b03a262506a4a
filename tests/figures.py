"""The figures of recognition and retrieval, kept in `figures.toml`.

`make figures` runs every evaluation, which takes minutes, and says what has fallen; the tests measure the quickest.
After a change that is meant to move them:

    make figures FIGURES=--update

writes what came out in place of the old values. A run (the arguments of `kinespace evaluate`), a figure of another
name, its tolerance (less than a listener would notice, more than another processor's rounding moves it) and its
direction are written into the file by hand. Runs ask some of the persons, and "progress" some of the motions: all of
them take minutes longer, and a change that makes recognition worse shows in these as well. Names of evaluations measure
only those (`FIGURES="teach --update"`). The takes are found as the tests find them: in `shared/data` beside the
repository, or where KINESPACE_DATA says. Look at the difference before you commit it: it is the change's price.
"""

import argparse
import io
import json
import os
import shlex
import sys
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any, NamedTuple

FILE = Path(__file__).with_name("figures.toml")

#: The evaluations that the tests measure, too.
QUICK = ("done_by_one", "retrieval_raw_split")


class Figure(NamedTuple):
    """An expected figure, how far it may fall, and whether higher or lower is better."""

    value: float
    tolerance: float
    direction: str

    def holds(self, got: float | None) -> bool:
        """Say whether a new value is no worse than the figure may be; a missing value is worse."""
        if got is None:
            return False
        worse = self.value - got if self.direction == "higher" else got - self.value
        return worse <= self.tolerance


Figures = dict[str, dict[str, Figure]]
_KEPT: dict[str, dict[str, Any]] = tomllib.loads(FILE.read_text(encoding="utf-8"))
#: The arguments of `kinespace evaluate` for each evaluation, as a line; `{data}` is the folder of recordings.
RUNS: dict[str, str] = {run: entries.pop("run") for run, entries in _KEPT.items()}


def measured(line: str, names: Iterable[str], data: Path | None) -> dict[str, float]:
    """Run one evaluation as a person would, on the recordings of a folder; give the figures that there are.

    A figure's name says where it stands in the JSON object: `mean.nearest` is "nearest" in "mean", `faults.0.x` is "x"
    in the first of "faults".
    """
    from kinespace.tools.cli.main import main  # noqa: PLC0415 - as a script this file first has to find the project

    printed = io.StringIO()
    arguments = [argument.replace("{data}", str(data)) for argument in shlex.split(line)]
    with redirect_stdout(printed):
        status = main(["evaluate", *arguments, "--json"])
    if status:
        raise RuntimeError(f"{' '.join(arguments)}: ended with {status}")
    values = json.loads(printed.getvalue())
    return {name: value for name in names if (value := _looked_up(values, name)) is not None}


def _looked_up(values: Any, name: str) -> float | None:  # noqa: ANN401 - JSON
    for part in name.split("."):
        values = values[int(part)] if isinstance(values, list) else values[part]
    return None if values is None else float(values)


def expected() -> Figures:
    """Read the expected figures."""
    return {run: {name: Figure(**entry) for name, entry in figures.items()} for run, figures in _KEPT.items()}


def fallen(run: str, figures: Mapping[str, Figure], got: Mapping[str, float]) -> list[str]:
    """Give for each figure that is worse than it may be its name, its expected value and its new value."""
    return [
        f"{run}.{name}: expected {figure.value:.4f} ({figure.direction} is better, tolerance {figure.tolerance}), "
        f"got {f'{got[name]:.4f}' if name in got else 'none'}"
        for name, figure in figures.items()
        if not figure.holds(got.get(name))
    ]


def written(figures: Figures, got: Mapping[str, Mapping[str, float]]) -> str:
    """Write figures as TOML, those that were measured with their new values."""
    lines = ["# `python tests/figures.py --update` writes the values; all else is written by hand."]
    for run, entries in figures.items():
        lines += ["", f"[{run}]", f'run = "{RUNS[run]}"']
        for name, (old, tolerance, direction) in entries.items():
            key = f'"{name}"' if "." in name else name
            value = got.get(run, {}).get(name, old)
            lines.append(f'{key} = {{ value = {value:.6f}, tolerance = {tolerance}, direction = "{direction}" }}')
    return "\n".join(lines) + "\n"


def _main(arguments: Sequence[str] | None = None) -> int:
    root = FILE.parents[1]
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("runs", nargs="*", metavar="RUN", help="default: all")
    parser.add_argument("--update", action="store_true", help="write what comes out to figures.toml")
    parsed = parser.parse_args(arguments)
    if absent := [name for name in parsed.runs if name not in RUNS]:
        parser.error(f"expected some of {', '.join(RUNS)}, got {absent[0]}")
    data = Path(os.environ.get("KINESPACE_DATA") or root.parent / "shared" / "data")
    figures, got, fell = expected(), dict[str, dict[str, float]](), list[str]()
    for name in parsed.runs or RUNS:
        got[name] = measured(RUNS[name], figures[name], data)
        fell += fallen(name, figures[name], got[name])
        print(name, got[name], flush=True)  # noqa: T201 - it is asked for
    if parsed.update:
        FILE.write_text(written(figures, got), encoding="utf-8")
    print("\n".join(fell) or "no figure has fallen")  # noqa: T201 - it is asked for
    return 0 if parsed.update or not fell else 1


if __name__ == "__main__":
    sys.exit(_main())
