"""`kinespace bench peers`: the recogniser and other methods on one feed, speed and accuracy side by side.

The feed is the motions of one person of the built-in library; all methods compare them with the other persons' motions.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kinespace.library import MotionLibrary
from kinespace.stream.recognizer import LiveSignature, Recognizer, Settings
from kinespace.tools.bench.baselines import FIRST, WINDOW, LeadingAxis, TimeWarping, by_eigh, by_svd
from kinespace.tools.bench.recorded import FRAME_RATE
from kinespace.tools.bench.report import Measured, table
from kinespace.tools.bench.timing import clock
from kinespace.tools.feeding.feed import clip_cues, resampled
from kinespace.tools.terminal.console import progress

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rich.table import Table

    from kinespace.library import Clip
    from kinespace.stream.frame import Frame
    from kinespace.tools.bench.report import Plan
    from kinespace.tools.feeding.feed import Cue

    #: Takes a frame, and names a class when an answer is due.
    Contender = Callable[[Frame], str | None]

#: The names of the other methods in the figures.
_OTHERS = {"svd": "SVD of the window", "eigh": "np.cov + eigh", "dtw": "DTW"}
FIGURES = (*(f"ratio_{key}" for key in _OTHERS), "accuracy", *(f"accuracy_{key}" for key in _OTHERS))
#: The person whose motions are played.
_PERSON = "bd"


class Peer(NamedTuple):
    """The result of one method.

    Attributes
    ----------
    us_per_frame
        Microseconds per frame, from joint positions to a class, median of the rounds.
    ratio
        Its cost relative to ours, median of the rounds' ratios.
    answers
        The number of answers after half a second of a motion.
    accuracy
        Share of them that named the motion's class.
    """

    us_per_frame: float
    ratio: float
    answers: int
    accuracy: float


def measure(plan: Plan) -> Measured:
    """Race all methods on the motions of one person of the built-in library."""
    peers = raced(MotionLibrary.builtin(), _PERSON, plan.rounds, plan.signature)
    figures = {f"ratio_{key}": peers[name].ratio for key, name in _OTHERS.items()}
    figures["accuracy"] = peers[plan.signature].accuracy
    figures |= {f"accuracy_{key}": peers[name].accuracy for key, name in _OTHERS.items()}
    return Measured(figures, [_table(peers, plan.signature)])


def _table(peers: dict[str, Peer], ours: LiveSignature) -> Table:
    most = max(peer.answers for peer in peers.values())
    title = f"Motions of {_PERSON} by the others' motions\ntimes: its cost in ours; right: of {most:,} answers"
    made = table(title, ("",), ("frames/s", f"times {ours}", "right"))
    for name, peer in peers.items():
        shown = f"ours, {name}" if name in list(LiveSignature) else name
        made.add_row(shown, f"{1e6 / peer.us_per_frame:,.0f}", f"{peer.ratio:,.2f}", f"{peer.accuracy:.1%}")
    return made


def raced(whole: MotionLibrary, person: str, rounds: int, ours: LiveSignature) -> dict[str, Peer]:
    """Measure all methods, ours first, on the motions of one person, compared with the other persons' motions.

    Parameters
    ----------
    whole
        Motions of several people who share classes, of HDM05's joints.
    person
        The person whose motions are played.
    rounds
        Pieces of the feed, of which medians are taken; a further piece before them warms up.
    ours
        The signature of ours with which all are compared.
    """
    contenders = contenders_of(whole.without(actors=[person]))
    played = [resampled(motion, FRAME_RATE) for motion in whole.motions if motion.actor == person]
    costs: dict[str, list[float]] = {name: [] for name in contenders}
    right: dict[str, list[bool]] = {name: [] for name in contenders}
    for piece in progress(_pieces(played, rounds + 1), "Racing", rounds + 1):
        for name, contender in contenders.items():
            start = clock()
            answers = [contender(cue.frame) for cue in piece]
            costs[name].append((clock() - start) * 1e6 / len(piece))
            right[name] += judged(piece, answers)
    us = {name: np.array(each[1:]) for name, each in costs.items()}
    return {
        name: Peer(
            float(np.median(us[name])),
            float(np.median(us[name] / us[ours])),
            len(right[name]),
            float(np.mean(right[name])),
        )
        for name in contenders
    }


def contenders_of(library: MotionLibrary) -> dict[str, Contender]:
    """Make all methods for a library, ours first."""
    svd, eigh, dtw = _OTHERS.values()
    return {
        LiveSignature.WINDOWS: _ours(library, Settings()),
        # The same window as the methods that compute the same.
        LiveSignature.PAPER: _ours(library, Settings(signature=LiveSignature.PAPER, window=WINDOW)),
        svd: LeadingAxis(library, FRAME_RATE, by_svd).push,
        eigh: LeadingAxis(library, FRAME_RATE, by_eigh).push,
        dtw: TimeWarping(library, FRAME_RATE).push,
    }


def _ours(library: MotionLibrary, settings: Settings) -> Contender:
    recognizer = Recognizer(library, settings)

    def push(frame: Frame) -> str | None:
        recognition = recognizer.push(frame)
        return recognition.classes[recognition.best] if recognition else None

    return push


def _pieces(motions: Sequence[Clip], count: int) -> list[list[Cue]]:
    """Distribute motions, so that each piece has some of each class; a second lies between two motions."""
    cues = list(clip_cues((motion for piece in range(count) for motion in motions[piece::count]), "bench"))
    ends = np.cumsum([0, *(sum(motion.frames for motion in motions[piece::count]) for piece in range(count))])
    return [cues[begin:end] for begin, end in pairwise(ends)]


def judged(piece: Sequence[Cue], answers: Sequence[str | None]) -> list[bool]:
    """Say whether each answer is the class performed; those of a motion's first half second do not count."""
    begin, last, right = 0.0, -np.inf, list[bool]()
    for cue, answer in zip(piece, answers, strict=True):
        if cue.due - last > FIRST:
            begin = cue.due
        last = cue.due
        # A difference of one frame is rounding.
        if answer is not None and cue.due - begin >= FIRST - 1.5 / FRAME_RATE:
            right.append(answer == cue.class_name)
    return right
