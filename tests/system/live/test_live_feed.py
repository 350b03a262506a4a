"""Every program ends soon on any signal and with any feed, in one line and with end events."""

import itertools
import re
import signal
import socket
import time
from contextlib import ExitStack

import pytest
from golden import moments
from programs import LOOPBACK, free_udp_port, ghost_cues, live, motion_cues, started, summary_counts, until

from kinespace.library import MotionLibrary
from kinespace.stream import osc
from kinespace.stream.osc import OscReceiver, decode_packet
from kinespace.stream.osc.packet import Message
from kinespace.tools.programs.live import fitted

pytestmark = pytest.mark.slow

SIGNALS = [signal.SIGINT, signal.SIGTERM, *([signal.SIGHUP] if hasattr(signal, "SIGHUP") else [])]
_UNCLOSED = re.compile(
    r"Exception ignored in: <(_io|posix)\..*\nTraceback .*\n( .*\n)*"
    r"ResourceWarning: unclosed (file|scandir iterator) .*\n"
)
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
        # An interrupt within an import, or while a folder is listed, leaves the file or the folder to the collector,
        # and `-W error` reports it.
        assert _UNCLOSED.sub("", program.errors) == ""


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="Windows has other signals")
def test_a_signal_ends_live_with_end_events() -> None:
    """The motion that is going on is ended for the listeners, and the counts are printed."""
    with live("--plain") as stage:
        stage.play(motion_cues("kickLFront1Reps", 2.0))
        stage.program.expect("start: ")
        stage.program.process.send_signal(signal.SIGHUP)
        assert (stage.program.wait(), stage.program.errors) == (0, "")
        assert summary_counts(stage.program.output)["frames"] == 240
        heard = [packet.packet for packet in stage._listener.listen_until(time.perf_counter() + 0.2)]  # noqa: SLF001 - events too
    messages = [message for packet in heard for message in osc.decode_packet(packet)]
    assert [each.arguments[0] for each in messages if each.address.endswith("/event")][-1] == "end"


def play(layout: str, port: int, seconds: float, sender: socket.socket) -> None:
    """Send a ghost in a product's layout at 30 Hz in real time: most feeds are timed by their arrival."""
    start = time.monotonic()
    shown = [cue.frame.positions for cue in ghost_cues("kickLFront1Reps", seconds)[::4]]
    for moment, packets in moments(layout, shown):
        time.sleep(max(0.0, start + moment - 1.0 - time.monotonic()))
        for packet in packets:
            sender.sendto(packet, (LOOPBACK, port))


def heard(receiver: OscReceiver, address: str) -> list[Message]:
    """Collect messages of one address, waiting for the first."""

    def came() -> list[Message]:
        messages = [message for datagram in iter(receiver.receive, None) for message in decode_packet(datagram)]
        return [message for message in messages if message.address == address]

    return until(came)


def test_a_feed_is_recognised_and_several_hear_it() -> None:
    """VMC in, from a network; native, TouchDesigner and VMC out, and ZeroMQ; the counts of the feed at the end."""
    with ExitStack() as stack:
        native, touch, thru = (OscReceiver(LOOPBACK, 0) for _ in range(3))
        for receiver in (native, touch, thru):
            stack.callback(receiver.close)
        outs = zip(("native", "touchdesigner", "vmc-thru"), (native, touch, thru), strict=True)
        options = [option for name, out in outs for option in ("--out", f"{name}={LOOPBACK}:{out.address[1]}")]
        sender = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        # ZeroMQ's sockets know no networks of IPv6.
        options += ["--allow-from", f"{LOOPBACK}/8,::1/128", "--zmq-out", f"tcp://{LOOPBACK}:*"]
        command = ("live", "--plain", "--feed", "vmc", "--osc-in", f"{LOOPBACK}:0", *options)
        program = stack.enter_context(started(*command))
        port = int(program.expect(r"listening on vmc 127\.0\.0\.1:(\d+); answering to native 127")[1])
        play("vmc", port, 2.0, sender)
        labels = [message.arguments[0] for message in heard(native, "/motion/vmc/label")]
        numbers = [message.arguments for message in heard(touch, "/motion/vmc/class")]
        passed_on = [message.arguments for message in heard(thru, "/VMC/Thru/motion/class")]
        assert program.interrupt() == 0
        assert program.errors == ""
        assert "kickLFront1Reps" in labels
        assert {type(value) for values in numbers for value in values} <= {int, float}
        assert [label for label, _ in passed_on][: len(labels)] == labels[: len(passed_on)]
        # On a busy machine a frame may end by its timeout.
        made = re.search(r"feed vmc: (\d+) frames made \(\d+ by end.*\), 0 refused", program.output)
        assert made, program.output
        assert int(made[1]) >= 40
        assert "malformed" not in program.output
        assert program.output.startswith("feed vmc: 22 of the library's 31 joints\n")


def test_a_joint_that_the_library_lacks_is_named(builtin: MotionLibrary, capsys: pytest.CaptureFixture[str]) -> None:
    """A misspelt joint would be missing without a word: a line names it and the most similar name."""
    joints = [name for name in builtin.skeleton.joints if name != "head"]
    assert len(fitted(builtin, "feed mine", [*joints, "haed", "tail"]).skeleton.joints) == 30
    told = (
        "feed mine: not compared, because the library lacks them: haed, perhaps head is meant; tail\n"
        "feed mine: 30 of the library's 31 joints\n"
    )
    assert capsys.readouterr().out == told
    fitted(builtin, "feed mine", [*joints, "head", "haed"])
    assert capsys.readouterr().out == ""
