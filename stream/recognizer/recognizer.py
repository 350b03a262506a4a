"""The recogniser of one performer: frames go in with their time, recognitions come out.

There is no socket, clock, thread or print in here. The recogniser sorts out frames that come late, starts again after
gaps, and keeps the hops. At a hop it asks others: which joints can be believed (`joints`), what the last seconds show
(`window`), how near the library's windows are, what that means (`decision`), how far the motion is (`progress`), and
whether a motion was really done (`done`).
"""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from kinespace.library import NOTHING, MotionLibrary, WindowIndex, by_joints, distance_rows
from kinespace.library.signature.body import Body
from kinespace.stream.frame import Frame
from kinespace.stream.present import MAX_PAUSE
from kinespace.stream.recognition import Event, Outcome, Recognition
from kinespace.stream.recognizer.decision import Decision
from kinespace.stream.recognizer.done import DoneFollower, EndingWindows, Look, costs_of
from kinespace.stream.recognizer.fitting import Fitting
from kinespace.stream.recognizer.joints import Joints
from kinespace.stream.recognizer.progress import ProgressFollower
from kinespace.stream.recognizer.settings import LiveSignature, Settings, index_for, threshold_for
from kinespace.stream.recognizer.window import Covariance, RowSmoother, Window
from kinespace.stream.status import RecognizerCounts

#: Gives an index as a body of some of its joints shows it; None while that is not open. Raises ValueError where
#: nothing can be compared by these joints.
Views = Callable[[WindowIndex, tuple[str, ...]], WindowIndex | None]

#: Share of a hop within which two moments are the same.
_SAME_HOP = 0.01
#: Seconds between two turns of a performer in overload, at most: after more its clock has jumped, or it was silent.
_LONGEST_TURN = 5.0
#: Frames that wait for the next hop to be measured together, at most: as many as wait for a turn in overload.
_MAX_WAITING = 24
#: Frames in a row that may be older than the newest before the sender is taken to have started again. A frame older
#: than the longest window means so at once.
_PATIENCE = 10
#: Gaps after which most frames are expected to come without one.
_GAPS = 3
#: Tolerance, as a share of the hop: a frame this much early still counts as due, because times are rounded.
_EARLY = 1e-3
#: Seconds between two sets of joints that are opened, so that a body that falls apart does not open one at every step.
_ASKED_AGAIN = 0.5
_SECOND_THREAD = "a recogniser is used by one thread at a time: expected none, got a second"


def refuse_copies(live: object) -> NoReturn:
    """Refuse to copy or pickle: a copy would follow by the original's memory."""
    kind = type(live).__name__
    raise TypeError(f"copy, pickle: expected a library or settings, got a {kind}: make another {kind} of these")


