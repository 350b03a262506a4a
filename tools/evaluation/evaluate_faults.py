"""`kinespace evaluate faults`: takes whose joints go wrong, through the recogniser that runs live.

Plays takes into the live recogniser with joints frozen, lost, exchanged or out of order, and bodies that jump between
two postures; counts answers with the last second inside the segment, and seconds of alarm.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from kinespace.library import MotionLibrary
from kinespace.stream.recognizer import Recognizer, Settings
from kinespace.tools.cli.arguments import add_shared, settings_of, several
from kinespace.tools.evaluation import harness
from kinespace.tools.evaluation.faults import FAULTS
from kinespace.tools.evaluation.scoring.answers import counted
from kinespace.tools.evaluation.scoring.bootstrap import Ratio, values_of
from kinespace.tools.evaluation.scoring.stream_score import basis_of
from kinespace.tools.evaluation.scoring.stream_tables import rests_on
from kinespace.tools.evaluation.takes import Take
from kinespace.tools.terminal.console import progress
from kinespace.tools.terminal.tables import print_scores

#: Of each share what is counted, and among what: answers to motions that the library knows, and to others.
_SHARES = dict.fromkeys(("right", "guessed", "wrong", "implausible"), "answers") | {"unknown_named": "unknown"}
#: Frames per second.
_RATE = 60.0
#: Seed of noise, drops and order.
_SEED = 0
_COLUMNS = (
    ("fault", "{fault}"),
    *((name.replace("_", " "), f"{{{name}:.1%}}") for name in _SHARES),
    ("noticed, s", "{noticed_s:.2f}"),
    ("alarmed", "{alarmed} of {seconds:.0f} s"),
)


class _Played(NamedTuple):
    """One take with one fault: its answers counted, and when the fault was noticed, seconds; None when it was not."""

    take: Take
    counts: Counter[str]
    noticed: float | None
    alarmed: int
    seconds: float


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    harness.add_sources(parser, "the library's own motions")
    harness.add_protocol(parser)
    text = f"the faults (default: all): {'; '.join(FAULTS)}"
    parser.add_argument("--fault", **several(str, "FAULT"), choices=[*FAULTS], help=text)
    add_shared(parser, "--json")


def run(options: argparse.Namespace) -> int:
    """Play every take with every fault, and print what was answered; return the exit status."""
    settings, (asked, _) = settings_of(options), harness.asked_of(options)
    played: dict[str, list[_Played]] = {fault: [] for fault in options.fault or FAULTS}
    for each in progress(asked, "Playing", len(asked)):
        sound = harness.Feed.of(each.take.clip, each.library.skeleton, each.take.delivered)
        step = max(1, round(each.take.clip.frame_rate / _RATE))
        sound = sound._replace(times=sound.times[::step], positions=sound.positions[::step])
        for fault, of_fault in played.items():
            feed = FAULTS[fault](sound, np.random.default_rng(_SEED))
            of_fault.append(_played(each.take, feed, each.library, settings))
    scores = [_scored(fault, each) for fault, each in played.items()]
    if options.json:
        harness.print_json({"faults": scores})
    else:
        caption = f"{rests_on(scores[0], 'segment')}; last second inside the segment"
        print_scores(scores, _COLUMNS, title="Takes whose joints go wrong", caption=caption)
    return 0


def _played(take: Take, feed: harness.Feed, library: MotionLibrary, settings: Settings) -> _Played:
    """Play a take with a fault; an alarm is a new note on joints, or an answer without joints."""
    recognizer, answers, alarms, note = Recognizer(library, settings), [], [], ""
    for time, answer in harness.pushed(recognizer, feed):
        if recognizer.doubt != note or (answer and answer.is_doubted):
            note = recognizer.doubt
            alarms.append(time)
        if answer:
            answers.append(answer)
    begun, ended = feed.times[[0, -1]].tolist()
    noticed = alarms[0] - begun if alarms else None
    counts = counted(take, library.classes, answers, harness.INSIDE)
    return _Played(take, counts, noticed, len({*map(int, alarms)}), ended - begun)


def _scored(fault: str, played: Sequence[_Played]) -> dict[str, object]:
    """Give the shares of one fault; the seconds until it was noticed in the slowest take, and the seconds of alarm."""
    counts = [each.counts for each in played]
    noticed = [each.noticed for each in played if each.noticed is not None]
    basis = basis_of([each.seconds for each in played], [each.take.person for each in played])
    shares = {
        name: Ratio([each[name] for each in counts], [each[whole] for each in counts])
        for name, whole in _SHARES.items()
    }
    basis["segments"] = sum(len(each.take.segments) for each in played)
    return {
        "fault": fault,
        "answers": sum(each["answers"] for each in counts),
        **values_of(shares),
        "noticed_s": max(noticed) if len(noticed) == len(played) else None,
        "alarmed": sum(each.alarmed for each in played),
        **basis,
    }
