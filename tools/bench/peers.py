"""`kinespace bench peers`: the recogniser and other methods on one feed, speed and accuracy side by side.

The feed is the motions of one person of the built-in library; all methods compare them with the other persons' motions.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kinespace.library import MotionLibrary
from kinespace.stream.recognizer import LiveSignature, Recognizer, Settings
from kinespace.tools.bench.baselines import FIRST, WINDOW, LeadingAxis, TimeWarping
from kinespace.tools.bench.recorded import FRAME_RATE
from kinespace.tools.bench.report import Measured
from kinespace.tools.bench.timing import clock
from kinespace.tools.feeding.feed import clip_cues, resampled
from kinespace.tools.terminal.console import progress
from kinespace.tools.terminal.tables import table_of

if TYPE_CHECKING:
    from kinespace.stream.frame import Frame
    from kinespace.tools.bench.baselines import Alternative
    from kinespace.tools.bench.report import Plan

#: The names of the other methods in the figures.
_OTHERS = {"svd": "SVD of the window", "dtw": "DTW"}
FIGURES = (*(f"ratio_{key}" for key in _OTHERS), "accuracy", *(f"accuracy_{key}" for key in _OTHERS))
#: The person whose motions are played.
_PERSON = "bd"


class Peer(NamedTuple):
    """The result of one method.

    Attributes
    ----------
    us_per_frame
        Microseconds per frame, from joint positions to a class, median of the motions.
    ratio
        Its cost relative to ours, median of the motions' ratios.
    answers
        The number of answers after half a second of a motion.
    accuracy
        Share of them that named the motion's class.
    """

    us_per_frame: float
    ratio: float
    answers: int
    accuracy: float


def measure(_: Plan) -> Measured:
    """Race all methods on the motions of one person of the built-in library."""
    peers = raced(MotionLibrary.builtin(), _PERSON)
    figures = {f"ratio_{key}": peers[name].ratio for key, name in _OTHERS.items()}
    figures["accuracy"] = peers[LiveSignature.WINDOWS].accuracy
    figures |= {f"accuracy_{key}": peers[name].accuracy for key, name in _OTHERS.items()}
    most = max(peer.answers for peer in peers.values())
    title = f"Motions of {_PERSON} by the others' motions\ntimes: its cost in ours; right: of {most:,} answers"
    rows = [
        (
            f"ours, {name}" if name in list(LiveSignature) else name,
            *(f"{1e6 / peer.us_per_frame:,.0f}", f"{peer.ratio:,.2f}", f"{peer.accuracy:.1%}"),
        )
        for name, peer in peers.items()
    ]
    return Measured(figures, [table_of(title, ("", "frames/s", "times windows", "right"), rows)])


def raced(whole: MotionLibrary, person: str) -> dict[str, Peer]:
    """Measure all methods, ours first, on the motions of one person, compared with the other persons' motions.

    Parameters
    ----------
    whole
        Motions of several people who share classes, of HDM05's joints.
    person
        The person whose motions are played, twice the first, which warms up.
    """
    contenders = contenders_of(whole.without(actors=[person]))
    own = [resampled(motion, FRAME_RATE) for motion in whole.motions if motion.actor == person]
    costs: dict[str, list[float]] = {name: [] for name in contenders}
    right: dict[str, list[bool]] = {name: [] for name in contenders}
    first = round(FIRST * FRAME_RATE) - 1
    for motion in progress([own[0], *own], "Racing", len(own) + 1):
        frames = [cue.frame for cue in clip_cues([motion], "bench")]
        for name, contender in contenders.items():
            contender.begin()
            start = clock()
            answers = [contender.push(frame) for frame in frames]
            costs[name].append((clock() - start) * 1e6 / len(frames))
            right[name] += [each == motion.class_name for each in answers[first:] if each is not None]
    us = {name: np.array(each[1:]) for name, each in costs.items()}
    return {
        name: Peer(
            float(np.median(us[name])),
            float(np.median(us[name] / us[LiveSignature.WINDOWS])),
            len(right[name]),
            float(np.mean(right[name])),
        )
        for name in contenders
    }


def contenders_of(library: MotionLibrary) -> dict[str, _Ours | Alternative]:
    """Make all methods for a library, ours first."""
    return {
        LiveSignature.WINDOWS: _Ours(library, Settings()),
        # The same window as the method that computes the same.
        LiveSignature.PAPER: _Ours(library, Settings(signature=LiveSignature.PAPER, window=WINDOW)),
        _OTHERS["svd"]: LeadingAxis(library, FRAME_RATE),
        _OTHERS["dtw"]: TimeWarping(library, FRAME_RATE),
    }


class _Ours:
    """The recogniser's guesses."""

    def __init__(self, library: MotionLibrary, settings: Settings) -> None:
        self._recognizer = Recognizer(library, settings)

    def begin(self) -> None:
        self._recognizer.reset()

    def push(self, frame: Frame) -> str | None:
        recognition = self._recognizer.push(frame)
        return recognition.classes[recognition.best] if recognition else None