class Recognizer:
    """Names the motion in the last seconds of one performer's feed.

    It follows one performer: `Performers` has a recogniser for each. When the feed pauses, a motion that goes on has no
    end until frames come again; `end` gives the end at once.

    Times are seconds. With milliseconds every frame comes after a gap and nothing is answered: `doubt` says so.

    One thread at a time may use a recogniser; several threads with a recogniser each may share an opened library. After
    a fork the child's recogniser is independent of the parent's.

    Parameters
    ----------
    library
        The motions to compare with, or their windows when the library is opened already.
    settings
        How to recognise; the defaults suit feeds of 20 to 500 frames per second.
    views
        Gives the library's windows as a body of fewer joints shows them, when some joints cannot be believed. By
        default they are opened at once, which takes a second for a large library.
    classes
        As `order` of `exchange`.

    Attributes
    ----------
    counts
        Counts of the frames, by their fate.
    settings
        How motions are recognised.
    fitting
        Whether the body is like the library's, and what is odd about it.

    Raises
    ------
    ValueError
        A parameter is of another type, or `classes` does not fit.
    """

    def __init__(
        self,
        library: MotionLibrary | WindowIndex,
        settings: Settings | None = None,
        views: Views = by_joints,
        classes: Sequence[str] = (),
    ) -> None:
        self.settings = Settings() if settings is None else settings
        if not isinstance(self.settings, Settings):
            raise ValueError(f"settings: expected Settings, got {type(settings).__name__}")  # noqa: TRY004
        index = index_for(library, self.settings)
        require_order(classes, index.library)
        self._views, self._window = views, Window(index, threshold_for(index, self.settings))
        self.counts = RecognizerCounts()
        self._decision = Decision(index, self.settings, classes)
        self._progress = ProgressFollower(index.phases) if self.settings.progress else None
        self._begin_with(index)
        self._skeleton = skeleton = index.library.skeleton
        self._shape = (len(skeleton.joints), 3)
        self._positions = np.empty((_MAX_WAITING, *self._shape))
        self._smoother = RowSmoother(Body.of(skeleton).segments, len(skeleton.pairs))
        watched = self.settings.plausibility
        self._joints = Joints(index.segments, skeleton.joints, self._positions, is_watched=watched)
        self._early = _EARLY * self.settings.hop
        self._clear()
        self._last = -math.inf
        self._busy = False
        #: The performer who is followed; None before the first frame.
        self._performer: str | None = None

    __reduce__ = refuse_copies

    def _begin_with(self, index: WindowIndex) -> None:
        """Begin what depends on the library anew: whole motions, how like its bodies the body is, the longest gap."""
        self.fitting, promised = Fitting(index), self.settings.promised
        self._done = DoneFollower(index.courses, index.library.skeleton, promised) if promised else None
        #: What the last look at whole motions saw, until an answer says it.
        self._look: Look | None = None
        self._gap = min(self.settings.longest_gap, self._window.seconds)

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Refuse a call that comes, from another thread, during a call."""
        if self._busy:
            raise RuntimeError(_SECOND_THREAD)
        self._busy = True
        try:
            yield
        finally:
            self._busy = False

    @property
    def library(self) -> MotionLibrary:
        """The motions that are compared."""
        return self._window.index.library

    @property
    def classes(self) -> tuple[str, ...]:
        """The class names, in the order in which answers count them."""
        return self._decision.classes

    def _clear(self) -> None:
        #: The windows of fewer joints, and the places of their distances among all.
        self._fewer: Window | None = None
        self._places: NDArray[np.intp] | None = None
        #: The joints that were left out when these windows were asked for, and when that was.
        self._without: tuple[int, ...] = ()
        self._asked_for: tuple[int, ...] = ()
        self._asked = -math.inf
        self._begin_again()
        self._joints.clear()
        self.fitting.begin_again()
        self._times: list[float] = []
        # When the next answer is due; and NaN until the first frame: every comparison with it is False, so the first
        # frame is neither late nor after a gap.
        self._newest, self._due = math.nan, -math.inf
        self._late_in_a_row = 0

    def exchange(self, library: MotionLibrary | WindowIndex, order: Sequence[str] = ()) -> Event | None:
        """Compare with another library from the next hop on; no window and no answer is lost.

        If the new library has another basis, the frames of the last two seconds are followed again.
        `WindowIndex.with_motions` keeps the basis. A library that is not opened yet is opened here, which takes long:
        open it before, in another thread if need be.

        Parameters
        ----------
        library
            Its motions, or their windows, over the same joints in the same order.
        order
            The order of the classes in answers, so that indices stay the same: all of its classes, and others, which
            are never named. By default the library's, sorted. To name fewer classes, leave their
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
        index = index_for(library, self.settings)
        self._skeleton.require_same(index.library.skeleton)
        require_order(order, index.library)
        with self._alone():
            self._window.exchange(index, threshold_for(index, self.settings))
            self._begin_with(index)
            self._fewer, self._asked_for = None, ()
            if self._progress:
                self._progress.exchange(index.phases)
            return self._decision.exchange(index, self.settings, order, self._end_time)

    @property
    def doubt(self) -> str:
        """A note on times that are no seconds, or on joints that could not be believed; empty while all is well."""
        return self.untimely or self._joints.note

    @property
    def untimely(self) -> str:
        """A note on frames that nearly all come after gaps, because their times are in milliseconds; else empty."""
        counts = self.counts
        if math.isfinite(self._due) or counts.restarts < _GAPS or counts.frames > 2 * counts.restarts:
            return ""
        return f"times: expected seconds, got a gap before nearly each of {counts.frames} frames (milliseconds?)"

    def only_follow(self, until: float) -> None:
        """Compare nothing before a time, seconds: earlier frames only fill the windows, which takes a third as long."""
        if self._due >= until:
            return
        if math.isfinite(self._due) and self.settings.hop:
            late = min(until - self._due, _LONGEST_TURN)
            self.counts.skipped += max(math.floor(late / self.settings.hop + _SAME_HOP), 0)
        self._due = until

    def set_sensitivity(self, share: float) -> None:
        """Recognise with another sensitivity from the next hop on; the paper's signature has none."""
        if self.settings.signature is LiveSignature.WINDOWS:
            with self._alone():
                self.settings = replace(self.settings, sensitivity=share)
                self._window.threshold = threshold_for(self._window.index, self.settings)
                if self._fewer:
                    self._fewer.threshold = threshold_for(self._fewer.index, self.settings, of_fewer=True)

    def covariance(self) -> Covariance:
        """Give the covariance behind the last answer, and its leading eigenvector, by which the paper compares.

        To be asked right after an answer: later frames enter the window. ValueError before the first answer.
        """
        return self._window.covariance()

    def pair_contributions(self) -> NDArray[np.float64] | None:
        """Give each joint pair's share of the variance along the last leading eigenvector, (pairs,); None before."""
        return self._window.contributions()

    def reset(self) -> None:
        """Forget the windows, as at the beginning of the feed; counts and a motion that goes on stay.

        Another performer may follow. `end` gives the end of the motion that goes on.
        """
        with self._alone():
            self._clear()
            self._begin_with(self._window.index)
            self._performer = None

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
            It is no frame, has another number of joints than the library's skeleton, or is another performer's.
        RuntimeError
            Another thread is using this recogniser.
        """
        due = self.take(frame)
        return answers_to([due])[0] if due else None

    def take(self, frame: Frame) -> "Due | None":
        """Take in a frame, as `push`; give what is due for `answers_to`, before which all calls are refused."""
        try:
            positions, time = frame.positions, frame.time
        except AttributeError:
            got = type(frame).__name__
            raise ValueError(f"frame: expected a Frame(performer, seconds, positions), got {got}") from None
        if positions.shape != self._shape:
            raise ValueError(f"positions: expected {self._shape}, got {positions.shape}")
        # As `_alone`, which costs as much as all the rest of a frame between hops.
        if self._busy:
            raise RuntimeError(_SECOND_THREAD)
        self._busy, taken = True, None
        try:
            if frame.performer != self._performer:
                if self._performer is not None:
                    raise ValueError(f"performer: expected {self._performer!r} until `reset`, got {frame.performer!r}")
                self._performer = frame.performer
            if not 0.0 < time - self._newest <= self._gap and not self._in_time(time):
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
            ending, window = self._measure(), self._fewer or self._window
            if not due or window.read(self.settings.stillness, self._smoother.noise) is None:
                if ending:
                    self._see(ending, costs_of([ending])[0])
                return None
            # Hops lie on a grid, so that their mean distance is the hop whatever the frame rate.
            hop = self.settings.hop
            self._due = self._due + hop if self._due + hop > time else time + hop
            taken = Due(self, frame, window, ending)
            return taken
        finally:
            self._busy = taken is not None

    def _measure(self) -> EndingWindows | None:
        """Measure the frames that came since the last hop together, because that is cheaper than one by one."""
        times = self._times
        begun = self._joints.mend(times)
        rows = distance_rows(self._positions[: len(times)], self._skeleton)
        if begun is not None:
            self._begin_again()
            times, rows = times[begun:], rows[begun:]
        if self._joints.left_out or self._without:
            self._leave_out(self._joints.left_out, self._times[-1])
        positions = self._positions[begun or 0 : len(self._times)]
        ending = self._done.push(times, positions) if self._done and times else None
        self._smoother.smooth(times, rows)
        self._window.push(times, rows)
        if self._fewer:
            self._fewer.push(times, rows[:, self._places])
        self._times.clear()
        return ending

    def _see(self, ending: EndingWindows, costs: NDArray[np.float32]) -> None:
        """Take in what whole motions cost."""
        if self._done:
            self._look = self._done.look(ending, costs).behind(self._look)

    def answer(self, due: "Due") -> Recognition:
        """Give the answer that is due, from what its window shows, and from what whole motions cost."""
        frame = due.frame
        if due.ending and due.costs is not None:
            self._see(due.ending, due.costs)
        self.counts.hops += 1
        look, self._look = self._look or Look(), None
        recognition = self._decision.push(frame, due.window, self._joints, look)
        if self._done and self._decision.evident:
            self._done.know(frame.time, *self._decision.evident)
        looks = frame.time >= self.fitting.due and recognition.outcome is not Outcome.STILL
        if looks and (newest := self._joints.newest) is not None:
            self.fitting.look(frame.time, newest)
        if self._progress:
            going_on = self._decision.events.going_on
            motion = recognition.class_name or (going_on.label if going_on else None)
            if progress := self._progress.push(frame.time, self._window.place(), motion):
                return replace(recognition, progress=progress)
        return recognition

    def free(self) -> None:
        """Take calls again: what was due is answered."""
        self._busy = False

    def _begin_again(self) -> None:
        """Forget the rows, and what was read off them; a motion that goes on stays."""
        for each in (self._window, self._smoother, self._decision, self._fewer, self._progress, self._done):
            if each:
                each.clear()

    def _leave_out(self, joints: tuple[int, ...], time: float) -> None:
        """Compare by the joints that are left, once their windows are open; they hold the last seconds at once."""
        if joints != self._without:
            self._without, self._fewer = joints, None
        if self._fewer or not joints or not self._joints.believed:
            return
        if joints != self._asked_for:
            if time - self._asked < _ASKED_AGAIN:
                return
            self._asked_for, self._asked = joints, time
        try:
            index = self._views(self._window.index, self._joints.believed)
        except ValueError:
            return  # these joints cannot be compared
        if index is not None:
            self._fewer = Window(index, threshold_for(index, self.settings, of_fewer=True))
            self._places = self._skeleton.places_of(index.library.skeleton)
            times, rows = self._window.recent()
            self._fewer.push(times.tolist(), rows[:, self._places])

    def _in_time(self, time: float) -> bool:
        """Sort out frames that come late; start again after a gap or when the sender's clock began again."""
        behind = self._newest - time
        if behind < -self._gap:
            if behind < -MAX_PAUSE:
                self._decision.ended_at = self._end_time
            self._restart()
        elif behind >= 0:
            self._late_in_a_row += 1
            if behind <= self._window.seconds and self._late_in_a_row <= _PATIENCE:
                self.counts.out_of_order += 1
                return False
            self._restart()
        return True

    def _restart(self) -> None:
        self._clear()
        self.counts.restarts += 1

    def end(self) -> Event | None:
        """End the motion that goes on, because no frame will come, or none came for `MAX_PAUSE` seconds.

        Returns
        -------
        The end, at the time of the newest frame; None when no motion goes on.
        """
        with self._alone():
            time, self._decision.ended_at = self._end_time, None
            return self._decision.events.end(time)

    @property
    def _end_time(self) -> float:
        """When a motion that goes on ends if nothing more comes, seconds."""
        ended_at = self._decision.ended_at
        return self._last if ended_at is None else ended_at


