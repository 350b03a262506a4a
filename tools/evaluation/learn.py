"""`kinespace learn`: teaches a library unknown motion, by takes of other people.

Fits the numbers that separate known motion from unknown, by takes in which nothing known happens and takes that contain
a known motion, and keeps them in the library's file. Figures come from persons who were left out of the fitting; the
saved numbers are fitted on all. Takes of bodies with fewer joints teach the numbers for such bodies.
"""

import argparse
import math
from collections import defaultdict
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.vq import kmeans2
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation
from scipy.special import expit

from kinespace.library import NOTHING, Clip, MotionLibrary, WindowIndex
from kinespace.library.naming import hdm05
from kinespace.library.signature.own_frame import AXES
from kinespace.library.windows.comparison import ACROSS_LABORATORIES
from kinespace.library.windows.courses import Pieces, path_of, turned, windows_of
from kinespace.library.windows.rejection import RATES, USUAL_OVER, Evidence, Rejection, typical_evidence
from kinespace.library.windows.taught import keeping_lessons
from kinespace.stream import Settings
from kinespace.stream.recognizer.decision import NOT_JUDGED, averaged
from kinespace.tools.cli import arguments
from kinespace.tools.cli.console import progress, require_place_for, scores_of, tell
from kinespace.tools.evaluation.evaluate_faults import noisy
from kinespace.tools.evaluation.harness import Feed, Sources, Take, answers_to, read_takes

#: Seconds between two windows that take part in learning.
_HOP = 0.1
#: Windows of a motion of the library before it counts as known: a beginning looks like many motions.
_BEGUN = 2
#: Seconds of a motion before another, as long as the longest window, and seconds between the two.
_BEFORE, _BETWEEN = 2.0, 0.25
#: Noises with which the library's own motions ask, metres on every coordinate, and how much each counts as known: the
#: noisier a known motion is, the more it looks like an unknown one, and strangers' takes have no noise.
_NOISES = {0.0: 1.0, 0.01: 2.0, 0.02: 4.0}
#: Sensitivity at which every class must be named.
_USUAL = 0.05
#: Share of a class's own motions that must then be named at some time.
_MIN_NAMED = 0.5
#: Seconds over which evidence is averaged: several hops in a row say the same of a motion.
_OVER = 0.1
#: A logit above all evidence.
_FAR = 20.0
#: The weight of the library's own motions as unknown, their class left out: other motions are more like everyday
#: movement.
_LEFT_OUT_COUNT = 0.5
#: The weight of strangers' motions as known: only they show how another laboratory's bodies differ.
_STRANGERS_COUNT = 2.0
#: Subjects are left out of the fitting in this many groups.
_FOLDS = 4
#: Steps of the windows that show everyday movement, the axes and the groups by which they are sorted, the windows that
#: found the groups, and the windows of a group, at least.
_EVERYDAY_COUNTS = (10, 13, 16, 20, 25, 31, 39, 49, 61, 76, 95, 119)
_EVERYDAY_AXES, _EVERYDAY_GROUPS, _EVERYDAY_WINDOWS, _EVERYDAY_LEAST = 64, 256, 20_000, 8
#: The cost of weights of either sign: they must pay on many windows.
_SHRINKING = 0.005

_COLUMNS = (
    "sensitivity {rate:g} | unknown time named {unknown_named:.1%} | starts a minute {starts_per_minute:.1f} | "
    "takes whose motion is named {takes_found:.0%}"
)

_SHAPE = 2 * len(ACROSS_LABORATORIES.groups)
#: The evidence and the guess of some windows.
Evidenced = list[tuple[Evidence, str]]


class WeighedWindows(NamedTuple):
    """Windows that are known, or are not, and their weight together."""

    windows: Evidenced
    is_known: bool
    weight: float


class _Own(NamedTuple):
    """A motion of the library, recognised by the other persons' motions, with and without its class."""

    class_name: str
    noise: float
    windows: Evidenced
    left_out: Evidenced
    #: Its windows when it follows another motion, which the long ones still hold.
    following: Evidenced

    def right(self) -> Evidenced:
        """Give the windows that are named rightly, after the motion's beginning."""
        return [each for each in (*self.windows[_BEGUN:], *self.following[_BEGUN:]) if each[1] == self.class_name]


