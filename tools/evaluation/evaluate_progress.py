"""`kinespace evaluate progress`: errors of phase, speed and amplitude, with the performer's motions left out."""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kinespace.library import MotionLibrary
from kinespace.library.distances import distance_rows
from kinespace.library.progress.phase_table import MOMENTS_PER_SECOND, PhaseTable, moving_point
from kinespace.library.windows.index import opened
from kinespace.stream.recognizer import Recognizer, Settings
from kinespace.stream.recognizer.progress import STEP, ProgressFollower
from kinespace.tools.cli.arguments import add_json, count
from kinespace.tools.evaluation import harness
from kinespace.tools.evaluation.scoring.rounds import COLUMNS as ROUNDS
from kinespace.tools.evaluation.scoring.rounds import rounds_scored
from kinespace.tools.terminal.console import progress

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from kinespace.library import Clip
    from kinespace.library.progress.phase_table import Moments
    from kinespace.library.windows.index import WindowIndex
    from kinespace.stream.recognition import Progress

    #: At each step of a played motion the phase and the speed, NaN where there was no answer; shape (2, steps).
    Estimate = NDArray[np.float64]

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
#: The main figures: the name of each, how the motion is played, the method, and its figure.
_MAIN = (
    ("phase_error", AS_RECORDED, NAMED, "phase_mean"),
    ("within_tenth", AS_RECORDED, NAMED, "phase_near"),
    ("warped_error", WARPED, NAMED, "phase_mean"),
    ("warped_within_tenth", WARPED, NAMED, "phase_near"),
    ("speed_octaves", WARPED, NAMED, "speed_octaves"),
    ("back_steps", AS_RECORDED, NAMED, "back"),
    ("clock_error", AS_RECORDED, CLOCK, "phase_mean"),
    ("clock_within_tenth", AS_RECORDED, CLOCK, "phase_near"),
)
_COLUMNS = (
    ("played", "{played}"),
    ("method", "{method}"),
    ("mean error", "{phase_mean:.3f}"),
    ("median", "{phase_median:.3f}"),
    ("within .1", "{phase_near:.1%}"),
    ("speed, octaves", "{speed_octaves:.2f}"),
    ("back", "{back:.1%}"),
    ("answered", "{answered:.1%}"),
)


