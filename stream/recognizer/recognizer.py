"""The recogniser of one performer: frames go in with their time, recognitions come out.

There is no socket, clock, thread or print in here. The recogniser sorts out frames that come late, starts again after
gaps, and keeps the hops. At a hop it asks others: which joints can be believed (`joints`), what the
windows show and how near the library's are (`live_windows`), what that means (`decision`), how far the motion is
(`progress`), and whether a motion was really done (`done`).
"""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from typing import NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

from kinespace.library import NOTHING, MotionLibrary, WindowIndex, by_joints, distance_rows
from kinespace.library.signature.body import Body
from kinespace.library.windows.rejection import RATES
from kinespace.stream.frame import Frame
from kinespace.stream.recognition import Done, Event, Outcome, Recognition
from kinespace.stream.recognizer.decision import Decision, SoFar
from kinespace.stream.recognizer.done import Asked, DoneFollower, Found, Look, costs_of
from kinespace.stream.recognizer.fitting import FeedKind, Fitting
from kinespace.stream.recognizer.joints import Joints
from kinespace.stream.recognizer.live_windows import Compared, Covariance, LiveWindows, RowSmoother, compare
from kinespace.stream.recognizer.progress import ProgressFollower
from kinespace.stream.recognizer.settings import LiveSignature, Settings, index_for, needed_lead, threshold_for

#: Gives an index as a body of some of its joints shows it; None while that is not open. Raises ValueError where
#: nothing can be compared by these joints.
Views = Callable[[WindowIndex, tuple[str, ...]], WindowIndex | None]

#: Share of a hop within which two moments are the same.
_SAME_HOP = 0.01
#: Seconds between two turns of a performer in overload, at most: after more its clock has jumped, or it was silent.
_LONGEST_TURN = 5.0
#: Frames that wait for the next hop to be measured together, at most.
_MAX_WAITING = 16
#: Frames in a row that may be older than the newest before the sender is taken to have started again. A frame older
#: than the longest window means so at once.
_PATIENCE = 10
#: Seconds without a frame after which a motion has ended: its performer may have done anything meanwhile.
MAX_PAUSE = 0.8
#: Gaps after which most frames are expected to come without one.
_GAPS = 3
#: Tolerance, as a share of the hop: a frame this much early still counts as due, because times are rounded.
_EARLY = 1e-3
#: Seconds between two sets of joints that are opened, so that a body that falls apart does not open one at every step.
_ASKED_AGAIN = 0.5
#: A class's evidence counts above the logit that the first of `rejection.RATES` of unknown movement has; above this one
#: for few people's classes beside others: those taught what is unknown, and such a class's own motions have less.
_RATE_BESIDE = RATES.index(0.05)
_SECOND_THREAD = "a recogniser is used by one thread at a time: expected none, got a second"


