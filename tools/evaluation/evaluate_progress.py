"""`kinespace evaluate progress`: errors of phase, speed and amplitude, with the performer's motions left out."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from kinespace.library import MotionLibrary
from kinespace.library.distances import distance_rows
from kinespace.library.progress.phase_table import MOMENTS_PER_SECOND, PhaseTable, moving_point, phase_table
from kinespace.library.windows.index import opened
from kinespace.stream.frame import Frame
from kinespace.stream.recognizer import Recognizer, Settings
from kinespace.stream.recognizer.progress import STEP, ProgressFollower
from kinespace.tools.cli.arguments import add_json, add_map, add_reading, count, reading_of
from kinespace.tools.evaluation.rounds import rounds_scored
from kinespace.tools.evaluation.takes import Sources, read_takes
from kinespace.tools.terminal.console import console, progress
from kinespace.tools.terminal.tables import narrow_table

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from kinespace.library import Clip
    from kinespace.library.progress.phase_table import Moments
    from kinespace.library.windows.index import WindowIndex
    from kinespace.stream.recognition import Recognition
    from kinespace.tools.evaluation.rounds import RoundsScore

    #: At each step of a played motion the phase and the speed, NaN where there was no answer.
    Told = tuple[NDArray[np.float64], NDArray[np.float64]]

#: The ways in which motions are played, and some of the ways that tell their phases.
AS_RECORDED, WARPED = "as recorded", "warped"
CLOCK, NAMED, KNOWN = "clock, true start", "filter, named class", "filter, true class"
#: Seconds from a motion's start that are not scored: no method can tell the phase yet.
_UNSCORED = 0.3
#: The speed curve: 2 to the power of a sine of this period, seconds, so from half to twice the speed.
_PERIOD = 3.0
#: Factors by which deviations from the mean posture are scaled.
SIZES = (0.6, 0.8, 1.25, 1.6)
#: An amplitude is read this long after the start, or at the end of a shorter motion; shorter motions are left out.
_READ_AFTER, _SHORTEST = 1.5, 1.0
#: A phase with a smaller error is right; a phase that falls by more goes back.
_NEAR, _FALLS = 0.1, 0.02
#: Every so many motions are timed, so many times; speeds at which one is drawn.
_COSTED, _REPEATS, _PICTURED = 12, 10, (0.5, 1.0, 2.0)


@dataclass(frozen=True, slots=True)
class ProgressScore:
    """The errors of one method, in one way of playing.

    Attributes
    ----------
    played
        `as recorded`, or `warped`: at a speed that swings between half and twice.
    method
        The method: a clock that runs from the true start or from the recogniser's first right answer for as long as the
        class's mean motion lasts; online time warping; or the filter, given the class, or with the class that it
        named.
    phase_mean, phase_median
        Absolute error of the phase.
    phase_near
        Share of the steps whose phase is within 0.1.
    speed_octaves
        Median absolute error of the speed, octaves; None for a method without speeds.
    back
        Share of the steps whose phase is lower by more than 0.02 than a step before.
    answered
        Share of the steps with a phase.
    steps, motions, persons
        The basis of the figures.
    """

    played: str
    method: str
    phase_mean: float
    phase_median: float
    phase_near: float
    speed_octaves: float | None
    back: float
    answered: float
    steps: int
    motions: int
    persons: int


@dataclass(frozen=True, slots=True)
class _Played:
    """One motion as it is played: a body at every step, and its true phase and speed."""

    clip: Clip
    positions: NDArray[np.float64]
    phases: NDArray[np.float64]
    speeds: NDArray[np.float64]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.description = (
        "Plays the built-in library's motions, as recorded and at speeds that swing between half and twice, and "
        "follows each by the motions of the other actors. The true phase of a motion is the median of its time "
        "warpings onto other actors' motions of its class. Or follows labelled takes by the built-in library, and "
        "compares with the rounds that the person makes of a motion."
    )
    parser.add_argument("takes", nargs="*", type=Path, metavar="TAKE", help="takes with labels beside them, or folders")
    add_map(parser)
    add_reading(parser)
    parser.add_argument("--every", type=count, default=1, help="play every nth motion alone (default %(default)s)")
    parser.add_argument(
        "--picture", type=Path, metavar="FILE", help="draw the phase of three motions of different speed, and end"
    )
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Run the program with these options; return the exit status."""
    library = MotionLibrary.builtin()
    if options.picture:
        return _pictured(library, options.picture)
    if options.takes:
        takes = read_takes(Sources(options.takes, names=dict(options.map)), reading_of(options))
        _tell_rounds(list(rounds_scored(takes, opened(library))), as_json=options.json)
        return 0
    # First, because it opens the whole library, which `evaluated` then finds open.
    cost = _cost(library)
    scores, amplitude = evaluated(library, every=options.every)
    if options.json:
        print(json.dumps(_summary(scores, amplitude, cost), indent=2))
    else:
        _print(scores, amplitude, cost)
    return 0


