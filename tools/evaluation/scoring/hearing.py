"""Motions that are heard once and ask many libraries: their windows are computed once, and compared often."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, cast

import numpy as np

from kinespace.stream.frame import Frame
from kinespace.stream.recognition import Event, EventKind, Outcome, Recognition
from kinespace.stream.recognizer import Recognizer
from kinespace.stream.recognizer.decision import FIRST_HOP, Decision, needed_lead
from kinespace.stream.recognizer.event_detector import EventDetector

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from kinespace.library import Clip
    from kinespace.library.windows.index import WindowIndex
    from kinespace.library.windows.parts import Part
    from kinespace.stream.recognizer import Settings


@dataclass(frozen=True, slots=True, eq=False)
class Hop:
    """One hop of a motion, the same for every library with the same metrics.

    Attributes
    ----------
    time
        Seconds, on the motion's clock.
    movement, noise
        As the recogniser computed them.
    vectors
        The vectors of the windows that end now, for each group (axes,).
    """

    time: float
    movement: float
    noise: float
    vectors: Sequence[NDArray[np.float32]] = field(repr=False)


class _Listening:
    """Takes the place of an opened library in a recogniser, and keeps the numbers that are compared with it."""

    def __init__(self, index: WindowIndex) -> None:
        self._index = index
        self.placed: list[Sequence[NDArray[np.float32]]] = []

    def __getattr__(self, name: str) -> object:
        return getattr(self._index, name)

    def log_distances(self, numbers: Mapping[Part, NDArray[np.float64]]) -> NDArray[np.float64]:
        self.placed.append(self._index.comparison.place(numbers))
        return self._index.log_distances(numbers)


def starts_of(clip: Clip, index: WindowIndex, settings: Settings) -> list[Event]:
    """Push a motion through a recogniser of its own, frame by frame; give its start events."""
    recognizer = Recognizer(index, settings)
    moving = clip.as_of(index.library.skeleton)
    return [
        event
        for time, positions in zip(moving.times.tolist(), moving.positions, strict=True)
        if (recognition := recognizer.push(Frame("clip", time, positions))) is not None
        for event in recognition.events
        if event.kind is EventKind.START
    ]


def heard(clip: Clip, index: WindowIndex, settings: Settings) -> list[Hop] | None:
    """Push a motion through a recogniser of its own, and keep the numbers that it compares.

    Returns
    -------
    The hops; None for a motion in which the recogniser doubts joints or finds a jump: it needs the recogniser itself.
    """
    listening = _Listening(index)
    recognizer = Recognizer(cast("WindowIndex", listening), settings)
    moving = clip.as_of(index.library.skeleton)
    hops = []
    for time, positions in zip(moving.times.tolist(), moving.positions, strict=True):
        recognition = recognizer.push(Frame("clip", time, positions))
        if recognition is None:
            continue
        if recognition.doubted or recognition.outcome is Outcome.IMPLAUSIBLE or recognizer.doubt:
            return None
        noise = recognition.evidence.noise if recognition.evidence else 0.0
        hops.append(Hop(time, recognition.movement, noise, listening.placed[-1]))
    return hops


def starts_heard(hops: Sequence[Hop], index: WindowIndex, settings: Settings) -> list[Event]:
    """Give the start events of a recogniser that compares with another library.

    Parameters
    ----------
    hops
        The hops of one motion.
    index
        Some windows of the library that heard the motion, in the same metrics.
    settings
        The recogniser's settings.
    """
    decision = Decision(index, stillness=settings.stillness, sensitivity=settings.sensitivity)
    detector = EventDetector(needed_lead(index.library, settings))
    starts, last = list[Event](), math.nan
    for hop in hops:
        elapsed = FIRST_HOP if math.isnan(last) else hop.time - last
        last = hop.time
        decided = decision.push(index.distances_of(hop.vectors), hop.movement, hop.noise, elapsed)
        recognition = Recognition(
            performer="clip",
            time=hop.time,
            outcome=decided.outcome,
            classes=index.classes,
            scores=1 / (1 + np.exp(decided.distances)),
            guess=decided.guess,
            movement=hop.movement,
            lead=decided.lead,
            eigenvector_class=None,
            eigenvector_score=0.0,
            share=0.0,
            gap=0.0,
        )
        starts += [event for event in detector.push(recognition) if event.kind is EventKind.START]
    return starts