class _Played(NamedTuple):
    """One motion as it is played: a body at every step, and its true phase and speed (2, steps)."""

    clip: Clip
    positions: NDArray[np.float64]
    true: Estimate


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.description = (
        "Plays the built-in library's motions, as recorded and at speeds that swing between half and twice, and "
        "follows each by the motions of the other actors. The true phase of a motion is the median of its time "
        "warpings onto other actors' motions of its class. Or follows labelled takes by the built-in library, and "
        "compares with the rounds that the person makes of a motion."
    )
    harness.add_sources(parser, "the built-in library's motions, alone")
    parser.add_argument("--every", type=count, default=1, help="play every nth motion alone (default %(default)s)")
    text = "draw the phase of three motions of different speed, and end"
    parser.add_argument("--picture", type=Path, metavar="FILE", help=text)
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Follow the motions or the takes, and print how right their progress was; return the exit status."""
    library, sources = MotionLibrary.builtin(), harness.sources_of(options)
    if options.picture:
        _draw(library, options.picture)
    elif sources:
        rounds = list(rounds_scored(harness.takes_at(sources, options, library), opened(library)))
        if not rounds:
            raise ValueError("takes: expected a whole round of a known class, got none (--map renames labels)")
        if options.json:
            harness.print_json(rounds)
        else:
            title = "Progress in the rounds of a motion, by the built-in library"
            harness.print_scores(rounds, ROUNDS, title=title, names=2)
    else:
        # First, because it opens the whole library, which `followed` then finds open.
        cost = _cost(library)
        scores, sizes = followed(library, every=options.every)
        error = float(np.median(sizes)) if sizes else math.nan
        if options.json:
            by = {(each["played"], each["method"]): each for each in scores}
            main = {name: by[played, method][figure] for name, played, method, figure in _MAIN}
            others = {"amplitude_error": error, "us_per_hop": cost, "scores": scores, "amplitudes": len(sizes)}
            harness.print_json(main | others)
        else:
            sizes_told = f"Amplitude: median error {error:.1%} of {len(sizes)} motions scaled by"
            caption = (
                f"{scores[0]['motions']} motions of {scores[0]['persons']} persons. {sizes_told} "
                f"{', '.join(map(str, SIZES))}. The filter takes {cost:.0f} µs a hop."
            )
            title = "Progress, the performer's motions left out"
            harness.print_scores(scores, _COLUMNS, title=title, caption=caption, names=2)
    return 0


def followed(library: MotionLibrary, *, every: int = 1) -> tuple[list[dict[str, object]], list[float]]:
    """Follow every motion by the other actors' motions.

    Returns
    -------
    The scores of each method in each way of playing, and the relative errors of known amplitudes.
    """
    truth, results = _true_phases(library), defaultdict[tuple[str, str], list[tuple[_Played, "Estimate"]]](list)
    sizes = list[float]()
    for actor in progress(library.actors, "Persons", len(library.actors)):
        index = opened(library.without(actors=[actor]))
        for clip in [each for each in library.motions if each.actor == actor][::every]:
            moments = index.phases.classes.get(clip.class_name)
            if moments is None or id(clip) not in truth:
                continue
            for way in (AS_RECORDED, WARPED):
                played = _played(clip, truth[id(clip)], moments.seconds, warped=way == WARPED)
                for method, estimate in _estimates(played, index).items():
                    results[way, method].append((played, estimate))
            sizes += _size_errors(clip, index)
    return [_scored(*key, each) for key, each in results.items()], sizes


def _true_phases(library: MotionLibrary) -> dict[int, NDArray[np.float64]]:
    """Give the phases of every motion's moments, by the motion's identity."""
    table = opened(library).phases
    return {
        id(clip): phases
        for name, moments in table.classes.items()
        for clip, phases in zip(table.courses[name][0], np.split(moments.phases, moments.starts[1:]), strict=True)
    }


def _played(clip: Clip, phases: NDArray[np.float64], mean_seconds: float, *, warped: bool) -> _Played:
    """Play a motion step by step, as recorded or at a swinging speed that begins anywhere in its curve."""
    times, speeds = list[float](), list[float]()
    now, begins = 0.0, (clip.frames * 0.618) % 1
    while now < clip.duration:
        speed = 2 ** math.sin(2 * math.pi * (len(times) * STEP / _PERIOD + begins)) if warped else 1.0
        times.append(now)
        speeds.append(speed)
        now += STEP * speed
    own = np.interp(np.array(times) * MOMENTS_PER_SECOND, np.arange(len(phases)), phases)
    true = np.array([own, np.array(speeds) * mean_seconds / clip.duration])
    return _Played(clip, _between(clip, np.array(times)), true)


def _between(clip: Clip, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the positions of a motion at some times, in a straight line between its frames."""
    places = times * clip.frame_rate
    below = np.minimum(places.astype(int), clip.frames - 2)
    part = (places - below)[:, None, None]
    positions: NDArray[np.float64] = clip.positions[below] * (1 - part) + clip.positions[below + 1] * part
    return positions


def _estimates(played: _Played, index: WindowIndex) -> dict[str, Estimate]:
    """Get phase and speed of every method at every step.

    The methods: a clock that runs from the true start, or from the recogniser's first right answer, for as long as the
    class's mean motion lasts; online time warping; the filter, given the class, or with the class that it named.
    """
    count, class_name = len(played.positions), played.clip.class_name
    moments, steps = index.phases.classes[class_name], np.arange(count, dtype=np.float64)
    feed = harness.Feed(steps * STEP, played.positions, index.library.skeleton)
    answers = [answer for _, answer in harness.pushed(Recognizer(index, Settings(progress=True)), feed)]
    right = [answer if answer and answer.class_name == class_name else None for answer in answers]
    started = next((step for step, answer in enumerate(right) if answer), count)
    points = _points(played.positions, index)
    clocks = [np.where(steps < since, np.nan, (steps - since) * STEP / moments.seconds) for since in (0, started)]
    return {
        CLOCK: np.array([np.minimum(clocks[0], 1), np.ones(count)]),
        "clock, first right answer": np.array([np.minimum(clocks[1], 1), np.ones(count)]),
        "online warping": np.array([_warped_online(points, moments, index.phases), np.full(count, np.nan)]),
        NAMED: _numbers([answer.progress if answer else None for answer in right]),
        KNOWN: _numbers(_follow(ProgressFollower(index.phases), points, class_name)),
    }


def _numbers(followed: Sequence[Progress | None]) -> Estimate:
    return np.array([(each.phase, each.speed) if each else (np.nan, np.nan) for each in followed]).T


