"""Print kinespace's answers, with python-osc. First start, elsewhere: kinespace live."""

import select
import sys

from pythonosc.dispatcher import Dispatcher
from pythonosc.osc_server import BlockingOSCUDPServer

# The address to which kinespace answers.
PORT = int(sys.argv[1]) if len(sys.argv) > 1 else 9311

last: dict[str, str] = {}


def label(address: str, name: str) -> None:
    """Print a performer's label whenever it changes: a class, or still or unknown."""
    performer = address.split("/")[2]
    if last.get(performer) != name:
        last[performer] = name
        print(f"{performer}: {name}", flush=True)


def event(address: str, kind: str, name: str, *_: float) -> None:
    """Print the start or the end of a motion."""
    print(f"{address.split('/')[2]}: {name} {kind}s", flush=True)


dispatcher = Dispatcher()
dispatcher.map("/motion/*/label", label)
dispatcher.map("/motion/*/event", event)
server = BlockingOSCUDPServer(("127.0.0.1", PORT), dispatcher)
if not select.select([server.socket], [], [], 5)[0]:
    print(f"no answer yet: does somebody send frames, to kinespace live --osc-out {PORT}?", flush=True)
server.serve_forever()
