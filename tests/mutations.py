"""Change one line of the product at random, run the tests that mirror it, and see whether they find the change.

`python tests/mutations.py --room library/windows --count 40` works in copies of the tree, not in the tree itself.
All tests that will run must pass without a change first. A change that makes tests hang, or takes all memory, is found.
"""

from __future__ import annotations

import argparse
import ast
import collections
import copy
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
from typing import NamedTuple

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
_PAIRS = (ast.Lt, ast.LtE), (ast.Gt, ast.GtE), (ast.Eq, ast.NotEq), (ast.Is, ast.IsNot), (ast.In, ast.NotIn)
_PAIRS_TOO = (ast.And, ast.Or), (ast.Add, ast.Sub), (ast.Mult, ast.Div), (ast.USub, ast.UAdd)
_SWAPS = {each: other for pair in (*_PAIRS, *_PAIRS_TOO) for each, other in (pair, pair[::-1])}
#: What is looked at after a file's own tests and its folder's; what is looked at last, though it is slow: the kept
#: answers, which show a constant that is a little different.
_WIDER = {"library": ("tests/library", "tests/stream/recognizer"), "stream": ("tests/stream",)}
_ANSWERS = ("tests/system/recognition",)
#: Tests that cover a room and do not lie in its mirror.
_ELSEWHERE = {
    "stream/osc": "tests/stream/test_codecs.py",
    "stream/zeromq": "tests/stream/test_codecs.py",
    "stream/inputs": "tests/tools/programs/test_listen.py",
    "library/recordings/formats/markers": "tests/library/recordings/formats",
}
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


def stages(path: Path, *, near: bool) -> list[tuple[str, ...]]:
    """Give the tests that are run for a file, one set after another, until a set finds the change."""
    folder = Path("tests") / path.parent
    sets = [(str(folder / f"test_{path.stem}.py"),), (str(folder),)]
    sets += [(test,) for room, test in _ELSEWHERE.items() if path.is_relative_to(room)]
    sets += [] if near else [_WIDER.get(path.parts[0], ("tests/tools",)), _ANSWERS]
    return [tests for tests in dict.fromkeys(sets) if all((ROOT / each).exists() for each in tests)]


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


def _run(tree: Path, tests: tuple[str, ...], seconds: float) -> bool:
    """Say whether tests pass in a copy, in time; no process is left."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:randomly", "-p", "no:cacheprovider", *tests]
    process = subprocess.Popen(
        command if tests == _ANSWERS else [*command, "-m", "not slow"],
        cwd=tree,
        env=os.environ | {"PYTHONPATH": str(tree / "packages"), "OPENBLAS_NUM_THREADS": "1"},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY)),  # noqa: PLW1509 - no lock is held
    )
    try:
        # With no test left after those that are slow, pytest ends with 5.
        return process.wait(seconds) in (0, 5)
    except subprocess.TimeoutExpired:
        return False
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def _found(mutant: Mutant, trees: queue.Queue[Path], seconds: dict[tuple[str, ...], float], *, near: bool) -> bool:
    """Try a change in one of the copies."""
    tree = trees.get()
    file = tree / mutant.path
    before = file.read_bytes()
    try:
        file.write_bytes(mutant.text)
        # Compiled modules are known by their time: another one for each change.
        os.utime(file, ns=(time.time_ns(), time.time_ns()))
        return not all(_run(tree, each, seconds[each]) for each in stages(mutant.path, near=near))
    finally:
        file.write_bytes(before)
        trees.put(tree)


def main() -> int:
    """Run, and print the share that was found of each room, and what was not found."""
    parser = argparse.ArgumentParser(description=__doc__)
    for name, usual in (("count", 30), ("seed", 1), ("jobs", 1)):
        parser.add_argument(f"--{name}", type=int, default=usual)
    parser.add_argument(
        "--near", action="store_true", help="only the tests of a file, its folder and its room, which is quick"
    )
    parser.add_argument("--room", action="append", help="a folder or file of library or stream; by default both")
    options = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("ended"))
    rooms = [ROOT / room for room in options.room or _WIDER]
    paths = sorted({each for room in rooms for each in ([room] if room.is_file() else room.rglob("*.py"))})
    chosen, trees = mutants(paths, options.count, options.seed), queue.Queue[Path]()
    seconds, by_room = dict[tuple[str, ...], float](), collections.defaultdict(list)
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(options.jobs) as pool:
        for job in range(options.jobs):
            trees.put(_copied(Path(folder) / str(job)))
        for tests in dict.fromkeys(each for mutant in chosen for each in stages(mutant.path, near=options.near)):
            begun = time.monotonic()
            if not _run(Path(folder) / "0", tests, 3600):
                sys.exit(f"these tests fail without a change: {' '.join(tests)}")
            seconds[tests] = 60 + 5 * (time.monotonic() - begun)
        results = pool.map(lambda each: _found(each, trees, seconds, near=options.near), chosen)
        for mutant, found in zip(chosen, results, strict=True):
            by_room[str(mutant.path.parent)].append(found)
            print(f"{'found    ' if found else 'NOT FOUND'} {mutant.path}:{mutant.line}  {mutant.change}", flush=True)  # noqa: T201
    every = [each for own in by_room.values() for each in own]
    for room, found in [*sorted(by_room.items()), ("all", every)]:
        print(f"{room:36} {sum(found):4} of {len(found):4} found")  # noqa: T201
    return 0 if all(every) else 1


if __name__ == "__main__":
    sys.exit(main())
