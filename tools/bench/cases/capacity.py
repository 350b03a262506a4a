"""Performers sent by one process to a recogniser in another process; this process times the answers."""

from __future__ import annotations

import math
import multiprocessing
import time
from collections import defaultdict
from contextlib import closing
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kinespace.library import MotionLibrary
from kinespace.stream.frame import Frame
from kinespace.stream.zeromq import Endpoint
from kinespace.tools.bench.cases.echo_floor import EmptyRecognizer, answer_to
from kinespace.tools.bench.memory import core_seconds, resident_mb
from kinespace.tools.bench.recorded import FRAME_RATE
from kinespace.tools.feeding.feed import Cue, OscFrameSender, Pace, ZmqFrameSender
from kinespace.tools.loopback.answer_listener import Listener, answer_in
from kinespace.tools.loopback.expected_answers import expected_answers
from kinespace.tools.loopback.service_process import BackgroundService

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from multiprocessing.connection import Connection

    from numpy.typing import NDArray

    from kinespace.stream.recognizer import Settings
    from kinespace.stream.service.status import Status
    from kinespace.tools.loopback.answer_listener import Heard
    from kinespace.tools.loopback.service_process import Transport

#: The 99th percentile of the latency, at most: one frame at 120 Hz.
MAX_P99 = 1 / 120
#: Share by which a sender may be late; a later sender would limit the measurement.
_BEHIND = 0.02
#: Seconds in which ZeroMQ peers meet.
_MEETING = 1.0
#: Seconds after the last frame in which answers may still come.
_LINGER = 1.0
#: Seconds for which the parent listens before it checks the sender.
_LISTEN = 0.05
#: Seconds of answers at the beginning that do not count.
_WARM_UP = 0.5
#: Relative size of the steps in which the largest crowd is searched.
_RESOLUTION = 1.1
#: How often a crowd is tried before it counts as too large, and how often the search continues above its end.
_TRIES = 3
_LOOKS = 3
#: The factor by which the search then continues.
_ABOVE = 1.25
#: Seconds in which the sender's process must have encoded everything.
_MAX_START = 120.0


@dataclass(frozen=True, slots=True)
class Crowd:
    """The result for a number of performers.

    Attributes
    ----------
    performers
        The number of performers.
    sent, expected, answered
        Frames sent, answers due and answers received.
    lost
        Answers due that did not come, or frames lost on the way in if these were more.
    seconds
        Latency of each answer since its frame was sent, shape (answers,), without the first half second.
    behind
        Share by which sending took longer than the feed: above 0.02 the sender limited the measurement.
    resident_mb
        Memory of the recogniser's process during the run, sampled from its start to its end.
    core_share
        The share of one core that the recogniser's process used while frames were sent; other programs on the machine
        hardly change it. None if the system does not say.
    status
        The recogniser's counters at the end; None if it recognised nothing.
    """

    performers: int
    sent: int
    expected: int
    answered: int
    lost: int
    seconds: NDArray[np.float64] = field(repr=False)
    behind: float
    resident_mb: tuple[float, ...] = field(repr=False)
    core_share: float | None
    status: Status | None = field(repr=False)

    def percentile(self, percent: float) -> float:
        """Give a percentile of the latencies in milliseconds; NaN when there is none."""
        return float(np.percentile(self.seconds, percent)) * 1000 if self.seconds.size else float("nan")

    @property
    def held(self) -> bool:
        """Whether nothing was lost and 99 % of the answers came within a frame's time."""
        in_time = bool(self.seconds.size) and self.percentile(99) <= MAX_P99 * 1000
        return in_time and not self.lost and self.behind <= _BEHIND


