"""Measures of recordings: units of length and of time, as files name them or as numbers show them, and even frames.

A frame's index gives its time, because frames are put on an even grid.
"""

import math
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from importlib import resources
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinespace.library import memory
from kinespace.library.clip import Clip
from kinespace.library.recordings.formats.errors import number_of
from kinespace.library.skeleton import Skeleton

#: Words in recordings, by kind.
WORDS = tomllib.loads((resources.files("kinespace.library.recordings.formats") / "words.toml").read_text("utf-8"))
#: Metres of each unit, under the names and abbreviations that files use, in lower case.
METRES = {word: float(metres) for metres, words in WORDS["metres"].items() for word in words}
#: The size of a person, in the file's numbers, up to which the unit is one of so many metres; beyond the last it is a
#: millimetre. A crouching child and a very tall person are far from the limits of metres and centimetres. Those between
#: are of whole bodies, grown up: Acclaim's unit, in which CMU's recordings are, and an inch.
_SIZES = ((16.0, 1.0), (46.0, 0.0254 / 0.45), (100.0, 0.0254), (500.0, 0.01))
#: Centimetres from a laboratory's origin, at most: a part of a body that is farther is in millimetres.
_FARTHEST = 15_000.0
#: Frames in which the size is measured, about.
_LOOKS = 256
#: What is so many times farther from a body's middle than half of its joints is no part of it.
FAR = 8.0
#: Joints that may be no part of the body, at most, and one of how many.
_MAX_ALIEN, _ALIEN = 3, 6


@lru_cache(maxsize=256)
def metres_of(unit: str) -> float | None:
    """Give the metres of a unit's name, or of a number that says them itself; None for any other text.

    A name may be cut short, as C3D's fields of four letters do it: `mete`.
    """
    name = unit.strip().strip("()[].").lower()
    meant = {METRES[name]} if name in METRES else {each for word, each in METRES.items() if word.startswith(name)}
    if len(meant) == 1 and (name in METRES or len(name) > 2):
        return meant.pop()
    metres = number_of(name) or 0.0
    return metres if 0 < metres < math.inf else None


