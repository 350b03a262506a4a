"""Change one line of the product at random, run the tests that reach it, and see whether one fails.

`python tests/system/house/mutations.py --room library/windows --count 40` works in copies of the tree, not in it.
First it runs the tests once, and notes which lines each test reaches and how long it takes (`pip install coverage`);
`--reached FILE` keeps these notes for the next run. For a change it runs the tests that reach its line: those of the
file's own folder first, then the others, the fastest first. A change that makes tests hang, or takes all memory, is
found.
"""

import argparse
import ast
import collections
import copy
import json
import os
import queue
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

ROOT = Path(__file__).resolve().parents[3]
_PAIRS = (ast.Lt, ast.LtE), (ast.Gt, ast.GtE), (ast.Eq, ast.NotEq), (ast.Is, ast.IsNot), (ast.In, ast.NotIn)
_PAIRS_TOO = (ast.And, ast.Or), (ast.Add, ast.Sub), (ast.Mult, ast.Div), (ast.USub, ast.UAdd)
_SWAPS = {each: other for pair in (*_PAIRS, *_PAIRS_TOO) for each, other in (pair, pair[::-1])}
#: The tests that are run once, with what they reach in a process of their own left out.
_TESTS = "tests/library", "tests/stream", "tests/system", "tests/tools/programs", "--ignore=tests/system/house"
_PLUGINS = "-p", "no:randomly", "-p", "no:cacheprovider"
_ROOMS = "library", "stream"
#: Seconds of the tests of other folders that a change is tried with, as they took when they were noted.
_SECONDS = 30.0
_NOT_COPIED = ".venv", ".git", "*_cache", "build", "__pycache__", "*.egg-info"
#: Bytes of memory that tests may take.
_MEMORY = 8 << 30


class Mutant(NamedTuple):
    """A change: the file, relative to the tree, the line, the change in words, and the file's new text."""

    path: Path
    line: int
    change: str
    text: bytes


def _changed(node: ast.AST) -> str | None:
    """Give the text of a changed node; None where it is not changed."""
    if isinstance(node, ast.Constant) and isinstance(node.value, (bool, int, float)):
        value = node.value
        return str(not value if isinstance(value, bool) else value * 1.5 + 1e-3 if value % 1 else value + 1)
    if isinstance(node, ast.Return) and node.value is not None and ast.unparse(node.value) != "None":
        return "return None"
    if isinstance(node, (ast.AugAssign, ast.Raise)) or (
        isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)
    ):
        return "pass"
    name = "ops" if isinstance(node, ast.Compare) else "op"
    operators = getattr(node, name, None)
    swapped = _SWAPS.get(type(operators[0] if isinstance(operators, list) else operators))
    if swapped is None or isinstance(node, ast.AugAssign):
        return None
    other = copy.deepcopy(node)
    setattr(other, name, [swapped(), *operators[1:]] if isinstance(operators, list) else swapped())
    return f"({ast.unparse(other)})"


def _candidates(tree: ast.AST) -> list[tuple[ast.AST, str]]:
    """List the nodes that can be changed, with their new text: none that only types, decorators or texts contain."""
    words = (
        ast.unparse(getattr(tree, "test", getattr(tree, "func", ast.Pass())))
        if isinstance(tree, (ast.If, ast.Call))
        else ""
    )
    if isinstance(tree, ast.JoinedStr) or words in {"TYPE_CHECKING", "field"} or getattr(tree, "arg", "") == "strict":
        return []  # what only types, representations and doubled checks see
    found = (
        [(tree.test, f"(not ({ast.unparse(tree.test)}))")] if isinstance(tree, (ast.If, ast.IfExp, ast.While)) else []
    )
    if isinstance(tree, (ast.stmt, ast.expr)) and (changed := _changed(tree)) is not None:
        found.append((tree, changed))
    for name, field in ast.iter_fields(tree):
        if name not in {"annotation", "returns", "decorator_list"}:
            for child in field if isinstance(field, list) else [field]:
                found += _candidates(child) if isinstance(child, ast.AST) else []
    return found


