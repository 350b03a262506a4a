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
#: A body of one's own in ten lines of python-osc: other joints than the library's, and names of a game's avatar.
SEND = """
import math, sys, time
from pythonosc.udp_client import SimpleUDPClient
SIDES = [side + part for side in ("Left", "Right") for part in ("Arm", "ForeArm", "Hand", "UpLeg", "Leg", "Foot")]
NAMES = ["Hips", "Spine", "Neck", *SIDES]
client = SimpleUDPClient("127.0.0.1", int(sys.argv[1]))
for number in range(10**6):
    if number % 30 == 0:
        client.send_message("/motion/skeleton", ["me", *NAMES])
    body = [place for joint in range(15) for place in (joint % 3 / 4, joint / 9, math.sin(number / 9 + joint) / 9)]
    client.send_message("/motion/frame", ["me", 0.0, *body])
    time.sleep(1 / 30)
"""
#: A body that stands, teaches a wave of its left arm by one example, and waves again every four seconds.
WAVE = """
import math, sys, time
from pythonosc.udp_client import SimpleUDPClient
NAMES = ["Hips", "Spine", "Neck", "Head"]
REST = [(0, 1, 0), (0, 1.2, 0), (0, 1.5, 0), (0, 1.7, 0)]
for side, x in (("Left", 0.2), ("Right", -0.2)):
    parts = (("Arm", 1.45), ("ForeArm", 1.15), ("Hand", 0.9), ("UpLeg", 0.95), ("Leg", 0.5), ("Foot", 0.1))
    NAMES += [side + part for part, _ in parts]
    REST += [(x if y > 1 or part == "Hand" else x / 2, y, 0) for part, y in parts]
client, began = SimpleUDPClient("127.0.0.1", int(sys.argv[1])), time.monotonic()
for number in range(10**6):
    now = time.monotonic() - began
    if number % 30 == 0:
        client.send_message("/motion/skeleton", ["me", *NAMES])
    if number == 600:
        client.send_message("/motion/teach", ["me", "wave", 1, 0.0])
    turn = 2.4 * math.sin(math.pi * min(now % 4 / 1.6, 1)) ** 2
    body = []
    for name, (x, y, z) in zip(NAMES, REST):
        reach = 1.45 - y if name in ("LeftForeArm", "LeftHand") else 0
        if reach:
            x, y = 0.2 + reach * math.sin(turn), 1.45 - reach * math.cos(turn)
        body += [x, y, z]
    client.send_message("/motion/frame", ["me", now, *body])
    time.sleep(1 / 60)
"""
#: Runs the example of an asyncio app, and prints the longest seconds that one of the loop's calls took: by the clock,
#: and of the processor's time.
MEASURE = """
import asyncio, sys, time
longest, run = [0.0, 0.0], asyncio.Handle._run
def timed(handle):
    clock, work = time.perf_counter(), time.thread_time()
    run(handle)
    longest[:] = max(longest[0], time.perf_counter() - clock), max(longest[1], time.thread_time() - work)
asyncio.Handle._run = timed
exec(compile(sys.argv[1], "example", "exec"), {"__name__": "__main__"})
print("longest", *longest)
"""


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
        _answered(binaries / "kinespace", SEND, b"/motion/me/label")
        rows.append(("... and the first answer about one's own body", time.perf_counter() - began, ANSWER))
        taught = ("--teach", Path(folder) / "mine.npz", "--library", "none")
        _answered(binaries / "kinespace", WAVE, b"/motion/me/done", *taught)
        rows.append(("... and a gesture of one's own, taught once, is done again", time.perf_counter() - began, OWN))
        asked = time.perf_counter()
        table = _run(binaries / "kinespace", "evaluate", "retrieval")
        rows.append(("kinespace evaluate retrieval: the paper's table", time.perf_counter() - asked, TABLE))
        example = _asyncio_example()
        *_, longest = _run(binaries / "python", "-c", MEASURE, example).splitlines()
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
