"""The meaning of a sender's times: seconds, milliseconds, frame numbers, or none, found by their arrivals.

Times that advance about as fast as the arrivals are seconds and are not changed. Milliseconds, and smaller units,
advance a thousand times as fast or more. Frame numbers advance by one from frame to frame. Times that stand still mean
nothing; a clock of 1970 in a 32-bit float, which advances every two minutes, does so too. In place of times that mean
nothing the arrivals are used.

A verdict rests on the frames of some tenths of a second. It takes the median of their steps, so that a lost frame, a
recording that begins again, and frames that arrive in bursts do not change it.
"""

from typing import NamedTuple

#: Seconds of arrivals that a verdict rests on, at least.
_SPAN = 0.4
#: Frames that a verdict rests on, at least.
_MIN_FRAMES = 7
#: Seconds without a frame after which the frames before are forgotten.
_PAUSE = 1.0
#: Frames a second above which frames come all at once, not as they are made: then there is no verdict.
_MAX_RATE = 2000.0
#: Share of times that repeat the time before, from which on the times mean nothing.
_STILL = 0.15
#: Units of time in programs, by their number in a second.
_UNITS = {1e3: "milliseconds", 1e6: "microseconds", 1e7: "ticks of 100 nanoseconds", 1e9: "nanoseconds"}
#: Factor by which the pace may differ from a unit's: frames are lost, and the first span is short.
_TOLERANCE = 1.6
#: The lowest pace of times that still count as seconds: a feed may be sent again slower than it was recorded.
_SLOWEST = 0.01
#: The highest such pace: a feed may be sent again faster, too.
_FASTEST = 500.0
#: Frame numbers a second, at least.
_MIN_NUMBERS = 4.0
#: The largest step of frame numbers: some programs send every second frame only.
_MAX_NUMBER_STEP = 10.0
#: Seconds over which the rate of frame numbers is measured.
_MEASURED = 10.0
#: Seconds by which a time may differ from the arrivals and still be of the same clock.
_SAME_CLOCK = 5.0


class Verdict(NamedTuple):
    """The meaning of a clock's times.

    Attributes
    ----------
    seconds
        Seconds of one unit; 0: the times mean nothing, and the arrivals are used.
    note
        A note for a person; empty for seconds.
    """

    seconds: float
    note: str = ""


SECONDS = Verdict(1.0)
_STANDS_STILL = Verdict(0.0, "times stand still: arrivals are used")
_COARSE = Verdict(0.0, "times go on in large steps, as in a 32-bit float: arrivals are used")
_BACKWARDS = Verdict(0.0, "times go back: arrivals are used")
_ASTRAY = Verdict(0.0, "times are neither seconds, milliseconds nor frame numbers: arrivals are used")
_NUMBERS = "times are frame numbers: scaled"


class SenderClock:
    """Converts one sender's times.

    Parameters
    ----------
    verdict
        The meaning of the times, if known from before; else they are seconds until a verdict.

    Attributes
    ----------
    verdict
        The current meaning of the times.
    """

    def __init__(self, verdict: Verdict | None = None) -> None:
        self.verdict = verdict or SECONDS
        self._time: float | None = None
        self._arrival = 0.0
        #: The steps of the sender's clock since the last verdict, each with the time between the arrivals, and the
        #: arrival before them.
        self._steps: list[tuple[float, float]] = []
        self._since = 0.0
        #: A new verdict, until it is believed.
        self._perhaps: Verdict | None = None
        self._has_judged = verdict is not None
        #: One of the sender's times, and its conversion to seconds.
        self._origin = 0.0, 0.0
        #: The time and the arrival from which on the rate of frame numbers is measured.
        self._measured_from = 0.0, 0.0

    def read(self, time: float, arrival: float) -> float:
        """Convert the time of one frame.

        Parameters
        ----------
        time
            The time as sent; the arrival itself where the sender sent 0, which means "on arrival".
        arrival
            When the frame came, seconds on our clock.

        Returns
        -------
        Seconds, on the sender's clock or on ours.
        """
        last, before = self._time, self._arrival
        if time == arrival and (last is None or abs(last - time + arrival - before) > _SAME_CLOCK):
            if last is None:
                return arrival
            # The sender's clock begins at 0: the times before and after are other times.
            time = 0.0
        self._time, self._arrival = time, arrival
        if last is not None:
            self._look(time - last, arrival - before)
        if self.verdict.seconds == 1.0:
            return time
        if not self.verdict.seconds:
            return arrival
        begun, seconds = self._origin
        return seconds + (time - begun) * self.verdict.seconds

    def _look(self, step: float, gap: float) -> None:
        """Take in a step of the sender's clock and the time since the frame before; perhaps give a verdict."""
        if gap > _PAUSE or len(self._steps) > _MAX_RATE:
            self._steps.clear()
            return
        if not self._steps:
            self._since = self._arrival - gap
        self._steps.append((step, gap))
        if len(self._steps) >= _MIN_FRAMES and (span := self._arrival - self._since) >= _SPAN:
            verdict = _judged(self._steps, span)
            self._steps.clear()
            if verdict is not None:
                self._believe(verdict)

    def _believe(self, verdict: Verdict) -> None:
        """Believe a verdict: the first one at once, another one when it is given twice in a row."""
        same = verdict.note == self.verdict.note
        if same or (self._has_judged and (self._perhaps is None or self._perhaps.note != verdict.note)):
            self._perhaps = None if same else verdict
            if same and verdict.note == _NUMBERS:
                self._measure()
            return
        self._has_judged, self._perhaps = True, None
        self.verdict = verdict
        if self._time is not None:
            self._measured_from = self._time, self._arrival
            self._origin = (self._time, self._arrival) if verdict.note == _NUMBERS else (0.0, 0.0)

    def _measure(self) -> None:
        """Measure the rate of frame numbers over all frames since they were first believed to be frame numbers."""
        begun, since = self._measured_from
        if self._time is None or not 0 < self._arrival - since <= _MEASURED:
            return
        if self._time <= begun:
            self._measured_from = self._time, self._arrival
            return
        place, seconds = self._origin
        self._origin = self._time, seconds + (self._time - place) * self.verdict.seconds
        self.verdict = Verdict((self._arrival - since) / (self._time - begun), _NUMBERS)


def _judged(steps: list[tuple[float, float]], span: float) -> Verdict | None:
    """Name the unit of times that advanced by these steps, each in its time; None when it is not clear."""
    count = len(steps)
    if count / span > _MAX_RATE:
        return None
    # A packet that comes twice comes twice at once; a clock that stands still does so for a frame's duration.
    waited = [step for step, gap in steps if 2 * gap * count > span]
    still = sum(step == 0 for step in waited)
    if still >= max(_STILL * len(waited), 1):
        return _COARSE if any(step for step, _ in steps) else _STANDS_STILL
    step = sorted(steps)[count // 2][0]
    return _of_pace(step, step * count / span)


def _of_pace(step: float, pace: float) -> Verdict:
    """Name the unit of times with this median step and this pace."""
    unit = next((unit for unit in _UNITS if unit / _TOLERANCE < pace < unit * _TOLERANCE), None)
    # Milliseconds advance by several, too.
    largest = 1 if unit else _MAX_NUMBER_STEP
    if step.is_integer() and 1 <= step <= largest and pace / step >= _MIN_NUMBERS:
        return Verdict(1 / pace, _NUMBERS)
    if unit:
        return Verdict(1 / unit, f"times are {_UNITS[unit]}: scaled")
    if _SLOWEST < pace < _FASTEST:
        return SECONDS
    return _BACKWARDS if pace < 0 else _ASTRAY