def mutants(paths: list[Path], count: int, seed: int) -> list[Mutant]:
    """Choose changes of different lines, each line alike."""
    chance, lines, chosen = np.random.default_rng(seed), collections.defaultdict(list), []
    for path in paths:
        for node, changed in _candidates(ast.parse(path.read_bytes())):
            lines[path, node.lineno].append((node, changed))  # type: ignore[attr-defined]
    there = sorted(lines)
    for path, line in (there[place] for place in chance.permutation(len(there))[:count]):
        node, changed = lines[path, line][chance.integers(len(lines[path, line]))]
        text = path.read_bytes()
        rows = [0, *(place + 1 for place, byte in enumerate(text) if byte == ord("\n"))]
        begin, end = rows[node.lineno - 1] + node.col_offset, rows[node.end_lineno - 1] + node.end_col_offset
        change = f"{' '.join(text[begin:end].decode().split())[:70]}  ->  {' '.join(changed.split())[:70]}"
        chosen.append(Mutant(path.relative_to(ROOT), line, change, text[:begin] + changed.encode() + text[end:]))
    return chosen


class Reached(NamedTuple):
    """What tests reach: seconds by test; and by file, relative to the tree, and line, the tests."""

    seconds: dict[str, float]
    lines: dict[str, dict[str, list[str]]]

    def by(self, mutant: Mutant) -> tuple[list[str], list[str]]:
        """Give the tests of a change's folder and the other tests that reach it; for a constant, all of its file."""
        lines, own = self.lines.get(str(mutant.path), {}), f"tests/{mutant.path.parent}/"
        tests = {*(lines.get(str(mutant.line)) or (each for of_line in lines.values() for each in of_line))}
        # What a test reaches in a process of its own is not seen.
        tests |= {each for each in self.seconds if each.startswith(f"{own}test_{mutant.path.stem}.py")}
        ordered = sorted(tests, key=self.seconds.__getitem__)
        near, others = ([each for each in ordered if each.startswith(own) is is_near] for is_near in (True, False))
        return near, others[: int((np.cumsum([self.seconds[each] for each in others]) < _SECONDS).sum())]


_seconds: collections.defaultdict[str, float] = collections.defaultdict(float)
_failed: set[str] = set()


def pytest_runtest_logstart(nodeid: str) -> None:
    """Note, where this file is a plugin of pytest, the lines from here on for another test."""
    _current().switch_context(nodeid)


def pytest_runtest_logreport(report: Any) -> None:  # noqa: ANN401 - pytest's
    """Add the seconds of a part of a test; a test that fails without a change finds nothing."""
    _seconds[report.nodeid] += report.duration
    if report.failed:
        _failed.add(report.nodeid)


def pytest_sessionfinish() -> None:
    """Write what was reached."""
    measured = _current()
    measured.stop()
    found, lines = measured.get_data(), {}
    for file in found.measured_files():
        by_line = {
            line: [each for each in tests if each and each not in _failed]
            for line, tests in found.contexts_by_lineno(file).items()
        }
        path = Path(file).resolve().relative_to(ROOT)
        lines[str(path)] = {line: tests for line, tests in by_line.items() if tests}
    seconds = {test: each for test, each in _seconds.items() if test not in _failed}
    Path(os.environ["REACHED"]).write_text(json.dumps((seconds, lines)))


def _current() -> Any:  # noqa: ANN401 - coverage has its own
    import coverage  # noqa: PLC0415 - only here

    return coverage.Coverage.current()


def _reached(tree: Path, kept: Path, quick: list[str]) -> Reached:
    """Run the tests in a copy and note what they reach, unless it is kept."""
    if not kept.exists():
        included = f"--include={','.join(f'{tree}/packages/kinespace/{room}/*' for room in _ROOMS)}"
        run = [sys.executable, "-m", "coverage", "run", "--rcfile=/dev/null", f"--data-file={tree}/.coverage", included]
        command = [*run, "-m", "pytest", "-q", "-p", "system.house.mutations", *_PLUGINS, *_TESTS, *quick]
        subprocess.run(command, cwd=tree, env=_environment(tree) | {"REACHED": str(kept.resolve())}, check=False)
    return Reached(*json.loads(kept.read_text()))


