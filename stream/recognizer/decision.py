"""The decision of a hop: the guess, whether it is known, and when a motion starts and ends.

Each hop the class in front gains its lead over the others, in log distance times thirtieths of a second; when another
class comes to the front the count begins again (`Hysteresis`). A clear lead takes over at once, a doubtful one takes a
moment. The guess needs little (`LEAD`), a start event more (`Settings.lead`), so that events come once, without
flicker.

While no class is named, because the body stands still or the movement is unknown, "no class" gathers lead at a steady
pace: slowly for the unknown, because a motion that goes on may look strange for a moment, and faster for stillness,
which never comes by chance.
"""

import math
from collections.abc import Collection
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinespace.library import NOTHING, WindowIndex
from kinespace.library.windows.rejection import Evidence, Rejection
from kinespace.stream.recognition import Event, EventKind, Outcome, Recognition
from kinespace.stream.recognizer.live_windows import Compared, LiveWindows

#: The lead after which a class becomes the guess.
LEAD = 0.6
#: The unit of leads: log distance times a thirtieth of a second.
_PER_SECOND = 30.0
#: Seconds that the first hop counts for.
_FIRST_HOP = 1 / 30
#: A larger lead of a guess counts as this much: the only class of a library leads infinitely.
_MAX_GUESS_PACE = 3.0
#: Lead, in log distance, at which a class gathers fastest towards its event.
_MAX_EVENT_PACE = 1.0
#: A pause between two recognitions that is longer counts as this long (seconds), so that a gap in the feed does not
#: add lead.
_MAX_HOP = 0.1
#: Seconds of stillness, and of unknown, ambiguous or implausible movement, after which a motion has ended.
_ENDED_AFTER = {
    Outcome.NAMED: 0.4,
    Outcome.STILL: 0.4,
    Outcome.UNKNOWN: 0.8,
    Outcome.AMBIGUOUS: 0.4,
    Outcome.IMPLAUSIBLE: 0.8,
}
#: Seconds over which `SoFar` averages, and the largest log distance, which a class without windows has.
_SO_FAR, _FARTHEST = 1.5, 20.0
#: Seconds for which a course that was near lets a class start that has led for long enough.
_NEAR_FOR = 0.2
#: Seconds after which a motion that is not seen again may have ended, beside one and a half times its length.
_SEEN = 0.5
#: (λ₁ − λ₂) / λ₁ below which the paper's eigenvector is too arbitrary to be compared.
_SMALLEST_GAP = 0.02
#: The name that stands for "no class".
_NONE = ""


class Hysteresis:
    """Follows which of several names has been in front for long enough.

    Parameters
    ----------
    needed
        Lead after which a name takes over.

    Attributes
    ----------
    current
        The name that took over last; None before the first.
    """

    def __init__(self, needed: float) -> None:
        self.needed = needed
        self.clear()

    def clear(self) -> None:
        """Forget everything, as at the start."""
        self.current: str | None = None
        self._leader: str | None = None
        self._lead = 0.0

    def keep(self, names: Collection[str]) -> None:
        """Forget all but these names."""
        self.current = self.current if self.current in names else None
        if self._leader not in names:
            self._leader, self._lead = None, 0.0

    def push(self, leader: str, pace: float, elapsed: float) -> bool:
        """Take in which name is in front.

        Parameters
        ----------
        leader
            The name in front.
        pace
            Its lead in log distance.
        elapsed
            Seconds for which the lead counts.

        Returns
        -------
        Whether the name took over now.
        """
        if leader != self._leader:
            self._leader, self._lead = leader, 0.0
        self._lead += pace * elapsed * _PER_SECOND
        if leader == self.current or self._lead < self.needed:
            return False
        self.current = leader
        return True


class SoFar:
    """Follows which class the last seconds are nearest to: an average of log distances, by movement.

    A motion's end, the return to rest, moves little and weighs little, so that no beginning need be found.
    """

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Forget everything, as at the start."""
        self._sums: NDArray[np.float64] | float = 0.0
        self._time = math.nan

    def push(self, distances: NDArray[np.float64], movement: float, time: float) -> int:
        """Take in each class's log distance, (classes,), how much the window moves, and seconds; give the nearest."""
        elapsed = _FIRST_HOP if math.isnan(self._time) else time - self._time
        self._time = time
        weighed = movement * elapsed * np.minimum(distances, _FARTHEST)
        self._sums = math.exp(-elapsed / _SO_FAR) * self._sums + weighed
        return int(self._sums.argmin())


