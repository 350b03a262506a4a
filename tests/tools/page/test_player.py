"""Recordings begun and ended while a service runs, and played from any second, at any speed, paused."""

from __future__ import annotations

import os
import time
from typing import TYPE_CHECKING

import pytest

from kinespace.stream.inputs import OscDecoder, Source
from kinespace.stream.inputs.recording.kinerec import RawFile, RawPacket, RawWriter
from kinespace.stream.inputs.recording.recorder import RecordingSession
from kinespace.stream.osc import OscReceiver, OscSender
from kinespace.tools.page.player import PagePlan, Player
from kinespace.tools.page.requests import Play

if TYPE_CHECKING:
    from pathlib import Path

PATIENCE = 30.0


def _recorded(path: Path, packets: int, seconds: float) -> None:
    with RawWriter(path, ["osc 127.0.0.1:9310"]) as writer:
        for index in range(packets):
            writer.write(RawPacket(100.0 + seconds * index / (packets - 1), 0, "", (f"/n {index}".encode(),)))
    os.utime(path, (time.time() - 60, time.time() - 60))


def _heard(receiver: OscReceiver, until: bytes) -> list[bytes]:
    heard: list[bytes] = []
    end = time.monotonic() + PATIENCE
    while until not in heard:
        assert time.monotonic() < end, heard
        while (packet := receiver.receive()) is not None:
            heard.append(packet)
        time.sleep(0.002)
    return heard


def test_a_recording_is_played_from_any_second_and_stopped(tmp_path: Path) -> None:
    """Played from a second on, only the packets from there come; paused, it stays there."""
    _recorded(tmp_path / "a.kinerec", 11, 1000.0)
    receiver = OscReceiver("127.0.0.1", 0)
    player = Player(PagePlan("", "", recordings=tmp_path, osc_to=f"127.0.0.1:{receiver.address[1]}"))
    try:
        assert player.described() == {
            "recordings": [("a.kinerec", 1000.0)],
            "playing": "",
            "at": 0.0,
            "speed": 0.0,
            "trouble": "",
        }
        assert player.play(Play("b.kinerec")) == "no such recording"
        assert player.play(Play("../a.kinerec")) == "no such recording"
        # Ten thousand times as fast: the browser's limit is checked before.
        assert player.play(Play("a.kinerec", 800.0, 10_000.0)) == ""
        assert _heard(receiver, b"/n 10") == [b"/n 8", b"/n 9", b"/n 10"]
        assert player.play(Play("a.kinerec", 100.0, 1.0)) == ""
        assert _heard(receiver, b"/n 1") == [b"/n 1"]
        assert player.play(Play("a.kinerec", 150.0, 0.0)) == ""
        told = player.described()
        assert (told["playing"], told["at"], told["speed"]) == ("a.kinerec", 150.0, 0.0)
    finally:
        player.stop()
        receiver.close()


def test_an_unplayable_recording_is_reported(tmp_path: Path) -> None:
    """A file that is no recording lasts no time, and trouble is told, not raised."""
    (tmp_path / "bad.kinerec").write_bytes(b"rubbish")
    os.utime(tmp_path / "bad.kinerec", (1, 1))
    player = Player(PagePlan("", "", recordings=tmp_path))
    assert player.described()["recordings"] == [("bad.kinerec", 0.0)]
    assert player.play(Play("bad.kinerec")) == ""
    end = time.monotonic() + PATIENCE
    while not player.described()["trouble"]:
        assert time.monotonic() < end
        time.sleep(0.005)
    player.stop()


def test_a_recording_begins_and_ends_while_packets_come(tmp_path: Path) -> None:
    """Only what comes between start and stop is in the file; a second recording is another file."""
    receiver = OscReceiver("127.0.0.1", 0)
    sender = OscSender("127.0.0.1", receiver.address[1])
    source = Source(receiver, OscDecoder())

    def send(packet: bytes) -> None:
        sender.send(packet)
        end = time.monotonic() + PATIENCE
        while source.take(time.monotonic()) is None:
            assert time.monotonic() < end

    session = RecordingSession(tmp_path, [source])
    try:
        assert session.stop() == ""
        send(b"/before\0,\0\0\0")
        name = session.start()
        assert session.start() == name
        send(b"/during\0,\0\0\0")
        assert session.stop() == name
        send(b"/after\0\0,\0\0\0")
        end = time.monotonic() + PATIENCE
        while [packet.parts for packet in RawFile(tmp_path / name).packets()] != [(b"/during\0,\0\0\0",)]:
            assert time.monotonic() < end
            time.sleep(0.005)
        with pytest.raises(OSError, match=r"."):
            RecordingSession(tmp_path / "missing", [source]).start()
    finally:
        source.close()
        sender.close()