@dataclass(slots=True)
class RecognizerCounts:
    """Counts of a recogniser's frames, by their fate."""

    #: Frames taken into the window.
    frames: int = 0
    #: Frames refused because they were not newer than the newest frame.
    out_of_order: int = 0
    #: How often the window was started again: after a gap, or when a sender began again.
    restarts: int = 0
    #: Windows answered.
    hops: int = 0
    #: Windows not answered, because frames had waited for too long and newer ones had come.
    skipped: int = 0

    def add(self, counts: "RecognizerCounts", times: int = 1) -> None:
        """Add other counts, or take them off with -1 times."""
        for each in fields(self):
            setattr(self, each.name, getattr(self, each.name) + times * getattr(counts, each.name))


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
    classes
        The class names, in the order in which answers count them.
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
        views: Views = by_joints,
        classes: Sequence[str] = (),
    ) -> None:
        self.settings = Settings() if settings is None else settings
        if not isinstance(self.settings, Settings):
            raise ValueError(f"settings: expected Settings, got {type(settings).__name__}")  # noqa: TRY004
        index = index_for(library, self.settings)
        self._views, self._windows = views, LiveWindows(index, threshold_for(index, self.settings))
        require_order(classes, index.library)
        self.counts = RecognizerCounts()
        self._decision = Decision(needed_lead(index.library, self.settings), stillness=self.settings.stillness)
        self._so_far = SoFar()
        self._progress = ProgressFollower(index.phases) if self.settings.progress else None
        promised = self.settings.promised
        self._done = DoneFollower(index.courses, index.library.skeleton, promised) if promised else None
        #: What the last look at whole motions saw, until an answer says it.
        self._look: Look | None = None
        self._answer_with(index, classes)
        skeleton = index.library.skeleton
        self._shape = (len(skeleton.joints), 3)
        self._positions = np.empty((_MAX_WAITING, *self._shape))
        self._smoother = RowSmoother(Body.of(skeleton).segments, len(skeleton.pairs))
        self._times: list[float] = []
        is_watched = self.settings.plausibility
        #: When the next answer is due, seconds.
        self._due = -math.inf
        self._joints = Joints(index.segments, skeleton.joints, self._positions, is_watched=is_watched)
        self._fitting = Fitting(index)
        self._early = _EARLY * self.settings.hop
        self._clear()
        self._last = -math.inf
        #: When a motion that goes on has ended, seconds, until the next answer says it; None while it goes on.
        self._ended_at: float | None = None
        self._busy = False
        #: The performer who is followed; None before the first frame.
        self._performer: str | None = None

    __reduce__ = refuse_copies

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
        return self._windows.index.library

    def _answer_with(self, index: WindowIndex, order: Sequence[str]) -> None:
        """Answer with the classes of an index, in an order."""
        classes = index.classes
        self.classes = tuple(order) or tuple(name for name in classes if name in index.library.classes)
        # Few people's classes start when a course of theirs was seen. Other classes start by their lead, because the
        # library has learned what is unknown to them.
        self._by_course = index.courses.of_few if self._done else frozenset[str]()
        self._beside = index.courses.beside_others if self._done else frozenset[str]()
        # The index of each class among the index's, one behind the last for a class without windows.
        self._named = np.array([classes.index(name) if name in classes else len(classes) for name in self.classes])
        self._all_named = self.classes == classes
        self._longest_gap = min(self.settings.longest_gap, self._windows.longest)
        self._so_far.clear()

    def _forget_fewer(self) -> None:
        """Forget the windows of fewer joints."""
        self._fewer: LiveWindows | None = None
        self._places: NDArray[np.intp] | None = None
        #: The joints that were left out when these windows were asked for, and when that was.
        self._without: tuple[int, ...] = ()
        self._asked_for: tuple[int, ...] = ()
        self._asked = -math.inf

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
        self.library.skeleton.require_same(index.library.skeleton)
        require_order(order, index.library)
        with self._alone():
            self._windows.exchange(index)
            self._fitting = Fitting(index)
            self._windows.threshold = threshold_for(index, self.settings)
            self._answer_with(index, order)
            self._fewer, self._asked_for = None, ()
            if self._progress:
                self._progress.exchange(index.phases)
            if self._done:
                self._done.exchange(index.courses)
            self._look = None
            lead = needed_lead(index.library, self.settings)
            return self._decision.exchange(index, self.classes, lead, self._end_time)

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

    @property
    def unlike(self) -> bool | None:
        """Whether the body is unlike the library's, so that few names are right; None until it has moved."""
        return self._fitting.unlike

    @property
    def other_kind(self) -> FeedKind | None:
        """The kind of the feed if another kind taught the library; None if not, and until the body has moved."""
        return self._fitting.other_kind

    @property
    def flat(self) -> bool:
        """Whether the body lies in a plane; False until it has moved."""
        return self._fitting.flat

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
                self._windows.threshold = threshold_for(self._windows.index, self.settings)
                if self._fewer:
                    self._fewer.threshold = threshold_for(self._fewer.index, self.settings, of_fewer=True)

    def covariance(self) -> Covariance:
        """Give the covariance behind the last answer, and its leading eigenvector, by which the paper compares.

        To be asked right after an answer: later frames enter the window. ValueError before the first answer.
        """
        return self._windows.covariance()

    def pair_contributions(self) -> NDArray[np.float64] | None:
        """Give each joint pair's share of the variance along the last leading eigenvector, (pairs,); None before."""
        return self._windows.contributions()

    def reset(self) -> None:
        """Forget the windows, as at the beginning of the feed; counts and a motion that goes on stay.

        Another performer may follow. `end` gives the end of the motion that goes on.
        """
        with self._alone():
            self._clear()
            if self._done:
                self._done.exchange(self._windows.index.courses)
            self._look = None
            self._fitting = Fitting(self._windows.index)
            self._performer = None

    def _clear(self) -> None:
        self._forget_fewer()
        self._begin_again()
        self._joints.clear()
        self._fitting.begin_again()
        self._times.clear()
        # NaN until the first frame: every comparison with it is False, so the first frame is neither late nor after a
        # gap.
        self._newest, self._due = math.nan, -math.inf
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
            asked, windows = self._measure(), self._fewer or self._windows
            if not due or windows.read(self.settings.stillness, self._smoother.noise) is None:
                if asked:
                    self._see(asked, costs_of([asked])[0])
                return None
            self._set_due(time)
            taken = Due(self, frame, windows, asked)
            return taken
        finally:
            self._busy = taken is not None

    def _follow(self, performer: str) -> None:
        if self._performer is not None:
            raise ValueError(f"performer: expected {self._performer!r} until `reset`, got {performer!r}")
        self._performer = performer

    def _measure(self) -> Asked | None:
        """Measure the frames that came since the last hop together, because that is cheaper than one by one."""
        times = self._times
        begun = self._joints.mend(times)
        rows = distance_rows(self._positions[: len(times)], self.library.skeleton)
        if begun is not None:
            self._begin_again()
            times, rows = times[begun:], rows[begun:]
        if self._joints.left_out or self._without:
            self._leave_out(self._joints.left_out, self._times[-1])
        positions = self._positions[begun or 0 : len(self._times)]
        asked = self._done.push(times, positions) if self._done and times else None
        self._smoother.smooth(times, rows)
        self._windows.push(times, rows)
        if self._fewer:
            self._fewer.push(times, rows[:, self._places])
        self._times.clear()
        return asked

    def _see(self, asked: Asked, costs: NDArray[np.float32]) -> None:
        """Take in what whole motions cost."""
        if self._done:
            self._look = self._done.look(asked, costs).behind(self._look)

    def answer(self, due: "Due", seen: Compared, costs: NDArray[np.float32] | None) -> Recognition:
        """Give the answer that is due, from what its windows show, and from what whole motions cost."""
        if due.asked and costs is not None:
            self._see(due.asked, costs)
        return self._recognized(due.frame, due.windows, seen)

    def free(self) -> None:
        """Take calls again: what was due is answered."""
        self._busy = False

    def _begin_again(self) -> None:
        """Forget the rows, and what was read off them; a motion that goes on stays."""
        parts = (self._windows, self._smoother, self._decision, self._so_far, self._fewer, self._progress, self._done)
        for each in parts:
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
            index = self._views(self._windows.index, self._joints.believed)
        except ValueError:
            return  # these joints cannot be compared
        if index is not None:
            self._fewer = LiveWindows(index, threshold_for(index, self.settings, of_fewer=True))
            self._places = self.library.skeleton.places_of(index.library.skeleton)
            times, rows = self._windows.recent()
            self._fewer.push(times.tolist(), rows[:, self._places])

    def _in_time(self, time: float) -> bool:
        """Sort out frames that come late; start again after a gap or when the sender's clock began again."""
        behind = self._newest - time
        if behind < -self._longest_gap:
            if behind < -MAX_PAUSE:
                self._ended_at = self._end_time
            self._restart()
        elif behind >= 0:
            self._late_in_a_row += 1
            if behind <= self._windows.longest and self._late_in_a_row <= _PATIENCE:
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

    def _recognized(self, frame: Frame, windows: LiveWindows, seen: Compared) -> Recognition:
        """Make the answer to a frame from what its windows show."""
        self.counts.hops += 1
        (signature, found), classes = seen, windows.index.classes
        jumped, doubted = self._joints.only_jumps(frame.time), self._joints.doubted
        decided = self._decision.push(windows, seen, self._smoother.noise, frame.time)
        if self._done and decided.average is not None:
            unknown = windows.index.rejection.thresholds.item(_RATE_BESIDE if decided.guess in self._beside else 0)
            self._done.know(frame.time, decided.guess, decided.average - unknown)
        outcome, distances = decided.outcome, found.named
        if jumped or (self._joints.left_out and windows is self._windows):
            outcome = Outcome.IMPLAUSIBLE
        if not self._all_named:
            # A class without windows is infinitely far.
            distances = np.append(distances, np.inf)[self._named]
        best = int(found.scores.argmax())
        scores = np.exp(distances)
        scores += 1.0
        looks = frame.time >= self._fitting.due and outcome is not Outcome.STILL
        if looks and (newest := self._joints.newest) is not None:
            self._fitting.look(frame.time, newest)
        look, self._look = self._look or Look(), None
        recognition = Recognition(
            performer=frame.performer,
            time=frame.time,
            outcome=outcome,
            classes=self.classes,
            scores=np.divide(1.0, scores, out=scores),
            # A window nearest to `nothing` is unknown; its best guess is the nearest class.
            guess=self.classes.index(decided.guess) if decided.guess in self.classes else int(distances.argmin()),
            so_far=self._so_far.push(distances, signature.movement, frame.time),
            movement=signature.movement,
            lead=decided.lead,
            eigenvector_class=classes[best] if classes[best] in self.classes else None,
            eigenvector_score=found.scores.item(best),
            share=signature.share,
            gap=signature.gap,
            evidence=decided.evidence,
            doubted=doubted,
            done=self._done_of(frame.performer, look.done) if look.done else None,
            seen=look.seen if look.seen and look.seen.class_name in self._by_course else None,
            by_course=decided.guess in self._by_course,
            ended_at=self._ended_at,
        )
        events, self._ended_at = self._decision.events(recognition), None
        progress = None
        if self._progress:
            going_on = self._decision.going_on
            motion = recognition.class_name or (going_on.label if going_on else None)
            progress = self._progress.push(frame.time, self._windows.place(), motion)
        if events or progress:
            return replace(recognition, events=events, progress=progress)
        return recognition

    def _done_of(self, performer: str, found: Found) -> Done:
        seconds = found.end - found.start
        index = self.classes.index(found.class_name)
        return Done(performer, found.class_name, index, found.start, seconds, found.score, found.speed, found.amplitude)

    def end(self) -> Event | None:
        """End the motion that goes on, because no frame will come, or none came for `MAX_PAUSE` seconds.

        Returns
        -------
        The end, at the time of the newest frame; None when no motion goes on.
        """
        with self._alone():
            time, self._ended_at = self._end_time, None
            return self._decision.end(time)

    @property
    def _end_time(self) -> float:
        """When a motion that goes on ends if nothing more comes, seconds."""
        return self._last if self._ended_at is None else self._ended_at


