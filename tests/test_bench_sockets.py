"""`kinespace bench sockets`: crowds, start-up and memory. No figure is held against a limit here."""

from __future__ import annotations

import mmap
import os
import sys
import time
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from stream import osc, zeromq
from stream.frame import Frame
from stream.recognizer import LiveSignature, Settings
from tools import latency
from tools.bench import crowd, memory, running
from tools.bench.crowd import Crowd, most_performers, play
from tools.bench.floor import EmptyRecognizer, answer_to
from tools.listener import answer_in

if TYPE_CHECKING:
    from tools.background import Transport
    from tools.bench.recorded import Recorded

SETTINGS = Settings(signature=LiveSignature.EIGENVECTOR, window=0.3)
NOBODY = Crowd(1, 10, 5, 5, 0, np.full(1000, 0.001), 0.0, (), None, None)


@pytest.mark.parametrize("transport", ["osc", "zmq"])
def test_a_crowd_is_answered_and_accounted_for(transport: Transport, recordings: Recorded) -> None:
    """Everybody's frames are sent, every answer due is answered or lost, latencies are those after the warm-up."""
    found = play(transport, 3, recordings.positions[:120], SETTINGS)
    assert (found.performers, found.sent) == (3, 360)
    # A window of 36 frames is full with the 37th; from then on every fourth frame is answered.
    assert found.expected == 3 * 21
    assert found.status is not None
    assert found.answered + found.lost >= found.expected
    if not found.lost:
        assert found.answered == found.expected
        assert found.status.outcomes.recognizers.frames == 360
        # The first half second of answers warms up.
        assert found.seconds.size == 3 * 6
    assert (found.seconds > 0).all()
    assert (found.seconds < 60).all()
    assert all(megabytes > 10 for megabytes in found.resident_mb)


def test_what_is_lost_is_seen(recordings: Recorded, monkeypatch: pytest.MonkeyPatch) -> None:
    """When a crowd is larger than the recogniser has room for, the frames it refused are lost and nothing is held."""
    service = crowd.BackgroundService
    monkeypatch.setattr(crowd, "BackgroundService", lambda *a, **k: service(*a, **{**k, "performers": 1}))
    found = play("osc", 2, recordings.positions[:60], SETTINGS)
    assert found.status is not None
    assert found.status.outcomes.no_room == 60
    assert found.lost >= 60
    assert not found.held


@pytest.mark.parametrize("transport", ["osc", "zmq"])
def test_under_a_crowd_is_a_floor(transport: Transport, recordings: Recorded) -> None:
    """Where nothing is recognised the same frames are answered, with answers as large as ours, and timed alike."""
    found = play(transport, 3, recordings.positions[:120], SETTINGS, empty=True)
    assert (found.performers, found.sent, found.expected) == (3, 360, 3 * 21)
    assert found.answered + found.lost == found.expected
    assert found.status is None
    if not found.lost:
        assert found.seconds.size == 3 * 6
    assert (found.seconds > 0).all()


def test_the_floor_answers_the_frames_that_are_due(recordings: Recorded) -> None:
    """Each performer's frames are counted for themselves, whatever order they come in; a greeting comes back."""
    positions = recordings.positions[:48]
    answer = answer_to(positions, SETTINGS)
    empty = EmptyRecognizer({1, 3}, answer, positions.shape[1])
    frames = [Frame(name, 1.0 + k, each) for k, each in enumerate(positions[:5]) for name in ("a", "bb")]
    for encoded in (osc.encode_frame, lambda frame: zeromq.encode_frame(frame, 0)):
        answered = [(frame.performer, int(frame.time) - 1, empty.answer(encoded(frame))) for frame in frames]
        heard = {(name, index): answer_in(packet).performer for name, index, packet in answered if packet}
        assert heard == {(name, index): name for name in ("a", "bb") for index in (1, 3)}
    assert empty.answer(osc.encode_frame(frames[0])) is None
    assert answered[2][2] == zeromq.encode_recognition(replace(answer, performer="a"))
    assert empty.answer([b"hello/", b""]) == [b"hello/", b""]
    with pytest.raises(ValueError, match="positions"):
        answer_to(positions[:10], SETTINGS)


