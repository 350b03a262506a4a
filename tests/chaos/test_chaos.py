"""The short form of `make chaos`: nothing ends the program, and the performer is still answered. No time is held."""

import signal
import threading
import time
from contextlib import closing
from itertools import count

import pytest
from chaos.attacks import INNOCENT, place_of
from chaos.performer import NAMES, cues_of
from chaos.trial import ended_with, started
from chaos.trials import TRIALS
from programs import PATIENCE, summary_counts

from kinespace.stream import zeromq
from kinespace.stream.zeromq import Endpoint
from kinespace.tools.feeding.feed import OscFrameSender
from kinespace.tools.programs import bench

#: The attacks on one recogniser, one after the other, and the seconds of each.
SUFFERED = [each.attack for each in TRIALS if each.attack and not each.first]
SECONDS = 0.15


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="this system cannot hold a process")
def test_nothing_ends_the_program() -> None:
    """After all attacks and a stop a performer is answered, the attacks are counted, and the program ends well."""
    with started(["--signature", "paper"]) as program:
        place, positions = place_of(program), bench.positions()[:120]
        for attack in SUFFERED:
            stop = threading.Event()
            threading.Timer(SECONDS, stop.set).start()
            attack(place, stop)  # type: ignore[arg-type]  # has what the attacks ask
            assert program.process.poll() is None, attack
        program.process.send_signal(signal.SIGSTOP)
        program.process.send_signal(signal.SIGCONT)
        receiver = zeromq.ZmqReceiver(Endpoint(place.answers, bind=False), f"class/{INNOCENT}/".encode())
        with closing(receiver) as answers, closing(OscFrameSender(*place.osc)) as sender:
            until = time.monotonic() + PATIENCE
            for number in count():
                # The name was another's a moment ago: it is this sender's once that has been silent.
                sender.announce(NAMES)
                for cue in cues_of(positions, 1.0 + number):
                    sender.send(sender.encode(cue.frame))
                    time.sleep(0.001)
                if answers.socket.poll(100) or time.monotonic() > until:
                    break
            assert answers.receive() is not None
        assert ended_with(program) == 0
        assert "Traceback" not in program.errors
        counts = summary_counts(program.output)
        assert min(counts["malformed"], counts["foreign"], counts["no room"]) > 0