class Due(NamedTuple):
    """An answer that is due: its recogniser and frame, the windows that were read, and those of whole motions."""

    recognizer: Recognizer
    frame: Frame
    windows: LiveWindows
    asked: Asked | None


def answers_to(due: Sequence[Due]) -> list[Recognition]:
    """Answer several performers, whose windows are compared together: then the library comes from memory once."""
    asked = [(place, each.asked) for place, each in enumerate(due) if each.asked]
    costs = dict[int, NDArray[np.float32]]()
    try:
        seen = compare([each.windows for each in due])
        for courses in {each.courses for _, each in asked}:
            places, some = zip(*((place, each) for place, each in asked if each.courses is courses), strict=True)
            costs.update(zip(places, costs_of(some), strict=True))
        shown = enumerate(zip(due, seen, strict=True))
        return [each.recognizer.answer(each, own, costs.get(place)) for place, (each, own) in shown]
    finally:
        for each in due:
            each.recognizer.free()


def require_order(order: Sequence[str], library: MotionLibrary) -> None:
    """Refuse an order of classes, unless it is empty, that lacks a class of the library or holds one twice."""
    known = set(library.classes) - {NOTHING}
    lacking = sorted(known.difference(order))
    if order and (isinstance(order, str) or lacking or len(set(order)) < len(order)):
        got = f"{len(order)} without {', '.join(lacking[:5])}" if lacking else repr(order)
        raise ValueError(f"classes: expected all of the library's {len(known)}, each once, got {got}")