def _summary(scores: Sequence[ProgressScore], amplitude: tuple[float, int], cost: float) -> dict[str, object]:
    """Give the main figures by their names, and all others below them."""
    by = {(each.played, each.method): each for each in scores}
    plain, warped = by[AS_RECORDED, NAMED], by[WARPED, NAMED]
    clock = by[AS_RECORDED, CLOCK]
    return {
        "phase_error": plain.phase_mean,
        "within_tenth": plain.phase_near,
        "warped_error": warped.phase_mean,
        "warped_within_tenth": warped.phase_near,
        "speed_octaves": warped.speed_octaves,
        "amplitude_error": amplitude[0],
        "back_steps": plain.back,
        "clock_error": clock.phase_mean,
        "clock_within_tenth": clock.phase_near,
        "us_per_hop": cost,
        "scores": [asdict(each) for each in scores],
        "amplitudes": amplitude[1],
    }


def evaluated(library: MotionLibrary, *, every: int = 1) -> tuple[list[ProgressScore], tuple[float, int]]:
    """Follow every motion by the other actors' motions.

    Returns
    -------
    The scores, and the median relative error of known amplitudes with the number of amplitudes.
    """
    truth = _true_phases(library)
    heard: dict[tuple[str, str], list[tuple[_Played, Told]]] = {}
    sizes: list[float] = []
    for actor in progress(library.actors, "Persons", len(library.actors)):
        index = opened(library.without(actors=[actor]))
        table = phase_table(index)
        for clip in [each for each in library.motions if each.actor == actor][::every]:
            moments = table.classes.get(clip.class_name)
            if moments is None or id(clip) not in truth:
                continue
            for kind in (AS_RECORDED, WARPED):
                played = _played(clip, truth[id(clip)], moments.seconds, warped=kind == WARPED)
                for method, told in _told(played, index, table).items():
                    heard.setdefault((kind, method), []).append((played, told))
            sizes += _size_errors(clip, index, table)
    scores = [_score(kind, method, results) for (kind, method), results in heard.items()]
    return scores, (float(np.median(sizes)) if sizes else math.nan, len(sizes))


def _true_phases(library: MotionLibrary) -> dict[int, NDArray[np.float64]]:
    """Give the phases of every motion's moments, by the motion's identity."""
    index = opened(library)
    table = phase_table(index)
    found: dict[int, NDArray[np.float64]] = {}
    for name, moments in table.classes.items():
        clips = [
            clip for clip in library.motions if clip.class_name == name and clip.duration >= 4 / MOMENTS_PER_SECOND
        ]
        found |= {
            id(clip): phases for clip, phases in zip(clips, np.split(moments.phases, moments.starts[1:]), strict=True)
        }
    return found


def _played(clip: Clip, phases: NDArray[np.float64], mean_seconds: float, *, warped: bool) -> _Played:
    """Play a motion step by step, as recorded or at a swinging speed that begins anywhere in its curve."""
    times: list[float] = []
    speeds: list[float] = []
    now = 0.0
    begins = (clip.frames * 0.618) % 1
    while now < clip.duration:
        speed = 2 ** math.sin(2 * math.pi * (len(times) * STEP / _PERIOD + begins)) if warped else 1.0
        times.append(now)
        speeds.append(speed)
        now += STEP * speed
    positions = _between(clip, np.array(times))
    own = np.interp(np.array(times) * MOMENTS_PER_SECOND, np.arange(len(phases)), phases)
    return _Played(clip, positions, own, np.array(speeds) * mean_seconds / clip.duration)


