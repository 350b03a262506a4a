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

from kinespace.stream import osc, zeromq
from kinespace.stream.frame import Frame
from kinespace.stream.recognizer import LiveSignature, Settings
from kinespace.tools.bench import memory
from kinespace.tools.bench.cases import capacity, startup
from kinespace.tools.bench.cases.capacity import Crowd, most_performers, play
from kinespace.tools.bench.cases.echo_floor import EmptyRecognizer, answer_to
from kinespace.tools.bench.cases.sockets import Sockets
from kinespace.tools.bench.cases.startup import Running
from kinespace.tools.loopback.answer_listener import answer_in

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from kinespace.tools.loopback.service_process import Transport

pytestmark = pytest.mark.slow

SETTINGS = Settings(signature=LiveSignature.PAPER)
NOBODY = Crowd(1, 10, 5, 5, 0, np.full(1000, 0.001), 0.0, (), None, None)


@pytest.mark.parametrize("transport", ["osc", "zmq"])
def test_a_crowd_is_answered_and_accounted_for(transport: Transport, played: NDArray[np.float32]) -> None:
    """All frames are sent, every answer due comes or is counted as lost, latencies exclude the warm-up."""
    found = play(transport, 3, played[:120], SETTINGS)
    assert (found.performers, found.sent) == (3, 360)
    # The first window is full with frame 19; from then on every fourth frame is answered.
    assert found.expected == 3 * 26
    assert found.status is not None
    assert found.answered + found.lost >= found.expected
    if not found.lost:
        assert found.answered == found.expected
        assert found.status.outcomes.recognizers.frames == 360
        # The first half second of answers warms up.
        assert found.seconds.size == 3 * 11
    assert (found.seconds > 0).all()
    assert (found.seconds < 60).all()
    assert all(megabytes > 10 for megabytes in found.resident_mb)


def test_lost_frames_are_counted(played: NDArray[np.float32], monkeypatch: pytest.MonkeyPatch) -> None:
    """When the recogniser has no room for all performers, their frames count as lost and no crowd is held."""
    service = capacity.BackgroundService
    monkeypatch.setattr(capacity, "BackgroundService", lambda *a, **k: service(*a, **{**k, "performers": 1}))
    found = play("osc", 2, played[:60], SETTINGS)
    assert found.status is not None
    assert found.status.outcomes.no_room == 60
    assert found.lost >= 60
    assert not found.held


@pytest.mark.parametrize("transport", ["osc", "zmq"])
def test_under_a_crowd_is_a_floor(transport: Transport, played: NDArray[np.float32]) -> None:
    """The empty loop answers the same frames with answers of the same size, timed in the same way."""
    found = play(transport, 3, played[:120], SETTINGS, empty=True)
    assert (found.performers, found.sent, found.expected) == (3, 360, 3 * 26)
    assert found.answered + found.lost == found.expected
    assert found.status is None
    if not found.lost:
        assert found.seconds.size == 3 * 11
    assert (found.seconds > 0).all()


def test_the_floor_answers_the_frames_that_are_due(played: NDArray[np.float32]) -> None:
    """Each performer's frames are counted for themselves, whatever order they come in; a greeting comes back."""
    positions = played[:48]
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

    monkeypatch.setattr(capacity, "play", played)
    found = most_performers("osc", np.zeros((1, 31, 3), np.float32), SETTINGS, most=500)
    if not limit:
        assert found is None
    else:
        assert found is not None
        assert min(limit, 500) / 1.1 - 1 <= found.performers <= min(limit, 500)
    assert max(tried) <= 500
    # A crowd that fails is tried three times and once more from above at most; a crowd that is held, once.
    assert all(tried.count(each) == 1 if each <= limit else tried.count(each) in (3, 6) for each in tried)


@pytest.mark.parametrize("disturbed", [range(2), range(4, 6), range(3, 9), range(1, 30, 3)])
def test_a_disturbance_does_not_end_the_search(disturbed: range, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whichever tries in a row or now and then fail for no reason of ours, the limit is found to a tenth."""
    tried: list[int] = []

    def played(_: str, performers: int, *__: object, **___: object) -> Crowd:
        tried.append(performers)
        return replace(NOBODY, performers=performers, lost=int(performers > 200 or len(tried) - 1 in disturbed))

    monkeypatch.setattr(capacity, "play", played)
    found = most_performers("osc", np.zeros((1, 31, 3), np.float32), SETTINGS)
    assert found is not None
    assert 200 / 1.1 - 1 <= found.performers <= 200


def test_capacity_is_a_share_of_the_empty_loop() -> None:
    """The share is of performers; without a crowd there is none."""
    found = Sockets(
        (),
        {"osc": replace(NOBODY, performers=60), "zmq": None},
        {"osc": replace(NOBODY, performers=400), "zmq": NOBODY},
        Running(1.0, None, None),
    )
    assert found.share("osc") == 0.15
    assert found.share("zmq") is None


def test_the_program_is_started_fed_and_ended(played: NDArray[np.float32]) -> None:
    """Start-up is a positive time; with more performers the program holds more memory."""
    found = startup.measure(played, LiveSignature.PAPER, starts=1, many=4)
    assert 0 < found.startup_s < 60
    if found.resident_mb is not None:
        assert found.resident_100_mb is not None
        assert found.resident_100_mb > found.resident_mb > 10


def test_memory_is_of_the_process_asked_for() -> None:
    """A process's memory shows in its resident memory; the memory of a missing process is unknown."""
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
    """A busy process's time agrees with its own count; the time of a missing process is unknown."""
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
    """Without `/proc`, `ps` gives about the same; without `ps` the memory is unknown."""
    monkeypatch.setattr(memory, "Path", lambda _: (_ for _ in ()).throw(FileNotFoundError))
    told = memory.resident_mb()
    monkeypatch.setattr(memory.shutil, "which", lambda _: None)
    assert memory.resident_mb() is None
    monkeypatch.undo()
    known = memory.resident_mb()
    if told is not None and known is not None:
        assert told == pytest.approx(known, rel=0.2)
