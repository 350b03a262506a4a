"""Answers: every packet with its receiver and its moment; answers computed beforehand, and paired with their frames."""

import time
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from programs import builtin_library, motion_cues

from kinespace.stream import Frame, Recognizer, Settings, osc
from kinespace.stream.osc import answers as osc_answers
from kinespace.stream.recognition import Answer
from kinespace.stream.zeromq import answers as zeromq_answers
from kinespace.tools.feeding.feed import Cue
from kinespace.tools.feeding.service import AnswerMatcher, Expected, Listener, classes_in, expected_answers


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


@pytest.mark.parametrize("seconds", [0.0003, 0.003, 0.03])
def test_listening_lasts_until_the_moment(stage: osc.OscReceiver, seconds: float) -> None:
    """Without a packet, listening ends when the moment has come and not before."""
    moment = time.perf_counter() + seconds
    assert Listener(stage).listen_until(moment) == []
    assert time.perf_counter() >= moment


def test_the_classes_are_read_where_a_recogniser_lists_them() -> None:
    """By either transport; other packets, and broken ones, list none."""
    for packet in (osc_answers.encode_classes(("bow", "jump")), zeromq_answers.encode_classes(("bow", "jump"))):
        assert classes_in(packet) == ["bow", "jump"]
    for packet in (b"/motion/classes\0,", b"#bundle\0", [b"classes/", b"{}"], [b"classes/"], [b"status/", b"1"]):
        assert classes_in(packet) == []


def over_osc(cue: Cue) -> Frame:
    """Give the frame as decoded from a datagram."""
    (frame,) = osc.decode(osc.encode_frame(cue.frame), 0.0).events
    assert isinstance(frame, Frame)
    return frame


def answer(label: str, score: float) -> Answer:
    """Make a received answer."""
    return Answer("me", 0, score, 0.1, label)


def test_positions_are_rounded_as_the_wire_rounds_them() -> None:
    """Far from the origin, where float32 holds only centimetres, rounded positions are expected."""
    library = builtin_library()
    meant = [
        replace(cue, frame=replace(cue.frame, positions=cue.frame.positions + np.float64(9e4)))
        for cue in motion_cues("kickLFront1Reps", 1.2)
    ]
    exact, received = Recognizer(library), Recognizer(library)
    exact_scores = [each.score for cue in meant if (each := exact.push(cue.frame))]
    scores = [each.score for cue in meant if (each := received.push(over_osc(cue)))]
    expected = [each.score for each in expected_answers(meant, library, Settings())]
    assert expected == pytest.approx(scores, abs=1e-9)
    assert expected != pytest.approx(exact_scores, abs=1e-5)


@given(st.lists(st.booleans(), max_size=40))
def test_answers_find_their_frames_and_the_missing_are_counted(arrived: list[bool]) -> None:
    """Whichever answers get lost, each that arrives is paired with its own frame, and the rest is lost or waiting."""
    expected = [Expected(3 * index, "wave", 0.5 + index / 1000) for index in range(len(arrived))]
    matcher = AnswerMatcher(expected)
    for each, has_arrived in zip(expected, arrived, strict=True):
        if has_arrived:
            assert matcher.match(answer(each.label, each.score + 4e-6)) == each
    assert matcher.lost + matcher.waiting == arrived.count(False)


def test_an_unexpected_answer_changes_nothing() -> None:
    """An answer with another label or score matches none, and the next one still finds its own."""
    matcher = AnswerMatcher([Expected(0, "wave", 0.9), Expected(4, "wave", 0.8)])
    assert matcher.match(answer("bow", 0.9)) is None
    assert matcher.match(answer("wave", 0.85)) is None
    assert matcher.match(answer("wave", 0.9)) == Expected(0, "wave", 0.9)
    assert (matcher.lost, matcher.waiting) == (0, 1)


def test_two_answers_alike_are_taken_in_their_order() -> None:
    """Of two expected answers that say the same, the earlier is taken first and none is lost."""
    alike = [Expected(0, "still", 0.5), Expected(4, "still", 0.5)]
    matcher = AnswerMatcher(alike)
    assert [matcher.match(answer("still", 0.5)) for _ in range(3)] == [*alike, None]
    assert (matcher.lost, matcher.waiting) == (0, 0)
