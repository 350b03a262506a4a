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
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kinespace.library import NOTHING, WindowIndex
from kinespace.library.windows.rejection import RATES, Evidence, Rejection
from kinespace.stream.frame import Frame
from kinespace.stream.recognition import Done, Event, EventKind, Outcome, Recognition
from kinespace.stream.recognizer.done import Found, Look
from kinespace.stream.recognizer.joints import Joints
from kinespace.stream.recognizer.settings import Settings, needed_lead
from kinespace.stream.recognizer.window import Window

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
#: Seconds over which the movement so far is averaged, and the largest log distance, which a class without windows has.
_SO_FAR, _FARTHEST = 1.5, 20.0
#: Seconds for which a course that was near lets a class start that has led for long enough.
_NEAR_FOR = 0.2
#: Seconds after which a motion that is not seen again may have ended, beside one and a half times its length.
_SEEN = 0.5
#: (λ₁ − λ₂) / λ₁ below which the paper's eigenvector is too arbitrary to be compared.
_SMALLEST_GAP = 0.02
#: A class's evidence counts above the logit that the first of `rejection.RATES` of unknown movement has; above this one
#: for few people's classes beside others: those taught what is unknown, and such a class's own motions have less.
_RATE_BESIDE = RATES.index(0.05)
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


class Decision:
    """Decides for one performer, and makes the recognition with its events.

    Parameters
    ----------
    index
        The library's windows, by all joints.
    settings
        How motions are recognised.
    order
        As `order` of `Recognizer.exchange`.

    Attributes
    ----------
    classes
        The class names, in the order in which answers count them.
    events
        When motions start and end.
    ended_at
        When a motion that goes on has ended, seconds, until the next answer says it; None while it goes on.
    evident
        The last guess, and its evidence above what unknown movement has; None where the comparison does not judge.
    """

    def __init__(self, index: WindowIndex, settings: Settings, order: Sequence[str]) -> None:
        self._stillness = settings.stillness
        self._guess, self.events = Hysteresis(LEAD), Events(needed_lead(index.library, settings))
        self.ended_at: float | None = None
        self._answer_with(index, settings, order)
        self.clear()

    def clear(self) -> None:
        """Forget the guess and the evidence, as at the start; a motion that goes on stays."""
        self._guess.clear()
        self.events.clear()
        self._judged, self._decided_at = NOT_JUDGED, math.nan
        self.evident: tuple[str, float] | None = None
        self._sums = np.zeros(len(self.classes))

    def _answer_with(self, index: WindowIndex, settings: Settings, order: Sequence[str]) -> None:
        """Answer with the classes of an index, in an order."""
        self._index, classes, courses = index, index.classes, index.courses if settings.promised else None
        self.classes = tuple(order) or tuple(name for name in classes if name in index.library.classes)
        # Few people's classes start when a course of theirs was seen. Other classes start by their lead, because the
        # library has learned what is unknown to them.
        self._by_course = courses.of_few if courses else frozenset[str]()
        self._beside = courses.beside_others if courses else frozenset[str]()
        # The index of each class among the index's, one behind the last for a class without windows.
        self._named = np.array([classes.index(name) if name in classes else len(classes) for name in self.classes])
        self._all_named = self.classes == classes
        #: The average of the last seconds' log distances, by movement.
        self._sums = np.zeros(len(self.classes))

    def exchange(self, index: WindowIndex, settings: Settings, order: Sequence[str], time: float) -> Event | None:
        """Go on with another library; give the end of the motion that goes on, at a time, if its class is gone."""
        self._answer_with(index, settings, order)
        return self.events.exchange(self.classes, needed_lead(index.library, settings), time)

    def push(self, frame: Frame, window: Window, joints: Joints, look: Look) -> Recognition:
        """Decide for the window that ends with a frame.

        Parameters
        ----------
        frame
            The frame.
        window
            What was read, and compared.
        joints
            Which joints can be believed.
        look
            What was seen of whole motions.
        """
        index, signature, found = window.index, window.signature, window.distances
        if signature is None or found is None:
            raise ValueError("window: expected one that was read and compared, got another")
        classes, weighing, distances = index.classes, index.comparison.weighing, found.named
        elapsed = _FIRST_HOP if math.isnan(self._decided_at) else frame.time - self._decided_at
        self._decided_at = frame.time
        guess, lead = self._follow(distances, classes, elapsed)
        known, evidence, self.evident = True, None, None
        if not weighing.as_in_paper:
            evidence, rejection = Evidence.of(found.judged, classes.index(guess), window.noise), index.rejection
            logit = rejection.logit(evidence, guess)
            self._judged = average, known = averaged(self._judged, logit, window.threshold, elapsed, rejection)
            unknown = rejection.thresholds.item(_RATE_BESIDE if guess in self._beside else 0)
            self.evident = guess, average - unknown
        outcome = Outcome.NAMED if known and guess != NOTHING else Outcome.UNKNOWN
        if weighing.as_in_paper and signature.gap < _SMALLEST_GAP:
            outcome = Outcome.AMBIGUOUS
        if signature.movement < self._stillness:
            outcome = Outcome.STILL
        # Windows of all joints say nothing where some are left out.
        if joints.only_jumps or (joints.left_out and index is self._index):
            outcome = Outcome.IMPLAUSIBLE
        if not self._all_named:
            # A class without windows is infinitely far.
            distances = np.append(distances, np.inf)[self._named]
        best = int(found.scores.argmax())
        scores = np.exp(distances)
        scores += 1.0
        recognition = Recognition(
            performer=frame.performer,
            time=frame.time,
            outcome=outcome,
            classes=self.classes,
            scores=np.divide(1.0, scores, out=scores),
            # A window nearest to `nothing` is unknown; its best guess is the nearest class.
            guess=self.classes.index(guess) if guess in self.classes else int(distances.argmin()),
            so_far=self._so_far(distances, signature.movement, elapsed),
            movement=signature.movement,
            lead=lead,
            eigenvector_class=classes[best] if classes[best] in self.classes else None,
            eigenvector_score=found.scores.item(best),
            share=signature.share,
            gap=signature.gap,
            evidence=evidence,
            doubted=joints.doubted,
            done=self._done_of(frame.performer, look.done) if look.done else None,
            seen=look.seen if look.seen and look.seen.class_name in self._by_course else None,
            by_course=guess in self._by_course,
            ended_at=self.ended_at,
        )
        events, self.ended_at = self.events.push(recognition), None
        return replace(recognition, events=events) if events else recognition

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

    def _so_far(self, distances: NDArray[np.float64], movement: float, elapsed: float) -> int:
        """Give the class that the last seconds are nearest to: an average of log distances, (classes,), by movement.

        A motion's end, the return to rest, moves little and weighs little, so that no beginning need be found.
        """
        weighed = movement * elapsed * np.minimum(distances, _FARTHEST)
        self._sums = math.exp(-elapsed / _SO_FAR) * self._sums + weighed
        return int(self._sums.argmin())

    def _done_of(self, performer: str, found: Found) -> Done:
        seconds = found.end - found.start
        index = self.classes.index(found.class_name)
        return Done(performer, found.class_name, index, found.start, seconds, found.score, found.speed, found.amplitude)


