"""The table of a running recogniser."""

import re
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from rich.console import Console

from kinespace.stream import Done, Event, EventKind, Outcome, Recognition
from kinespace.stream.recognition import Gone
from kinespace.stream.status import InputCounts, PerformerCounts, RecognizerCounts, Status
from kinespace.stream.teaching import State, Step
from kinespace.tools.cli import live_table
from kinespace.tools.cli.console import csv_text, log_as, note, say
from kinespace.tools.cli.live_table import LiveTable, PlainLines, counts, summary

CLASSES = ("bow", "jump", "wave")


def recognition(
    performer: str, best: str, *, score: float = 0.9, outcome: Outcome = Outcome.NAMED, time: float = 12.5
) -> Recognition:
    """Make an answer in which one class leads."""
    scores = np.array([score if name == best else 0.25 for name in CLASSES])
    return Recognition(performer, time, outcome, CLASSES, scores, movement=0.1, share=0.9, gap=0.8)


def status(*performers: str) -> Status:
    """Make a status in which every counter is another number."""
    inputs = InputCounts(received=101, malformed=2, foreign=3, overrun=4, missing=5)
    recognizers = RecognizerCounts(frames=80, out_of_order=8, restarts=9, hops=20)
    outcomes = PerformerCounts(no_room=6, other_joints=7, recognizers=recognizers)
    return Status(inputs, outcomes, 10, dict.fromkeys(performers, 119.6), hop_p50=0.0012, hop_p99=0.0034)


def shown(table: LiveTable, width: int = 120) -> str:
    """Draw the table as text."""
    console = Console(file=StringIO(), width=width, markup=False, emoji=False)
    console.print(table.drawn())
    return console.file.getvalue()


def test_plain_lines_come_on_change_only(capsys: pytest.CaptureFixture[str]) -> None:
    """A performer's line is printed when the label changes, and again after a status without the performer."""
    lines = PlainLines()
    for best in ("bow", "bow", "wave", "wave", "bow"):
        lines.send(recognition("me", best))
    lines.send(recognition("me", "bow", outcome=Outcome.STILL))
    lines.send(recognition("you", "bow"))
    lines.send(status("you"))
    for name in ("you", "me"):
        lines.send(recognition(name, "bow"))
    printed = capsys.readouterr().out.splitlines()
    assert [line.split()[3] for line in printed] == ["bow", "wave", "bow", "still", "bow", "bow"]
    assert [line.split()[2] for line in printed] == ["me"] * 4 + ["you", "me"]
    assert printed[0].split() == ["0.000", "s", "me", "bow", "score", "0.900", "margin", "0.650"]


def test_the_table_shows_the_latest_of_each_performer() -> None:
    """Each performer has one row with the last label, score, margin, runner-up and rate; the caption has the counts."""
    table = LiveTable(CLASSES)
    table.send(recognition("me", "bow"))
    table.send(recognition("you", "wave", score=0.75))
    table.send(recognition("me", "jump", score=0.5))
    table.send(status("me", "you"))
    drawn = shown(table)
    (mine,) = [line for line in drawn.splitlines() if line.startswith("me ")]
    (yours,) = [line for line in drawn.splitlines() if line.startswith("you ")]
    assert re.fullmatch(r"me +jump +0\.500 +0\.250 +120", mine.strip())
    assert re.match(r"you +wave +0\.750 ", yours)
    assert "waiting" not in drawn
    assert "3 classes · received 101, malformed 2" in drawn


def test_motions_that_were_done_are_counted(capsys: pytest.CaptureFixture[str]) -> None:
    """Their counts stand below the table, the last three classes of each performer; in lines each has its own."""
    table, lines = LiveTable(CLASSES), PlainLines()
    for sink in (table, lines):
        sink.send(recognition("me", "bow", time=2.0))
        for name, count in (("bow", 1), ("wave", 1), ("jump", 1), ("bow", 2), ("hop", 7)):
            sink.send(Done("me", name, 0, 1.0, 1.5, 0.9, 1.25, 0.5, count))
        sink.send(status("me"))
    assert "me done: jump 1, bow 2, hop 7" in shown(table)
    assert "me  done: hop 7, 1.5 s, speed 1.25, amplitude 0.50" in capsys.readouterr().out
    table.send(status())
    assert "done" not in shown(table)


def test_remarks_on_performers_are_shown(capsys: pytest.CaptureFixture[str]) -> None:
    """Clocks, refused frames, and addresses that are not as the name: below the table, and in lines printed once."""
    named = status("me", "佐藤", "Actor 1")
    noticed = replace(named, clocks={"me": "times are milliseconds"}, refused={"you": "2 joints, from 10.0.0.5"})
    table, lines = LiveTable(CLASSES), PlainLines()
    for sink in (table, lines, lines):
        sink.send(noticed)
    printed = capsys.readouterr().out
    for told in (
        *("performer me: times are milliseconds", "you: frames refused: 2 joints, from 10.0.0.5"),
        *("performer 佐藤: OSC answers at /motion/佐藤/", "performer Actor 1: OSC answers at /motion/Actor%201/"),
    ):
        assert told in shown(table)
        assert printed.count(told) == 1
    assert "performer me: OSC" not in printed
    for said in ("time: expected a number, got 'x'", "time: expected a number, got 'y'", "joints: expected 31, got 2"):
        lines.send(replace(named, notes=(f"last malformed: {said}",)))
    assert capsys.readouterr().out.splitlines() == [
        "last malformed: time: expected a number, got 'x'",
        "last malformed: joints: expected 31, got 2",
    ]


