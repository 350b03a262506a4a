"""`kinespace evaluate done`: motions found that were really done, counted, and the false alarms an hour.

Takes are replayed through the recogniser that runs live, and the motions said to be done are compared with the labels.
Every motion that was said once is also played to its half only, and must not be done then.
"""

import argparse
from dataclasses import replace
from typing import Any

import numpy as np

from kinespace.library import WindowIndex, opened
from kinespace.stream import Settings
from kinespace.tools.cli.arguments import settings_of
from kinespace.tools.cli.console import progress, scores_of, tell
from kinespace.tools.evaluation.harness import AskedTake, Feed, Take, add_asked, answers_to, asked_of
from kinespace.tools.evaluation.words import DoneTake, Said, by_class, said_in, score_done

#: Seconds for which the body stands still behind a take, because a motion is said a moment after its end, and behind a
#: motion that is broken off.
_STANDS = 0.6
#: False alarms an hour that are compared.
_PROMISED = (1.0, 6.0, 60.0, 600.0)
_COLUMNS = (
    "{name} | found {found:.1%} | takes found {takes_found:.1%} | counted right {counted_right:.1%} | "
    "false an hour {false_per_hour:.1f} | delay {delay_s:.2f} s | broken off, done {broken_done:.1%}"
)
_OF_CLASSES = "class {name} | segments {segments:.0f} | found {found:.0f} | false {false:.0f}"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    add_asked(parser)
    parser.add_argument("--promises", action="store_true", help="compare the promises 1, 6, 60 and 600 an hour")


def run(options: argparse.Namespace) -> None:
    """Replay takes, score what was said, and print the results."""
    settings, scores = settings_of(options), list[dict[str, Any]]()
    asked, _ = asked_of(options)
    takes = list[DoneTake]()
    for promised in _PROMISED if options.promises else (settings.false_alarms,):
        name, changed = f"{promised:g}/h", replace(settings, false_alarms=promised)
        takes = [done_take(each, changed) for each in progress(asked, name, len(asked))]
        scores.append({"name": name, "promised_per_hour": promised, **score_done(takes)})
    people = sorted({each.take.person for each in takes} - {""})
    persons = {name: score_done([each for each in takes if each.take.person == name]) for name in people}
    classes, last = by_class(takes), scores[-1]
    of_persons, of_classes = ([{"name": name, **each} for name, each in by.items()] for by in (persons, classes))
    rests_on = f"{last['segments']} motions, {last['takes']} takes with a motion; {last['hours'] * 60:.1f} minutes"
    title = f"{rests_on}, {last['unknown_hours'] * 60:.1f} unknown"
    caption = "false an hour, 95 %: {:.1f} to {:.1f}".format(*last["false_interval"])
    tell(
        options,
        {**last, "classes": classes, "persons": persons, "promises": scores},
        scores_of([*scores, *of_persons], _COLUMNS, title=title, caption=caption),
        scores_of(of_classes, _OF_CLASSES, title="By class"),
    )


def done_take(asked: AskedTake, settings: Settings) -> DoneTake:
    """Play a take, and each of its known motions to its half."""
    take, index = asked.take, opened(asked.library)
    whole, broken = DoneTake(take, set(asked.library.classes), _said(take, index, settings)), list[bool]()
    # Half of several rounds holds whole ones.
    once = [segment for segment, said in whole.shared()[0] if len(said) <= 1]
    for segment, motion in zip(take.segments, take.motions() if take.is_known else (), strict=False):
        if segment in once:
            half = Take(motion.moved_to(motion.positions[: max(motion.frames // 2, 2)]), (segment,))
            broken.append(any(each.class_name == segment.label for each in _said(half, index, settings)))
    return replace(whole, broken=broken)


def _said(take: Take, index: WindowIndex, settings: Settings) -> list[Said]:
    """Push a take through a recogniser of its own, with some stillness behind it; give the motions said to be done."""
    feed = Feed.of(take.clip, index.library.skeleton, take.delivered)
    stands = np.arange(1, round(_STANDS * take.clip.frame_rate) + 1) / take.clip.frame_rate
    positions = np.pad(feed.positions, ((0, len(stands)), (0, 0), (0, 0)), mode="edge")
    feed = feed._replace(times=np.append(feed.times, feed.times[-1] + stands), positions=positions)
    return said_in(answers_to(feed, index, settings))["done"]
