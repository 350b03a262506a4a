"""`kinespace evaluate faults`: takes whose joints go wrong, through the recogniser that runs live."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from kinespace.library import MotionLibrary
from kinespace.stream.frame import Frame
from kinespace.stream.recognition import Outcome
from kinespace.stream.recognizer import Recognizer, Settings
from kinespace.tools.cli.arguments import (
    add_actor_in,
    add_json,
    add_library,
    add_map,
    add_reading,
    add_settings,
    add_subjects,
    add_takes,
    library_at,
    positive,
    reading_of,
    settings_of,
)
from kinespace.tools.evaluation.faults import FAULTS, Feed
from kinespace.tools.evaluation.scoring.protocols import Protocol, folds_of
from kinespace.tools.evaluation.scoring.stream_tables import percent
from kinespace.tools.evaluation.takes import Sources, Take, read_takes
from kinespace.tools.terminal.console import console, progress
from kinespace.tools.terminal.tables import narrow_table

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

    from kinespace.stream.recognition import Recognition
    from kinespace.tools.evaluation.scoring.protocols import Fold

#: Seconds for which an answer's segment must have lasted for the answer to count.
_INSIDE = 1.0


@dataclass(frozen=True, slots=True)
class FaultScore:
    """How right the answers to takes with one fault were. Shares are 0 to 1; None where there is none.

    Attributes
    ----------
    fault
        The fault of the joints.
    answers
        The number of answers to motions that the library knows, with the last second inside the segment.
    right, guessed, wrong, implausible
        The shares of these answers that name the class performed, that have it as best guess, that name another class,
        and that are `Outcome.IMPLAUSIBLE`.
    unknown_named
        Share of the answers to motions that the library does not know, last second inside, that name a class.
    noticed_s
        Seconds until a fault was noticed, in the slowest take; None when none was noticed in some take.
    alarmed, seconds
        The number of seconds in which a fault was noticed or joints were left out, and the number of all seconds.
    segments, persons
        The basis of the shares.
    """

    fault: str
    answers: int
    right: float | None
    guessed: float | None
    wrong: float | None
    implausible: float | None
    unknown_named: float | None
    noticed_s: float | None
    alarmed: int
    seconds: float
    segments: int
    persons: int


@dataclass(slots=True)
class _Counts:
    """The counts of one take."""

    answers: int = 0
    right: int = 0
    guessed: int = 0
    wrong: int = 0
    implausible: int = 0
    unknown: int = 0
    unknown_named: int = 0
    noticed: float = math.inf
    alarmed: int = 0
    seconds: float = 0.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.description = (
        "Plays takes into the live recogniser with joints frozen, lost, exchanged or out of order, and bodies that "
        "jump between two postures; counts answers with the last second inside the segment, and seconds of alarm."
    )
    parser.add_argument("takes", nargs="*", type=Path, metavar="TAKE", help="labelled takes, or folders of them")
    add_takes(parser)
    add_reading(parser)
    add_actor_in(parser)
    add_library(parser)
    add_subjects(parser)
    parser.add_argument(
        "--protocol",
        choices=[str(protocol) for protocol in Protocol],
        default=str(Protocol.LIBRARY),
        help="as for stream",
    )
    add_map(parser)
    parser.add_argument(
        "--fault", nargs="+", action="extend", choices=list(FAULTS), default=[], help="the faults (default: all)"
    )
    parser.add_argument("--rate", type=positive, default=60.0, help="frames per second (default %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of noise, drops and order (default %(default)s)")
    add_settings(parser)
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Run the program with these options; return the exit status."""
    sources = Sources(
        options.takes,
        tables=options.tables,
        names=dict(options.map),
        persons=options.subjects,
        without_persons=options.without_subjects,
    )
    if not sources:
        raise ValueError("TAKE, --takes: expected takes, got none")
    takes = read_takes(sources, reading_of(options))
    known = library_at(options.library) if options.library else None
    folds = folds_of(takes, Protocol(options.protocol), lambda: known or MotionLibrary.builtin())
    asked = [(fault, fold, take) for fault in options.fault or FAULTS for fold in folds for take in fold.takes]
    counted: dict[str, list[tuple[Take, _Counts]]] = {}
    for fault, fold, take in progress(asked, "Replaying", len(asked)):
        counts = _counted(take, fold, fault, options.rate, options.seed, settings_of(options))
        counted.setdefault(fault, []).append((take, counts))
    scores = [_scored(fault, each) for fault, each in counted.items()]
    if options.json:
        print(json.dumps({"faults": [asdict(score) for score in scores]}))
    else:
        _print(scores)
    return 0