class _TakeWindows(NamedTuple):
    """The windows of one take, every `_HOP` seconds."""

    take: Take
    windows: Evidenced

    @property
    def is_unknown(self) -> bool:
        return not self.take.labels

    def known(self) -> Evidenced:
        """Give the windows whose guess is a class that the take contains."""
        return [window for window in self.windows if window[1] in self.take.contains]


class _BodyWindows(NamedTuple):
    """Windows by the joints of one body: of a library's own motions, and of takes with all its joints and with fewer.

    Evidence is relative to what is typical of the library by these joints.
    """

    opened: WindowIndex
    own: list[_Own]
    whole: list[_TakeWindows]
    fewer: list[_TakeWindows]


#: Takes, each with the numbers that judge it.
_Judged = Sequence[tuple[_TakeWindows, Rejection]]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.add_argument("library", type=Path, metavar="LIBRARY", help="a library file")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FILE", help="the library to write")
    text = "also write typical windows of the takes in which nothing known happens, over HDM05's joints"
    parser.add_argument("--everyday", type=Path, metavar="FILE.npz", help=text)
    arguments.add_reading(parser)
    arguments.add_shared(parser, "--takes", "--subjects", "--overwrite", "--json")


def run(options: argparse.Namespace) -> None:
    """Learn, save the library with the learned numbers, and print their figures."""
    require_place_for(options.output, overwrite=options.overwrite)
    library = arguments.library_at(options.library)
    sources = Sources(tables=options.tables, persons=options.subjects)
    takes = read_takes(sources, arguments.reading_of(options))
    if all(take.labels for take in takes):
        raise ValueError("takes: expected some in which nothing known happens, got none")
    if options.everyday:
        np.savez_compressed(options.everyday, windows=everyday_of([take.clip for take in takes if not take.labels]))
    _require_others(library)
    whole = [take for take in takes if set(library.skeleton.joints) <= set(take.clip.skeleton.joints)]
    seen = _seen_by(library, whole, follow=True)
    clean = [each for each in seen.own if not each.noise]
    rejection, judged = _learned(library.classes, [seen], clean, _OVER)
    typical, joints = seen.opened.rejection.typical, len(library.skeleton.joints)
    learned = dict(replace(rejection, typical=typical, joints=joints).kept())
    if fewer := [take for take in takes if take not in whole]:
        learned |= learned_of_few(library, whole, fewer).kept(few=True)
    keeping_lessons(replace(library, learned=learned)).save(options.output)
    thresholds = rejection.thresholds.tolist()
    rows = [{"rate": rate} | _figures(judged, each) for rate, each in zip(RATES, thresholds, strict=True)]
    unknown = [each.take.clip.duration for each in seen.whole if each.is_unknown]
    containing = sum(bool(each.take.contains) for each in seen.whole)
    title = (
        f"{len(unknown)} unknown takes ({sum(unknown) / 60:.1f} minutes), {containing} with a known motion; "
        f"{len({each.take.person for each in seen.whole})} subjects, each judged by numbers fitted on others"
    )
    tell(options, rows, scores_of(rows, _COLUMNS, title=title, names=0))


def _require_others(library: MotionLibrary) -> None:
    """Require two motions of each class where one person made them all: each is asked about by the others."""
    names = [each.class_name for each in library.motions if each.class_name != NOTHING]
    alone = sorted(name for name in set(names) if names.count(name) < 2)
    if len(library.actors) < 2 and alone:
        few = f"got one of {', '.join(alone)}; single examples need no learning"
        raise ValueError(f"library: expected two motions or more of each class of a single person, {few}")


