"""The figures of recognition and retrieval, kept in `figures.toml`.

`make figures` runs every evaluation, which takes minutes, and says what has fallen; the tests measure the quick ones.
After a change that is meant to move them:

    make figures FIGURES=--update

writes what came out in place of the old values; tolerances and directions stay as they are. Names of evaluations
measure only those (`FIGURES="noise --update"`). The takes are found as the tests find them: in `shared/data` beside the
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
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

FILE = Path(__file__).with_name("figures.toml")

#: Which way is better, and how far the other way a figure may go: less than a listener would notice, more than another
#: processor's rounding moves it. By the last part of a figure's name.
KINDS: Mapping[str, tuple[str, float]] = {
    "frame_accuracy": ("higher", 0.02),
    "segment_accuracy": ("higher", 0.02),
    "segment_majority": ("higher", 0.03),
    "known_answered": ("higher", 0.03),
    "segments_found": ("higher", 0.05),
    "median_delay_s": ("lower", 0.1),
    "p90_delay_s": ("lower", 0.2),
    "median_seen": ("lower", 0.05),
    "median_event_delay_s": ("lower", 0.1),
    "false_per_minute": ("lower", 3.0),
    "false_starts_per_minute": ("lower", 0.5),
    "unknown_answered": ("lower", 0.03),
    "takes_found": ("higher", 0.03),
    "changes_per_minute": ("lower", 2.0),
    "auc_unknown": ("higher", 0.02),
    "answers_right": ("higher", 0.03),
    "answers_guessed": ("higher", 0.03),
    "clips_right": ("higher", 0.03),
    "clips_guessed": ("higher", 0.03),
    "nearest": ("higher", 0.01),
    "two_nearest": ("higher", 0.01),
    "mean": ("higher", 0.01),
    "worst": ("higher", 0.02),
    "phase_error": ("lower", 0.01),
    "within_tenth": ("higher", 0.03),
    "warped_error": ("lower", 0.01),
    "warped_within_tenth": ("higher", 0.03),
    "speed_octaves": ("lower", 0.05),
    "back_steps": ("lower", 0.01),
    "doubted": ("lower", 0.005),
    "same_first_right": ("higher", 0.03),
    "other_first_right": ("higher", 0.03),
    "right": ("higher", 0.03),
    "guessed": ("higher", 0.03),
    "wrong": ("lower", 0.02),
    "alarmed": ("lower", 0.9),
}
_OF_KNOWN = (
    *("frame_accuracy", "segment_accuracy", "segment_majority", "known_answered", "segments_found"),
    *("median_delay_s", "p90_delay_s", "median_seen", "median_event_delay_s", "changes_per_minute"),
)
_OF_UNKNOWN = ("unknown_answered", "false_per_minute", "false_starts_per_minute")
_OF_BOTH = (*_OF_KNOWN, *_OF_UNKNOWN, "auc_unknown", "doubted")
_OF_SENSOR = ("frame_accuracy", "segment_accuracy", "known_answered", "unknown_answered", "auc_unknown", "doubted")
_OF_PERSONS = tuple(
    f"{of}.{name}" for of in ("mean", "worst") for name in ("frame_accuracy", "segment_accuracy", "segment_majority")
)
_OF_NOISE = ("answers_right", "answers_guessed", "clips_right", "clips_guessed")
_OF_RETRIEVAL = ("nearest", "two_nearest")
_OF_PROGRESS = (
    *("phase_error", "within_tenth", "warped_error", "warped_within_tenth"),
    *("speed_octaves", "back_steps"),
)

_OWN_TAKES = tuple(f"{{data}}/cmu/13_{number}.amc" for number in (29, 30, 31))
_OTHERS_TAKES = (*_OWN_TAKES, "{data}/cmu/86_01.amc")
_NAMES = ("--map", "Squat=squat1Reps", "ArmCircle=rotateArmsBothBackward1Reps", "Jog=jogLeftCircle4StepsRstart")

# Some of the persons, and in "noise" and "progress" some of the motions: all of them take minutes longer, and a change
# that makes recognition worse shows in these as well.
_SOME_STRANGERS = ("02", "03", "05", "09", "35")
_SOME_PERSONS = tuple(
    f"{{data}}/utkinect/joints_s0{person}_e0{take}.txt" for person in range(1, 10, 2) for take in (1, 2)
)


class Run(NamedTuple):
    """One evaluation: the arguments of `kinespace evaluate` (`{data}` is the folder of recordings), and its figures.

    A figure's name says where it stands in the JSON object: `mean.nearest` is "nearest" in "mean", `noise.0.x` is "x"
    in the first of "noise".
    """

    arguments: tuple[str, ...]
    figures: tuple[str, ...]

    @property
    def needs_recordings(self) -> bool:
        """Whether it reads recordings, beside the built-in library."""
        return any("{data}" in argument for argument in self.arguments)


def _retrieval(signature: str, protocol: str, *figures: str) -> Run:
    return Run(("retrieval", "--signature", signature, "--protocol", protocol), (*_OF_RETRIEVAL, *figures))


#: The evaluations that the tests measure: one of each kind.
QUICK = ("own_takes", "builtin", "noise", "faults", "teach", "progress", "retrieval_spread_split")

RUNS: Mapping[str, Run] = {
    "own_takes": Run(("stream", *_OWN_TAKES, "--protocol", "leave-one-take-out"), _OF_KNOWN),
    "own_takes_paper": Run(
        ("stream", *_OWN_TAKES, "--protocol", "leave-one-take-out", "--signature", "paper"), _OF_KNOWN
    ),
    "builtin": Run(("stream", *_OTHERS_TAKES, *_NAMES), _OF_BOTH),
    "builtin_paper": Run(("stream", *_OTHERS_TAKES, *_NAMES, "--signature", "paper"), _OF_BOTH),
    **{
        f"builtin_{skeleton}": Run(("stream", *_OTHERS_TAKES, *_NAMES, "--skeleton", skeleton), _OF_BOTH)
        for skeleton in ("kinectv2", "osceleton")
    },
    "utkinect": Run(
        ("stream", *_SOME_PERSONS, "--protocol", "leave-one-person-out"), (*_OF_KNOWN, *_OF_PERSONS, "doubted")
    ),
    "strangers": Run(
        ("stream", "--takes", "{data}/cmu_takes/takes.csv", "--subjects", *_SOME_STRANGERS),
        (*_OF_UNKNOWN, "takes_found", "doubted"),
    ),
    **{
        sensor: Run(("stream", f"{{data}}/{sensor}/takes", "--actor-in", "name"), _OF_SENSOR)
        for sensor in ("uiprmd", "uiprmd_kinect", "kindergator")
    },
    "camera": Run(
        ("stream", "{data}/camera", "--actor-in", "name", "--map", "squat=squat1Reps", "run=jogLeftCircle4StepsRstart"),
        _OF_SENSOR,
    ),
    "noise": Run(
        ("noise", "--noise", "0", "20", "--groups", "3", "--every", "4"),
        tuple(f"noise.{index}.{name}" for index in range(2) for name in _OF_NOISE),
    ),
    "faults": Run(
        ("faults", "{data}/cmu/13_30.amc", *_NAMES[:2], "--fault", "left arm frozen", "none"),
        ("faults.0.right", "faults.0.guessed", "faults.0.wrong", "faults.1.right", "faults.1.alarmed"),
    ),
    "teach": Run(
        ("teach", "--teachers", "bd", "--draws", "1", "--examples", "1"), ("same_first_right.0", "other_first_right.0")
    ),
    "progress": Run(("progress", "--every", "16"), _OF_PROGRESS),
    **{
        f"retrieval_{signature}_{protocol}": _retrieval(signature, protocol)
        for signature in ("eigenvector", "spread")
        for protocol in ("leave-one-out", "actor-held-out")
    },
    **{
        f"retrieval_{signature}_split": _retrieval(signature, "split", "splits.mean", "splits.worst")
        for signature in ("eigenvector", "spread")
    },
}


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


def measured(run: Run, data: Path | None) -> dict[str, float]:
    """Run one evaluation as a person would, on the recordings of a folder; the figures that there are."""
    from kinespace.tools.cli.main import main  # noqa: PLC0415 - as a script this file first has to find the project

    printed = io.StringIO()
    arguments = [argument.replace("{data}", str(data)) for argument in run.arguments]
    with redirect_stdout(printed):
        status = main(["evaluate", *arguments, "--json"])
    if status:
        raise RuntimeError(f"{' '.join(arguments)}: ended with {status}")
    told = json.loads(printed.getvalue())
    return {name: value for name in run.figures if (value := _looked_up(told, name)) is not None}


def _looked_up(told: Any, name: str) -> float | None:  # noqa: ANN401 - JSON
    for part in name.split("."):
        told = told[int(part)] if isinstance(told, list) else told[part]
    return None if told is None else float(told)


def kind_of(name: str) -> tuple[str, float]:
    """Give the direction and the usual tolerance of a figure; a number in a list has its list's."""
    return KINDS[[part for part in name.split(".") if not part.isdecimal()][-1]]


def expected() -> Figures:
    """Read the expected figures."""
    with FILE.open("rb") as file:
        runs = tomllib.load(file)
    return {run: {name: Figure(**entry) for name, entry in figures.items()} for run, figures in runs.items()}


def fallen(run: str, figures: Mapping[str, Figure], got: Mapping[str, float]) -> list[str]:
    """Give for each figure that is worse than it may be its name, its expected value and its new value."""
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
            direction, tolerance = (old.direction, old.tolerance) if old else kind_of(name)
            key = f'"{name}"' if "." in name else name
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
    before = expected() if FILE.exists() else {}
    told, kept = list[str](), {name: {k: each.value for k, each in before[name].items()} for name in before}
    for name in parsed.runs or RUNS:
        kept[name] = measured(RUNS[name], data)
        told += fallen(name, before.get(name, {}), kept[name])
        print(name, kept[name], flush=True)  # noqa: T201 - it is asked for
        if parsed.update:
            FILE.write_text(written(before, {run: kept[run] for run in RUNS if run in kept}), encoding="utf-8")
    print("\n".join(told) or "no figure has fallen")  # noqa: T201 - it is asked for
    return 0 if parsed.update or not told else 1


if __name__ == "__main__":
    sys.exit(_main())