class Events:
    """Says once when a motion starts and ends, from recognitions.

    Parameters
    ----------
    lead
        Lead that a class needs before a start event. More is later and surer.

    Attributes
    ----------
    going_on
        The start of the motion that goes on; None when no motion goes on.
    """

    def __init__(self, lead: float) -> None:
        self._event = Hysteresis(lead)
        self.going_on: Event | None = None
        self._event_at, self._seen_until = math.nan, -math.inf
        self._near, self._near_until = "", -math.inf

    def clear(self) -> None:
        """Forget the courses that were near; a motion that goes on stays."""
        self._near_until = -math.inf

    def exchange(self, classes: Sequence[str], lead: float, time: float) -> Event | None:
        """Go on with other classes, and the lead that they need; end a motion whose class is gone, at a time."""
        self._event.needed = lead
        if self.going_on and self.going_on.label not in classes:
            return self.end(time)
        if self.going_on:
            self.going_on = replace(self.going_on, index=classes.index(self.going_on.label))
        return None

    def push(self, recognition: Recognition) -> tuple[Event, ...]:
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
            goes_on = self.going_on is not None and self.going_on.label == seen.class_name
            self._near, self._near_until = seen.class_name, recognition.time + _NEAR_FOR
            if (goes_on and seen.score > 0.5) or seen.begins:
                self._seen_until = recognition.time + _SEEN + 1.5 * seen.seconds
            if seen.begins and not goes_on:
                index = recognition.classes.index(seen.class_name)
                return (*before, *self._starts(recognition, index, seen.score))
        named = recognition.class_name or _NONE
        pace = min(max(recognition.lead, 0.0), _MAX_EVENT_PACE)
        if named and recognition.by_course:
            is_seen = self.going_on and self.going_on.label == named and recognition.time < self._seen_until
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
        events = [_event(EventKind.END, recognition, self.going_on.index)] if self.going_on else []
        self.going_on = None
        if index >= 0:
            self.going_on = _event(EventKind.START, recognition, index, score)
            events.append(self.going_on)
        return tuple(events)

    def ends(self, recognition: Recognition) -> tuple[Event, ...]:
        """End a motion that goes on where the recognition says that it has ended before."""
        ended = None if recognition.ended_at is None else self.end(recognition.ended_at)
        return (ended,) if ended else ()

    def end(self, time: float) -> Event | None:
        """End the motion that is going on, at a time in seconds; None when none is."""
        begun, self.going_on = self.going_on, None
        self._event.clear()
        self._event_at = math.nan
        return replace(begun, kind=EventKind.END, time=time) if begun else None


def _event(kind: EventKind, recognition: Recognition, index: int, score: float | None = None) -> Event:
    score = float(recognition.scores[index]) if score is None else score
    return Event(recognition.performer, kind, recognition.classes[index], index, score, recognition.time)
