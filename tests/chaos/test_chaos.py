"""The short form of `make chaos`: nothing ends the program, and the performer is still answered. No time is held."""

import math
import signal
import threading
import time
from contextlib import closing
from itertools import count

import numpy as np
import pytest
from chaos.__main__ import table
from chaos.attacks import INNOCENT
from chaos.performer import NAMES, cues_of
from chaos.trial import Effort, ended_with, started, tried
from chaos.trials import TRIALS
from numpy.typing import NDArray
from programs import PATIENCE

from kinespace.stream import zeromq
from kinespace.stream.zeromq import Endpoint
from kinespace.tools.feeding.feed import OscFrameSender

#: The attacks on one recogniser, one after the other, and the seconds of each.
SUFFERED = [each.attack for each in TRIALS if each.attack and not each.first]
SECONDS = 0.25


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="this system cannot hold a process")
def test_nothing_ends_the_program(played: NDArray[np.float32]) -> None:
    """After all attacks and a stop a performer is answered, the attacks are counted, and the program ends well."""
    with started(["--signature", "paper"]) as program:
        place = program.place()
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
                for cue in cues_of(played[:120], 1.0 + number):
                    sender.send(sender.encode(cue))
                    time.sleep(0.001)
                if answers.socket.poll(100) or time.monotonic() > until:
                    break
            assert answers.receive() is not None
        assert ended_with(program) == 0
        assert "Traceback" not in program.printed
        for counted in ("malformed", "foreign", "no room"):
            assert f"{counted} 0" not in program.printed.rpartition("received")[2]


@pytest.mark.slow
def test_a_trial_has_an_outcome(played: NDArray[np.float32]) -> None:
    """The performer is answered before and after, what happened is in a row, and the program ends when asked."""
    name = "killed while recording, begun again"
    (trial,) = [each for each in TRIALS if each.name == name]
    found = tried(trial, Effort(before=1.0, during=1.0, after=0.5, memory=1.0), played)
    assert (found.name, found.ended) == (name, 0)
    assert found.expected > 10
    assert found.memory[0] > 10
    assert "packets recorded" in found.counted
    never = found._replace(p99=math.nan, recovered=math.inf, ended=1, noticed=0.5)
    row = table([never]).splitlines()[2]
    assert row.startswith(f"| {name} (noticed after 0.50 s) ENDED with 1 | {found.answered} / {found.expected} | ")
    assert " | - | " in row
    assert f" | never | {found.counted} |" in row
