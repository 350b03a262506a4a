"""How the words of gestures are reported: a table, JSON, and every word in a file."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence

from kinespace.tools.cli.arguments import add_shared, report_path
from kinespace.tools.evaluation.harness import print_json, written
from kinespace.tools.evaluation.scoring.answer_tables import write_rows
from kinespace.tools.evaluation.scoring.bootstrap import Ratio
from kinespace.tools.evaluation.scoring.stream_tables import rests_on
from kinespace.tools.evaluation.scoring.words import COLUMNS, Heard, score_words, word_rows
from kinespace.tools.terminal.output_path import require_place_for_report
from kinespace.tools.terminal.tables import print_scores


def add_report(parser: argparse.ArgumentParser) -> None:
    """Add the options for what is printed and written."""
    text = "write every word said: person, time, kind, class, whether it is right, its segment"
    parser.add_argument("--answers", type=report_path, metavar="CSV", help=text)
    add_shared(parser, "--json")


def report(
    heard: Sequence[Heard],
    options: argparse.Namespace,
    title: str,
    caption: str,
    further: Mapping[str, object] | None = None,
) -> int:
    """Print the scores of all takes together, write the words, and return the exit status; `further` is for JSON."""
    scores, persons = score_words(heard), {each.person for each in heard}
    basis = {
        "seconds": sum(each.seconds for each in heard),
        "segments": sum(each.asked for each in heard),
        "persons": len(persons) if all(persons) else None,
    }
    so_far = Ratio([each.so_far for each in heard], [each.asked for each in heard]).value()
    if options.answers:
        require_place_for_report(options.answers, options)
        write_rows(options.answers, word_rows(heard))
    if options.json:
        print_json({**scores, "so_far": so_far, **(further or {}), **basis})
        return 0
    rows = [{"name": kind, **score, "interval": _written(score["intervals"]["f1"])} for kind, score in scores.items()]
    caption = f"{rests_on(basis, 'gesture')}; {written(so_far)} right so far at a gesture's end; {caption}"
    print_scores(rows, COLUMNS, title=title, caption=caption)
    return 0


def _written(interval: tuple[float, float] | None) -> str:
    return "-" if interval is None else "{:.1%} to {:.1%}".format(*interval)
