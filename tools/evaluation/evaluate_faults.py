"""`kinespace evaluate faults`: takes whose joints go wrong, through the recogniser that runs live.

Plays takes into the live recogniser with joints frozen, lost, exchanged or out of order, and bodies that jump between
two postures; counts answers with the last second inside the segment, and seconds of alarm.
"""

import argparse
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinespace.library import MotionLibrary, distance_rows
from kinespace.library.windows.segments import mirrored_places
from kinespace.stream import Recognizer, Settings
from kinespace.tools.cli.arguments import settings_of, several
from kinespace.tools.cli.console import progress, scores_of, tell
from kinespace.tools.evaluation.harness import INSIDE, Feed, Take, add_asked, asked_of, pushed
from kinespace.tools.evaluation.scores import basis_of, counted_in, rests_on

#: What becomes of a feed's frames.
Fault = Callable[[Feed, np.random.Generator], Feed]

#: The joints of the left arm, in HDM05's names; a skeleton has some of them.
LEFT_ARM = ("lhumerus", "lradius", "lwrist", "lhand", "lthumb", "lfingers")
#: The standard deviation of each coordinate, metres.
NOISE = 0.02
#: The share of frames that is dropped.
DROPPED = 0.5
#: Metres by which a body is elsewhere, the standard deviation of each coordinate.
_FAR = 3.0
#: Every twelfth frame is searched for the posture farthest from the first.
_EVERY = 12


def _posed(change: Callable[[NDArray[Any], Feed], object]) -> Fault:
    """Make a fault of a function that changes the positions, (frames, joints, 3), of a feed in their place."""

    def fault(feed: Feed, _: np.random.Generator) -> Feed:
        positions = feed.positions.copy()
        change(positions, feed)
        return feed._replace(positions=positions)

    return fault


def _freeze(positions: NDArray[np.float64], feed: Feed) -> None:
    places = [place for place, name in enumerate(feed.skeleton.joints) if name in LEFT_ARM]
    positions[:, places] = positions[0, places]


def _exchange_wrists(positions: NDArray[np.float64], feed: Feed) -> None:
    joints = feed.skeleton.joints
    # A body without wrists has hands.
    name = "wrist" if "lwrist" in joints else "hand"
    left, right = joints.index(f"l{name}"), joints.index(f"r{name}")
    positions[:, [left, right]] = positions[:, [right, left]]


def _exchange_sides(positions: NDArray[np.float64], feed: Feed, since: float = -1.0) -> None:
    """Exchange left and right after some of each three seconds."""
    order = mirrored_places(feed.skeleton.joints)
    if order is None:
        raise ValueError("--fault: expected joints whose names say left or right")
    where = feed.times % 3.0 > since
    positions[where] = positions[where][:, order]