def _told(played: _Played, index: WindowIndex, table: PhaseTable) -> dict[str, Told]:
    """Get phase and speed of every method at every step."""
    count, class_name = len(played.positions), played.clip.class_name
    moments = table.classes[class_name]
    answers = _recognized(played, index)
    started = next((i for i, each in enumerate(answers) if each and each.class_name == class_name), None)
    elapsed = np.arange(count) * STEP / moments.seconds
    none = np.full(count, np.nan)
    own_clock = (
        none if started is None else np.minimum(np.maximum(np.arange(count) - started, 0) * STEP / moments.seconds, 1)
    )
    named = [each.progress if each and each.class_name == class_name else None for each in answers]
    points = _points(played.positions, index)
    follower = ProgressFollower(table)
    known = [follower.push(place * STEP, point, class_name) for place, point in enumerate(points)]
    return {
        CLOCK: (np.minimum(elapsed, 1.0), np.ones(count)),
        "clock, first right answer": (
            np.where(np.arange(count) < (count if started is None else started), np.nan, own_clock),
            np.ones(count),
        ),
        "online warping": (_warped_online(points, moments, table), none),
        NAMED: (
            np.array([each.phase if each else np.nan for each in named]),
            np.array([each.speed if each else np.nan for each in named]),
        ),
        KNOWN: (
            np.array([each.phase if each else np.nan for each in known]),
            np.array([each.speed if each else np.nan for each in known]),
        ),
    }


def _recognized(played: _Played, index: WindowIndex) -> list[Recognition | None]:
    recognizer = Recognizer(index, Settings(progress=True))
    return [recognizer.push(Frame("performer", place * STEP, each)) for place, each in enumerate(played.positions)]


def _points(positions: NDArray[np.float64], index: WindowIndex) -> NDArray[np.float64]:
    rows = distance_rows(positions, index.library.skeleton)
    placed: NDArray[np.float64] = rows @ index.basis.directions / index.body.size(rows)[:, None]
    return placed


def _warped_online(points: NDArray[np.float64], moments: Moments, table: PhaseTable) -> NDArray[np.float64]:
    """Warp onto every recording at once, with an open begin; give the phase of the cheapest path's end (Dixon 2005)."""
    starts = np.zeros(len(moments.phases), dtype=bool)
    starts[moments.starts] = True
    total, phases = np.zeros(len(moments.phases)), []
    for place, point in enumerate(points):
        live = moving_point(points[max(0, place - round(2 / MOMENTS_PER_SECOND / STEP))], point) @ table.whitening
        cost = np.sqrt(((moments.vectors - live[:, None]) ** 2).sum(axis=0))
        before = np.where(starts, np.inf, np.roll(total, 1))
        total = np.minimum(total, before) + cost if place else cost
        phases.append(moments.phases[total.argmin()])
    return np.array(phases)


def _size_errors(clip: Clip, index: WindowIndex, table: PhaseTable) -> list[float]:
    """Scale a motion's deviations from its mean posture, and compare the amplitudes with the known factors."""
    if clip.duration < _SHORTEST:
        return []

    def amplitude(size: float) -> float:
        mean = clip.positions.mean(axis=0)
        scaled = replace(clip, positions=mean + size * (clip.positions - mean))
        played = _played(scaled, np.zeros(2), clip.duration, warped=False)
        follower = ProgressFollower(table)
        told = [
            follower.push(place * STEP, point, clip.class_name)
            for place, point in enumerate(_points(played.positions, index))
        ]
        last = told[min(len(told) - 1, round(_READ_AFTER / STEP))]
        return last.amplitude if last else math.nan

    own = amplitude(1.0)
    return [abs(amplitude(size) / own / size - 1) for size in SIZES]


def _cost(library: MotionLibrary) -> float:
    """Measure the microseconds of a hop: of each of some motions the quickest time, and the median of these."""
    index = opened(library)
    table = phase_table(index)
    costs = []
    for clip in library.motions[::_COSTED]:
        points = _points(clip.positions[:: round(clip.frame_rate * STEP)], index)
        costs.append(min(_seconds(ProgressFollower(table), points, clip.class_name) for _ in range(_REPEATS)))
    return float(np.median(costs)) * 1e6


def _seconds(follower: ProgressFollower, points: NDArray[np.float64], class_name: str) -> float:
    begun = perf_counter()
    for place, point in enumerate(points):
        follower.push(place * STEP, point, class_name)
    return (perf_counter() - begun) / len(points)