#: The averaged evidence, a logit (`library.windows.rejection`), NaN before the first; and whether the guess is known.
Judged = tuple[float, bool]
NOT_JUDGED: Judged = (math.nan, False)


def averaged(before: Judged, logit: float, threshold: float, elapsed: float, rejection: Rejection) -> Judged:
    """Average evidence, and hold it against a threshold, which is lower for a named motion.

    Parameters
    ----------
    before
        What was given for the window before.
    logit, threshold
        The evidence of the newest window, and from which evidence a guess is known.
    elapsed
        Seconds since the last window.
    rejection
        Says over how many seconds evidence is averaged, and how far it may fall for a named motion.
    """
    average, known = before
    average = logit if math.isnan(average) else average
    average -= math.expm1(-elapsed / rejection.over) * (logit - average)
    return average, average >= threshold - (rejection.held if known else 0.0)


class Decided(NamedTuple):
    """The decision for the windows that end now.

    Attributes
    ----------
    outcome
        Whether the guess is named, else why not.
    guess
        The class that is guessed; `nothing` for movement like the library's motions of that name.
    lead
        Log distance by which the guess is ahead of all other classes, below 0 while it is held.
    evidence
        The evidence for the guess; None where the comparison does not judge.
    average
        The averaged evidence, a logit; None likewise.
    """

    outcome: Outcome
    guess: str
    lead: float
    evidence: Evidence | None
    average: float | None = None