def guessed_metres(positions: NDArray[np.float64], names: Sequence[str] = ()) -> float:
    """Guess the metres of a file's unit from a person's size in it; positions (frames, joints, 3), NaN where not seen.

    The size is the diagonal of the box around the joints, usual for the frames in which two joints or more are seen.
    People differ less than tenfold in size, so metres, centimetres and millimetres can be distinguished; Acclaim's unit
    and inches, too, where `names` tell of a head and of feet. Any other unit is taken for the nearest of these:
    distances then have another scale, which recognition does not depend on. A pelvis, a hand, or a head alone, by its
    `names`, is a fifth of a person.
    """
    seen = positions[np.isfinite(positions).all(axis=2).sum(axis=1) > 1]
    if not len(seen):
        return 1.0
    some = seen[:: 1 + len(seen) // _LOOKS]
    away, radius = from_middle(some)
    far, there = away > FAR * radius, np.isfinite(away).sum(axis=1, keepdims=True)
    # A reference on the floor, or a thing, is no part of the body; many joints are: half of all may be a face's.
    alien = far & (far.sum(axis=1, keepdims=True) <= np.minimum(_MAX_ALIEN, there // _ALIEN))
    own = np.where(alien[:, :, None], np.nan, some)
    size = float(np.median(np.linalg.norm(np.nanmax(own, axis=1) - np.nanmin(own, axis=1), axis=1)))
    text, parts = " ".join(names).lower(), WORDS["columns"]["parts_of_body"] if names else ()
    if any(all(any(word in name.lower() for word in part) for name in names) for part in parts):
        size *= 5
    is_whole = "head" in text and ("foot" in text or "ankle" in text)
    found = next((metres for most, metres in _SIZES if size <= most and (is_whole or metres in (1.0, 0.01))), 0.001)
    # No laboratory is so large: these are the feet alone, say.
    is_far = found == _SIZES[-1][1] and np.nanmedian(np.abs(some).max(axis=2)) > _FARTHEST
    return 0.001 if is_far and not is_whole else found


def from_middle(positions: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Give how far each joint is from its frame's middle joint, (frames, joints), and how far half of them are."""
    seen = np.isfinite(positions[:, :, 0])
    middle = np.full((len(positions), 3), np.nan)
    middle[seen.any(axis=1)] = np.nanmedian(positions[seen.any(axis=1)], axis=1)
    away = np.linalg.norm(positions - middle[:, None], axis=2)
    return away, float(np.median(away[seen])) if seen.any() else 0.0


#: Shape (frames,), seconds or in a file's unit; and shape (frames, joints, 3), metres or in a file's unit.
Times = NDArray[np.float64]
Positions = NDArray[np.float64]
#: Seconds a marker may be out of sight. Over a longer time a straight line would be an invented movement.
MAX_GAP = 0.5
#: Rates that senders usually have; a feed that comes almost as often is taken to have such a rate.
USUAL = np.array([10.0, 12.5, 15.0, 20.0, 24.0, 25.0, 30.0, 50.0, 60.0, 72.0, 75.0, 90.0, 100.0, 120.0, 144.0, 240.0])
#: Share by which frames may come more or less often than a usual rate.
_ABOUT = 0.03
#: Two times are the same when they differ by less than this share of a frame's time, or by less than these seconds.
_TIE = 1e-6
#: Frames per second of a file without a clock: the rate of MediaPipe's cameras.
FRAME_RATE = 30.0
#: Seconds of the units in which files count time, by the words for them in a column's name.
SECONDS = {word: float(seconds) for seconds, words in WORDS["seconds"].items() for word in words}
_FRAMES, _TIMES = (frozenset(WORDS["columns"][kind]) for kind in ("frames", "times"))
#: Frames per second that are likely, and that are possible: times of no named unit have the unit that gives them.
_RATES = ((14.0, 1000.0), (1.0, 1000.0))
#: Steps of times that are smaller are a moment in no unit.
_LEAST_STEP = 1e-12
#: Frames per second, at most, of times in ticks of 100 ns that nothing names: a Kinect's.
_MOST_BY_TICKS = 70.0
#: Two rates whose logarithms differ by less are alike.
_NEARLY = 0.1
#: Times that differ from even ones by less than this share of a frame are even.
_EVEN = 1e-4
#: Frames whose times show how they are rounded; a slip of more than this share of a frame is a missing one.
_LAST, _SLIP = 16, 0.9
#: A column of times is passed over for one that goes on more often: it has less than this share of its steps.
_GOES = 0.9
#: Steps for each one backwards, at least, where takes follow each other; otherwise the times mean nothing.
_FALLS = 10
#: Frames of the grid, at most: a day at 60 frames per second.
MAX_FRAMES = 24 * 3600 * 60


class Evened(NamedTuple):
    """Frames on an even grid.

    Attributes
    ----------
    positions
        Shape (frames, joints, 3), metres.
    rate
        Frames per second.
    missing
        Frames that stand on straight lines, because no frame came near their time.
    gaps
        Times between which no frame came for longer than straight lines may last, seconds from the grid's beginning.
    """

    positions: Positions
    rate: float
    missing: int
    gaps: tuple[tuple[float, float], ...]

    def clip(self, skeleton: Skeleton) -> Clip:
        """Make a clip of them; ValueError where a position is not finite."""
        return Clip(skeleton, self.positions, self.rate, filled=self.missing * len(skeleton.joints), gaps=self.gaps)


def evened(times: Times, positions: Positions, *, rate: float | None = None, begin: float | None = None) -> Evened:
    """Put frames on an even grid: straight lines between two frames, standing still where no frame came for long.

    Parameters
    ----------
    times
        Seconds on any clock, shape (frames,), not falling; of frames at the same time the last one counts.
    positions
        Shape (frames, joints, 3), metres.
    rate
        Frames per second of the grid; the rate at which the frames came when not given.
    begin
        The time at which the grid begins; the first frame's when not given. The body stands still until the first
        frame.

    Raises
    ------
    ValueError
        Fewer than two frames, times that fall or are not finite, or more than a day of frames.
    """
    if len(times) < 2 or not np.isfinite(times).all() or (np.diff(times) < 0).any():
        raise ValueError("time: expected at least 2 finite times that do not fall")
    last = np.append(np.diff(times) > 0, True)
    times, positions = times[last], positions[last]
    if len(times) < 2:
        raise ValueError("time: expected at least 2 different times, got 1")
    rate = rate or _usual_rate(times)
    begin = float(times[0]) if begin is None else begin
    frames = int(np.floor((times[-1] - begin) * rate + 1e-6)) + 1
    if frames > MAX_FRAMES:
        raise ValueError(f"time: expected at most {MAX_FRAMES} frames at {rate:g} per second, got {frames}")
    memory.require_numbers(max(frames, len(times)) * positions[0].size)
    grid = begin + np.arange(frames) / rate
    after = np.clip(np.searchsorted(times, grid - _TIE), 1, len(times) - 1)
    before = after - 1
    apart = times[after] - times[before]
    share = np.clip((grid - times[before]) / apart, 0.0, 1.0)
    # A straight line over a long time would be an invented movement: the body stays where it was last seen.
    share[(apart > MAX_GAP) & (share < 1 - _TIE)] = 0.0
    share[share < _TIE] = 0.0
    nearest = np.minimum(np.abs(grid - times[before]), np.abs(times[after] - grid))
    missing = int(((nearest > 1 / rate) & (apart <= MAX_GAP) & (grid >= times[0])).sum())
    return Evened(_between(positions, before, after, share), rate, missing, tuple(_gaps(times, begin)))


def words_of(name: str) -> list[str]:
    """Give the words of a column's name in small letters: `timestampUs` has two."""
    return [word.lower() for word in re.findall(r"[A-ZÀ-Þ]?[a-zµμß-ÿ]+|[A-ZÀ-Þ]+(?![a-z])|\d+|[Ͱ-\uffff]+", name)]


def _unit_in(name: str) -> float | None:
    """Give the seconds of the unit in a column's name."""
    return next((SECONDS[word] for word in words_of(name) if word in SECONDS), None)


def seconds_of(moments: Times, name: str, rate: float | None = None) -> tuple[Times, str]:
    """Read a column of times by the unit in its name, or else by the steps of its numbers.

    Parameters
    ----------
    moments
        The numbers, shape (frames,).
    name
        The column's name.
    rate
        Frames per second where the numbers are frame numbers, or no times; `FRAME_RATE` when not given.

    Returns
    -------
    Seconds from the first frame, and a remark; empty where the times are what they seem to be.
    """
    since, assumed = moments - moments[0], rate or FRAME_RATE
    steps = np.diff(since)[np.diff(since) > _LEAST_STEP]
    step = float(np.median(steps)) if len(steps) else 0.0
    words, named = words_of(name), _unit_in(name)
    counts = _FRAMES & {*words} and not (named or _TIMES & {*words})
    if step >= 1 and (since % 1 == 0).all() and (counts or (step == 1 and named != 1e-3)):
        return since / assumed, f"times: {name!r} holds frame numbers: {assumed:g} frames a second"
    units = [unit for unit in (named, 1.0, 1e-3, 1e-6, 1e-7, 1e-9, 60.0, 86_400.0) if unit]
    if step and rate and not named:
        # The unit that gives the rate which is known otherwise.
        units.sort(key=lambda unit: abs(math.log(rate * step * unit)) > _NEARLY)
    # Numbers of frames are no slow seconds.
    for lowest, highest in (_RATES[:1] if counts else _RATES) if step else ():
        for unit in units:
            # A unit that the file names is believed while it is possible at all.
            least, most = _RATES[-1] if unit == named else (lowest, _MOST_BY_TICKS if unit == 1e-7 else highest)
            if least <= 1 / (step * unit) <= most:
                return since * unit, ""
    remark = f"times: {name!r} gives no rate of frames: {assumed:g} frames a second"
    return np.arange(len(since)) / assumed, remark


def clock_of(columns: Mapping[str, Times]) -> tuple[str, Times | None]:
    """Give the column of times that goes on, by its name; of two columns that count seconds and their parts the sum."""
    for name, coarse in columns.items():
        rises, whole = np.diff(coarse) > 0, _unit_in(name) or 1.0
        if not rises.any() or 2 * rises.sum() > len(rises) or (coarse % 1).any() or (np.diff(coarse) < 0).any():
            continue
        for part, fine in columns.items():
            falls = np.diff(fine) < 0
            if falls.any() and not (falls & ~rises).any():
                unit = _unit_in(part) or 1 / (fine.max() + 1)
                both = (coarse - coarse[0]) * whole + fine * (unit if fine.max() >= 1 else 1.0)
                others = {each: columns[each] for each in columns if each not in (name, part)}
                return clock_of({f"s of {name}, {part}": both} | others)
    steps = {name: np.sign(np.diff(each[np.isfinite(each)])) for name, each in columns.items()}
    goes = {name: abs(float(each.mean())) if len(each) else 0.0 for name, each in steps.items()}
    return next(((name, columns[name]) for name in goes if goes[name] >= _GOES * max(goes.values())), ("", None))


def are_shuffled(moments: Times) -> bool:
    """Say whether frames stand in another order than their times: some a few frames too late, or all backwards."""
    steps = np.diff(moments)
    back = steps[steps < 0]
    return len(back) > 0 and bool(2 * len(back) > len(steps) or -back.min() < _FALLS * np.median(np.abs(steps)))


def timing(
    moments: Times | None, name: str, said: float, given: float | None, notes: list[str]
) -> tuple[Times | None, float | None]:
    """Give the seconds of a file's frames, and their rate where it is known otherwise.

    Parameters
    ----------
    moments, name
        A column of times and its name; None where there is none.
    said, given
        Frames per second as the file's header says (0: it does not), and as a person asks for.
    notes
        Gets a remark where there are no times, or odd ones, or others than the header says.
    """
    known = given or said
    if moments is None or len(moments) < 2:
        if not known:
            notes.append(f"times: none in it: {FRAME_RATE:g} frames a second")
        return None, known or FRAME_RATE
    paced = _in_order(moments, name.strip(), known, notes)
    if not isinstance(paced, np.ndarray):
        return None, paced
    seconds, remark = seconds_of(paced, name, known)
    if remark and given:
        # Frames come as often as the person says, whatever their numbers.
        seconds = seconds / (float(np.median(np.diff(seconds))) * given or 1.0)
    if remark and not known:
        notes.append(remark)
    if remark or not said or not (np.diff(seconds) > 0).any():
        return seconds, given
    pace = _pace(seconds)
    if abs(said / pace - 1) <= _ABOUT:
        # Even times, which need no grid, are more exact than a header.
        return seconds, given or (None if _even_rate(seconds) and not _even_rate(seconds, said) else said)
    notes.append(f"times: the header says {said:g} frames a second, {name.strip()!r} {pace:.4g}: the times count")
    return seconds, given


def _in_order(moments: Times, name: str, known: float | None, notes: list[str]) -> Times | float:
    """Give times that do not fall; or the rate of frames, where the times are too coarse or mean nothing."""
    steps = np.diff(moments)
    falls, rises, stands = steps < 0, np.flatnonzero(steps > 0), 2 * (steps == 0).sum() > len(steps)
    if _FALLS * falls.sum() > len(steps) or (stands and len(rises) < 3):
        if not known:
            notes.append(f"times: {name!r} gives no rate of frames: {FRAME_RATE:g} frames a second")
        return known or FRAME_RATE
    if falls.any():
        notes.append(f"times: {name!r} starts again behind frame {falls.argmax() + 1}: takes follow each other")
        moments = moments + np.cumsum(np.append(0, np.where(falls, np.median(steps[rises]) - steps, 0)))
    if stands:
        # A clock of whole seconds, say: as many frames as there are between its steps.
        unit = _unit_in(name) or 1.0
        known = known or float((rises[-1] - rises[0]) / (unit * (moments[rises[-1]] - moments[rises[0]])))
        notes.append(f"times: {name!r} stands for several frames: {known:g} frames a second")
        return known
    return moments


def laid(times: Times, positions: Positions, rate: float | None = None) -> Evened:
    """Take a file's frames as they stand where their times are even but for rounding; else put them on a grid.

    Parameters and errors are those of `evened`.
    """
    last = np.append(np.diff(times) > 0, True)
    is_odd = len(times) < 2 or (np.diff(times) < 0).any() or last.sum() < 2
    even = 0.0 if is_odd else _even_rate(times[last] - times[0], rate)
    return Evened(positions[last], even, 0, ()) if even else evened(times, positions, rate=rate)


def _even_rate(since: Times, rate: float | None = None) -> float:
    """Give the rate at which times are even but for rounding, a known one or their own; 0 where they are not."""
    mean = (len(since) - 1) / float(since[-1])
    # `%g` rounds the last times most.
    last = np.diff(since[-_LAST:])
    rounded = next((10.0**-n for n in range(1, 8) if _is_rounded(last, n)), 0.0)
    own = rate or _whole(mean, 1e-6 + rounded / float(since[-1]))
    slip = float(np.ptp(since - np.arange(len(since)) / own))
    return own if slip <= min(1.01 * rounded + _EVEN / mean, _SLIP / mean) else 0.0


def _is_rounded(times: Times, place: int) -> bool:
    scaled = times * 10.0**place
    # Seconds since 1970 are exact to a quarter of a microsecond.
    return bool(np.abs(scaled - np.round(scaled)).max() < 1e-3 + 5e-7 * 10**place)


def _whole(rate: float, slack: float) -> float:
    """Give the whole number from which a rate was rounded, if there is one; slack is a share of it."""
    return float(round(rate)) if round(rate) and abs(round(rate) / rate - 1) <= slack else rate


def _gaps(times: Times, begin: float) -> Iterator[tuple[float, float]]:
    if times[0] - begin > MAX_GAP:
        yield 0.0, float(times[0]) - begin
    for place in np.flatnonzero(np.diff(times) > MAX_GAP).tolist():
        yield float(times[place]) - begin, float(times[place + 1]) - begin


def _between(positions: Positions, before: NDArray[np.intp], after: NDArray[np.intp], share: Times) -> Positions:
    """Weigh two frames; at a frame's own time the frame itself is given, even if its neighbour lacks joints."""
    weighed = positions[before]
    moved = np.flatnonzero(share > 0)
    # A few frames at a time: all at once take the memory of two further recordings.
    for some in np.array_split(moved, 1 + len(moved) // 4096):
        weighed[some] += share[some, None, None] * (positions[after[some]] - positions[before[some]])
    exact = share > 1 - _TIE
    weighed[exact] = positions[after[exact]]
    return weighed


def _pace(times: Times) -> float:
    """Give the mean rate of the frames that follow closely: more exact than the median, which rounding spoils."""
    steps = np.diff(times)
    steps = steps[steps > 0]
    return 1 / float(steps[steps < 2 * np.median(steps)].mean())


def _usual_rate(times: Times) -> float:
    """Give how often frames came: the mean of close frames, or the usual rate that lies near."""
    mean = _pace(times)
    nearest = float(USUAL[np.abs(USUAL / mean - 1).argmin()])
    return nearest if abs(nearest / mean - 1) <= _ABOUT else round(mean, 3) or mean


def with_missing_frames(frame_numbers: NDArray[np.int64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Put straight lines where frame numbers are missing, so that a frame's index gives its time; (frames, n)."""
    wanted = np.arange(frame_numbers[0], frame_numbers[-1] + 1)
    if len(wanted) == len(frame_numbers):
        return values
    return np.stack([np.interp(wanted, frame_numbers, column) for column in values.T], axis=1)
