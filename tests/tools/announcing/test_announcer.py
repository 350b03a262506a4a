"""`kinespace live` announced: found by another mDNS than ours, described over HTTP, gone when it ends."""

import json
import socket
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack, closing
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest
from programs import LOOPBACK, PATIENCE, free_udp_port, ghost_cues, started
from zeroconf import ServiceBrowser, ServiceStateChange, Zeroconf

from kinespace.library import MotionLibrary
from kinespace.stream.osc import OscSender
from kinespace.stream.osc.frames import encode_frame
from kinespace.tools.announcing.announcer import MAX_CLIENTS, QUERY_SERVICE, Announcer
from kinespace.tools.announcing.description import Known
from kinespace.tools.announcing.finding import OSC_SERVICE


def until(condition: Callable[[], bool]) -> None:
    """Wait until a condition holds."""
    end = time.monotonic() + PATIENCE
    while not condition() and time.monotonic() < end:
        time.sleep(0.05)
    assert condition()


def asked(address: str) -> Any:  # noqa: ANN401 - JSON
    """Ask over HTTP, as any program does."""
    with urlopen(address, timeout=PATIENCE) as response:  # noqa: S310 - our own address
        return json.load(response)


@pytest.mark.slow
def test_live_is_found_and_described(builtin: MotionLibrary) -> None:
    """Both services have the right ports; the description names port, classes and performer; the end is said."""
    port, seen = free_udp_port(), dict[str, ServiceStateChange]()

    def note(zeroconf: Zeroconf, service_type: str, name: str, state_change: ServiceStateChange) -> None:
        del zeroconf, service_type
        seen[name] = state_change

    names = [f"kinespace {port}.{service}" for service in (OSC_SERVICE, QUERY_SERVICE)]
    ends = ("--osc-in", f"{LOOPBACK}:{port}", "--osc-out", f"{LOOPBACK}:{free_udp_port()}", "--plain", "--announce")
    with closing(Zeroconf([LOOPBACK])) as network, closing(OscSender(LOOPBACK, port)) as sender:
        ServiceBrowser(network, [OSC_SERVICE, QUERY_SERVICE], handlers=[note])
        with started("live", *ends) as program:
            address = program.expect(r"OSCQuery: (http://\S+)")[1]
            until(lambda: all(seen.get(name) is ServiceStateChange.Added for name in names))
            osc, query = (network.get_service_info(name.partition(".")[2], name) for name in names)
            assert (osc.port, osc.parsed_addresses()) == (port, [LOOPBACK])
            assert address == f"http://{LOOPBACK}:{query.port}/"
            assert asked(f"{address}?HOST_INFO")["OSC_PORT"] == port
            assert len(asked(f"{address}motion/classes?RANGE")["RANGE"]) == len(builtin.classes)
            sender.send(encode_frame(ghost_cues("squat1Reps", 0.5, performer="ann")[0].frame))
            until(lambda: "ann" in asked(f"{address}motion")["CONTENTS"])
            assert program.interrupt() == 0
        until(lambda: all(seen.get(name) is ServiceStateChange.Removed for name in names))


@pytest.mark.slow
def test_clients_that_never_ask_take_little_and_hold_up_nobody() -> None:
    """Hundreds come and say half a request: one thread serves all, odd requests are answered, the end comes at once."""
    threads, halves = threading.active_count(), list[socket.socket]()
    announcer = Announcer((LOOPBACK, free_udp_port()), Known(31, ("wave",)))
    place = LOOPBACK, int(announcer.address.split(":")[2].strip("/"))
    with ExitStack() as opened:
        for _ in range(300):
            halves.append(opened.enter_context(socket.create_connection(place, PATIENCE)))
            halves[-1].sendall(b"GET / HTTP/1.1\r\nHost: 127")
        until(lambda: len(announcer.clients) <= MAX_CLIENTS)
        # One serves, one announces, one is zeroconf's.
        assert threading.active_count() <= threads + 3
        began = time.monotonic()
        announcer.close()
        assert time.monotonic() - began < PATIENCE
    assert not [each for each in threading.enumerate() if each.name == "kinespace OSCQuery"]


@pytest.mark.slow
def test_a_rebound_name_gets_nothing() -> None:
    """A page that calls this machine by a name of its own learns nothing; the threads end with the announcer."""
    with closing(Announcer((LOOPBACK, free_udp_port()), Known(31, ("wave",)))) as announcer:
        assert asked(f"{announcer.address}motion/classes")["RANGE"] == [{"VALS": ["wave"]}]
        announcer.publish_classes(("bow", "wave"))
        assert asked(f"{announcer.address}motion/classes")["TYPE"] == "ss"
        with pytest.raises(HTTPError, match="403"):
            urlopen(Request(announcer.address, headers={"Host": "evil.example"}), timeout=PATIENCE)  # noqa: S310 - as above