def play(
    transport: Transport, performers: int, positions: NDArray[np.float32], settings: Settings, *, empty: bool = False
) -> Crowd:
    """Let so many performers do the same motion, each at a moment of its own, 120 times a second.

    A performer's frames are sent at an even share of the frame time after the performer's before, and performers enter
    one after the other, so that neither frames nor hops of all performers coincide.

    Parameters
    ----------
    transport
        "osc" or "zmq".
    performers
        The number of performers.
    positions
        The positions of each performer, shape (frames, joints, 3), metres.
    settings
        The settings of the recogniser.
    empty
        Recognise nothing: answer the same frames with a fixed answer.
    """
    hop = max(1, round(settings.hop * FRAME_RATE))
    cues = [Cue(k / FRAME_RATE, Frame("p", 1.0 + k / FRAME_RATE, each), k) for k, each in enumerate(positions)]
    due = [each.cue for each in expected_answers(cues, MotionLibrary.builtin(), settings)]
    stand_in = EmptyRecognizer(due, answer_to(positions, settings), positions.shape[1]) if empty else None
    with BackgroundService(transport, settings=settings, performers=performers, stand_in=stand_in) as service:
        greeter, receiver = service.connect()
        with closing(greeter), closing(Listener(receiver)) as listener:
            request = _Request(service.frames_to, performers, positions, hop)
            sent, behind, heard, used = _run(request, listener, service.process_id)
    status = service.status
    latencies, answered = _latencies(heard, sent, due)
    expected = performers * len(due)
    if status:
        missing = status.lost + status.unsent + sent.size - status.outcomes.recognizers.frames
    else:
        missing = 0 if empty else sent.size
    return Crowd(
        performers=performers,
        sent=sent.size,
        expected=expected,
        answered=answered,
        lost=max(expected - answered, missing, 0),
        seconds=latencies,
        behind=behind,
        resident_mb=used.resident_mb,
        core_share=used.core_share,
        status=status,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Request:
    address: str | tuple[str, int]
    performers: int
    positions: NDArray[np.float32]
    hop: int


class _Used(NamedTuple):
    """The memory (sampled) and the share of a core that the recogniser's process used."""

    resident_mb: tuple[float, ...]
    core_share: float | None


def _run(
    request: _Request, listener: Listener, process_id: int | None
) -> tuple[NDArray[np.float64], float, list[Heard], _Used]:
    """Start the sender, and listen until it is done and no more answers come."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_send, args=(theirs, request), daemon=True)
    process.start()
    theirs.close()
    heard: list[Heard] = []
    resident: list[float] = []
    try:
        if not ours.poll(_MAX_START):
            raise TimeoutError("the sender's process did not start")
        ours.recv()
        sampled, before, begun = 0.0, core_seconds(process_id), time.perf_counter()
        while not ours.poll():
            heard += listener.listen_until(time.perf_counter() + _LISTEN)
            if time.perf_counter() >= sampled:
                sampled = time.perf_counter() + 1.0
                resident += [megabytes] if (megabytes := resident_mb(process_id)) is not None else []
        sent, behind = ours.recv()
        after, ended = core_seconds(process_id), time.perf_counter()
        heard += listener.listen_until(time.perf_counter() + _LINGER)
    except EOFError:
        raise ChildProcessError("the sender's process ended before it was done") from None
    finally:
        process.kill()
        process.join()
        ours.close()
    share = None if before is None or after is None else (after - before) / (ended - begun)
    return sent, behind, heard, _Used(tuple(resident), share)


def _latencies(
    heard: Sequence[Heard], sent: NDArray[np.float64], due: Sequence[int]
) -> tuple[NDArray[np.float64], int]:
    """Pair each performer's answers, in order, with the frames they answer; give latencies and the number of answers.

    Where an answer is missing, the pairs of that performer are not known and do not count.
    """
    arrivals = defaultdict[str, list[float]](list)
    for each in heard:
        answer = answer_in(each.packet)
        if answer is not None:
            arrivals[answer.performer].append(each.arrival)
    answered = sum(map(len, arrivals.values()))
    first = next((index for index, cue in enumerate(due) if cue >= due[0] + _WARM_UP * FRAME_RATE), 0) if due else 0
    complete = {int(name[1:]): moments for name, moments in arrivals.items() if len(moments) == len(due)}
    latencies = [np.array(moments)[first:] - sent[index, due][first:] for index, moments in complete.items()]
    return np.concatenate([np.zeros(0), *latencies]), answered


def _send(connection: Connection, request: _Request) -> None:
    """Run in the sender's process: encode everything, report, send on schedule, report when each frame was sent."""
    address = request.address
    sender = ZmqFrameSender(Endpoint(address, bind=False)) if isinstance(address, str) else OscFrameSender(*address)
    count, frames = request.performers, len(request.positions)
    packets = [
        [sender.encode(Cue(0.0, Frame(f"p{index}", 1.0 + k / FRAME_RATE, each), k)) for index in range(count)]
        for k, each in enumerate(request.positions)
    ]
    if isinstance(sender, ZmqFrameSender):
        sender.greet()
        time.sleep(_MEETING)
    sent = np.zeros((count, frames))
    connection.send(None)
    pace = Pace()
    for moment in range(frames + request.hop - 1):
        for index in range(count):
            k = moment - index % request.hop
            if 0 <= k < frames:
                pace.wait_for((moment + index / count) / FRAME_RATE)
                # Before the call, because the answer may be on its way before the call returns.
                sent[index, k] = time.perf_counter()
                sender.send(packets[k][index])
    whole = (frames + request.hop - 1) / FRAME_RATE
    behind = max((time.perf_counter() - pace.moment(whole)) / whole, 0.0)
    connection.send((sent, behind))
    connection.recv()  # until the answers are heard: closing would drop messages that ZeroMQ still holds


def most_performers(
    transport: Transport, positions: NDArray[np.float32], settings: Settings, *, most: int = 1024, empty: bool = False
) -> Crowd | None:
    """Find the largest crowd that one core holds: nothing is lost, and p99 is within a frame's time.

    The crowd is doubled until it fails, and then searched in steps of a tenth. Noise of the machine only ever makes a
    crowd worse, so a crowd that fails is tried again. At the end the search tries a quarter more, in case a longer
    disturbance ended it, and goes on from there if that crowd is held.

    Parameters
    ----------
    transport, positions, settings, empty
        The same as for `play`.
    most
        The number of performers, at most.

    Returns
    -------
    None when one performer is too many.
    """

    def tried(performers: int) -> Crowd | None:
        crowds = (play(transport, performers, positions, settings, empty=empty) for _ in range(_TRIES))
        return next((crowd for crowd in crowds if crowd.held), None)

    held = _searched(tried, None, 8, most)
    for _ in range(_LOOKS):
        above = min(math.ceil(held.performers * _ABOVE), most) if held else 0
        found = tried(above) if held and above > held.performers else None
        if found is None:
            break
        held = _searched(tried, found, min(2 * above, most), most)
    return held


def _searched(tried: Callable[[int], Crowd | None], held: Crowd | None, trying: int, most: int) -> Crowd | None:
    """Double a crowd that is held, then close in on the largest crowd that is held."""
    low, high = held.performers if held else 0, most + 1
    while low < trying < high and (low == 0 or high / low > _RESOLUTION):
        found = tried(trying)
        if found:
            held, low = found, trying
        else:
            high = trying
        trying = min(2 * low, most) if high > most else (low + high) // 2
    return held
