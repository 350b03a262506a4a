"""What a sender's times mean: seconds, milliseconds, frame numbers, or nothing, as their arrivals show.

Times that go on about as fast as the arrivals are seconds and stay as they are. Milliseconds, and the smaller units
that programs count in, go on a thousand times as fast and more. Frame numbers go on by one from frame to frame. Times
that stand still tell nothing: so does a clock of 1970 in a 32-bit float, which goes on every two minutes. In place of
times that tell nothing the arrivals are used.

A verdict rests on the frames of some tenths of a second. The middle of their steps is looked at, so that neither a
frame that was lost, nor a recording that begins again, nor frames that arrive in bursts change it.
"""

from __future__ import annotations

from typing import NamedTuple

#: Seconds of arrivals, and frames, that a verdict rests on at least.
_SPAN, _MIN_FRAMES = 0.4, 7
#: Seconds without a frame after which the frames before are forgotten.
_PAUSE = 1.0
#: Frames a second above which frames are not sent as they are made, but all at once: nothing is said of their times.
_MAX_RATE = 2000.0
#: Share of the times that repeat the time before, from which on they tell nothing.
_STILL = 0.15
#: Units that programs count time in, by how many of them a second has.
_UNITS = {1e3: "milliseconds", 1e6: "microseconds", 1e7: "ticks of 100 nanoseconds", 1e9: "nanoseconds"}
#: Factor by which the pace of a unit may be missed: frames are lost, and a first span is short.
_TOLERANCE = 1.6
#: What seconds may seem to go on per second: a feed is sent again faster or slower than it was recorded.
_SLOWEST, _FASTEST = 0.01, 500.0
#: Frame numbers a second at least, and what they may go on by: some programs send every second frame only.
_MIN_NUMBERS, _MAX_NUMBER_STEP = 4.0, 10.0
#: Seconds over which the rate of frame numbers is measured, better and better.
_MEASURED = 10.0
#: Seconds by which a time may differ from what the arrivals say and be of the same clock.
_SAME_CLOCK = 5.0


class Verdict(NamedTuple):
    """What a clock's times are.

    Attributes
    ----------
    seconds
        Seconds of one unit; 0: the times tell nothing, and the arrivals are used.
    told
        What is said of them; empty for seconds.
    """

    seconds: float
    told: str = ""


SECONDS = Verdict(1.0)
_STANDS_STILL = Verdict(0.0, "times stand still: arrivals are used")
_COARSE = Verdict(0.0, "times go on in large steps, as in a 32-bit float: arrivals are used")
_BACKWARDS = Verdict(0.0, "times go back: arrivals are used")
_ASTRAY = Verdict(0.0, "times are neither seconds, milliseconds nor frame numbers: arrivals are used")
_NUMBERS = "times are frame numbers: scaled"


class SenderClock:
    """Reads one sender's times.

    Parameters
    ----------
    verdict
        What the times are, where that was seen before; else they are seconds until something else is seen.

    Attributes
    ----------
    verdict
        What the times are taken to be now.
    """

    def __init__(self, verdict: Verdict | None = None) -> None:
        self.verdict = verdict or SECONDS
        self._time: float | None = None
        self._arrival = 0.0
        self._steps: list[float] = []
        self._gaps: list[float] = []
        #: The verdict before, as long as it is not believed.
        self._perhaps: Verdict | None = None
        self._has_judged = verdict is not None
        #: A time of the sender's, and the seconds that it was read as.
        self._origin = 0.0, 0.0
        #: The time and the arrival from which on the rate of frame numbers is measured.
        self._measured_from = 0.0, 0.0

    @property
    def told(self) -> str:
        """What a person should know of the times; empty while they are seconds."""
        return self.verdict.told

    def read(self, time: float, arrival: float) -> float:
        """Read the time of one frame.

        Parameters
        ----------
        time
            As sent; the arrival itself where the sender said 0, which stands for "on arrival".
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
            # Other times were told before and after: the sender's clock begins at 0.
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
        """Take in a step of the sender's clock and how long after the frame before the frame came; perhaps judge."""
        if gap > _PAUSE or len(self._steps) > _MAX_RATE:
            self._forget()
            return
        self._steps.append(step)
        self._gaps.append(gap)
        if len(self._steps) >= _MIN_FRAMES and (span := sum(self._gaps)) >= _SPAN:
            verdict = _judged(self._steps, self._gaps, span)
            self._forget()
            if verdict is not None:
                self._believe(verdict)

    def _forget(self) -> None:
        self._steps.clear()
        self._gaps.clear()

    def _believe(self, verdict: Verdict) -> None:
        """Take a verdict for true: the first at once, another than before when it is given twice in a row."""
        same = verdict.told == self.verdict.told
        if same or (self._has_judged and (self._perhaps is None or self._perhaps.told != verdict.told)):
            self._perhaps = None if same else verdict
            if same and verdict.told == _NUMBERS:
                self._measure()
            return
        self._has_judged, self._perhaps = True, None
        self.verdict = verdict
        if self._time is not None:
            self._measured_from = self._time, self._arrival
            self._origin = (self._time, self._arrival) if verdict.told == _NUMBERS else (0.0, 0.0)

    def _measure(self) -> None:
        """Measure the rate of frame numbers over all that came since they were first believed to be some."""
        begun, since = self._measured_from
        if self._time is None or not 0 < self._arrival - since <= _MEASURED:
            return
        if self._time <= begun:
            self._measured_from = self._time, self._arrival
            return
        place, seconds = self._origin
        self._origin = self._time, seconds + (self._time - place) * self.verdict.seconds
        self.verdict = Verdict((self._arrival - since) / (self._time - begun), _NUMBERS)


def _judged(steps: list[float], gaps: list[float], span: float) -> Verdict | None:
    """Say what times are that went on by these steps while so many seconds passed; None when nothing can be said."""
    count = len(steps)
    if count / span > _MAX_RATE:
        return None
    # A packet that comes twice comes twice at once; a clock that stands still stands still as long as a frame lasts.
    waited = [step for step, gap in zip(steps, gaps, strict=True) if 2 * gap * count > span]
    still = sum(step == 0 for step in waited)
    if still >= max(_STILL * len(waited), 1):
        return _COARSE if any(steps) else _STANDS_STILL
    step = sorted(steps)[count // 2]
    return _of_pace(step, step * count / span)


def _of_pace(step: float, pace: float) -> Verdict:
    """Say what times are whose middle step is this, and that go on by so much a second."""
    unit = next((unit for unit in _UNITS if unit / _TOLERANCE < pace < unit * _TOLERANCE), None)
    # Milliseconds go on by several too.
    largest = 1 if unit else _MAX_NUMBER_STEP
    if step.is_integer() and 1 <= step <= largest and pace / step >= _MIN_NUMBERS:
        return Verdict(1 / pace, _NUMBERS)
    if unit:
        return Verdict(1 / unit, f"times are {_UNITS[unit]}: scaled")
    if _SLOWEST < pace < _FASTEST:
        return SECONDS
    return _BACKWARDS if pace < 0 else _ASTRAY
