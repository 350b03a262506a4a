"""`kinespace bench peers`: our recogniser and its alternatives on one feed, speed and accuracy side by side."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from library import MotionLibrary
from stream.frame import Frame
from stream.recognizer import LiveSignature, Recognizer, Settings
from tools.bench import alternatives
from tools.bench.alternatives import AlternativeRecognizer
from tools.bench.recorded import FRAME_RATE, Feed
from tools.bench.timing import in_turns, timed
from tools.console import progress
from tools.evaluate_stream import replay
from tools.streamscore import course_of, score_courses

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from library import Clip
    from library.labels import Segment
    from stream.recognition import Recognition
    from tools.bench.recorded import Recorded
    from tools.streamscore import Course

#: Seconds a contender's turn should take.
_TURN = 0.15
#: Most hops in a turn.
_MOST_HOPS = 60
#: Seconds that finding one contender's accuracy should take at most; a slower one is asked at fewer moments.
_ASKING = 20.0
#: Seconds that must lie in a segment for a moment to count as inside it, as `kinespace evaluate stream` has it.
_INSIDE = 1.0


class Contender(Protocol):
    """Whoever takes frames and gives recognitions."""

    def push(self, frame: Frame) -> Recognition | None:
        """Take in a frame; an answer when one is due."""


@dataclass(frozen=True, slots=True)
class Peer:
    """What one contender came to.

    Attributes
    ----------
    name
        Who.
    us_per_frame
        Microseconds per frame, from joint positions to class scores, median of the rounds.
    ratios
        How many times as long as each of our signatures it took, median of the rounds' ratios.
    accuracy, accuracy_inside
        Share of the labelled time of known motions whose class was the best guess, and the same where the last second
        lies wholly inside the segment: what `kinespace evaluate stream` calls frame and segment accuracy. None when no
        take is labelled.
    every
        At every how many hops it was asked for its accuracy.
    """

    name: str
    us_per_frame: float
    ratios: dict[LiveSignature, float]
    accuracy: float | None
    accuracy_inside: float | None
    every: int

    @property
    def frames_per_second(self) -> float:
        """How many frames of the feed it answers in a second."""
        return 1e6 / self.us_per_frame


@dataclass(frozen=True, slots=True)
class Peers:
    """All contenders, ours first, and by name what those need that could not take part."""

    peers: tuple[Peer, ...]
    missing: dict[str, str]

    def ratio(self, name: str, signature: LiveSignature) -> float | None:
        """Give how many times as long as ours a contender took; None when it is not there."""
        found = [peer.ratios[signature] for peer in self.peers if peer.name == name]
        return found[0] if found else None


def measure(recorded: Recorded, *, rounds: int, asking: float = _ASKING) -> Peers:
    """Race everybody that is installed over the same frames, and score what they answer to the labelled takes.

    Parameters
    ----------
    recorded
        The recordings; the clips must be those of the built-in library.
    rounds
        Of the race.
    asking
        Seconds that finding one contender's accuracy should take at most.
    """
    library = MotionLibrary.builtin()
    settings = {signature: Settings(signature=signature) for signature in LiveSignature}
    window, hop = Settings().window, round(Settings().hop * FRAME_RATE)
    makers = alternatives.makers(library, recorded.clips, window=window, frame_rate=FRAME_RATE)
    there = {name: make for name, (needs, make) in makers.items() if alternatives.is_installed(needs)}

    def asked(name: str, every: int = 1) -> AlternativeRecognizer:
        return AlternativeRecognizer(
            there[name](), library.classes, window=round(window * FRAME_RATE), hop=hop, every=every
        )

    positions = recorded.positions
    turns: dict[str, Callable[[], float]] = {
        **{signature: _OurTurns(Recognizer(library, each), positions).take for signature, each in settings.items()},
        **{name: _Turns(asked(name), positions, hop).take for name in there},
    }
    costs = in_turns(turns, rounds, what="Racing")
    ours = {signature: costs[signature] for signature in LiveSignature}
    hops = sum(take.frames for take in recorded.takes) / hop

    def result(name: str) -> Peer:
        us = float(np.median(costs[name]))
        # Whoever keeps a state must see every hop, and ours are quick.
        must_see_all = name in (*LiveSignature, "IncrementalPCA")
        every = 1 if must_see_all else max(1, round(us * 1e-6 * hop * hops / asking))
        courses = [
            replay(take, segments, library=library, classes=library.classes, settings=settings[LiveSignature(name)])
            if name in list(LiveSignature)
            else replayed(asked(name, every), take, segments, library=library, every=every)
            for take, segments in _labelled(recorded)
        ]
        score = score_courses(courses, library.classes, _INSIDE) if courses else None
        return Peer(
            name=name,
            us_per_frame=us,
            ratios={signature: float(np.median(costs[name] / each)) for signature, each in ours.items()},
            accuracy=score.frame_accuracy if score else None,
            accuracy_inside=score.segment_accuracy if score else None,
            every=every,
        )

    return Peers(
        peers=tuple(result(name) for name in progress(list(turns), "Accuracy", len(turns))),
        missing={name: needs for name, (needs, _) in makers.items() if name not in there},
    )


def _labelled(recorded: Recorded) -> list[tuple[Clip, tuple[Segment, ...]]]:
    return [each for each in zip(recorded.takes, recorded.segments, strict=True) if each[1]]


class _OurTurns:
    """Our recogniser, going on along the feed."""

    def __init__(self, recognizer: Recognizer, positions: NDArray[np.float32]) -> None:
        self._recognizer = recognizer
        self._feed = Feed(positions)
        for frame in self._feed.take(round(3 * FRAME_RATE)):
            recognizer.push(frame)

    def take(self) -> float:
        """Take some seconds of feed; microseconds per frame."""
        frames = self._feed.take(4 * _MOST_HOPS)

        def push() -> None:
            for frame in frames:
                self._recognizer.push(frame)

        return timed(push) * 1e6 / len(frames)


class _Turns:
    """An alternative, going on along the feed by as many hops as a turn has room for."""

    def __init__(self, recognizer: AlternativeRecognizer, positions: NDArray[np.float32], hop: int) -> None:
        self._recognizer = recognizer
        self._feed = Feed(positions)
        self._hop = hop
        self._hops = 1
        recognizer.fill(self._feed)

    def take(self) -> float:
        """Take some hops of feed; microseconds per frame."""
        frames = self._feed.take(self._hops * self._hop)

        def push() -> None:
            for frame in frames:
                self._recognizer.push(frame)

        seconds = timed(push)
        self._hops = min(max(1, int(_TURN / seconds * self._hops)), _MOST_HOPS)
        return seconds * 1e6 / len(frames)


def replayed(
    contender: Contender, take: Clip, segments: Sequence[Segment], *, library: MotionLibrary, every: int
) -> Course:
    """Push a take through a contender, and lay its answers beside the labels.

    Somebody who is asked at few hops only is judged at those moments only: a sample of all moments, not a late answer.

    Parameters
    ----------
    contender
        Who has seen nothing yet.
    take, segments
        The take and what is performed when.
    library
        What is recognised with.
    every
        At every how many hops it answers.
    """
    recognitions = []
    for time, positions in zip(take.times.tolist(), take.positions, strict=True):
        recognition = contender.push(Frame(take.name, time, positions))
        if recognition is not None:
            recognitions.append(recognition)
    times = take.times if every == 1 else np.array([each.time for each in recognitions])
    return course_of(
        take.name,
        times,
        segments,
        classes=library.classes,
        known=library.classes,
        recognitions=recognitions,
        events=(),
    )