def everyday_of(clips: Sequence[Clip]) -> NDArray[np.float16]:
    """Find typical windows of everyday movement, by which courses are judged (`library.windows.courses.everyday`).

    Windows of several lengths are sorted into groups by their courses (k-means in the axes in which they vary most). A
    group of windows of several persons gives the mean of its windows; no window of anybody is kept.

    Parameters
    ----------
    clips
        Takes with all of HDM05's joints; others are left out.

    Returns
    -------
    Shape (groups, POINTS, 3 joints + `AXES`), metres.

    Raises
    ------
    ValueError
        No take has all joints, or no group has windows of two persons.
    """
    whole = [each.over(hdm05.SKELETON) for each in clips if set(hdm05.SKELETON.joints) <= set(each.skeleton.joints)]
    read = [windows_of(path_of(clip), _EVERYDAY_COUNTS) for clip in whole]
    persons = np.repeat([clip.actor for clip in whole], [len(each) for each in read])
    if len(set(persons.tolist())) < 2:
        raise ValueError("--everyday: expected takes of several persons with HDM05's joints, got none")
    windows = np.concatenate(read)
    pieces, draw = Pieces.of(windows), np.random.default_rng(0)
    some = draw.permutation(len(windows))[:_EVERYDAY_WINDOWS]
    mean = pieces.courses.mean(axis=0)
    axes = np.linalg.svd(pieces.courses[some[: len(mean) * 4]] - mean, full_matrices=False)[2][:_EVERYDAY_AXES].T
    points = (pieces.courses - mean) @ axes
    centres, _ = kmeans2(points[some], _EVERYDAY_GROUPS, iter=20, minit="points", rng=draw, missing="warn")
    group = (np.square(centres).sum(axis=1) - 2 * points @ centres.T).argmin(axis=1)
    seen = turned(windows).reshape(*windows.shape[:2], AXES)
    windows = windows[..., :-AXES]
    # Windows count alike, however far they go.
    alike = (windows - windows.mean(axis=1, keepdims=True)) / np.maximum(pieces.lengths, 1e-6)[:, None, None]
    groups = [group == each for each in range(_EVERYDAY_GROUPS)]
    means = [
        np.hstack([alike[own].mean(axis=0) * np.median(pieces.lengths[own]), seen[own].mean(axis=0)])
        for own in groups
        if np.count_nonzero(own) >= _EVERYDAY_LEAST and len(set(persons[own].tolist())) > 1
    ]
    if not means:
        raise ValueError("--everyday: expected a group of windows of two persons, got none")
    return np.array(means, dtype=np.float16)


def _seen_by(
    library: MotionLibrary, whole: Sequence[Take], fewer: Sequence[Take] = (), *, follow: bool
) -> _BodyWindows:
    """Let a library recognise its own motions, perhaps behind others, too, and takes that have all of its joints."""
    opened = WindowIndex.of(library, weighing=ACROSS_LABORATORIES)
    index = _asked(opened, typical_evidence(opened))
    shown = progress([*whole, *fewer], "Strangers", len(whole) + len(fewer))
    courses = [_TakeWindows(take, _windows(index, take.clip.over(library.skeleton))) for take in shown]
    return _BodyWindows(index, _own_courses(index, follow=follow), courses[: len(whole)], courses[len(whole) :])


def _learned(
    classes: Sequence[str], bodies: Sequence[_BodyWindows], clean: Sequence[_Own], over: float
) -> tuple[Rejection, _Judged]:
    """Learn numbers for some bodies: no more unknown time of any of them is named than a threshold says.

    Parameters
    ----------
    classes
        The classes that may be guessed.
    bodies
        The windows by the joints of each body.
    clean
        Motions by which biases are raised, so that every class is named at the usual sensitivity, also a class that
        resembles strangers' everyday movement.
    over
        Seconds over which evidence is averaged.

    Returns
    -------
    The numbers, relative to what is typical; and the takes, each with numbers fitted on other persons'.
    """
    lessons = [lesson for seen in bodies for lesson in _own_lessons(seen.own)]
    takes = [each for seen in bodies for each in (seen.whole, seen.fewer)]

    def fit(persons: Collection[str] = ()) -> Rejection:
        strangers = [lesson for courses in takes for lesson in _lessons(courses, persons)]
        return fitted([*lessons, *strangers], classes, over)

    apart = _fitted_apart([each for courses in takes for each in courses], fit)
    usual = _threshold(clean, apart, _USUAL)
    raised = {id(each): _raised(each, clean, usual) for _, each in apart}
    judged = [(course, raised[id(each)]) for course, each in apart]
    of_bodies = [[each for each in judged if each[0] in (*seen.whole, *seen.fewer)] for seen in bodies]
    thresholds = [max(_threshold([], each, rate) for each in of_bodies) for rate in RATES]
    return replace(_raised(fit(), clean, usual), thresholds=np.array(thresholds)), judged


