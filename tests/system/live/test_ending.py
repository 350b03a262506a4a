"""Every program ends soon on any signal and with any feed, in one line and with end events."""

import itertools
import re
import signal
import time

import pytest
from programs import LOOPBACK, free_udp_port, live, motion_cues, started, summary_counts

from kinespace.stream import osc

pytestmark = pytest.mark.slow

SIGNALS = [signal.SIGINT, signal.SIGTERM, *([signal.SIGHUP] if hasattr(signal, "SIGHUP") else [])]
_UNCLOSED = re.compile(r"Exception ignored in: <_io.*\nTraceback .*\n( .*\n)*ResourceWarning: unclosed file .*\n")
PROGRAMS: dict[str, tuple[tuple[object, ...], str]] = {
    "replay": (("replay", "squat1Reps", "--loop", "--osc", f"{LOOPBACK}:{free_udp_port()}"), ""),
    "listen": (("listen", f"{LOOPBACK}:0", "--seconds", 100), "listening"),
    "demo": (("demo",), ""),
    "latency": (("latency", "--transport", "osc", "--seconds", 100), ""),
}


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="Windows has other signals")
@pytest.mark.parametrize(("name", "number"), list(zip(PROGRAMS, itertools.cycle(SIGNALS), strict=False)))
def test_a_signal_ends_a_program_without_a_traceback(name: str, number: signal.Signals) -> None:
    """At any moment, and with any child processes, a program prints only its report.

    All signals go the same way; each program gets one of them.
    """
    arguments, said = PROGRAMS[name]
    with started(*arguments) as program:
        program.expect(said)
        # Somewhere in its work; where does not matter.
        time.sleep(1.0)
        program.process.send_signal(number)
        # On a busy machine it has not even begun, and the system ends it; or the interrupt comes inside an `exec`, with
        # which dataclasses are made: then Python ends by SIGINT, although the interrupt was caught.
        assert program.wait() in (0, 1, -number, -signal.SIGINT)
        # An interrupt within an import leaves the module's file to the collector, and `-W error` reports the file.
        assert _UNCLOSED.sub("", program.errors) == ""


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="Windows has other signals")
@pytest.mark.parametrize("number", SIGNALS)
def test_every_signal_ends_live_with_end_events(number: signal.Signals) -> None:
    """The motion that is going on is ended for the listeners, and the counts are printed."""
    with live("--plain") as stage:
        stage.play(motion_cues("kickLFront1Reps", 2.0))
        stage.program.expect("start: ")
        stage.program.process.send_signal(number)
        assert (stage.program.wait(), stage.program.errors) == (0, "")
        assert summary_counts(stage.program.output)["frames"] == 240
        heard = [packet.packet for packet in stage._listener.listen_until(time.perf_counter() + 0.2)]  # noqa: SLF001 - events too
    events = [
        message for packet in heard for message in osc.decode_packet(packet) if message.address.endswith("/event")
    ]
    assert [event.arguments[0] for event in events][-1] == "end"