def _environment(tree: Path) -> dict[str, str]:
    paths = os.pathsep.join(str(tree / each) for each in ("packages", "tests"))
    data = {"KINESPACE_DATA": str(ROOT.parent / "shared" / "data")} | os.environ
    return data | {"PYTHONPATH": paths, "OPENBLAS_NUM_THREADS": "1"}


def _copied(folder: Path) -> Path:
    """Copy the tree, and lay its packages out as they are installed."""
    shutil.copytree(ROOT, folder, ignore=shutil.ignore_patterns(*_NOT_COPIED))
    package = folder / "packages" / "kinespace"
    package.mkdir(parents=True)
    for part in (
        *(folder / "tools" / "front").glob("*.py"),
        *(folder / name for name in ("library", "stream", "tools")),
    ):
        (package / part.name).symlink_to(part)
    return folder


def _passes(tree: Path, tests: list[str], seconds: float) -> bool:
    """Say whether tests pass in a copy, in time; no process is left."""
    listed = tree / "listed"
    listed.write_text("\n".join(tests))
    process = subprocess.Popen(
        [sys.executable, "-m", "pytest", "-x", "-q", *_PLUGINS, f"@{listed}"],
        cwd=tree,
        env=_environment(tree),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY)),  # noqa: PLW1509 - no lock is held
    )
    try:
        return process.wait(seconds) == 0
    except subprocess.TimeoutExpired:
        return False
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def _found(mutant: Mutant, trees: queue.Queue[Path], reached: Reached) -> bool:
    """Try a change in one of the copies."""
    tree = trees.get()
    file = tree / mutant.path
    before = file.read_bytes()
    try:
        file.write_bytes(mutant.text)
        # Compiled modules are known by their time: another one for each change.
        os.utime(file, ns=(time.time_ns(), time.time_ns()))
        sets = [each for each in reached.by(mutant) if each]
        return not all(_passes(tree, each, 120 + 10 * sum(map(reached.seconds.__getitem__, each))) for each in sets)
    finally:
        file.write_bytes(before)
        trees.put(tree)


def main() -> int:
    """Run, and print the share that was found of each room, and what was not found."""
    parser = argparse.ArgumentParser(description=__doc__)
    for name, usual in (("count", 30), ("seed", 1), ("jobs", 1)):
        parser.add_argument(f"--{name}", type=int, default=usual)
    parser.add_argument("--reached", type=Path, help="a file of what the tests reach, made if it is not there")
    parser.add_argument("--quick", action="store_true", help="without the tests that are slow")
    parser.add_argument("--room", action="append", help="a folder or file of library or stream; by default both")
    options = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("ended"))
    rooms = [ROOT / room for room in options.room or _ROOMS]
    paths = sorted({each for room in rooms for each in ([room] if room.is_file() else room.rglob("*.py"))})
    chosen, trees = mutants(paths, options.count, options.seed), queue.Queue[Path]()
    by_room = collections.defaultdict[str, list[bool]](list)
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(options.jobs) as pool:
        for job in range(options.jobs):
            trees.put(_copied(Path(folder) / str(job)))
        kept = options.reached or Path(folder) / "reached.json"
        reached = _reached(Path(folder) / "0", kept, ["-m", "not slow"] if options.quick else [])
        results = pool.map(lambda each: _found(each, trees, reached), chosen)
        for mutant, found in zip(chosen, results, strict=True):
            by_room[str(mutant.path.parent)].append(found)
            print(f"{'found    ' if found else 'NOT FOUND'} {mutant.path}:{mutant.line}  {mutant.change}", flush=True)  # noqa: T201
    every = [each for own in by_room.values() for each in own]
    for room, found in [*sorted(by_room.items()), ("all", every)]:
        print(f"{room:36} {sum(found):4} of {len(found):4} found")  # noqa: T201
    return 0 if all(every) else 1


if __name__ == "__main__":
    sys.exit(main())