def _points(positions: NDArray[np.float64], index: WindowIndex) -> NDArray[np.float64]:
    rows = distance_rows(positions, index.library.skeleton)
    placed: NDArray[np.float64] = rows @ index.basis.directions / index.body.size(rows)[:, None]
    return placed


def _follow(follower: ProgressFollower, points: NDArray[np.float64], class_name: str) -> list[Progress | None]:
    return [follower.push(place * STEP, point, class_name) for place, point in enumerate(points)]


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


def _size_errors(clip: Clip, index: WindowIndex) -> list[float]:
    """Scale a motion's deviations from its mean posture, and compare the amplitudes with the known factors."""
    if clip.duration < _SHORTEST:
        return []

    def amplitude(size: float) -> float:
        mean = clip.positions.mean(axis=0)
        scaled = replace(clip, positions=mean + size * (clip.positions - mean))
        points = _points(_played(scaled, np.zeros(2), clip.duration, warped=False).positions, index)
        followed = _follow(ProgressFollower(index.phases), points, clip.class_name)
        last = followed[min(len(followed) - 1, round(_READ_AFTER / STEP))]
        return last.amplitude if last else math.nan

    own = amplitude(1.0)
    return [abs(amplitude(size) / own / size - 1) for size in SIZES]


def _cost(library: MotionLibrary) -> float:
    """Measure the microseconds of a hop: of each of some motions the quickest time, and the median of these."""
    index = opened(library)

    def seconds(points: NDArray[np.float64], class_name: str) -> float:
        follower, begun = ProgressFollower(index.phases), perf_counter()
        _follow(follower, points, class_name)
        return (perf_counter() - begun) / len(points)

    costs = []
    for clip in library.motions[::_COSTED]:
        points = _points(clip.positions[:: round(clip.frame_rate * STEP)], index)
        costs.append(min(seconds(points, clip.class_name) for _ in range(_REPEATS)))
    return float(np.median(costs)) * 1e6


def _draw(library: MotionLibrary, path: Path) -> None:
    """Draw how the phase of one motion goes when it is played at three speeds, by the motions of the other actors."""
    # matplotlib is an extra.
    from kinespace.tools.evaluation.pictures import draw_phases, require_place_for_picture  # noqa: PLC0415

    require_place_for_picture(path)
    clip = next(each for each in library.motions if each.class_name == "squat1Reps" and each.actor == "mm")
    index, own, courses = opened(library.without(actors=[clip.actor])), _true_phases(library)[id(clip)], {}
    for speed in _PICTURED:
        times = np.arange(0, clip.duration, STEP * speed)
        estimate = _numbers(
            _follow(ProgressFollower(index.phases), _points(_between(clip, times), index), clip.class_name)
        )
        true = np.interp(times * MOMENTS_PER_SECOND, np.arange(len(own)), own)
        courses[speed] = (np.arange(len(times)) * STEP, estimate[0], true)
    draw_phases(path, clip.class_name, courses)


def _scored(way: str, method: str, results: Sequence[tuple[_Played, Estimate]]) -> dict[str, object]:
    """Compare one method's phases and speeds with the true ones, from `_UNSCORED` seconds on.

    Errors of the phase (mean and median) and of the speed (octaves, median; None for a method without speeds) are
    absolute; the rest are shares of the steps: with a phase within 0.1, with a lower phase than a step before, with a
    phase at all.
    """
    first = round(_UNSCORED / STEP)
    errors = np.concatenate([(estimate[0] - played.true[0])[first:] for played, estimate in results])
    rising = np.concatenate([np.diff(estimate[0])[first:] for _, estimate in results])
    octaves = np.concatenate([np.log2(estimate[1] / played.true[1])[first:] for played, estimate in results])
    answered = np.isfinite(errors)
    octaves = np.abs(octaves[np.isfinite(octaves) & answered])
    errors = np.abs(errors[answered])
    return {
        "played": way,
        "method": method,
        "phase_mean": float(errors.mean()),
        "phase_median": float(np.median(errors)),
        "phase_near": float((errors <= _NEAR).mean()),
        "speed_octaves": float(np.median(octaves)) if len(octaves) else None,
        "back": float((rising[np.isfinite(rising)] < -_FALLS).mean()),
        "answered": float(answered.mean()),
        "steps": len(errors),
        "motions": len(results),
        "persons": len({played.clip.actor for played, _ in results}),
    }
