"""`kinespace bench peers`: the recogniser and its alternatives on one feed, speed and accuracy side by side.

The feed is the motions of one person of the built-in library; all methods compare them with the other persons' motions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kinespace.stream.recognizer import LiveSignature, Recognizer, Settings
from kinespace.tools.bench.cases import baselines
from kinespace.tools.bench.cases.baselines import Hopping
from kinespace.tools.bench.recorded import FRAME_RATE
from kinespace.tools.bench.timing import clock
from kinespace.tools.feeding.feed import clip_cues, resampled
from kinespace.tools.terminal.console import progress

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from kinespace.library import Clip, MotionLibrary
    from kinespace.stream.frame import Frame
    from kinespace.tools.feeding.feed import Cue

    #: Takes a frame, and names a class when an answer is due.
    Contender = Callable[[Frame], str | None]

#: Seconds of a motion before answers count; no method answers sooner.
_FIRST = 0.5


@dataclass(frozen=True, slots=True)
class Peer:
    """The result of one method.

    Attributes
    ----------
    name
        The method's name.
    us_per_frame
        Microseconds per frame, from joint positions to a class, median of the rounds.
    ratios
        Its cost relative to each of our signatures, median of the rounds' ratios.
    accuracy
        Share of the answers after half a second of a motion whose best guess was the motion's class.
    """

    name: str
    us_per_frame: float
    ratios: dict[LiveSignature, float]
    accuracy: float

    @property
    def frames_per_second(self) -> float:
        """How many frames of the feed it handles in a second."""
        return 1e6 / self.us_per_frame


@dataclass(frozen=True, slots=True)
class Peers:
    """All methods, ours first, and the motions and answers on which their accuracy rests.

    Attributes
    ----------
    peers
        The methods in their order.
    person
        The person whose motions were played.
    motions, answers
        The number of motions, and the number of answers of each method that count, about.
    """

    peers: tuple[Peer, ...]
    person: str
    motions: int
    answers: int

    def peer(self, name: str) -> Peer | None:
        """Give a method's result; None when it was not measured."""
        return next((peer for peer in self.peers if peer.name == name), None)


def measure(whole: MotionLibrary, *, person: str, rounds: int) -> Peers:
    """Measure all methods on the motions of one person, compared with the other persons' motions.

    Parameters
    ----------
    whole
        Motions of several people who share classes, of HDM05's joints.
    person
        The person whose motions are played.
    rounds
        Pieces of the feed, of which medians are taken; a further piece before them warms up.
    """
    library = whole.without(actors=[person])
    played = [resampled(motion, FRAME_RATE) for motion in whole.motions if motion.actor == person]
    hop, first = round(Settings().hop * FRAME_RATE), round(_FIRST * FRAME_RATE)
    contenders: dict[str, Contender] = {
        **{each: _ours(library, _settings(each)) for each in LiveSignature},
        **{
            name: Hopping(make(), library.classes, first=first, hop=hop).push
            for name, make in baselines.makers(library, FRAME_RATE).items()
        },
    }
    pieces = _pieces(played, rounds + 1)
    costs: dict[str, list[float]] = {name: [] for name in contenders}
    right: dict[str, list[bool]] = {name: [] for name in contenders}
    for piece in progress(pieces, "Racing", len(pieces)):
        for name, contender in contenders.items():
            start = clock()
            answers = [contender(cue.frame) for cue in piece]
            costs[name].append((clock() - start) * 1e6 / len(piece))
            right[name] += _judged(piece, answers)
    us = {name: np.array(each[1:]) for name, each in costs.items()}
    return Peers(
        peers=tuple(
            Peer(
                name=name,
                us_per_frame=float(np.median(us[name])),
                ratios={signature: float(np.median(us[name] / us[signature])) for signature in LiveSignature},
                accuracy=float(np.mean(right[name])),
            )
            for name in contenders
        ),
        person=person,
        motions=len(played),
        answers=max(map(len, right.values())),
    )


def _settings(signature: LiveSignature) -> Settings:
    """Give the paper's signature the same window as the alternatives that compute the same."""
    return Settings(signature=signature, window=baselines.WINDOW if signature is LiveSignature.PAPER else None)


def _ours(library: MotionLibrary, settings: Settings) -> Contender:
    recognizer = Recognizer(library, settings)

    def push(frame: Frame) -> str | None:
        recognition = recognizer.push(frame)
        return recognition.classes[recognition.best] if recognition else None

    return push


def _pieces(motions: Sequence[Clip], count: int) -> list[list[Cue]]:
    """Distribute motions, so that each piece has some of each class; a second lies between two motions."""
    cues = list(clip_cues((motion for piece in range(count) for motion in motions[piece::count]), "bench"))
    ends = np.cumsum([sum(motion.frames for motion in motions[piece::count]) for piece in range(count)])
    return [cues[begin:end] for begin, end in zip([0, *ends[:-1]], ends, strict=True)]


def _judged(piece: Sequence[Cue], answers: Sequence[str | None]) -> list[bool]:
    """Say for each answer that counts whether it is the class performed."""
    begin, last, judged = 0.0, -np.inf, list[bool]()
    for cue, answer in zip(piece, answers, strict=True):
        if cue.due - last > _FIRST:
            begin = cue.due
        last = cue.due
        # A difference of one frame is rounding.
        if answer is not None and cue.due - begin >= _FIRST - 1.5 / FRAME_RATE:
            judged.append(answer == cue.class_name)
    return judged
