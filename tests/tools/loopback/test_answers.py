"""Answers: every packet with its receiver and its moment; answers computed beforehand, and paired with their frames."""

import time
from contextlib import closing

from hypothesis import given
from hypothesis import strategies as st

from kinespace.stream import osc
from kinespace.stream.recognition import Answer
from kinespace.tools.feeding.service import AnswerMatcher, Expected, Listener


def test_every_packet_is_received_in_order_with_its_moment(stage: osc.OscReceiver) -> None:
    """Datagrams that wait are all collected, in order, each with the receiver it came in on and when it was taken."""
    listener, before = Listener(stage), time.perf_counter()
    with closing(osc.OscSender(*stage.address)) as sender:
        for number in range(20):
            sender.send(b"%d" % number)
        received = listener.listen_until(before + 0.02)
        after = time.perf_counter()
        assert [each.packet for each in received] == [b"%d" % number for number in range(20)]
        assert all(each.receiver is stage for each in received)
        arrivals = [each.arrival for each in received]
        assert [before, *arrivals, after] == sorted([before, *arrivals, after])
        # A moment that is past is not waited for, but what waits is taken.
        assert listener.listen_until(0.0) == []
        sender.send(b"late")
        assert [each.packet for each in listener.listen_until(0.0)] == [b"late"]


def answer(label: str, score: float) -> Answer:
    """Make a received answer."""
    return Answer("me", 0, score, 0.1, label)


@given(st.lists(st.booleans(), max_size=40))
def test_answers_find_their_frames_and_the_missing_are_counted(arrived: list[bool]) -> None:
    """Whichever answers get lost, each that arrives is paired with its own frame, and the rest is lost or waiting."""
    expected = [Expected(3 * index, "wave", 0.5 + index / 1000) for index in range(len(arrived))]
    matcher = AnswerMatcher(expected)
    for each, has_arrived in zip(expected, arrived, strict=True):
        if has_arrived:
            assert matcher.match(answer(each.label, each.score + 4e-6)) == each
    assert matcher.lost + matcher.waiting == arrived.count(False)