def learned_of_few(library: MotionLibrary, takes: Sequence[Take], fewer: Sequence[Take]) -> Rejection:
    """Learn the numbers for bodies of few joints.

    Parameters
    ----------
    library
        The library.
    takes, fewer
        Takes with all joints of the library, and takes of bodies with fewer.
    """
    by_joints = defaultdict[tuple[str, ...], list[Take]](list)
    for take in fewer:
        by_joints[tuple(name for name in library.skeleton.joints if name in take.clip.skeleton.joints)].append(take)
    bodies = [_seen_by(library.restricted_to(joints), takes, own, follow=False) for joints, own in by_joints.items()]
    rejection, _ = _learned(library.classes, bodies, [], USUAL_OVER)
    return replace(rejection, joints=max(map(len, by_joints)))


def _asked(index: WindowIndex, typical: NDArray[np.float64]) -> WindowIndex:
    """Let an index name all that is asked, and give evidence relative to what is typical, (2 groups,)."""
    index.rejection = Rejection(np.zeros(_SHAPE + 1), 0.0, {}, {}, np.zeros(len(RATES)), typical)
    return index


def _own_courses(whole: WindowIndex, *, follow: bool) -> list[_Own]:
    """Let each person's motions be recognised by the others', with noise and without, perhaps behind another, too.

    The motions of a single person are recognised by this person's other motions. Behind another motion they teach
    bodies of few joints to name the unknown (tests/TRIED.md).
    """
    found, library, typical = list[_Own](), whole.library, whole.rejection.typical
    groups = [[place for place, each in enumerate(library.motions) if each.actor == actor] for actor in library.actors]
    if len(groups) < 2:
        groups = [[place] for group in groups for place in group]
    for group in progress(groups, "Motions", len(groups)):
        own = [(place, library.motions[place]) for place in group]
        others = library.without(motions=[each for _, each in own])
        index = _asked(WindowIndex.of(others, weighing=ACROSS_LABORATORIES), typical)
        for name in {each.class_name for _, each in own} - {NOTHING}:
            apart = [place for place, each in enumerate(index.library.motions) if each.class_name != name]
            left = _asked(index.of_some(apart), typical) if apart else None
            asking = [place for place, each in own if each.class_name == name]
            same = [each for each in library.motions if each.actor == own[0][1].actor and each.class_name != name]
            for place, noise in product(asking, _NOISES):
                clip = library.motions[place]
                windows, following = _windows(index, clip, noise, place), Evidenced()
                left_out = _windows(left, clip, noise, place) if left else []
                if before := [each for each in same if follow and each.frame_rate == clip.frame_rate]:
                    behind = joined(before[place % len(before)], clip)
                    following = _windows(index, behind, noise, place, behind.duration - clip.duration)
                found.append(_Own(name, noise, windows, left_out, following))
    return found


def joined(before: Clip, clip: Clip) -> Clip:
    """Let a motion follow another one, of the same joints and frame rate.

    The body is turned and moved to where the other motion ends, and goes there on straight lines. Recognition sees
    distances alone, so the turn may be about any axis.
    """
    rate, first, end = clip.frame_rate, clip.positions[0], before.positions[-round(_BEFORE * clip.frame_rate) :]
    there, here = end[-1].mean(axis=0), first.mean(axis=0)
    turn, _ = Rotation.align_vectors(end[-1] - there, first - here)
    moved = turn.apply((clip.positions - here).reshape(-1, 3)).reshape(clip.positions.shape) + there
    shares = np.linspace(0.0, 1.0, round(_BETWEEN * rate) + 1, endpoint=False)[1:, None, None]
    between = end[-1] + shares * (moved[0] - end[-1])
    return Clip(clip.skeleton, np.concatenate([end, between, moved]), rate)


