"""`python tests/tools/bench/against.py COMMIT`: costs of `bench stages` over another version's, by turns."""

import json
import os
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kinespace.tools.cli.console import console, progress, table_of
from kinespace.tools.programs.bench import COSTS, Measurement, shown

#: Turns of each version, and draws of turns from which an interval is taken.
TURNS, _DRAWS = 6, 2000
#: The folder of this version's sources.
_HERE = Path(__file__).parents[3]
_MEASURE = "import sys; from kinespace.tools.cli.entry import main; sys.argv[1:]=['bench', 'stages', '--json']; main()"


def measure(commit: str) -> Measurement:
    """Measure stages of both versions by turns; give the ratio of each figure with its 95 % interval.

    Raises
    ------
    OSError
        This version is not a checkout of the repository, git has no such commit, or pip cannot install it.
    """
    with tempfile.TemporaryDirectory(prefix="kinespace-") as folder:
        other = _installed(commit, Path(folder))
        turns = [(_figures(None), _figures(other)) for _ in progress(range(TURNS), "Turns", TURNS)]
    names = [name for name in COSTS if all(figures.get(name) for turn in turns for figures in turn)]
    rows, ratios = [], dict[str, float]()
    for name in names:
        ours, theirs = (np.array([turn[which][name] for turn in turns], dtype=np.float64) for which in (0, 1))
        ratios[f"{name}_ratio"], low, high = _ratio(ours, theirs)
        middle = f"{ratios[f'{name}_ratio']:.2f} ({low:.2f} to {high:.2f})"
        rows.append((name, shown(float(np.median(theirs)), 1), shown(float(np.median(ours)), 1), middle))
    title = f"This version against {commit}, medians of {TURNS} turns"
    return Measurement(ratios, [table_of(title, ("", "before", "now", "ratio (95 %)"), rows)])


def _ratio(ours: NDArray[np.float64], theirs: NDArray[np.float64]) -> tuple[float, float, float]:
    """Give the median ratio of turns, and the interval of such medians of turns drawn again."""
    ratios = ours / theirs
    drawn = np.median(np.random.default_rng(0).choice(ratios, (_DRAWS, len(ratios))), axis=1)
    low, high = np.quantile(drawn, (0.025, 0.975))
    return float(np.median(ratios)), float(low), float(high)


def _figures(place: Path | None) -> dict[str, float]:
    """Measure in a process of its own, with the packages at a place, or else with these; one thread."""
    environment = dict(os.environ, OPENBLAS_NUM_THREADS="1") | ({"PYTHONPATH": f"{place}"} if place else {})
    figures: dict[str, float] = json.loads(_called([sys.executable, "-c", _MEASURE], environment=environment))
    return figures


def _installed(commit: str, folder: Path) -> Path:
    """Install a commit's packages, with compiled loops where a compiler is, and without what they need."""
    sources = folder / "sources"
    archive = _called(["git", "-C", f"{_HERE}", "archive", f"{commit}^{{commit}}"])
    with tarfile.open(fileobj=BytesIO(archive)) as files:
        files.extractall(sources, filter="data")
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps"]
    _called([*pip, "--target", f"{folder / 'packages'}", f"{sources}"])
    return folder / "packages"


def _called(command: Sequence[str], *, environment: dict[str, str] | None = None) -> bytes:
    # S603: every argument is ours, but for the commit, which git alone reads.
    done = subprocess.run(command, env=environment, capture_output=True, check=False)
    if done.returncode:
        last = done.stderr.decode(errors="replace").strip().splitlines()
        raise OSError(f"{' '.join(command[:3])}: {last[-1] if last else 'failed'}")
    return done.stdout


if __name__ == "__main__":
    for each in measure(sys.argv[1]).tables:
        console.print(each)
