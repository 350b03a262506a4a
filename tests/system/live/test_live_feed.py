"""`kinespace live --feed`: another product's packets into a real process, answers out in several layouts."""

import re
import socket
import time
from contextlib import ExitStack
from pathlib import Path

import pytest
from golden import LAYOUTS, Moment
from programs import LOOPBACK, PATIENCE, builtin_library, ghost_cues, started

from kinespace.library.naming.hdm05 import SKELETON
from kinespace.stream.feeds import builtin_preset
from kinespace.stream.osc import OscReceiver
from kinespace.stream.osc.packet import Message, decode_packet
from kinespace.tools.programs.live import fitted

pytestmark = pytest.mark.slow


def play(layout: str, port: int, seconds: float, sender: socket.socket) -> None:
    """Send a ghost in a product's layout at 30 Hz in real time: most feeds are timed by their arrival."""
    start = time.monotonic()
    for number, cue in enumerate(ghost_cues("kickLFront1Reps", seconds)[::4]):
        places = dict(zip(SKELETON.joints, cue.frame.positions, strict=True))
        time.sleep(max(0.0, start + number / 30 - time.monotonic()))
        for packet in LAYOUTS[layout][1](Moment(places, 1.0 + number / 30, number)):
            sender.sendto(packet, (LOOPBACK, port))


def heard(receiver: OscReceiver, address: str) -> list[Message]:
    """Collect messages of one address, waiting for the first."""
    until = time.monotonic() + PATIENCE
    messages: list[Message] = []
    while not messages and time.monotonic() < until:
        while (datagram := receiver.receive()) is not None:
            messages += [message for message in decode_packet(datagram) if message.address == address]
        time.sleep(0.01)
    return messages


def test_a_feed_is_recognised_and_several_hear_it() -> None:
    """VMC in; native, TouchDesigner, VMC and a reply to the sender out; the counts of the feed at the end."""
    with ExitStack() as stack:
        native, touch, thru = (OscReceiver(LOOPBACK, 0) for _ in range(3))
        for receiver in (native, touch, thru):
            stack.callback(receiver.close)
        outs = zip(("native", "touchdesigner", "vmc-thru"), (native, touch, thru), strict=True)
        options = [option for name, out in outs for option in ("--out", f"{name}={LOOPBACK}:{out.address[1]}")]
        sender = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
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


def test_hands_are_shaken_with_qualisys(tmp_path: Path) -> None:
    """A sender that waits for a handshake gets it, sends, is recognised, and gets the farewell."""
    preset, receiver = tmp_path / "ours.toml", OscReceiver(LOOPBACK, 0)
    with ExitStack() as stack:
        stack.callback(receiver.close)
        sender = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        sender.bind((LOOPBACK, 0))
        sender.settimeout(PATIENCE)
        port = f"port = {sender.getsockname()[1]}"
        preset.write_text(builtin_preset("qtm").text.replace("port = 22225", port), encoding="utf-8")

        def told() -> object:
            return decode_packet(sender.recv(2000))[0].arguments[0]

        out = f"native={LOOPBACK}:{receiver.address[1]}"
        command = ("live", "--plain", "--feed", preset, "--osc-in", f"{LOOPBACK}:0", "--out", out)
        program = stack.enter_context(started(*command))
        ours = program.expect(r"listening on ours 127\.0\.0\.1:(\d+)")[1]
        assert [told(), told()] == [f"Connect {ours}", "StreamFrames AllFrames 3D Skeleton:global"]
        play("qtm", int(ours), 1.0, sender)
        assert heard(receiver, "/motion/Jan/label")
        assert (program.interrupt(), program.errors) == (0, "")
        commands = iter(told, "Disconnect")
        assert list(commands)[-1] == "StreamFrames Stop"
        assert "requests not sent 0" in program.output


def test_a_joint_that_the_library_lacks_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    """A misspelt joint would be missing without a word: a line names it and the most similar name."""
    library = builtin_library()
    joints = [name for name in library.skeleton.joints if name != "head"]
    assert len(fitted(library, "feed mine", [*joints, "haed", "tail"]).skeleton.joints) == 30
    told = (
        "feed mine: the library has no joint 'haed', perhaps head is meant\n"
        "feed mine: not compared, because the library lacks them: haed, tail\n"
        "feed mine: 30 of the library's 31 joints\n"
    )
    assert capsys.readouterr().out == told
    fitted(library, "feed mine", [*joints, "head", "haed"])
    assert capsys.readouterr().out == ""