def _counted(take: Take, fold: Fold, fault: str, rate: float, seed: int, settings: Settings) -> _Counts:  # noqa: PLR0917 - one take's circumstances
    """Play a take with a fault, and count its answers."""
    clip = take.clip.as_of(fold.library.skeleton)
    shown = np.arange(clip.frames) if take.delivered is None else take.delivered
    shown = shown[:: max(1, round(clip.frame_rate / rate))]
    sound = Feed(clip.times[shown], clip.positions[shown], fold.library.skeleton)
    feed = FAULTS[fault](sound, np.random.default_rng(seed))
    recognizer, counts = Recognizer(fold.library, settings), _Counts()
    alarmed, told = set[int](), ""
    for time, positions in zip(feed.times.tolist(), feed.positions, strict=True):
        answer = recognizer.push(Frame("take", time, positions))
        if recognizer.doubt != told or (answer and (answer.doubted or answer.outcome is Outcome.IMPLAUSIBLE)):
            told = recognizer.doubt
            alarmed.add(int(time))
            counts.noticed = min(counts.noticed, time - float(feed.times[0]))
        if answer:
            _count(counts, answer, take, fold.library)
    counts.alarmed, counts.seconds = len(alarmed), float(feed.times[-1] - feed.times[0])
    return counts


def _count(counts: _Counts, answer: Recognition, take: Take, library: MotionLibrary) -> None:
    inside = [each for each in take.segments if each.start + _INSIDE <= answer.time < each.end]
    if not inside:
        return
    performed = inside[-1].label
    if performed not in library.classes:
        counts.unknown += 1
        counts.unknown_named += answer.class_name is not None
        return
    counts.answers += 1
    counts.right += answer.class_name == performed
    counts.guessed += answer.guess_index >= 0 and answer.classes[answer.guess_index] == performed
    counts.wrong += answer.class_name not in (None, performed)
    counts.implausible += answer.outcome is Outcome.IMPLAUSIBLE


def _scored(fault: str, counted: Sequence[tuple[Take, _Counts]]) -> FaultScore:
    counts = [each for _, each in counted]
    answers, unknown = sum(each.answers for each in counts), sum(each.unknown for each in counts)
    noticed = max(each.noticed for each in counts)

    def share(name: str, among: int) -> float | None:
        return sum(getattr(each, name) for each in counts) / among if among else None

    return FaultScore(
        fault=fault,
        answers=answers,
        right=share("right", answers),
        guessed=share("guessed", answers),
        wrong=share("wrong", answers),
        implausible=share("implausible", answers),
        unknown_named=share("unknown_named", unknown),
        noticed_s=noticed if math.isfinite(noticed) else None,
        alarmed=sum(each.alarmed for each in counts),
        seconds=sum(each.seconds for each in counts),
        segments=sum(len(take.segments) for take, _ in counted),
        persons=len({take.person for take, _ in counted}),
    )


def _print(scores: Sequence[FaultScore]) -> None:
    first = scores[0]
    table = narrow_table(
        "Takes whose joints go wrong",
        f"{first.seconds:.0f} s, {first.segments} segments, {first.persons} persons; last second inside the segment",
    )
    table.add_column("fault")
    for heading in ("right", "guessed", "wrong", "implausible", "unknown named", "noticed", "alarmed"):
        table.add_column(heading, justify="right")
    for score in scores:
        shares = (score.right, score.guessed, score.wrong, score.implausible, score.unknown_named)
        table.add_row(
            score.fault,
            *("-" if share is None else percent(share) for share in shares),
            "-" if score.noticed_s is None else f"{score.noticed_s:.2f} s",
            f"{score.alarmed} of {score.seconds:.0f} s",
        )
    console.print(table)
