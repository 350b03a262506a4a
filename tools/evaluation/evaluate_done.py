"""`kinespace evaluate done`: motions found that were really done, counted, and the false alarms an hour.

Takes are replayed through the recogniser that runs live, and the motions said to be done are compared with the labels.
Every motion that was said once is also played to its half only, and must not be done then.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from kinespace.library.windows.index import opened
from kinespace.stream.recognition import EventKind
from kinespace.stream.recognizer import Recognizer
from kinespace.tools.cli.arguments import add_shared, settings_of, several
from kinespace.tools.evaluation import harness
from kinespace.tools.evaluation.scoring.done_score import DoneTake, Said, by_class, score_done
from kinespace.tools.terminal.console import console, progress
from kinespace.tools.terminal.tables import print_scores

if TYPE_CHECKING:
    import argparse

    from kinespace.library import Clip, MotionLibrary
    from kinespace.stream.recognizer import Settings
    from kinespace.tools.evaluation.harness import Asked

#: Seconds for which the body stands still behind a take, because a motion is said a moment after its end, and behind a
#: motion that is broken off.
_STANDS = 0.6
#: False alarms an hour that are promised for the picture.
_PROMISED = (1.0, 6.0, 60.0, 600.0)
_WIDTH = 40
_COLUMNS = (
    ("", "{name}"),
    ("found", "{found:.1%}"),
    ("takes found", "{takes_found:.1%}"),
    ("counted right", "{counted_right:.1%}"),
    ("false an hour", "{false_per_hour:.1f}"),
    ("delay", "{delay_s:.2f} s"),
    ("broken off, done", "{broken_done:.1%}"),
)
_OF_CLASSES = (
    ("class", "{name}"),
    ("motions", "{segments:.0f}"),
    ("found", "{found:.0f}"),
    ("false", "{false:.0f}"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    harness.add_sources(parser, "the library's own motions")
    text = "recordings in which nothing known happens, or folders of them"
    parser.add_argument("--unknown", **several(Path, "TAKE"), help=text)
    harness.add_protocol(parser)
    text = "compare the promises 1, 6, 60 and 600 an hour: a picture of found against false an hour"
    parser.add_argument("--promises", action="store_true", help=text)
    text = "score start events as if they said that a motion was done, to compare"
    parser.add_argument("--starts", action="store_true", help=text)
    add_shared(parser, "--json")


def run(options: argparse.Namespace) -> int:
    """Replay takes, score what was said, and print the results; return the exit status."""
    settings = settings_of(options)
    asked, _ = harness.asked_of(options)
    scores = dict[str, dict[str, object]]()
    takes = list[DoneTake]()
    for promised in _PROMISED if options.promises else (settings.false_alarms,):
        changed = replace(settings, false_alarms=promised)
        takes = [
            done_take(each, changed, starts=options.starts) for each in progress(asked, f"{promised:g}/h", len(asked))
        ]
        scores[f"{promised:g}/h"] = {"promised_per_hour": promised, **score_done(takes)}
    persons = {
        person: score_done([each for each in takes if each.take.person == person])
        for person in sorted({each.take.person for each in takes} - {""})
    }
    classes = by_class(takes)
    last = next(reversed(scores.values()))
    if options.json:
        harness.print_json({**last, "classes": classes, "persons": persons, "promises": list(scores.values())})
        return 0
    print_scores(
        [{"name": name} | each for name, each in (scores | persons).items()],
        _COLUMNS,
        title=f"{last['segments']} motions, {last['takes']} takes with a motion; "
        f"{last['hours'] * 60:.1f} minutes, {last['unknown_hours'] * 60:.1f} unknown",  # type: ignore[operator]
        caption=f"false an hour, 95 %: {' to '.join(f'{each:.1f}' for each in last['false_interval'] or ())}",  # type: ignore[attr-defined]
    )
    print_scores([{"name": name, **each} for name, each in classes.items()], _OF_CLASSES, title="By class")
    for name, each in scores.items() if options.promises else ():
        found = each["found"] if each["found"] is not None else each["takes_found"]
        console.print(f"{name:>7} {'█' * round(_WIDTH * float(found or 0)):<{_WIDTH}} {each['false_per_hour']:6.1f}/h")  # type: ignore[arg-type]
    return 0


def done_take(asked: Asked, settings: Settings, *, starts: bool = False) -> DoneTake:
    """Play a take, and each of its known motions to its half."""
    take, library = asked.take, asked.library
    known = set(library.classes)
    said = played(take.clip, library, settings, starts=starts, delivered=take.delivered)
    whole = DoneTake(take, known, said)
    # Half of several rounds holds whole ones.
    often = {segment for segment, own in zip(whole.segments, whole.shared()[0], strict=True) if len(own) > 1}
    halves = [
        replace(motion, positions=motion.positions[: max(motion.frames // 2, 2)])
        for segment, motion in zip(take.segments, take.motions() if take.is_known else (), strict=False)
        if segment.label in known and segment not in often
    ]
    broken = [
        any(each.class_name == half.class_name for each in played(half, library, settings, starts=starts))
        for half in halves
    ]
    return replace(whole, broken=broken)


def played(
    clip: Clip,
    library: MotionLibrary,
    settings: Settings,
    *,
    starts: bool = False,
    delivered: object = None,
) -> list[Said]:
    """Push a clip through a recogniser of its own; give what it said was done, or the starts of motions."""
    feed = harness.Feed.of(clip, library.skeleton, delivered)  # type: ignore[arg-type]
    stands = np.arange(1, round(_STANDS * clip.frame_rate) + 1) / clip.frame_rate
    feed = feed._replace(
        times=np.concatenate([feed.times, feed.times[-1] + stands]),
        positions=np.concatenate([feed.positions, np.repeat(feed.positions[-1:], len(stands), axis=0)]),
    )
    found = list[Said]()
    for time, answer in harness.pushed(Recognizer(opened(library), settings), feed):
        if answer and starts:
            begun = [event.label for event in answer.events if event.kind is EventKind.START]
            found += [Said(label, time, time, time) for label in begun]
        elif answer and (done := answer.done):
            found.append(Said(done.label, done.start, done.end, time))
    return found
