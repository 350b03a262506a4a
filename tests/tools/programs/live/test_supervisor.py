"""`kinespace live` kept running: its log for programs, and what it says to systemd."""

import json
import signal
import socket
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from kinespace.library import MotionLibrary
from kinespace.stream import Frame, osc
from kinespace.tools.feeding.service import Program

pytestmark = pytest.mark.skipif(not hasattr(socket, "AF_UNIX"), reason="systemd is Linux's")


def _said(notified: socket.socket, until: str) -> list[str]:
    """Collect what is said to systemd until a line comes."""
    said = list[str]()
    while until not in "\n".join(said):
        said += notified.recv(4096).decode().splitlines()
    return said


@pytest.mark.slow
def test_live_keeps_a_log_and_speaks_to_systemd(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """READY once, WATCHDOG with each status, STOPPING at the end; each line of the log is one JSON object."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as notified:
        notified.bind(f"{tmp_path / 'notify'}")
        notified.settimeout(60.0)
        monkeypatch.setenv("NOTIFY_SOCKET", f"{tmp_path / 'notify'}")
        with Program("live", "--log", "json", "--osc-in=127.0.0.1:0", "--osc-out=127.0.0.1:9") as program:
            (port,) = program.expect(r"listening on OSC 127.0.0.1:(\d+)").groups()
            begun = _said(notified, "STATUS=")
            assert begun[:2] == ["READY=1", "WATCHDOG=1"]
            assert begun[2].startswith("STATUS=waiting: 0 performers")
            kick = next(each for each in MotionLibrary.builtin().motions if each.class_name == "kickLFront1Reps")
            sender = osc.OscSender("127.0.0.1", int(port))
            for moment, positions in zip(kick.times.tolist(), kick.positions, strict=True):
                sender.send(osc.encode_frame(Frame("ann", 1.0 + moment, positions)))
                time.sleep(1 / 120)
            sender.close()
            later = _said(notified, ": 1 performers")
            assert "READY=1" not in later
            program.process.send_signal(signal.SIGTERM)
            _said(notified, "STOPPING=1")
            program.process.wait(60.0)
            lines = [json.loads(line) for line in program.printed.splitlines()]
    assert {"time", "level", "text"} <= set.intersection(*map(set, lines))
    starts = [line for line in lines if line.get("what") == "start"]
    assert {(line["performer"], line["class"], line["level"]) for line in starts} == {
        ("ann", "kickLFront1Reps", "info")
    }
    assert abs(datetime.fromisoformat(starts[0]["time"]) - datetime.now(UTC)) < timedelta(minutes=5)


@pytest.mark.slow
def test_without_systemd_a_log_in_text_has_levels(monkeypatch: pytest.MonkeyPatch) -> None:
    """A time, a level and the line."""
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    with Program("live", "--log", "text", "--osc-in=127.0.0.1:0", "--osc-out=127.0.0.1:9") as program:
        program.expect(r"(?m)^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z info    listening on OSC")
