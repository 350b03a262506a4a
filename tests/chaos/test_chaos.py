"""Attacks on a running `kinespace live`: nothing ends it, and a performer is still answered. No time is held."""

import signal
import threading
import time
from contextlib import closing
from functools import partial
from itertools import count

import numpy as np
import pytest
from chaos import attacks
from chaos.attacks import INNOCENT, flood, publish
from numpy.typing import NDArray
from programs import PATIENCE

from kinespace.library.naming.hdm05 import SKELETON
from kinespace.stream import osc, zeromq
from kinespace.stream.frame import Announcement, Frame
from kinespace.stream.zeromq import Endpoint
from kinespace.tools.loopback.program import Program

#: Each runs for some seconds on one recogniser, one after the other; floods of so many packets a second, 0: 30 Mbit.
SECONDS = 0.25
ATTACKS = (
    *(partial(flood, packets, 20_000) for packets in (attacks.garbage, attacks.new_names, attacks.right_frames)),
    *(partial(flood, each, 0) for each in (attacks.many_messages, attacks.packed_frames, attacks.full_datagrams)),
    *(partial(flood, each, 300) for each in (attacks.impostor, attacks.foreign_joints, attacks.many_performers)),
    partial(flood, attacks.commands, 20),
    *(partial(publish, each, 20_000) for each in (attacks.zmq_garbage, attacks.zmq_impostor)),
    *(partial(publish, each, 0) for each in (attacks.zmq_lists, attacks.zmq_headers, attacks.zmq_parts)),
    *(attacks.many_ports, attacks.large_subscriptions, attacks.silent_connections),
)
ENDS = ("--osc-in", "127.0.0.1:0", "--zmq-in", "tcp://127.0.0.1:*", "--zmq-out", "tcp://127.0.0.1:*")


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="this system cannot hold a process")
def test_nothing_ends_the_program(played: NDArray[np.float32]) -> None:
    """After all attacks and a stop a performer is answered, the attacks are counted, and the program ends well."""
    with Program("live", *ENDS, "--plain", "--signature", "paper") as program:
        place = program.place()
        for attack in ATTACKS:
            stop = threading.Event()
            threading.Timer(SECONDS, stop.set).start()
            attack(place, stop)  # type: ignore[arg-type]  # has what the attacks ask
            assert program.process.poll() is None, attack
        program.process.send_signal(signal.SIGSTOP)
        program.process.send_signal(signal.SIGCONT)
        receiver = zeromq.ZmqReceiver(Endpoint(place.answers, bind=False), f"class/{INNOCENT}/".encode())
        with closing(receiver) as answers, closing(osc.OscSender(*place.osc)) as sender:
            until = time.monotonic() + PATIENCE
            for number in count():
                # The name was another's a moment ago: it is this sender's once that has been silent.
                sender.send(osc.encode_announcement(Announcement(INNOCENT, SKELETON.joints)))
                for frame, positions in enumerate(played[:120]):
                    sender.send(osc.encode_frame(Frame(INNOCENT, 1.0 + number + frame / 120, positions)))
                    time.sleep(0.001)
                if answers.socket.poll(100) or time.monotonic() > until:
                    break
            assert answers.receive() is not None
        program.process.send_signal(signal.SIGTERM)
        assert program.process.wait(PATIENCE) == 0
        assert "Traceback" not in program.printed
        for counted in ("malformed", "foreign", "no room"):
            assert f"{counted} 0" not in program.printed.rpartition("received")[2]