def _pictured(library: MotionLibrary, path: Path) -> int:
    """Draw how the phase of one motion goes when it is played at three speeds, by the motions of the other actors."""
    # matplotlib is an extra.
    from kinespace.tools.terminal.pictures import draw_phases, require_place_for_picture  # noqa: PLC0415

    require_place_for_picture(path)
    clip = next(each for each in library.motions if each.class_name == "squat1Reps" and each.actor == "mm")
    index = opened(library.without(actors=[clip.actor]))
    follower, courses = ProgressFollower(phase_table(index)), {}
    own = _true_phases(library)[id(clip)]
    for speed in _PICTURED:
        times = np.arange(0, clip.duration, STEP * speed)
        points = _points(_between(clip, times), index)
        follower.clear()
        told = [follower.push(place * STEP, point, clip.class_name) for place, point in enumerate(points)]
        true = np.interp(times * MOMENTS_PER_SECOND, np.arange(len(own)), own)
        courses[speed] = (np.arange(len(points)) * STEP, np.array([each.phase for each in told if each]), true)
    draw_phases(path, clip.class_name, courses)
    return 0


def _between(clip: Clip, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the positions of a motion at some times, in a straight line between its frames."""
    places = times * clip.frame_rate
    below = np.minimum(places.astype(int), clip.frames - 2)
    part = (places - below)[:, None, None]
    positions: NDArray[np.float64] = clip.positions[below] * (1 - part) + clip.positions[below + 1] * part
    return positions


def _score(kind: str, method: str, results: Sequence[tuple[_Played, Told]]) -> ProgressScore:
    """Compare one method's phases and speeds with the true ones, from `_UNSCORED` seconds on."""
    first = round(_UNSCORED / STEP)
    errors = np.concatenate([(told[0] - played.phases)[first:] for played, told in results])
    rising = np.concatenate([np.diff(told[0])[first:] for _, told in results])
    octaves = np.concatenate([np.log2(told[1] / played.speeds)[first:] for played, told in results])
    answered = np.isfinite(errors)
    octaves = np.abs(octaves[np.isfinite(octaves) & answered])
    errors = np.abs(errors[answered])
    return ProgressScore(
        played=kind,
        method=method,
        phase_mean=float(errors.mean()),
        phase_median=float(np.median(errors)),
        phase_near=float((errors <= _NEAR).mean()),
        speed_octaves=float(np.median(octaves)) if len(octaves) else None,
        back=float((rising[np.isfinite(rising)] < -_FALLS).mean()),
        answered=float(answered.mean()),
        steps=len(errors),
        motions=len(results),
        persons=len({played.clip.actor for played, _ in results}),
    )


def _tell_rounds(scores: Sequence[RoundsScore], *, as_json: bool) -> None:
    if not scores:
        raise ValueError("takes: expected a whole round of a known class, got none (--map renames labels)")
    if as_json:
        print(json.dumps([asdict(each) for each in scores], indent=2))
        return
    table = narrow_table(title="Progress in the rounds of a motion, by the built-in library")
    for heading in ("take", "class", "seconds", "rounds", "told", "followed", "mean error", "within .1"):
        table.add_column(heading, justify="left" if heading in ("take", "class") else "right")
    for each in scores:
        table.add_row(
            each.take,
            each.class_name,
            f"{each.seconds:.1f}",
            f"{each.rounds:.2f}",
            f"{each.rounds_told:.2f}",
            f"{each.followed:.1%}",
            f"{each.phase_error:.3f}",
            f"{each.within_tenth:.1%}",
        )
    console.print(table)


def _print(scores: Iterable[ProgressScore], amplitude: tuple[float, int], cost: float) -> None:
    table = narrow_table(title="Progress, the performer's motions left out")
    for heading in ("played", "method", "mean error", "median", "within .1", "speed, octaves", "back", "answered"):
        table.add_column(heading, justify="left" if heading in ("played", "method") else "right")
    score = None
    for score in scores:
        table.add_row(
            score.played,
            score.method,
            f"{score.phase_mean:.3f}",
            f"{score.phase_median:.3f}",
            f"{score.phase_near:.1%}",
            "-" if score.speed_octaves is None else f"{score.speed_octaves:.2f}",
            f"{score.back:.1%}",
            f"{score.answered:.1%}",
        )
    console.print(table)
    if score:
        console.print(
            f"{score.motions} motions of {score.persons} persons. Amplitude: median error {amplitude[0]:.1%} of "
            f"{amplitude[1]} motions scaled by {', '.join(map(str, SIZES))}. The filter takes {cost:.0f} µs a hop."
        )