class Decision:
    """Decides for one performer.

    Parameters
    ----------
    lead
        Lead that a class needs before a start event. More is later and surer.
    going_on
        The start of a motion that goes on already.
    stillness
        As in `stream.recognizer.settings.Settings`.
    """

    def __init__(self, lead: float, going_on: Event | None = None, stillness: float = 0.0) -> None:
        self._guess, self._judged, self._event = Hysteresis(LEAD), NOT_JUDGED, Hysteresis(lead)
        self._active, self._stillness = going_on, stillness
        self._event.current = going_on.label if going_on else None
        self._decided_at = self._event_at = math.nan
        self._seen_until = -math.inf
        self._near, self._near_until = "", -math.inf

    @property
    def going_on(self) -> Event | None:
        """The start of the motion that goes on; None when no motion goes on."""
        return self._active

    def clear(self) -> None:
        """Forget the guess and the evidence, as at the start; a motion that goes on stays."""
        self._guess.clear()
        self._judged, self._decided_at, self._near_until = NOT_JUDGED, math.nan, -math.inf

    def exchange(self, index: WindowIndex, classes: Collection[str], lead: float, time: float) -> Event | None:
        """Go on with another library; give the end of the motion that goes on, at a time, if its class is gone.

        Parameters
        ----------
        index
            The library's windows.
        classes
            The classes that are answered.
        lead
            As in the constructor.
        time
            Seconds.
        """
        self._guess.keep(index.classes)
        self._event.needed = lead
        if self._active and self._active.label not in classes:
            return self.end(time)
        self._event.keep({*classes, _NONE})
        if self._active:
            self._active = replace(self._active, index=list(classes).index(self._active.label))
        return None

    def push(self, windows: LiveWindows, seen: Compared, noise: float, time: float) -> Decided:
        """Decide for the windows that end now.

        Parameters
        ----------
        windows, seen
            The windows, and what they gave when they were read.
        noise
            Standard deviation of a distance's noise, metres.
        time
            Seconds, on the clock of the frames.
        """
        elapsed = _FIRST_HOP if math.isnan(self._decided_at) else time - self._decided_at
        self._decided_at = time
        index, (signature, distances) = windows.index, seen
        weighing, classes = index.comparison.weighing, index.classes
        guess, lead = self._follow(distances.named, classes, elapsed)
        known, evidence, average = True, None, None
        if weighing.judges:
            evidence = Evidence.of(distances.judged, classes.index(guess), noise)
            rejection = index.rejection
            logit = rejection.logit(evidence, guess)
            self._judged = average, known = averaged(self._judged, logit, windows.threshold, elapsed, rejection)
        outcome = Outcome.NAMED if known and guess != NOTHING else Outcome.UNKNOWN
        if not weighing.judges and signature.gap < _SMALLEST_GAP:
            outcome = Outcome.AMBIGUOUS
        if signature.movement < self._stillness:
            outcome = Outcome.STILL
        return Decided(outcome, guess, lead, evidence, average)

    def _follow(self, distances: NDArray[np.float64], classes: tuple[str, ...], elapsed: float) -> tuple[str, float]:
        """Let the guess follow the nearest class; give the guess and its lead over all other classes."""
        # For some ten numbers Python finds the least two before numpy has begun.
        listed = distances.tolist()
        nearest, second = sorted([*listed, math.inf])[:2]
        ahead = second - nearest
        leader = classes[listed.index(nearest)]
        self._guess.push(leader, min(ahead, _MAX_GUESS_PACE), elapsed)
        guess = self._guess.current
        if guess is None or guess not in classes:
            guess = self._guess.current = leader
        return guess, ahead if guess == leader else nearest - listed[classes.index(guess)]

    def events(self, recognition: Recognition) -> tuple[Event, ...]:
        """Take in the next recognition; give the events it causes: none, an end, a start, or an end and a start.

        A class of few people starts when the course of its motions has been seen, or when it has led for long enough
        while its course is near (`recognition.seen` with a score below 0.5). It ends when it has not been seen
        for as long as a motion lasts. Other classes start when they have led for long enough.
        """
        before = self.ends(recognition)
        elapsed = recognition.time - self._event_at
        self._event_at = recognition.time
        if not 0 <= elapsed <= _MAX_HOP:
            elapsed = _MAX_HOP if elapsed > 0 else 0.0
        if seen := recognition.seen:
            goes_on = self._active is not None and self._active.label == seen.class_name
            self._near, self._near_until = seen.class_name, recognition.time + _NEAR_FOR
            if (goes_on and seen.score > 0.5) or seen.begins:
                self._seen_until = recognition.time + _SEEN + 1.5 * seen.seconds
            if seen.begins and not goes_on:
                index = recognition.classes.index(seen.class_name)
                return (*before, *self._starts(recognition, index, seen.score))
        named = recognition.class_name or _NONE
        pace = min(max(recognition.lead, 0.0), _MAX_EVENT_PACE)
        if named and recognition.by_course:
            is_seen = self._active and self._active.label == named and recognition.time < self._seen_until
            is_seen = is_seen or (self._near == named and recognition.time < self._near_until)
            named = named if is_seen else _NONE
        if named == _NONE:
            pace = self._event.needed / (_ENDED_AFTER[recognition.outcome] * _PER_SECOND)
        if not self._event.push(named, pace, elapsed):
            return before
        return (*before, *self._starts(recognition, recognition.class_index if named else -1))

    def _starts(self, recognition: Recognition, index: int, score: float | None = None) -> tuple[Event, ...]:
        """End the motion that goes on, and start another, with a score of its own; -1 starts none."""
        self._event.current = recognition.classes[index] if index >= 0 else _NONE
        ended = [_event(EventKind.END, recognition, self._active.index)] if self._active else []
        self._active = None
        if index >= 0:
            started = _event(EventKind.START, recognition, index)
            self._active = started if score is None else replace(started, score=score)
        return (*ended, *([self._active] if self._active else []))

    def ends(self, recognition: Recognition) -> tuple[Event, ...]:
        """End a motion that goes on where the recognition says that it has ended before."""
        ended = None if recognition.ended_at is None else self.end(recognition.ended_at)
        return (ended,) if ended else ()

    def end(self, time: float) -> Event | None:
        """End the motion that is going on, at a time in seconds; None when none is."""
        begun, self._active = self._active, None
        self._event.clear()
        self._event_at = math.nan
        return replace(begun, kind=EventKind.END, time=time) if begun else None


def _event(kind: EventKind, recognition: Recognition, index: int) -> Event:
    return Event(
        performer=recognition.performer,
        kind=kind,
        label=recognition.classes[index],
        index=index,
        score=float(recognition.scores[index]),
        time=recognition.time,
    )