def _windows(
    index: WindowIndex, clip: Clip, noise: float = 0.0, seed: int | None = None, begun: float = 0.0
) -> Evidenced:
    """Push a clip through the recogniser, as a noisy sensor sees it if asked; give its windows from a time on."""
    feed = Feed.of(clip, index.library.skeleton)
    feed = feed if seed is None else noisy(noise)(feed, np.random.default_rng(seed))
    answers, typical = answers_to(feed, index, Settings(hop=_HOP)), index.rejection.typical
    seen = [(each.evidence, each.classes[each.best]) for each in answers if each.evidence and each.time >= begun]
    return [(_relative(evidence, typical), guess) for evidence, guess in seen]


def _relative(evidence: Evidence, typical: NDArray[np.float64]) -> Evidence:
    """Give distances and leads relative to typical ones, (2 groups,)."""
    distances, leads = np.split(np.array(evidence.compared) - typical, 2)
    return Evidence(tuple(distances.tolist()), tuple(leads.tolist()), evidence.noise)


def _fitted_apart(courses: Sequence[_TakeWindows], fit: Callable[[Collection[str]], Rejection]) -> _Judged:
    """Pair each take with a rejection that is fitted without the takes of some persons, its own among them."""
    people = sorted({each.take.person for each in courses})
    if len(people) < 2:
        raise ValueError(f"takes: expected two subjects or more, got {len(people)}")
    folds = [people[place::_FOLDS] for place in range(min(_FOLDS, len(people)))]
    fits = [(fold, fit(fold)) for fold in folds]
    return [(each, fitted) for fold, fitted in fits for each in courses if each.take.person in fold]


def _own_lessons(own: Sequence[_Own]) -> list[WeighedWindows]:
    """Take the library's own motions as known and, their class left out, as unknown; each class counts alike."""
    lessons = list[WeighedWindows]()
    for noise, name in product(_NOISES, sorted({each.class_name for each in own})):
        motions = [each for each in own if (each.noise, each.class_name) == (noise, name)]
        right = [window for each in motions for window in each.right()]
        lessons.append(WeighedWindows(right, is_known=True, weight=_NOISES[noise]))
        left_out = [window for each in motions for window in each.left_out]
        lessons.append(WeighedWindows(left_out, is_known=False, weight=_LEFT_OUT_COUNT))
    classes = len(lessons) / (2 * len(_NOISES))
    return [lesson._replace(weight=lesson.weight / classes) for lesson in lessons]


def _lessons(courses: Sequence[_TakeWindows], without: Collection[str]) -> list[WeighedWindows]:
    """Take strangers' takes as unknown and as known, without some persons' takes; each class performed counts alike."""
    courses = [each for each in courses if each.take.person not in without]
    unknown = [window for each in courses if each.is_unknown for window in each.windows]
    known = defaultdict[str, Evidenced](list)
    for window in (window for each in courses for window in each.known()):
        known[window[1]].append(window)
    weight = _STRANGERS_COUNT / max(len(known), 1)
    lessons = [WeighedWindows(windows, is_known=True, weight=weight) for windows in known.values()]
    return [*lessons, WeighedWindows(unknown, is_known=False, weight=1.0)]


def _raised(rejection: Rejection, own: Sequence[_Own], threshold: float) -> Rejection:
    """Raise the biases of classes until enough of each class's own motions are named at some time."""
    biases = dict(rejection.biases)
    for name in biases:
        highest = [_highest(rejection, name, each.windows) for each in own if each.class_name == name]
        if highest:
            biases[name] += max(threshold - float(np.quantile(highest, 1 - _MIN_NAMED)), 0.0)
    return replace(rejection, biases=biases)


def _highest(rejection: Rejection, name: str, windows: Evidenced) -> float:
    """Give the highest averaged evidence of a motion while its class is the guess."""
    before, highest = NOT_JUDGED, -_FAR
    for window in windows:
        before = averaged(before, rejection.logit(*window), math.inf, _HOP, rejection)
        if window[1] == name:
            highest = max(highest, before[0])
    return highest