def test_a_performer_whose_frames_stop_is_not_shown_as_living(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """After half a second without an answer table and lines say so, the lines once; after its return, the label."""
    table, lines, now = LiveTable(CLASSES), PlainLines(), [10.0]
    monkeypatch.setattr(live_table.time, "monotonic", lambda: now[0])
    for _ in range(2):
        for sink in (table, lines):
            sink.send(recognition("me", "bow"))
            sink.send(status("me"))
        assert "no frames" not in shown(table)
        now[0] += 3.0
        for sink in (table, lines, lines):
            sink.send(status("me"))
        assert "no frames for 3 s" in shown(table)
    for sink in (table, lines):
        sink.send(replace(status(), performers={"me": 0.0}, outcomes=PerformerCounts(opening=2)))
    assert "no frames for 3 s" in shown(table), "others' frames wait"
    for sink in (table, lines):
        sink.send(replace(status("me"), outcomes=PerformerCounts(opening=3)))
    assert "no frames" not in shown(table), "frames wait while the library opens"
    lines.send(Gone("me"))
    printed = capsys.readouterr().out
    assert printed.count("performer me: no frames\n") == 2
    assert printed.count("performer me: gone\n") == 1


def test_the_summary_adds_answers_and_times() -> None:
    """The summary holds the counts, the answers, the new beginnings, the unsent and the hop times in milliseconds."""
    first, second = summary(status(), 1 / 30)
    assert first == counts(status())
    assert second == (
        "20 answers of 80 frames (--hop: at most 30 answers a second), "
        "9 windows started again, 10 answers not sent, hop 1.20 ms (p50) 3.40 ms (p99)"
    )
    refused = replace(status(), refused={"ann": "2 joints"}, notes=("malformed: x",))
    assert summary(refused, 1 / 30)[2:] == ["performer ann: frames refused: 2 joints", "malformed: x"]
    # Lines have said them already.
    assert summary(refused, 1 / 30, notes=False) == summary(status(), 1 / 30)


#: A text that moves the cursor, colours, turns the writing round, and begins a line of its own.
HOSTILE = "a\x1b[31m\x9b\u202e\u2028\nFORGED"


@pytest.fixture
def logged() -> Iterator[Callable[[Literal["text", "json"]], None]]:
    """Give the switch to a log, which is off again afterwards."""
    yield log_as
    log_as(None)


@pytest.mark.parametrize("way", ["text", "json"])
def test_a_log_without_an_output(way: str, logged: Callable[..., None], monkeypatch: pytest.MonkeyPatch) -> None:
    """A program whose output was closed when it began (`>&-`) says nothing, and goes on."""
    logged(way)
    monkeypatch.setattr("sys.stdout", None)
    say("a line")


@pytest.mark.parametrize("way", ["table", "lines", "text", "json"])
def test_no_name_steers_a_terminal_or_forges_a_line(
    way: str, logged: Callable[..., None], capsys: pytest.CaptureFixture[str]
) -> None:
    """Whatever a performer, a class, a joint or a note is called, it stays in its line, without control characters."""
    if way in ("text", "json"):
        logged(way)
    sink: LiveTable | PlainLines = LiveTable(CLASSES) if way == "table" else PlainLines()
    hostile = Recognition(HOSTILE, 1.0, Outcome.NAMED, (HOSTILE,), np.ones(1), movement=0.1, share=0.9, gap=0.8)
    sink.send(hostile)
    for kind in (EventKind.START, EventKind.END, EventKind.START):
        sink.send(Event(HOSTILE, kind, HOSTILE, 0, 0.9, 2.0))
    sink.send(Done(HOSTILE, HOSTILE, 0, 1.0, 1.0, 0.9, 1.0, 1.0))
    said = {HOSTILE: HOSTILE}
    odd = replace(status(HOSTILE), notes=(HOSTILE,), refused=said, doubted=said, compared=said, clocks=said)
    sink.send(odd)
    sink.send(State(HOSTILE, Step.REFUSED, 0.0, HOSTILE))
    sink.send(Gone(HOSTILE))
    for line in summary(odd, 1 / 30):
        say(line)
    note(HOSTILE)
    output = capsys.readouterr()
    for text in (shown(sink) if isinstance(sink, LiveTable) else "", output.out, output.err):
        assert not [each for each in text if not each.isprintable() and each != "\n"]
        assert not [line for line in text.splitlines() if line.lstrip().startswith("FORGED")]
    assert "FORGED" in output.out + output.err


def test_a_log_that_cannot_be_written_is_an_error_without_a_traceback(
    logged: Callable[..., None], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is the sink's error, which the service counts; where the reader has gone the program ends, as all do."""
    with Path("/dev/full").open("w", buffering=1, encoding="utf-8") as full:
        monkeypatch.setattr(sys, "stdout", full)
        logged("json")
        with pytest.raises(OSError, match="No space left"):
            say("a line")
        with suppress(OSError):
            full.close()
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(("text", "cell"), [("=1+1", "'=1+1"), ("@x", "'@x"), ("-head", "'-head"), ("head", "head")])
def test_no_cell_is_computed(text: str, cell: str) -> None:
    """A name that a spreadsheet would take for a formula has an apostrophe before it."""
    assert csv_text(text) == cell