@dataclass(slots=True)
class Due:
    """An answer that is due: its recogniser and frame, the window that was read, and those of whole motions."""

    recognizer: Recognizer
    frame: Frame
    window: Window
    ending: EndingWindows | None
    #: What whole motions cost; None until they are compared.
    costs: NDArray[np.float32] | None = None


def answers_to(due: Sequence[Due]) -> list[Recognition]:
    """Answer several performers, whose windows are compared together: then the library comes from memory once.

    A window that rests stands as it was compared before.
    """
    try:
        new = [each.window for each in due if each.window.distances is None]
        for index in {each.index for each in new}:
            windows = [each for each in new if each.index is index]
            signatures = [each.signature for each in windows if each.signature]
            for window, distances in zip(windows, index.distances(signatures), strict=True):
                window.distances = distances
        for courses in {each.ending.courses for each in due if each.ending}:
            some = [(each, each.ending) for each in due if each.ending and each.ending.courses is courses]
            for (each, _), costs in zip(some, costs_of([ending for _, ending in some]), strict=True):
                each.costs = costs
        return [each.recognizer.answer(each) for each in due]
    finally:
        for each in due:
            each.recognizer.free()


def require_order(order: Sequence[str], library: MotionLibrary) -> None:
    """Refuse an order of classes that lacks a class of the library or holds one twice; an empty one where none is."""
    known = set(library.classes) - {NOTHING}
    if not order and not known:
        raise ValueError(f"library: expected a class besides {NOTHING!r}, got none")
    lacking = sorted(known.difference(order))
    if order and (isinstance(order, str) or lacking or len(set(order)) < len(order)):
        got = f"{len(order)} without {', '.join(lacking[:5])}" if lacking else repr(order)
        raise ValueError(f"classes: expected all of the library's {len(known)}, each once, got {got}")
