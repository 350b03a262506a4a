"""`kinespace live`: a real process that is fed over real sockets, and stopped as a person stops it."""

import json
import signal
import socket
from datetime import UTC, datetime, timedelta
from itertools import cycle, islice
from pathlib import Path

import pytest
from fakes import FakeReceiver
from golden import message, moments
from programs import LOOPBACK, builtin_library, ghost_cues, live, started, until

from kinespace.stream import Announcement, Settings
from kinespace.stream.feeds import builtin_preset
from kinespace.stream.inputs import Source
from kinespace.stream.inputs.decoder import FeedDecoder
from kinespace.tools.feeding.service import expected_answers
from kinespace.tools.programs.ends import UnreadPort
from kinespace.tools.programs.live import OSC_OUT


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "answering"),
    [
        ("--osc-out 9 --zmq-in {any} --zmq-out {any}", r"native 127.0.0.1:9, ZeroMQ tcp://127\.0\.0\.1:\d+"),
        ("--out vrchat,puredata --out max=:7401 --joints kinectv2", "vrchat .*, puredata .*, max 127.0.0.1:7401"),
        ("--feed vmc --sender 10.0.0.2", f"native {OSC_OUT}"),
    ],
)
def test_it_says_where_it_listens_and_answers(options: str, answering: str) -> None:
    """With an input alone answers go where they always go, else where they were asked for; the line says so."""
    options = options.format(any="tcp://127.0.0.1:*")
    with started("live", "--plain", "--osc-in", "127.0.0.1:0", *options.split()) as program:
        program.expect(rf"listening on (OSC|vmc) 127\.0\.0\.1:[1-9].*; answering to {answering}; Ctrl-C ends\n")
        assert ("--joints: 25 of the library's 31 joints" in program.output) == ("--joints" in options)
        assert (program.interrupt(), program.errors) == (0, "")


@pytest.mark.slow
def test_every_frame_is_answered_that_is_due() -> None:
    """Over OSC the answers equal the expected ones, one by one, and the counts at the end are exact."""
    cues = ghost_cues("squat1Reps", 2.0)
    expected = [each.label for each in expected_answers(cues, builtin_library(), Settings())]
    with live("--plain", "--zmq-out", f"tcp://{LOOPBACK}:*", "--bodies") as stage:
        stage.sender.announce(Announcement("ghost", builtin_library().skeleton.joints))
        stage.play(cues)
        answers, counts = stage.answers(len(expected)), stage.stopped()
    assert [answer.label for answer in answers] == expected
    assert {answer.performer for answer in answers} == {"ghost"}
    lost = {name: 0 for name in counts if name not in ("received", "frames", "answers")}
    assert counts == {"received": 241, "frames": 240, "answers": len(expected), **lost}


def _said(notified: socket.socket, until: str) -> list[str]:
    """Collect what is said to systemd until a line comes."""
    said = list[str]()
    while until not in "\n".join(said):
        said += notified.recv(4096).decode().splitlines()
    return said


@pytest.mark.skipif(not hasattr(socket, "AF_UNIX"), reason="systemd is Linux's")
@pytest.mark.slow
def test_live_keeps_a_log_and_speaks_to_systemd(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """READY once, WATCHDOG with each status, STOPPING at the end; each line of the log is one JSON object."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as notified:
        notified.bind(f"{tmp_path / 'notify'}")
        notified.settimeout(60.0)
        monkeypatch.setenv("NOTIFY_SOCKET", f"{tmp_path / 'notify'}")
        with live("--log", "json") as stage:
            begun = _said(notified, "STATUS=")
            assert begun[:2] == ["READY=1", "WATCHDOG=1"]
            assert begun[2].startswith("STATUS=waiting: 0 performers")
            stage.play(ghost_cues("kickLFront1Reps", 2.0))
            assert "READY=1" not in _said(notified, ": 1 performers")
            stage.program.process.send_signal(signal.SIGTERM)
            _said(notified, "STOPPING=1")
            stage.program.wait()
            lines = [json.loads(line) for line in stage.program.output.splitlines()]
    assert {"time", "level", "text"} <= set.intersection(*map(set, lines))
    starts = [line for line in lines if line.get("what") == "start"]
    said = {(line["performer"], line["class"], line["level"]) for line in starts}
    assert said == {("ghost", "kickLFront1Reps", "info")}
    assert abs(datetime.fromisoformat(starts[0]["time"]) - datetime.now(UTC)) < timedelta(minutes=5)


@pytest.mark.slow
@pytest.mark.parametrize(("layout", "run"), [("vmc", "--feed vmc"), ("osceleton", "--feed osceleton")])
def test_a_known_feed_is_named_with_the_command_that_reads_it(layout: str, run: str) -> None:
    """As `listen` says it, with the port that the packets come to; after a silence nothing is said."""
    unread = UnreadPort((LOOPBACK, 9310), None)
    positions = [cue.frame.positions for cue in ghost_cues("squat1Reps", 0.5)[::4]]
    for arrival, packets in moments(layout, islice(cycle(positions), 60)):
        for packet in packets:
            unread.keep(packet, arrival, ("127.0.0.1", 5000))
    assert f"end this and run: kinespace live {run} --osc-in 127.0.0.1:9310" in until(lambda: unread.note(3.0))
    assert unread.note(60.0) == ""


class _Asked:
    """Counts what it is asked to look at."""

    kept = 0

    def keep(self, *_: object) -> None:
        self.kept += 1

    def note(self, now: float) -> str:
        del now
        return "looks like another"


def test_a_frame_that_time_completes_is_a_frame() -> None:
    """Where a body's joints come one by one, packets make no frames themselves; they are not looked at all the same."""
    receiver, asked = FakeReceiver(), _Asked()
    source = Source(receiver, FeedDecoder(builtin_preset("joints")))  # type: ignore[arg-type] # all that is used
    source.unread = asked
    for number in range(40):
        receiver.packets.append((message("/Head", "fff", 0.0, 1.0, number / 100), ("127.0.0.1", 5000)))
        source.take(10 + number / 20)
        source.tend(10 + number / 20 + 0.04)
    # Until the first frame nothing is known.
    assert asked.kept <= 1
