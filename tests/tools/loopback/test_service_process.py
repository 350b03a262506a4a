"""A service, or an echo, in a process of its own."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from typing import TYPE_CHECKING

import pytest
from programs import PATIENCE, motion_cues

from kinespace.library import MotionLibrary
from kinespace.stream import Announcement, Settings
from kinespace.tools.loopback.answer_listener import Listener, answer_in
from kinespace.tools.loopback.expected_answers import expected_answers
from kinespace.tools.loopback.service_process import BackgroundService

if TYPE_CHECKING:
    from kinespace.stream.recognition import Answer
    from kinespace.tools.feeding.feed import Packet
    from kinespace.tools.loopback.service_process import Transport

pytestmark = pytest.mark.slow

TRANSPORTS: tuple[Transport, ...] = ("osc", "zmq")


def hear(listener: Listener, count: int) -> list[Packet]:
    """Wait for some packets."""
    heard: list[Packet] = []
    until = time.monotonic() + PATIENCE
    while len(heard) < count and time.monotonic() < until:
        heard += [each.packet for each in listener.listen_until(time.perf_counter() + 0.01)]
    return heard


def hear_answer(listener: Listener) -> list[Answer]:
    """Wait for an answer."""
    answers: list[Answer] = []
    until = time.monotonic() + PATIENCE
    while not answers and time.monotonic() < until:
        answers += [answer for packet in hear(listener, 1) if (answer := answer_in(packet))]
    return answers


@pytest.mark.parametrize("transport", TRANSPORTS)
def test_a_feed_is_answered_from_another_process(transport: Transport) -> None:
    """Every answer that is due comes, as expected."""
    library, settings = MotionLibrary.builtin(), Settings()
    cues = motion_cues("squat1Reps", 1.2)
    expected = expected_answers(cues, library, settings)
    answers: list[Answer] = []
    with BackgroundService(transport, settings=settings) as service:
        sender, receiver = service.connect()
        listener = Listener(receiver)
        try:
            sender.announce(Announcement("dancer", library.skeleton.joints))
            due = {each.cue for each in expected}
            for place, cue in enumerate(cues):
                sender.send(sender.encode(cue))
                # An answer that is due is waited for, so that a socket never holds more than a few frames.
                answers += hear_answer(listener) if place in due else ()
        finally:
            sender.close()
            listener.close()
    assert [answer.label for answer in answers] == [each.label for each in expected]
    assert [answer.score for answer in answers] == pytest.approx([each.score for each in expected], abs=1e-5)


def test_an_error_in_the_process_is_raised_here() -> None:
    """An error in the other process is raised in this one, and no process or socket stays behind."""
    with (
        pytest.raises(ChildProcessError, match="most: expected at least 1 performer, got 0"),
        BackgroundService("osc", performers=0),
    ):
        pytest.fail("started without room for anybody")
    assert multiprocessing.active_children() == []


def test_a_killed_child_ends_quietly() -> None:
    """When the other process is killed, leaving the block neither waits nor raises."""
    with BackgroundService("osc") as service:
        os.kill(service.process_id, signal.SIGKILL)


def test_an_error_inside_the_block_stops_the_child() -> None:
    """A program that fails while the service runs takes it down with it."""
    with pytest.raises(RuntimeError, match="ours"), BackgroundService("osc"):
        raise RuntimeError("ours")
    assert multiprocessing.active_children() == []