def fitted(lessons: Sequence[WeighedWindows], class_names: Sequence[str], over: float) -> Rejection:
    """Fit a logistic function that separates known windows from unknown ones; thresholds are not set yet.

    Parameters
    ----------
    lessons
        Windows of both kinds; within each they count alike.
    class_names
        The classes that may be guessed.
    over
        Seconds over which evidence is averaged.
    """
    taught = [lesson for lesson in lessons if lesson.windows]
    rows = np.vstack([_numbers(lesson.windows, class_names) for lesson in taught])
    lengths = [len(lesson.windows) for lesson in taught]
    signs = np.repeat([1.0 if lesson.is_known else -1.0 for lesson in taught], lengths)
    counts = np.repeat([lesson.weight / len(lesson.windows) for lesson in taught], lengths)
    counts /= counts.sum()
    middle, scale = rows.mean(axis=0), rows.std(axis=0) + 1e-6
    scaled = np.column_stack([(rows - middle) / scale, np.ones(len(rows))])

    def loss(slope: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        margins = signs * (scaled @ slope)
        inner = np.append(slope[:-1], 0.0)
        gradient = -(counts * signs * expit(-margins)) @ scaled
        return float(counts @ np.logaddexp(0, -margins) + _SHRINKING * inner @ inner), gradient + 2 * _SHRINKING * inner

    slope = minimize(loss, np.zeros(scaled.shape[1]), jac=True, method="L-BFGS-B").x
    plain = slope[:-1] / scale
    offset = float(slope[-1] - plain @ middle)
    weights, biases, slopes = np.split(plain, [-2 * len(class_names), -len(class_names)])
    by_class = [dict(zip(class_names, each.tolist(), strict=True)) for each in (biases, slopes)]
    relative = np.zeros(len(weights) - 1)
    return Rejection(weights, offset, by_class[0], by_class[1], np.zeros(len(RATES)), relative, over=over)


def _numbers(windows: Evidenced, class_names: Sequence[str]) -> NDArray[np.float64]:
    """Give the inputs of `Rejection`'s weights, with a bias and a lead for every class: (windows, numbers)."""
    compared = np.array([evidence.compared for evidence, _ in windows])
    leads = [evidence.lead for evidence, _ in windows]
    noise = [evidence.noisiness for evidence, _ in windows]
    guesses = np.array([[float(guess == name) for name in class_names] for _, guess in windows])
    return np.column_stack([compared, noise, guesses, guesses * np.array(leads)[:, None]])


def _threshold(own: Sequence[_Own], judged: _Judged, rate: float) -> float:
    """Find the threshold at which this share of unknown time is named, by halving.

    With own motions the biases are raised for every threshold that is tried.
    """
    low, high = -_FAR, _FAR
    for _ in range(16):
        middle = (low + high) / 2
        raised = {id(fit): _raised(fit, own, middle) if own else fit for _, fit in judged}
        tried = [(course, raised[id(fit)]) for course, fit in judged]
        low, high = (middle, high) if _figures(tried, middle)["unknown_named"] > rate else (low, middle)
    return high


def _figures(judged: _Judged, threshold: float) -> dict[str, float]:
    """Count the results of a threshold on the takes: shares of unknown time and of takes, and starts a minute."""
    named = seconds = starts = found = containing = 0.0
    for course, rejection in judged:
        before, known = NOT_JUDGED, list[bool]()
        for window in course.windows:
            before = averaged(before, rejection.logit(*window), threshold, _HOP, rejection)
            known.append(before[1])
        if course.is_unknown:
            named += _HOP * sum(known)
            seconds += course.take.clip.duration
            starts += sum(now and not last for last, now in zip([False, *known], known, strict=False))
        elif course.take.contains:
            containing += 1
            right = (guess in course.take.contains for _, guess in course.windows)
            found += any(each and now for each, now in zip(right, known, strict=True))
    return {
        "threshold": round(threshold, 3),
        "unknown_named": named / seconds if seconds else 0.0,
        "starts_per_minute": 60 * starts / seconds if seconds else 0.0,
        "takes_found": found / containing if containing else 0.0,
    }