def _change_unit(positions: NDArray[np.float64], feed: Feed) -> None:
    positions[feed.times > feed.times[len(feed.times) // 2]] *= 1000.0


def _lose(positions: NDArray[np.float64], feed: Feed) -> None:
    joints = feed.skeleton.joints
    positions[:, joints.index("head")] = np.nan
    positions[feed.times % 1.0 < 0.15, joints.index("rhand")] = np.nan


def _zero(positions: NDArray[np.float64], feed: Feed) -> None:
    positions[feed.times % 4.0 > 2.0, feed.skeleton.joints.index("lhand")] = 0.0


def _jumping(period: float) -> Fault:
    def jump(positions: NDArray[np.float64], feed: Feed) -> None:
        rows = distance_rows(feed.positions[::_EVERY], feed.skeleton)
        farthest = int(np.abs(rows - rows[0]).sum(axis=1).argmax()) * _EVERY
        positions[:] = feed.positions[np.where((feed.times / period).astype(np.intp) % 2, farthest, 0)]

    return _posed(jump)


def _elsewhere(period: float) -> Fault:
    def fault(feed: Feed, generator: np.random.Generator) -> Feed:
        moved = (feed.times / period).astype(np.intp)
        places = _FAR * generator.standard_normal((moved.max() + 1, 1, 3))
        return feed._replace(positions=feed.positions + places[moved])

    return fault


def _order(feed: Feed, generator: np.random.Generator) -> Feed:
    return feed._replace(positions=feed.positions[:, generator.permutation(len(feed.skeleton.joints))])


def noisy(metres: float) -> Fault:
    """Make the fault of a sensor of 30 frames per second with white noise, metres, on every coordinate."""

    def fault(feed: Feed, generator: np.random.Generator) -> Feed:
        step = max(1, round(1 / 30 / float(np.median(np.diff(feed.times)))))
        positions = feed.positions[::step]
        return Feed(feed.times[::step], positions + metres * generator.standard_normal(positions.shape), feed.skeleton)

    return fault


def _drops(feed: Feed, generator: np.random.Generator) -> Feed:
    kept = generator.random(len(feed.times)) >= DROPPED
    return Feed(feed.times[kept], feed.positions[kept], feed.skeleton)


#: Faults by name; for the last four no joint is to blame.
FAULTS: dict[str, Fault] = {
    "left arm frozen": _posed(_freeze),
    "wrists exchanged": _posed(_exchange_wrists),
    "sides exchanged": _posed(_exchange_sides),
    "sides exchanged now and then": _posed(partial(_exchange_sides, since=1.5)),
    "elsewhere, 1/60 s": _elsewhere(1 / 60),
    "elsewhere, 1 s": _elsewhere(1.0),
    "two postures, 1/30 s": _jumping(1 / 30),
    "two postures, 1/4 s": _jumping(0.25),
    "two postures, 1 s": _jumping(1.0),
    "unit changed": _posed(_change_unit),
    "head and hand lost": _posed(_lose),
    "hand at 0, 0, 0": _posed(_zero),
    "joints in another order": _order,
    "none": lambda feed, _: feed,
    "noise of 20 mm, 30 Hz": noisy(NOISE),
    "half the frames dropped": _drops,
}


#: Of each share what is counted, and among what: answers to motions that the library knows, and to others.
_SHARES = dict.fromkeys(("right", "guessed", "wrong", "implausible"), "answers") | {"unknown_named": "unknown"}
#: Frames per second.
_RATE = 60.0
#: Seed of noise, drops and order.
_SEED = 0
_COLUMNS = (
    "fault {fault} | right {right:.1%} | guessed {guessed:.1%} | wrong {wrong:.1%} | implausible {implausible:.1%} | "
    "unknown named {unknown_named:.1%} | noticed, s {noticed_s:.2f} | alarmed {alarmed} of {seconds:.0f} s"
)


class _FaultyTake(NamedTuple):
    """One take with one fault: its answers counted, and when the fault was noticed, seconds; None when it was not."""

    take: Take
    counts: Counter[str]
    noticed: float | None
    alarmed: int
    seconds: float


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    add_asked(parser)
    text = f"the faults (default: all): {'; '.join(FAULTS)}"
    parser.add_argument("--fault", **several(str, "FAULT"), choices=[*FAULTS], help=text)


def run(options: argparse.Namespace) -> None:
    """Play every take with every fault, and print what was answered."""
    settings, (asked, _) = settings_of(options), asked_of(options)
    played: dict[str, list[_FaultyTake]] = {fault: [] for fault in options.fault or FAULTS}
    for each in progress(asked, "Playing", len(asked)):
        sound = Feed.of(each.take.clip, each.library.skeleton, each.take.delivered)
        step = max(1, round(each.take.clip.frame_rate / _RATE))
        sound = sound._replace(times=sound.times[::step], positions=sound.positions[::step])
        for fault, of_fault in played.items():
            feed = FAULTS[fault](sound, np.random.default_rng(_SEED))
            of_fault.append(_played(each.take, feed, each.library, settings))
    scores = [_scored(fault, each) for fault, each in played.items()]
    caption = f"{rests_on(scores[0], 'segment')}; last second inside the segment"
    table = scores_of(scores, _COLUMNS, title="Takes whose joints go wrong", caption=caption)
    tell(options, {"faults": scores}, table)


def _played(take: Take, feed: Feed, library: MotionLibrary, settings: Settings) -> _FaultyTake:
    """Play a take with a fault; an alarm is a new note on joints, or an answer without joints."""
    recognizer, answers, alarms, note = Recognizer(library, settings), [], [], ""
    for time, answer in pushed(recognizer, feed):
        if recognizer.doubt != note or (answer and answer.is_doubted):
            note = recognizer.doubt
            alarms.append(time)
        if answer:
            answers.append(answer)
    begun, ended = feed.times[[0, -1]].tolist()
    noticed = alarms[0] - begun if alarms else None
    counts = counted_in(take, library.classes, answers, INSIDE)
    return _FaultyTake(take, counts, noticed, len({*map(int, alarms)}), ended - begun)


def _scored(fault: str, played: Sequence[_FaultyTake]) -> dict[str, object]:
    """Give the shares of one fault; the seconds until it was noticed in the slowest take, and the seconds of alarm."""
    counts = sum((each.counts for each in played), Counter[str]())
    noticed = [each.noticed for each in played if each.noticed is not None]
    basis = basis_of([each.seconds for each in played], [each.take.person for each in played])
    basis["segments"] = sum(len(each.take.segments) for each in played)
    return {
        "fault": fault,
        "answers": counts["answers"],
        **{name: counts[name] / counts[whole] if counts[whole] else None for name, whole in _SHARES.items()},
        "noticed_s": max(noticed) if len(noticed) == len(played) else None,
        "alarmed": sum(each.alarmed for each in played),
        **basis,
    }
