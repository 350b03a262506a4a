"""The answer: the movement of a performer in one window, its score, the reason if no class is named, and events."""

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from kinespace.library.windows.rejection import Evidence

#: The label of a performer who has left.
GONE = "gone"


class Outcome(StrEnum):
    """Why a recognition names a class or names none."""

    NAMED = "named"
    #: The body hardly moves: there is no eigenvector to compare.
    STILL = "still"
    #: The nearest class is not near enough: the movement is probably no class of the library.
    UNKNOWN = "unknown"
    #: The two leading eigenvalues are nearly equal: the eigenvector is any direction between two.
    AMBIGUOUS = "ambiguous"
    #: The body moves as no body can, or too few joints can be believed (`stream.recognizer.joints`).
    IMPLAUSIBLE = "implausible"


class EventKind(StrEnum):
    """Start or end."""

    START = "start"
    END = "end"


@dataclass(frozen=True, slots=True)
class Event:
    """A motion has started or ended.

    Attributes
    ----------
    performer
        The performer's name.
    kind
        Start or end.
    label, index
        Class name and index.
    score
        Score of the class at that moment.
    time
        The moment of the decision, seconds, on the clock of the frames.
    """

    performer: str
    kind: EventKind
    label: str
    index: int
    score: float
    time: float


@dataclass(frozen=True, slots=True)
class Done:
    """A motion was really done: its whole course was seen, from its beginning to its end.

    Attributes
    ----------
    performer
        The performer's name.
    label, index
        Class name and index.
    start, duration
        When it began, seconds, on the clock of the frames, and for how many seconds it went on.
    score
        0 to 1, how sure it is; the limit follows from the false alarms that are accepted.
    speed, amplitude
        1 as fast, and as large, as the nearest motion of the library; 2 twice as fast, twice as large.
    count
        Its number among the performer's motions of this class, from 1; 0 before it is counted.
    """

    performer: str
    label: str
    index: int
    start: float
    duration: float
    score: float
    speed: float
    amplitude: float
    count: int = 0

    @property
    def end(self) -> float:
        """When it ended, seconds, on the clock of the frames."""
        return self.start + self.duration


@dataclass(frozen=True, slots=True)
class Progress:
    """How far in a motion a performer is.

    Attributes
    ----------
    class_name
        The motion.
    phase
        0 at the motion's start, 1 at its end.
    scrub
        A phase for scrubbing a recording: it goes back only when the motion is well behind it.
    speed
        1 as fast as the library's mean recording, 2 twice as fast.
    amplitude
        1 as large as the library's recordings at this phase.
    sure
        How probable it is that the phase is right within 0.1, 0 to 1: low where a motion's start and end look alike.
    cycles
        Whole rounds of a cyclic motion since it was named.
    """

    class_name: str
    phase: float
    scrub: float
    speed: float
    amplitude: float
    sure: float
    cycles: int


@dataclass(frozen=True, slots=True)
class Gone:
    """A performer has left: nothing more is answered."""

    performer: str


@dataclass(frozen=True, slots=True)
class Classes:
    """The class names, in the order in which indices count them."""

    names: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Seen:
    """A motion whose course was seen (`stream.recognizer.done`): its first part, or all of it.

    Attributes
    ----------
    class_name
        Its class.
    score
        1 for the very motion of the library, 0.5 at the limit; less for a course that is only near.
    seconds
        How long the nearest motion of the library lasts.
    begins
        Whether it has begun just now: its movement is no part of a motion of its class that was seen before.
    """

    class_name: str
    score: float
    seconds: float
    begins: bool