@pytest.mark.parametrize(
    ("change", "held"),
    [
        ({}, True),
        ({"lost": 1}, False),
        ({"seconds": np.full(1000, 0.009)}, False),
        ({"seconds": np.append(np.full(995, 0.001), np.full(5, 0.5))}, True),
        ({"seconds": np.zeros(0)}, False),
        ({"behind": 0.1}, False),
    ],
)
def test_a_crowd_is_held_when_nothing_is_lost_or_late(change: dict[str, object], held: bool) -> None:  # noqa: FBT001 - a parameter of the test
    """Lost answers, a p99 above a frame's time, no answers or a sender that could not keep up: not held."""
    assert replace(NOBODY, **change).held == held  # type: ignore[arg-type]


@pytest.mark.parametrize("limit", [0, 1, 7, 8, 9, 37, 100, 499, 500, 9999])
def test_the_largest_crowd_is_found_to_a_tenth(limit: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The search ends at most a tenth below the limit and never above it or above the most asked for."""
    tried: list[int] = []

    def played(_: str, performers: int, *__: object, **___: object) -> Crowd:
        tried.append(performers)
        return replace(NOBODY, performers=performers, lost=int(performers > limit))

    monkeypatch.setattr(crowd, "play", played)
    found = most_performers("osc", np.zeros((1, 31, 3), np.float32), SETTINGS, most=500)
    if not limit:
        assert found is None
    else:
        assert found is not None
        assert min(limit, 500) / 1.1 - 1 <= found.performers <= min(limit, 500)
    assert max(tried) <= 500
    # Whatever fails is tried twice, whatever is held once.
    assert all(tried.count(each) == (1 if each <= limit else 2) for each in tried)


def test_noise_gets_a_second_try(monkeypatch: pytest.MonkeyPatch) -> None:
    """A crowd that fails once and is held the second time is held."""
    tried: list[int] = []

    def played(_: str, performers: int, *__: object, **___: object) -> Crowd:
        tried.append(performers)
        return replace(NOBODY, performers=performers, lost=int(tried.count(performers) == 1))

    monkeypatch.setattr(crowd, "play", played)
    found = most_performers("osc", np.zeros((1, 31, 3), np.float32), SETTINGS, most=16)
    assert found is not None
    assert found.performers == 16


def test_latency_can_be_measured_on_recorded_frames(recordings: Recorded) -> None:
    """Frames that are given are what is sent, begun again when they are too few."""
    found = latency.measure("osc", rate_hz=100.0, seconds=1.0, settings=SETTINGS, positions=recordings.positions[:80])
    assert found.sent == 100
    assert found.answered + found.lost > 0


def test_the_program_is_started_fed_and_ended(recordings: Recorded) -> None:
    """Start-up is a positive time; with more performers the program holds more memory."""
    found = running.measure(recordings.positions, LiveSignature.EIGENVECTOR, starts=1, many=4)
    assert 0 < found.startup_s < 60
    if found.resident_mb is not None:
        assert found.resident_100_mb is not None
        assert found.resident_100_mb > found.resident_mb > 10


def test_memory_is_of_the_process_asked_for() -> None:
    """What a process takes shows in its resident memory, asked for by number or not; nobody's is unknown."""
    before = memory.resident_mb()
    if before is None:
        pytest.skip("this system does not say how much memory a process holds")
    # Asked of the system itself: an array may lie in memory that earlier ones have left to the process.
    with mmap.mmap(-1, 64 << 20) as taken:
        taken.write(bytes(64 << 20))
        after = memory.resident_mb(os.getpid())
    assert after is not None
    assert after - before > 32
    assert memory.resident_mb(2**22 + 1) is None


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux is asked")
def test_time_on_a_core_is_of_the_process_asked_for() -> None:
    """A process that computes has had a core for about as long as it says itself; one that is not there, for none."""
    before, begun = memory.core_seconds(), time.process_time()
    while time.process_time() < begun + 0.3:
        pass
    after, ended = memory.core_seconds(os.getpid()), time.process_time()
    assert before is not None
    assert after is not None
    # The system counts hundredths of a second.
    assert after - before == pytest.approx(ended - begun, abs=0.1)
    assert memory.core_seconds(2**22 + 1) is None


def test_memory_is_asked_of_ps_where_there_is_no_proc(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without `/proc` `ps` tells about the same; without `ps` nobody does."""
    monkeypatch.setattr(memory, "Path", lambda _: (_ for _ in ()).throw(FileNotFoundError))
    told = memory.resident_mb()
    monkeypatch.setattr(memory.shutil, "which", lambda _: None)
    assert memory.resident_mb() is None
    monkeypatch.undo()
    known = memory.resident_mb()
    if told is not None and known is not None:
        assert told == pytest.approx(known, rel=0.2)
