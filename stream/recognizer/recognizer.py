"""The recogniser of one performer: frames go in with their time, recognitions come out.

There is no socket, clock, thread or print in here. The recogniser sorts out frames that come late, starts anew after
gaps, and keeps the hops. A matcher compares the windows, by all parts of the signature or by the paper's eigenvector
alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from functools import wraps
from typing import TYPE_CHECKING, Concatenate, ParamSpec, TypeVar

import numpy as np

from kinespace.library.distances import DistanceMeasurer
from kinespace.library.motion_library import NOTHING
from kinespace.library.windows.body import Body
from kinespace.library.windows.paper import opened_by_paper
from kinespace.stream.recognition import Recognition
from kinespace.stream.recognizer.decision import needed_lead, places_in
from kinespace.stream.recognizer.event_detector import EventDetector
from kinespace.stream.recognizer.joints.doubts import Doubts
from kinespace.stream.recognizer.matcher import PaperMatcher, WindowMatcher, index_of, library_of
from kinespace.stream.recognizer.settings import LiveSignature, Settings
from kinespace.stream.recognizer.windows.smoothing import RowSmoother

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from kinespace.library.motion_library import MotionLibrary
    from kinespace.library.windows.index import WindowIndex
    from kinespace.stream.frame import Frame
    from kinespace.stream.recognition import Event
    from kinespace.stream.recognizer.joints.doubts import LongAgo
    from kinespace.stream.recognizer.joints.fewer_joints import Opener
    from kinespace.stream.recognizer.matcher import Matcher, Reading


_Given = ParamSpec("_Given")
_Answer = TypeVar("_Answer")

#: Share of a hop within which two moments are the same.
_SAME_HOP = 0.01
#: Frames that wait for the next hop to be measured together, at most.
_MAX_WAITING = 16
#: Seconds without a frame after which a motion has ended: its performer may have done anything meanwhile.
MAX_PAUSE = 0.8
#: Tolerance, as a share of the hop: a frame this much early still counts as due, because times are rounded.
_EARLY = 1e-3
_SECOND_THREAD = "a recogniser is used by one thread at a time: expected none, got a second"
#: Defaults of the paper's signature.
_WINDOW, _SMALLEST_GAP = 0.5, 0.02


@dataclass(slots=True)
class RecognizerCounts:
    """Counts of a recogniser's frames, by their fate."""

    #: Frames taken into the window.
    frames: int = 0
    #: Frames refused because they were not newer than the newest frame.
    out_of_order: int = 0
    #: How often the window was started anew: after a gap, or when a sender began again.
    restarts: int = 0
    #: Windows answered.
    hops: int = 0

    def add(self, counts: RecognizerCounts, times: int = 1) -> None:
        """Add other counts, or take them off with -1 times."""
        for each in fields(self):
            setattr(self, each.name, getattr(self, each.name) + times * getattr(counts, each.name))


def _one_at_a_time(
    method: Callable[Concatenate[Recognizer, _Given], _Answer],
) -> Callable[Concatenate[Recognizer, _Given], _Answer]:
    """Refuse a call that comes, from another thread, during a call."""

    @wraps(method)
    def guarded(self: Recognizer, /, *given: _Given.args, **named: _Given.kwargs) -> _Answer:
        if self._busy:
            raise RuntimeError(_SECOND_THREAD)
        self._busy = True
        try:
            return method(self, *given, **named)
        finally:
            self._busy = False

    return guarded


