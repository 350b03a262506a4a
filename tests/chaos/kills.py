"""`make kills`: `live --teach` is killed again and again; no example that was taught a second ago may be lost."""

import argparse
import json
import os
import tempfile
import threading
import time
from collections import Counter
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import zmq
from chaos.attacks import place_of
from chaos.performer import stream
from chaos.trial import started

from kinespace.library import MotionLibrary
from kinespace.tools.programs import bench

#: Seconds after which an example must be safe; seconds of movement before the first one; of an example.
SAFE, WARM, LONG = 1.0, 2.0, 1.5
#: Examples before a kill, at most; seconds in which one must be taught.
EXAMPLES, PATIENCE = 6, 30.0


def taught_before_kill(path: Path, kill: int, draw: np.random.Generator) -> dict[str, float]:
    """Teach some classes, kill the program about a second later; give how old each example was then, seconds."""
    taught, ended = dict[str, float](), threading.Event()
    with ExitStack() as opened:
        program = opened.enter_context(started(("--teach", str(path), "--control", "tcp://127.0.0.1:*")))
        place, control = place_of(program), program.expect(r"ZeroMQ (tcp://\S+) \(control\)")[1]
        performer = threading.Thread(target=stream, args=(place, "p", ended, bench.positions()[::2], 60.0))
        performer.start()
        opened.callback(performer.join)
        opened.callback(ended.set)
        context = opened.enter_context(zmq.Context())
        asking, notices = (opened.enter_context(context.socket(kind)) for kind in (zmq.REQ, zmq.SUB))
        asking.linger = 0
        asking.connect(control)
        notices.connect(place.answers)
        notices.subscribe(b"teach/")
        time.sleep(WARM)
        for number in range(int(draw.integers(1, EXAMPLES + 1))):
            name = f"c{kill} {number}"
            asking.send(json.dumps({"do": "last", "performer": "p", "seconds": LONG, "class": name}).encode())
            asking.recv()
            until = time.monotonic() + PATIENCE
            while name not in taught and time.monotonic() < until:
                if notices.poll(100) and (said := json.loads(notices.recv_multipart()[1]).get("taught")):
                    taught.setdefault(said, time.monotonic())
            time.sleep(draw.choice([0.0, 0.5, 2.0]))
        time.sleep(SAFE if kill % 2 else draw.uniform(0.0, 4.0))
        killed = time.monotonic()
        program.process.kill()
    return {name: killed - at for name, at in taught.items()}


def main() -> int:
    """Kill it some times; return 1 where an example was lost that was old enough."""
    parser = argparse.ArgumentParser(prog="make kills", description=__doc__)
    parser.add_argument("--kills", type=int, default=200, help="how often (default %(default)s)")
    wanted, draw, found, loads = parser.parse_args().kills, np.random.default_rng(0), Counter[str](), list[float]()
    with tempfile.TemporaryDirectory() as folder:
        for kill in range(wanted):
            path = Path(folder) / f"{kill // 20}.npz"
            ages = taught_before_kill(path, kill, draw)
            there = set(MotionLibrary.load(path).classes)
            for name, age in ages.items():
                found[("old" if age >= SAFE else "young") + (" lost" if name not in there else "")] += 1
            loads.append(os.getloadavg()[0])
    print({**found, "kills": wanted, "load": [round(each, 1) for each in (min(loads), max(loads))]})  # noqa: T201 - it is asked for
    return int(found["old lost"] > 0)


if __name__ == "__main__":
    raise SystemExit(main())
