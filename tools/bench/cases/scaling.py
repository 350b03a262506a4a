"""`kinespace bench growth`: how the cost grows with joints and library, and with which exponent."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from kinespace.library import MotionLibrary, Skeleton
from kinespace.stream.recognizer import Recognizer, Settings
from kinespace.tools.bench.cases.stages import ROUND, WARM_UP, pushing
from kinespace.tools.bench.recorded import Feed
from kinespace.tools.bench.timing import clock, exponent, in_turns
from kinespace.tools.feeding.feed import without_pause
from kinespace.tools.terminal.console import progress

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from kinespace.library import Clip

#: The order in which joints are added to smaller bodies (15 as from OpenNI, 20 as from a Kinect).
_ORDER = (
    *("root", "thorax", "head", "lhumerus", "lradius", "lhand", "rhumerus", "rradius", "rhand"),
    *("lfemur", "ltibia", "lfoot", "rfemur", "rtibia", "rfoot"),
    *("lwrist", "rwrist", "ltoes", "rtoes", "upperback"),
)
#: Seconds of each motion of an enlarged library: enough for one window.
_STRETCH = 0.25
#: How many times as fast as recorded motions are played.
_SPEEDS = tuple(np.linspace(0.7, 1.2, 11).tolist())
#: Seconds of feed.
_SECONDS = 30.0


@dataclass(frozen=True, slots=True)
class Sizes:
    """The sizes to which joints and libraries grow."""

    joints: tuple[int, ...] = (15, 20, 31, 55)
    motions: tuple[int, ...] = (288, 2_337, 20_000, 200_000)


@dataclass(frozen=True, slots=True)
class Growth:
    """How one cost grows.

    Attributes
    ----------
    of
        The quantity that grows.
    cost
        The cost, as text; it is in microseconds.
    labels
        The sizes in a reader's words.
    sizes
        The numbers for the exponent: pairs for joints.
    us
        The cost at each size, median.
    exponent
        b of cost = a · size^b, by least squares of the logarithms.
    """

    of: str
    cost: str
    labels: tuple[str, ...]
    sizes: tuple[float, ...]
    us: tuple[float, ...]
    exponent: float


def measure(settings: Settings, *, sizes: Sizes, rounds: int) -> tuple[Growth, ...]:
    """Grow one quantity after another; the others stay at their default: 31 joints, the built-in library."""
    parts: list[Callable[[], Growth]] = [
        lambda: by_joints(settings, sizes.joints, rounds),
        lambda: by_library(settings, sizes.motions, rounds),
    ]
    return tuple(part() for part in progress(parts, "Growth", len(parts)))


def _grown(of: str, cost: str, sizes: dict[str, float], jobs: dict[str, Callable[[], float]], rounds: int) -> Growth:
    us = {name: float(np.median(each)) for name, each in in_turns(jobs, rounds).items()}
    counts, costs = tuple(sizes[name] for name in us), tuple(us.values())
    return Growth(of, cost, tuple(us), counts, costs, exponent(counts, costs))


def by_joints(settings: Settings, joints: Sequence[int], rounds: int) -> Growth:
    """Time a recogniser of each number of joints; the exponent counts pairs."""
    libraries = {f"{count}": with_joints(MotionLibrary.builtin(), count) for count in joints}
    jobs = {name: pushing(library, _played(library), settings) for name, library in libraries.items()}
    pairs = {name: float(len(library.skeleton.pairs)) for name, library in libraries.items()}
    return _grown("joints", "a frame (exponent of pairs)", pairs, jobs, rounds)


def by_library(settings: Settings, motions: Sequence[int], rounds: int) -> Growth:
    """Time an answer with libraries of each size, whose motions are as long as one window."""
    builtin = MotionLibrary.builtin()
    jobs = {f"{count}": _answering(enlarged(builtin, count), _played(builtin), settings) for count in motions}
    return _grown("library", "an answer", {f"{count}": float(count) for count in motions}, jobs, rounds)


def _played(library: MotionLibrary) -> NDArray[np.float32]:
    return without_pause(library.motions[::8], 120.0, _SECONDS)


def _answering(library: MotionLibrary, positions: NDArray[np.float32], settings: Settings) -> Callable[[], float]:
    """Make a job of pushing frames: microseconds for each answered frame, the matching included."""
    recognizer, feed = Recognizer(library, settings), Feed(positions)
    for frame in feed.take(WARM_UP):
        recognizer.push(frame)

    def run() -> float:
        seconds = list[float]()
        for frame in feed.take(ROUND):
            start = clock()
            answered = recognizer.push(frame) is not None
            seconds += [clock() - start] if answered else []
        return float(np.median(seconds)) * 1e6

    return run


def with_joints(library: MotionLibrary, count: int) -> MotionLibrary:
    """Give a library of HDM05's body with another number of joints.

    Fewer joints are the most important ones; more are the 31 joints and points half way between a joint and its parent.

    Parameters
    ----------
    library
        A library of HDM05's skeleton.
    count
        The number of joints: 5 to 20, 31, or up to 61.

    Raises
    ------
    ValueError
        No body with so many joints is known.
    """
    joints = len(library.skeleton.joints)
    if count <= len(_ORDER):
        return library.restricted_to(_ORDER[:count])
    if not joints <= count < 2 * joints:
        raise ValueError(f"joints: expected 5 to {len(_ORDER)}, or {joints} to {2 * joints - 1}, got {count}")
    return MotionLibrary.of_clips(_with_points_between(motion, count - joints) for motion in library.motions)


def _with_points_between(motion: Clip, count: int) -> Clip:
    skeleton = motion.skeleton
    bones = [(joint, parent) for joint, parent in enumerate(skeleton.parents) if parent >= 0][:count]
    between = [(motion.positions[:, joint] + motion.positions[:, parent]) / 2 for joint, parent in bones]
    names = (*skeleton.joints, *(f"above {skeleton.joints[joint]}" for joint, _ in bones))
    positions = np.concatenate([motion.positions, *(each[:, None] for each in between)], axis=1)
    return replace(motion, skeleton=Skeleton(names), positions=positions)


def enlarged(library: MotionLibrary, count: int) -> MotionLibrary:
    """Give a library of so many short motions: stretches of a library's motions, from other frames on, at other speeds.

    They share the library's positions: no copy is made.

    Parameters
    ----------
    library
        The library whose motions are cut.
    count
        The number of motions, at most the number of stretches.

    Raises
    ------
    ValueError
        There are fewer stretches.
    """
    places = [
        (motion, start, round(_STRETCH * motion.frame_rate))
        for motion in library.motions
        for start in range(motion.frames - round(_STRETCH * motion.frame_rate) + 1)
    ]
    most = len(places) * len(_SPEEDS)
    if count > most:
        raise ValueError(f"count: expected at most {most}, got {count}")
    chosen = np.linspace(0, most - 1, count).astype(int)
    motions = []
    for place, speed in zip(*np.divmod(chosen, len(_SPEEDS)), strict=True):
        motion, start, length = places[place]
        rate = motion.frame_rate * _SPEEDS[speed]
        motions.append(replace(motion, positions=motion.positions[start : start + length], frame_rate=rate))
    return MotionLibrary(library.skeleton, tuple(motions), library.learned)
