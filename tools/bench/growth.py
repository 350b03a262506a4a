"""`kinespace bench growth`: how the cost grows with joints, window, library and performers, and the exponent of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from library import MotionLibrary, hdm05
from library.distances import distance_rows
from library.signature import Moments, signature_of, similarity
from library.skeleton import Skeleton
from stream.performers import Performers
from stream.recognizer import LiveSignature, Recognizer, Settings
from tools.bench.recorded import FRAME_RATE, Feed
from tools.bench.stages import WARM_UP
from tools.bench.timing import exponent, in_turns, timed
from tools.console import progress

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray

    from library import Clip
    from library.signature import Signature
    from stream.frame import Frame
    from tools.bench.recorded import Recorded

#: The joints that smaller feeds have, in the order they are added (15 as from OpenNI, 20 as from a Kinect).
_ORDER = (
    *("root", "thorax", "head", "lhumerus", "lradius", "lhand", "rhumerus", "rradius", "rhand"),
    *("lfemur", "ltibia", "lfoot", "rfemur", "rtibia", "rfoot"),
    *("lwrist", "rwrist", "ltoes", "rtoes", "upperback"),
)
#: How far a perturbed copy's axis is from the real one: ‖noise‖ before it is brought to unit length again.
_PERTURBATION = 0.3
#: Rows perturbed at once, so that the largest library needs no second room.
_AT_ONCE = 10_000
_WINDOWS_ASKED = 16
#: Performers whose windows are matched together.
_TOGETHER = 8
#: Rounding of scores computed in another order: what is nearer to the best is the best.
_SAME_SCORE = 1e-5
#: Frames of one round.
_ROUND = 240


@dataclass(frozen=True, slots=True)
class Sizes:
    """What is grown, each to several sizes."""

    joints: tuple[int, ...] = (15, 20, 31, 55)
    seconds: tuple[float, ...] = (0.5, 1.0, 2.0, 4.0)
    motions: tuple[int, ...] = (288, 2_337, 20_000, 200_000)
    performers: tuple[int, ...] = (1, 10, 50, 100)


@dataclass(frozen=True, slots=True)
class Growth:
    """How one cost grows.

    Attributes
    ----------
    of
        What is grown.
    cost
        What a cost is, in microseconds.
    labels
        The sizes as a reader calls them.
    sizes
        What the exponent counts in: pairs for joints.
    us
        The cost at each size, median.
    exponent
        b of cost = a · size^b, by least squares of the logarithms.
    recall
        Of all that a search for the best should find, the share that it found at the largest size; None where nothing
        is searched for.
    """

    of: str
    cost: str
    labels: tuple[str, ...]
    sizes: tuple[float, ...]
    us: tuple[float, ...]
    exponent: float
    recall: float | None = None


def measure(recorded: Recorded, *, sizes: Sizes, rounds: int) -> tuple[Growth, ...]:
    """Grow one thing after another; everything else stays as usual: 31 joints, 1 s, the eigenvector, one performer."""
    parts: Sequence[Callable[[], Growth]] = (
        lambda: by_joints(recorded, sizes.joints, rounds),
        lambda: by_window(recorded, sizes.seconds, rounds),
        lambda: by_library(recorded, sizes.motions, rounds),
        lambda: by_library(recorded, sizes.motions, rounds, together=_TOGETHER),
        *(_by_performers(recorded, sizes.performers, signature, rounds) for signature in LiveSignature),
    )
    return tuple(part() for part in progress(parts, "Growth", len(parts)))


def _grown(of: str, cost: str, sizes: dict[str, float], jobs: dict[str, Callable[[], float]], rounds: int) -> Growth:
    us = {name: float(np.median(each)) for name, each in in_turns(jobs, rounds).items()}
    counts, costs = tuple(sizes[name] for name in us), tuple(us.values())
    return Growth(of, cost, tuple(us), counts, costs, exponent(counts, costs))


def by_joints(recorded: Recorded, joints: Sequence[int], rounds: int) -> Growth:
    """Time a recogniser of each number of joints; the exponent counts pairs."""
    pairs: dict[str, float] = {}
    jobs: dict[str, Callable[[], float]] = {}
    for count in joints:
        clips = [with_joints(clip, count) for clip in recorded.examples]
        library = enlarged(MotionLibrary.of_clips(clips), len(recorded.clips))
        positions = np.concatenate([with_joints(take, count).positions for take in recorded.takes])
        name = f"{count}"
        pairs[name] = len(library.skeleton.pairs)
        jobs[name] = _pushing(library, positions, Settings(signature=LiveSignature.EIGENVECTOR))
    return _grown("joints", "a frame (exponent of pairs)", pairs, jobs, rounds)


def by_window(recorded: Recorded, seconds: Sequence[float], rounds: int) -> Growth:
    """Time a recogniser of each window length."""
    library, positions = MotionLibrary.builtin(), recorded.positions
    jobs = {
        f"{each:g} s": _pushing(library, positions, Settings(signature=LiveSignature.EIGENVECTOR, window=each))
        for each in seconds
    }
    return _grown("window", "a frame", {f"{each:g} s": each for each in seconds}, jobs, rounds)


def _pushing(library: MotionLibrary, positions: NDArray[np.floating], settings: Settings) -> Callable[[], float]:
    recognizer, feed = Recognizer(library, settings), Feed(positions)
    for frame in feed.take(WARM_UP + round(settings.window * FRAME_RATE)):
        recognizer.push(frame)

    def push(frames: Sequence[Frame]) -> None:
        for frame in frames:
            recognizer.push(frame)

    def run() -> float:
        frames = feed.take(_ROUND)
        return timed(lambda: push(frames)) * 1e6 / len(frames)

    return run


def by_library(recorded: Recorded, motions: Sequence[int], rounds: int, *, together: int = 1) -> Growth:
    """Time the match of one window with libraries of each size, windows of so many performers asked for together."""
    builtin = MotionLibrary.builtin()
    axes = np.array([signature.axis.vector for signature in _live_signatures(recorded.takes[0], builtin.skeleton)])
    libraries = {f"{count}": enlarged(builtin, count) for count in motions}
    jobs = {name: _matching(library, axes, together) for name, library in libraries.items()}
    of = "library" if together == 1 else f"library, {together} together"
    grown = _grown(of, "a match", {f"{count}": count for count in motions}, jobs, rounds)
    return replace(grown, recall=recall(libraries[f"{max(motions)}"], axes))


def recall(library: MotionLibrary, axes: NDArray[np.float64]) -> float:
    """Give the share of the classes' best scores that are found, of those that comparing with every motion finds.

    Parameters
    ----------
    library
        Motions.
    axes
        Unit vectors asked for, shape (windows, pairs).
    """
    starts = np.searchsorted(library.class_indices, np.arange(len(library.classes)))
    best = np.maximum.reduceat(similarity(axes.astype(np.float32), library.axes.T), starts, axis=1)
    return float((library.class_scores(axes) >= best - _SAME_SCORE).mean())


def _live_signatures(take: Clip, skeleton: Skeleton) -> Iterator[Signature]:
    """Give signatures of windows of one second, spread over a take."""
    rows, length = distance_rows(take.positions, skeleton), round(take.frame_rate)
    for start in np.linspace(0, len(rows) - length, _WINDOWS_ASKED).astype(int):
        yield signature_of(Moments.of_rows(rows[start : start + length]))


def _matching(library: MotionLibrary, axes: NDArray[np.float64], together: int) -> Callable[[], float]:
    asked = [axes[start : start + together] for start in range(0, len(axes), together)]

    def run() -> float:
        return timed(lambda: [library.class_scores(each) for each in asked]) * 1e6 / len(axes)

    return run


def _by_performers(
    recorded: Recorded, performers: Sequence[int], signature: LiveSignature, rounds: int
) -> Callable[[], Growth]:
    return lambda: by_performers(recorded, performers, signature, rounds)


def by_performers(recorded: Recorded, performers: Sequence[int], signature: LiveSignature, rounds: int) -> Growth:
    """Time one frame of each of so many performers, every one at another place of the recordings and of its hop."""
    positions = recorded.positions
    settings = Settings(signature=signature)
    jobs = {f"{count}": _performing(count, positions, settings) for count in performers}
    sizes = {f"{count}": float(count) for count in performers}
    return _grown(f"performers, {signature}", "a frame of each", sizes, jobs, rounds)


def _performing(count: int, positions: NDArray[np.float32], settings: Settings) -> Callable[[], float]:
    many = Performers(MotionLibrary.builtin(), settings, most=count)
    spread = len(positions) // count
    feeds = [Feed(positions, f"performer {index}", index * spread) for index in range(count)]
    hop = round(settings.hop * FRAME_RATE)

    def tick(moment: int) -> None:
        for index, feed in enumerate(feeds):
            # They came in one after the other: their hops do not fall on the same frame.
            if index % hop <= moment:
                many.push(feed.next(), 0.0)

    def some(moments: range) -> None:
        for moment in moments:
            tick(moment)

    some(range(WARM_UP))
    ticks = 3 * hop

    def run() -> float:
        return timed(lambda: some(range(WARM_UP, WARM_UP + ticks))) * 1e6 / ticks

    return run


def with_joints(clip: Clip, count: int) -> Clip:
    """Give a clip of HDM05's body with another number of joints.

    Fewer are the most important ones; more are the 31 and points half way between a joint and its parent.

    Parameters
    ----------
    clip
        Of HDM05's skeleton.
    count
        How many joints, 2 to 20, 31, or up to 61.

    Raises
    ------
    ValueError
        No such number of joints is known.
    """
    skeleton = hdm05.SKELETON
    bones = [(joint, parent) for joint, parent in enumerate(skeleton.parents) if parent >= 0]
    extra = bones[: count - len(skeleton.joints)] if count > len(skeleton.joints) else []
    if count > len(skeleton.joints) + len(bones) or len(_ORDER) < count < len(skeleton.joints) or count < 2:
        raise ValueError(f"joints: expected 2 to {len(_ORDER)}, or {len(skeleton.joints)} to 61, got {count}")
    names = _ORDER[:count] if count <= len(_ORDER) else skeleton.joints
    places = [skeleton.joints.index(name) for name in names]
    between = [(clip.positions[:, joint] + clip.positions[:, parent]) / 2 for joint, parent in extra]
    added = tuple(f"above {skeleton.joints[joint]}" for joint, _ in extra)
    positions = np.concatenate([clip.positions[:, places], *(each[:, None] for each in between)], axis=1)
    return replace(clip, skeleton=Skeleton.of_joints((*names, *added)), positions=positions)


def enlarged(library: MotionLibrary, count: int) -> MotionLibrary:
    """Give a library of so many motions: the real ones first, then copies with perturbed axes, class by class.

    Only axes enter a match; means and deviations are one row seen many times, which spares gigabytes.

    Parameters
    ----------
    library
        Real motions.
    count
        How many motions there shall be, at least as many as there are.
    """
    origins = np.sort(np.arange(count) % len(library), kind="stable")
    copies = np.append(False, origins[1:] == origins[:-1])
    generator = np.random.default_rng(0)
    axes = np.empty((count, library.axes.shape[1]), dtype=np.float32)
    scale = np.float32(_PERTURBATION / np.sqrt(axes.shape[1]))
    for start in range(0, count, _AT_ONCE):
        chosen = slice(start, start + _AT_ONCE)
        block = library.axes[origins[chosen]]
        noise = generator.standard_normal(block.shape, dtype=np.float32)
        block = block + scale * copies[chosen, None] * noise
        axes[chosen] = block / np.linalg.norm(block, axis=1, keepdims=True)
    return replace(
        library,
        motions=tuple(library.motions[index] for index in origins),
        axes=axes,
        means=np.broadcast_to(library.means[0], axes.shape),
        deviations=np.broadcast_to(library.deviations[0], axes.shape),
        windows=None,
    )
