"""What a newcomer types, from a clean clone, and how long it takes: `python tests/system/newcomer.py` prints a table.

The clone, its environment and kinespace's cache lie in a temporary folder; packages come from pip's usual place. The
load of the machine stands below the table: on a busy one every figure is larger.
"""

import os
import re
import socket
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
#: Seconds from the clone to the first answer, and from the installed program to the paper's table; seconds for which
#: the loop of an asyncio app may stand still.
ANSWER, TABLE, STILL = 90.0, 60.0, 0.005
#: Seconds from the clone to the first gesture of one's own that is said by `done`.
OWN = 120.0
#: Seconds after which a step has failed.
_PATIENCE = 600.0
#: What a newcomer's programs do: `send` a body of one's own, teach it to `wave`, `measure` an asyncio app.
SCRIPTS: dict[str, str] = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))


def _asyncio_example() -> str:
    """Give the example of an asyncio app on the page about libraries."""
    page = (ROOT / ".github" / "docs" / "libraries.md").read_text(encoding="utf-8")
    (code,) = [each for each in re.findall(r"```python\n(.+?)```", page, re.DOTALL) if "asyncio" in each]
    return code


def _free_port() -> int:
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextmanager
def _running(*command: object) -> Iterator[None]:
    process = subprocess.Popen([*map(str, command)], stdout=subprocess.DEVNULL)
    try:
        yield
    finally:
        process.terminate()
        process.wait()


def _run(*command: object) -> str:
    """Run a command to its end; give what it prints."""
    done = subprocess.run([*map(str, command)], check=True, stdout=subprocess.PIPE, text=True, timeout=_PATIENCE)
    return done.stdout


def _answered(program: Path, sender: str, message: bytes, *options: object) -> None:
    """Start `live` and a sender of one's own body, and wait for the first message at an address."""
    port = _free_port()
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as answers:
        answers.bind(("127.0.0.1", 0))
        answers.settimeout(_PATIENCE)
        ends = ("--osc-in", f"127.0.0.1:{port}", "--osc-out", answers.getsockname()[1])
        live = _running(program, "live", "--plain", *ends, *options)
        with live, _running(program.with_name("python"), "-c", sender, port):
            while message not in answers.recv(20_000):
                pass


def main() -> None:
    """Clone, install, time each step, print the table."""
    rows = list[tuple[str, float, float]]()
    with tempfile.TemporaryDirectory() as folder:
        os.environ["XDG_CACHE_HOME"] = f"{folder}/cache"
        clone, began = Path(folder) / "kinespace", time.perf_counter()
        _run("git", "clone", "--quiet", ROOT, clone)
        _run(sys.executable, "-m", "venv", clone / ".venv")
        binaries = clone / ".venv" / "bin"
        _run(binaries / "pip", "install", "--quiet", "--disable-pip-version-check", clone)
        installed = time.perf_counter()
        rows.append(("git clone, pip install .", installed - began, ANSWER))
        _answered(binaries / "kinespace", SCRIPTS["send"], b"/motion/me/label")
        rows.append(("... and the first answer about one's own body", time.perf_counter() - began, ANSWER))
        taught = ("--teach", Path(folder) / "mine.npz", "--library", "none")
        _answered(binaries / "kinespace", SCRIPTS["wave"], b"/motion/me/done", *taught)
        rows.append(("... and a gesture of one's own, taught once, is done again", time.perf_counter() - began, OWN))
        asked = time.perf_counter()
        table = _run(binaries / "kinespace", "evaluate", "retrieval")
        rows.append(("kinespace evaluate retrieval: the paper's table", time.perf_counter() - asked, TABLE))
        example = _asyncio_example()
        *_, longest = _run(binaries / "python", "-c", SCRIPTS["measure"], example).splitlines()
        clock, work = map(float, longest.split()[1:])
        lines = sum(bool(line.strip()) for line in example.splitlines())
        rows.append((f"an asyncio app of {lines} lines: its loop's longest call", clock, STILL))
        rows.append(("... of the processor's time", work, STILL))
    print(table)  # noqa: T201 - it is asked for
    for what, seconds, most in rows:
        print(f"{what:60} {seconds:9.4f} s  (at most {most:g}){'' if seconds <= most else '  MISSED'}")  # noqa: T201 - as above
    print(f"load {', '.join(f'{each:.1f}' for each in os.getloadavg())}, {os.cpu_count()} cores")  # noqa: T201 - as above


if __name__ == "__main__":
    main()