class Recognizer:
    """Names the motion in the last seconds of one performer's feed.

    It follows one performer: `Performers` has a recogniser for each. When the feed pauses, a motion that goes on has no
    end until frames come again; `end` gives the end at once.

    Times are seconds. With milliseconds every frame comes after a gap: nothing is answered, and `counts.restarts` grows
    with each frame.

    One thread at a time may use a recogniser; several threads with a recogniser each may share an opened library. After
    a fork the child's recogniser is independent of the parent's.

    Parameters
    ----------
    library
        The motions to compare with, or their windows when the library is opened already.
    settings
        How to recognise; the defaults suit feeds of 20 to 500 frames per second.
    opener
        Gives the windows of the library as a body of fewer joints shows it, when some joints cannot be believed. By
        default they are opened at once, which takes a second for a large library.
    classes
        As `order` of `exchange`.

    Attributes
    ----------
    counts
        Counts of the frames, by their fate.
    classes
        The class names, in the order in which answers count them.
    library
        The motions that are compared.
    settings
        How motions are recognised.

    Raises
    ------
    ValueError
        A parameter is of another type, or `classes` does not fit.
    """

    def __init__(
        self,
        library: MotionLibrary | WindowIndex,
        settings: Settings | None = None,
        opener: Opener | None = None,
        classes: Sequence[str] = (),
    ) -> None:
        self.settings = Settings() if settings is None else settings
        if not isinstance(self.settings, Settings):
            raise ValueError(f"settings: expected Settings, got {type(settings).__name__}")  # noqa: TRY004
        self._matcher = _matcher(library, self.settings)
        require_order(classes, library)
        self.counts = RecognizerCounts()
        self._detector = EventDetector(needed_lead(library_of(library), self.settings))
        self._compare_with(library, classes)
        skeleton = self.library.skeleton
        self._shape = (len(skeleton.joints), 3)
        self._positions = np.empty((_MAX_WAITING, *self._shape))
        self._rows = np.empty((_MAX_WAITING, len(skeleton.pairs)))
        self._measurer = DistanceMeasurer(skeleton, _MAX_WAITING)
        self._smoother = RowSmoother(Body.of(skeleton).segments, len(skeleton.pairs))
        self._times: list[float] = []
        self._doubts = Doubts(self.library, self._matcher, opener)
        self._longest_gap = min(self.settings.longest_gap, self._matcher.longest)
        self._early = _EARLY * self.settings.hop
        # NaN until the first frame: every comparison with it is False, so the first frame is neither late nor after a
        # gap.
        self._newest = math.nan
        self._last = -math.inf
        self._due = self._compared_from = -math.inf
        self._late_in_a_row = 0
        #: The end of a motion by a pause in the feed, until the next answer tells it.
        self._ended: Event | None = None
        self._busy = False
        #: The performer who is followed; None before the first frame.
        self._performer: str | None = None

    def _compare_with(self, library: MotionLibrary | WindowIndex, order: Sequence[str]) -> None:
        self.library = library_of(library)
        classes = self._matcher.classes
        named = set(self.library.classes)
        self.classes = tuple(order) or tuple(name for name in classes if name in named)
        # The index of each class among the matcher's, one behind the last for a class without windows; and the index of
        # each of the matcher's classes among ours, where `nothing` has none.
        self._named = np.array([classes.index(name) if name in classes else len(classes) for name in self.classes])
        self._some_have_none = bool((self._named == len(classes)).any())
        self._all_named = self.classes == classes
        self._places = places_in(classes, self.classes)

    @_one_at_a_time
    def exchange(self, library: MotionLibrary | WindowIndex, order: Sequence[str] = ()) -> Event | None:
        """Compare with another library from the next hop on; no window and no answer is lost.

        If the new library has another basis, the frames of the last two seconds are followed anew.
        `WindowIndex.with_motions` keeps the basis. A library that is not opened yet is opened here, which takes long:
        open it before, in another thread if need be.

        Parameters
        ----------
        library
            Its motions, or their windows, over the same joints in the same order.
        order
            The order of the classes in answers, so that indices stay the same: all of its classes, and others beside
            them, which are never named. By default the library's, sorted. To name fewer classes, leave their
            motions out (`MotionLibrary.without`).

        Returns
        -------
        The end of the motion that goes on, when the new library lacks its class; else None.

        Raises
        ------
        ValueError
            A class of the library is missing in the order, or a class is there twice; nothing is exchanged.
        SkeletonMismatchError
            The library has other joints; nothing is exchanged.
        """
        self.library.skeleton.require_same(library_of(library).skeleton)
        require_order(order, library)
        classes = self.classes
        self._matcher.exchange(library)
        self._compare_with(library, order)
        self._doubts.exchange(self.library)
        lead = needed_lead(self.library, self.settings)
        return self._detector.exchange(places_in(classes, self.classes), self._last, lead)

    @property
    def doubt(self) -> str:
        """A note on joints that could not be believed, in words; empty while all is well."""
        return self._doubts.told

    @property
    def long_ago(self) -> LongAgo | None:
        """Facts for another recogniser that goes on with the last seconds of this feed; None for none."""
        return self._doubts.long_ago

    def go_on(self, known: LongAgo) -> None:
        """Go on for another recogniser, whose last frames this one has seen or is about to see."""
        self._doubts.go_on(known)

    def only_follow(self, until: float) -> None:
        """Compare nothing before a time, seconds: earlier frames only fill the windows, which takes a third as long."""
        self._compared_from = until

    def keep_time_with(self, answered: float) -> None:
        """Answer the same frames as another recogniser, which answered the frame of this time, seconds."""
        hop = self.settings.hop
        hops = math.floor((self._newest - answered) / hop + _SAME_HOP) + 1 if self._newest >= answered else 0
        self._due = answered + hops * hop

    @_one_at_a_time
    def set_sensitivity(self, share: float) -> None:
        """Recognise with another sensitivity from the next hop on; the paper's signature has none."""
        if isinstance(self._matcher, WindowMatcher):
            self.settings = replace(self.settings, sensitivity=share)
            self._matcher.set_sensitivity(share)
            self._doubts.exchange(self.library)

    def pair_contributions(self) -> NDArray[np.float64] | None:
        """Give each joint pair's share of the variance along the last leading eigenvector, (pairs,); None before."""
        return self._matcher.pair_contributions()

    @_one_at_a_time
    def reset(self) -> None:
        """Forget the windows, as at the beginning of the feed; counts and a motion that goes on stay.

        Another performer may follow. `end` gives the end of the motion that goes on.
        """
        self._clear()
        self._performer = None

    def _clear(self) -> None:
        self._matcher.clear()
        self._smoother.clear()
        self._doubts.clear()
        self._times.clear()
        self._newest, self._due, self._compared_from = math.nan, -math.inf, -math.inf
        self._late_in_a_row = 0

    def push(self, frame: Frame) -> Recognition | None:
        """Take in a frame.

        Parameters
        ----------
        frame
            Positions in the order of the library's skeleton, (joints, 3), metres. The performer's name is copied to the
            answer.

        Returns
        -------
        A recognition when one is due, else None: between hops, while the first window fills, or when the frame was
        refused because it was not newer than the newest frame (counted).

        Raises
        ------
        ValueError
            The frame has another number of joints than the library's skeleton, or is another performer's.
        RuntimeError
            Another thread is using this recogniser.
        """
        positions, time = frame.positions, frame.time
        if positions.shape != self._shape:
            raise ValueError(f"positions: expected {self._shape}, got {positions.shape}")
        # As `_one_at_a_time`, whose call costs as much as all the rest of a frame between hops.
        if self._busy:
            raise RuntimeError(_SECOND_THREAD)
        self._busy = True
        try:
            if frame.performer != self._performer:
                self._follow(frame.performer)
            if not 0.0 < time - self._newest <= self._longest_gap and not self._in_time(time):
                return None
            self._late_in_a_row = 0
            times = self._times
            self._positions[len(times)] = positions
            times.append(time)
            self._newest = self._last = time
            self.counts.frames += 1
            due = time >= self._due - self._early
            if not due and len(times) < _MAX_WAITING:
                return None
            self._measure()
            if due and time < self._compared_from:
                self._set_due(time)
                return None
            reading = self._doubts.read(time, self._smoother.noise) if due else None
            if reading is None:
                return None
            self._set_due(time)
            return self._recognized(frame, reading)
        finally:
            self._busy = False

    def _follow(self, performer: str) -> None:
        if self._performer is not None:
            raise ValueError(f"performer: expected {self._performer!r} until `reset`, got {performer!r}")
        self._performer = performer

    def _measure(self) -> None:
        """Measure the frames that came since the last hop together, because that is cheaper than one by one."""
        times, positions = self._times, self._positions[: len(self._times)]
        begun = self._doubts.mend(times, positions) if self.settings.plausibility else None
        if begun is not None:
            self._matcher.clear()
            self._smoother.clear()
            times, positions = times[begun:], positions[begun:]
        rows = self._rows[: len(times)]
        self._measurer.measure(positions, rows)
        self._smoother.smooth(times, rows)
        self._matcher.push(times, rows)
        self._doubts.push(times, rows)
        self._times.clear()

    def _in_time(self, time: float) -> bool:
        """Sort out frames that come late; start anew after a gap or when the sender's clock began again."""
        behind = self._newest - time
        if behind < -self._longest_gap:
            if behind < -MAX_PAUSE:
                self._ended = self._end()
            self._restart()
        elif behind >= 0:
            self._late_in_a_row += 1
            if behind <= self._matcher.longest and self._late_in_a_row <= self.settings.patience:
                self.counts.out_of_order += 1
                return False
            self._restart()
        return True

    def _restart(self) -> None:
        self._clear()
        self.counts.restarts += 1

    def _set_due(self, time: float) -> None:
        """Keep hops on a grid, so that their mean distance is the hop whatever the frame rate."""
        hop = self.settings.hop
        self._due = self._due + hop if self._due + hop > time else time + hop

    def _recognized(self, frame: Frame, reading: Reading) -> Recognition:
        """Make the answer to a frame from its windows' reading."""
        self.counts.hops += 1
        distances = reading.distances
        if self._some_have_none:
            distances = np.append(distances, np.inf)  # a class without windows is infinitely far
        if not self._all_named:
            distances = distances[self._named]
        # A window nearest to `nothing` is unknown; its best guess is the nearest class.
        guess = self._places.get(reading.guess)
        found = self._places.get(reading.eigenvector_class)
        scores = np.exp(distances)
        scores += 1.0
        recognition = Recognition(
            performer=frame.performer,
            time=frame.time,
            outcome=reading.outcome,
            classes=self.classes,
            scores=np.divide(1.0, scores, out=scores),
            guess=int(distances.argmin()) if guess is None else guess,
            movement=reading.movement,
            lead=reading.lead,
            eigenvector_class=None if found is None else self.classes[found],
            eigenvector_score=reading.eigenvector_score,
            share=reading.share,
            gap=reading.gap,
            evidence=reading.evidence,
            doubted=self._doubts.joints,
        )
        events = self._detector.push(recognition)
        if self._ended:
            events, self._ended = (self._ended, *events), None
        progress = self._matcher.follow(frame.time, self._motion_of(recognition)) if self.settings.progress else None
        return replace(recognition, events=events, progress=progress) if events or progress else recognition

    def _motion_of(self, recognition: Recognition) -> str | None:
        """Name the motion that is followed: the class named now, else the motion that goes on."""
        going_on = self._detector.going_on
        return recognition.class_name or (going_on.label if going_on else None)

    @_one_at_a_time
    def end(self) -> Event | None:
        """End the motion that goes on, because no frame will come, or none came for `MAX_PAUSE` seconds.

        Returns
        -------
        The end, at the time of the newest frame; None when no motion goes on.
        """
        return self._end()

    def _end(self) -> Event | None:
        ended, self._ended = self._ended, None
        return ended or self._detector.end(self._last)


def require_order(order: Sequence[str], library: MotionLibrary | WindowIndex) -> None:
    """Refuse an order of classes, unless it is empty, that lacks a class of the library or holds one twice."""
    known = set(library.classes) - {NOTHING}
    lacking = sorted(known.difference(order))
    if order and (isinstance(order, str) or lacking or len(set(order)) < len(order)):
        got = f"{len(order)} without {', '.join(lacking[:5])}" if lacking else repr(order)
        raise ValueError(f"classes: expected all of the library's {len(known)}, each once, got {got}")


def _matcher(library: MotionLibrary | WindowIndex, settings: Settings) -> Matcher:
    """Open a library and make the matcher that compares with it."""
    motions = library_of(library)
    if settings.signature is LiveSignature.PAPER:
        window = _WINDOW if settings.window is None else settings.window
        gap = _SMALLEST_GAP if settings.smallest_gap is None else settings.smallest_gap
        paper = opened_by_paper(motions, window)
        return PaperMatcher(paper, stillness=settings.stillness, smallest_gap=gap)
    return WindowMatcher(
        index_of(library),
        stillness=settings.stillness,
        sensitivity=settings.sensitivity,
        progress=settings.progress,
    )