@dataclass(frozen=True, slots=True, eq=False)
class Recognition:
    """The answer to one window of one performer.

    Attributes
    ----------
    performer
        The performer's name.
    time
        Time of the window's last frame, seconds, on the clock of the frames.
    outcome
        Whether a class is named, else why not.
    classes
        The class names, sorted unless the recogniser was given another order, as of taught classes; an index into them
        is an index into `scores`.
    scores
        Score of each class, 0 to 1, shape (classes,): 1 / (1 + d²) of the distance d to its nearest window. Raw, not
        normalised: an unknown movement scores low everywhere. Given even when no class is named.
    movement
        Root mean square deviation of a distance in the window, relative to the root mean square distance.
    lead
        Log distance by which the best guess is ahead of all other classes, below 0 while a guess is held.
    eigenvector_class, eigenvector_score
        The class that the leading eigenvector alone finds, and its best |inner product| with a window of the library
        (Le Naour et al. 2012, section 3). None: the nearest window is of the class `nothing`.
    share
        Share of the window's variance along its leading eigenvector, 0 to 1.
    gap
        (λ₁ − λ₂) / λ₁ of the window's two leading eigenvalues, 0 to 1.
    guess
        Index of the best guess, with any outcome. Usually the class with the highest score; at a change of motion
        the class before, until the new one has led for long enough. None: the class with the highest score; -1: no
        class is known.
    so_far
        Index of the class that the movement of the last seconds is nearest to: the guess of a moment falls off at a
        motion's end, this one does not; -1: no class is known.
    evidence
        The evidence that the guess is known; None with the paper's signature, which does not know unknown motion.
    progress
        How far the performer is in the motion that is named or goes on; None without such a motion, or unless asked
        for.
    events
        The events of this recognition: a motion's end, a motion's start, or none.
    doubted
        Names of the joints that cannot be believed; the class is named without them.
    done
        The motion that was found just now to have been done; None for none.
    seen
        The motion whose course was seen just now; None for none.
    by_course
        Whether the guess's class has a course, so that it starts where its course is seen.
    ended_at
        When a motion that went on ended before this window, seconds, because the feed paused; else None.
    """

    performer: str
    time: float
    outcome: Outcome
    classes: tuple[str, ...] = field(repr=False)
    scores: NDArray[np.floating] = field(repr=False)
    movement: float
    lead: float = 0.0
    eigenvector_class: str | None = None
    eigenvector_score: float = 0.0
    share: float = 0.0
    gap: float = 0.0
    guess: int | None = None
    so_far: int = -1
    evidence: Evidence | None = field(default=None, repr=False)
    progress: Progress | None = None
    events: tuple[Event, ...] = ()
    doubted: tuple[str, ...] = ()
    done: Done | None = None
    seen: Seen | None = None
    by_course: bool = False
    ended_at: float | None = None

    @property
    def is_doubted(self) -> bool:
        """Whether the body is implausible, or some of its joints cannot be believed."""
        return self.outcome is Outcome.IMPLAUSIBLE or bool(self.doubted)

    @property
    def best(self) -> int:
        """Index of the best guess: `guess`, or the class with the highest score."""
        return int(np.argmax(self.scores)) if self.guess is None else self.guess

    @property
    def class_index(self) -> int:
        """Index of the named class, -1 for none."""
        return self.best if self.outcome is Outcome.NAMED else -1

    @property
    def class_name(self) -> str | None:
        """The named class, or None."""
        return self.classes[self.best] if self.outcome is Outcome.NAMED else None

    @property
    def label(self) -> str:
        """The named class, or the word for the outcome: never empty, so that it can be shown directly."""
        return self.class_name or str(self.outcome)

    @property
    def followed(self) -> tuple[float, float, float]:
        """Phase, speed and amplitude of the motion whose progress is given, for programs that expect numbers; or 0s."""
        progress = self.progress
        return (progress.phase, progress.speed, progress.amplitude) if progress else (0.0, 0.0, 0.0)

    @property
    def guess_index(self) -> int:
        """Index of the best guess, also when it is held back as unknown; -1 when there is no guess."""
        return self.best if self.outcome in (Outcome.NAMED, Outcome.UNKNOWN) else -1

    @property
    def score(self) -> float:
        """Score of the best guess."""
        return float(self.scores[self.best]) if len(self.scores) else 0.0

    @property
    def second_index(self) -> int:
        """Index of the class with the highest score apart from the best guess; -1 in a library of one class."""
        if len(self.scores) < 2:
            return -1
        others = self.scores.copy()
        others[self.best] = -np.inf
        return int(others.argmax())

    @property
    def margin(self) -> float:
        """How far the best guess's score is above the runner-up's; the score itself in a library of one class.

        Below zero while a guess is held at a change of motion.
        """
        second = self.second_index
        return self.score - float(self.scores[second]) if second >= 0 else self.score

    def as_dict(self) -> dict[str, Any]:
        """Give the answer as a flat row of numbers and texts for a table, like a pandas DataFrame.

        `class`, `guess`, `so_far` and `event` are empty where there is none; `score <class>` is each class's score.
        """
        names = (*self.classes, "")
        return {
            "performer": self.performer,
            "time": float(self.time),
            "outcome": str(self.outcome),
            "label": self.label,
            "class": names[self.class_index],
            "guess": names[self.guess_index],
            "so_far": names[self.so_far],
            "score": self.score,
            "margin": self.margin,
            "movement": float(self.movement),
            "share": float(self.share),
            "event": ", ".join(f"{event.kind} {event.label}" for event in self.events),
            "done": self.done.label if self.done else "",
            "doubted": ", ".join(self.doubted),
            **{f"score {name}": score for name, score in zip(self.classes, self.scores.tolist(), strict=True)},
        }


class Answer(msgspec.Struct, frozen=True, rename={"class_name": "class"}):
    """One recognition as a receiver reads it off the wire; OSC tells the fields from `performer` to `margin`.

    Attributes
    ----------
    performer
        The performer's name.
    class_name, index
        The named class and its index; None and -1 for none.
    outcome
        `named`, or the word that says why no class is named.
    score, margin
        Score and margin of the best class, 0 to 1.
    guess
        The best class, also where none is named.
    scores
        The score of each class, by its name.
    progress
        The fields of a recognition's progress, by name.
    """

    performer: str
    class_name: str | None
    index: int
    outcome: str
    score: float
    margin: float
    guess: str | None = None
    scores: dict[str, float] = {}
    progress: dict[str, str | float] | None = None

    @property
    def label(self) -> str:
        """The class's name, or the word that says why no class is named."""
        return self.class_name or self.outcome
