"""`kinespace evaluate progress`: errors of phase and speed, with the performer's motions left out.

Plays the built-in library's motions, as recorded and at speeds that swing between half and twice, and follows each by
the motions of the other actors. The true phase of a motion is the median of its time warpings onto other actors'
motions of its class.
"""

import argparse
import math
from collections import defaultdict
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from kinespace.library import Clip, MotionLibrary, WindowIndex, opened
from kinespace.library.phases import KEYFRAMES_PER_SECOND
from kinespace.library.signature.own_frame import at_steps
from kinespace.stream import Recognizer, Settings
from kinespace.stream.recognizer.progress import STEP
from kinespace.tools.cli.arguments import add_shared, count
from kinespace.tools.cli.console import progress, scores_of, tell
from kinespace.tools.evaluation.harness import Feed, pushed

#: At each step of a played motion the phase and the speed, NaN where there was no answer; shape (2, steps).
Estimate = NDArray[np.float64]

#: The ways in which motions are played, and how they are followed.
AS_RECORDED, WARPED = "as recorded", "warped"
NAMED = "filter, named class"
#: Seconds from a motion's start that are not scored: no method can know the phase yet.
_UNSCORED = 0.3
#: The speed curve: 2 to the power of a sine of this period, seconds, so from half to twice the speed.
_PERIOD = 3.0
#: A phase with a smaller error is right.
_NEAR = 0.1
#: A phase that falls by more goes back.
_FALLS = 0.02
#: The main figures: the name of each, how the motion is played, and the figure of the named class.
_MAIN = (
    ("phase_error", AS_RECORDED, "phase_mean"),
    ("within_tenth", AS_RECORDED, "phase_near"),
    ("warped_error", WARPED, "phase_mean"),
    ("warped_within_tenth", WARPED, "phase_near"),
    ("speed_octaves", WARPED, "speed_octaves"),
    ("back_steps", AS_RECORDED, "back"),
)
_COLUMNS = (
    "played {played} | method {method} | mean error {phase_mean:.3f} | median {phase_median:.3f} | "
    "within .1 {phase_near:.1%} | speed, octaves {speed_octaves:.2f} | back {back:.1%} | answered {answered:.1%}"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.add_argument("--every", type=count, default=1, help="play every nth motion (default %(default)s)")
    add_shared(parser, "--json")


def run(options: argparse.Namespace) -> None:
    """Follow the motions, and print how right their progress was."""
    scores = followed(MotionLibrary.builtin(), every=options.every)
    named = {each["played"]: each for each in scores}
    found = {name: named[played][figure] for name, played, figure in _MAIN} | {"scores": scores}
    caption = f"{scores[0]['motions']} motions of {scores[0]['persons']} persons"
    title = "Progress, the performer's motions left out"
    tell(options, found, scores_of(scores, _COLUMNS, title=title, caption=caption, names=2))


def followed(library: MotionLibrary, *, every: int = 1) -> list[dict[str, object]]:
    """Follow every motion by the other actors' motions; give the scores of each way of playing."""
    classes = opened(library).phases.classes.values()
    # The phases of every motion's keyframes, by the motion's identity.
    truth = {id(clip): phases for each in classes for clip, phases in zip(each.clips, each.phases, strict=True)}
    results = defaultdict[str, list[tuple[Clip, Estimate, Estimate]]](list)
    for actor in progress(library.actors, "Persons", len(library.actors)):
        index = opened(library.without(actors=[actor]))
        for clip in [each for each in library.motions if each.actor == actor][::every]:
            keyframes = index.phases.classes.get(clip.class_name)
            if keyframes is None or id(clip) not in truth:
                continue
            for way in (AS_RECORDED, WARPED):
                positions, true = _played(clip, truth[id(clip)], keyframes.seconds, warped=way == WARPED)
                results[way].append((clip, true, _estimate(clip.class_name, positions, index)))
    return [_scored(way, each) for way, each in results.items()]


def _played(
    clip: Clip, phases: NDArray[np.float64], mean_seconds: float, *, warped: bool
) -> tuple[NDArray[np.float64], Estimate]:
    """Play a motion step by step, as recorded or at a swinging speed that begins anywhere in its curve.

    Returns
    -------
    The body at every step, (steps, joints, 3), and its true phase and speed, (2, steps).
    """
    times, speeds = list[float](), list[float]()
    now, begins = 0.0, (clip.frames * 0.618) % 1
    while now < clip.duration:
        speed = 2 ** math.sin(2 * math.pi * (len(times) * STEP / _PERIOD + begins)) if warped else 1.0
        times.append(now)
        speeds.append(speed)
        now += STEP * speed
    own = np.interp(np.array(times) * KEYFRAMES_PER_SECOND, np.arange(len(phases)), phases)
    true = np.array([own, np.array(speeds) * mean_seconds / clip.duration])
    return at_steps(clip.times, clip.positions, np.array(times)), true


def _estimate(performed: str, positions: NDArray[np.float64], index: WindowIndex) -> Estimate:
    """Get phase and speed at every step at which the class performed was named."""
    feed = Feed(np.arange(len(positions), dtype=np.float64) * STEP, positions, index.library.skeleton)
    answers = [answer for _, answer in pushed(Recognizer(index, Settings(progress=True)), feed)]
    named = [each and each.class_name == performed and each.progress for each in answers]
    return np.array([(each.phase, each.speed) if each else (np.nan, np.nan) for each in named]).T


def _scored(way: str, results: Sequence[tuple[Clip, Estimate, Estimate]]) -> dict[str, object]:
    """Compare the filter's phases and speeds with the true ones, which come first, from `_UNSCORED` seconds on.

    Errors of the phase (mean and median) and of the speed (octaves, median) are absolute; the rest are shares of the
    steps: with a phase within 0.1, with a lower phase than a step before, with a phase at all.
    """
    first = round(_UNSCORED / STEP)
    errors = np.concatenate([(estimate[0] - true[0])[first:] for _, true, estimate in results])
    rising = np.concatenate([np.diff(estimate[0])[first:] for _, _, estimate in results])
    octaves = np.concatenate([np.log2(estimate[1] / true[1])[first:] for _, true, estimate in results])
    answered = np.isfinite(errors)
    errors = np.abs(errors[answered])
    return {
        "played": way,
        "method": NAMED,
        "phase_mean": float(errors.mean()),
        "phase_median": float(np.median(errors)),
        "phase_near": float((errors <= _NEAR).mean()),
        "speed_octaves": float(np.median(np.abs(octaves[answered]))),
        "back": float((rising[np.isfinite(rising)] < -_FALLS).mean()),
        "answered": float(answered.mean()),
        "steps": len(errors),
        "motions": len(results),
        "persons": len({clip.actor for clip, *_ in results}),
    }
