"""The messages of workers: what goes out comes back."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from synthetic import STICK_CLASSES, stick_clip

from kinespace.stream.frame import Announcement, Frame, NewSender
from kinespace.stream.recognition import Event, EventKind, Progress
from kinespace.stream.recognizer import Recognizer
from kinespace.stream.service import worker

if TYPE_CHECKING:
    from kinespace.library.motion_library import MotionLibrary
    from kinespace.stream.recognition import Recognition

POSITIONS = np.arange(18.0).reshape(6, 3) / 7


@pytest.mark.parametrize("kind", ["f4", "f8"])
def test_frames_come_back_to_the_last_bit(kind: str) -> None:
    """Positions keep their precision, and all else is as it was sent."""
    sent = worker.SentFrame.of(Frame("ann", 3.0, POSITIONS.astype(kind)))
    sent.joints, sent.begins = ("a", "b"), True
    (found,) = worker.decode_orders(worker.encode(worker.Orders(seen=[sent]))).seen
    new, announced, frame = found.events()
    assert (found, new, announced) == (sent, NewSender("ann"), Announcement("ann", ("a", "b")))
    assert isinstance(frame, Frame)
    assert (frame.performer, frame.time, frame.positions.dtype) == ("ann", 3.0, np.dtype(kind))
    assert np.array_equal(frame.positions, POSITIONS.astype(kind))


@pytest.fixture(scope="module")
def recognition(sticks: MotionLibrary) -> Recognition:
    """Give a recognition of a real window."""
    recognizer = Recognizer(sticks)
    clip = stick_clip(STICK_CLASSES[0], seed=80, frames=120)
    answers = [recognizer.push(Frame("ann", k / 120, each)) for k, each in enumerate(clip.positions)]
    return [each for each in answers if each][-1]


def test_answers_come_back_to_the_last_bit(recognition: Recognition) -> None:
    """Every number of a recognition, its progress and events come back, and the report with it."""
    event = Event("ann", EventKind.START, recognition.classes[1], 1, 0.5, 2.0)
    progress = Progress(recognition.classes[1], 0.5, 0.4, 1.0, 1.1, 0.9, 2)
    whole = replace(recognition, events=(event,), progress=progress, doubted=("c",))
    report = worker.Report(worker.PerformerCounts(), {"bob": "why"}, stale=4)
    back = worker.decode_answers(worker.encode(worker.Answers([whole], report)))
    (found,) = back.answers
    assert back.report == report
    assert np.array_equal(found.scores, whole.scores)
    assert {**asdict(found), "scores": ()} == {**asdict(whole), "scores": ()}
