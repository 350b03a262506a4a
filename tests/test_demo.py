"""`kinespace demo`: the whole loop on this machine, with nothing but the built-in library."""

from __future__ import annotations

import json
import math
import multiprocessing
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from io import StringIO
from typing import TYPE_CHECKING, NoReturn

import pytest
from programs import started
from rich.console import Console

from library import MotionLibrary
from tools import demo
from tools.background import BackgroundService
from tools.cli import main

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

#: One class, so that a whole demo fits in two seconds.
CLASS = "squat1Reps"
SECONDS = "2"


def part_of(whole: MotionLibrary, renamed: Mapping[str, str]) -> MotionLibrary:
    """Give the motions of some classes, under other names."""
    kept = [index for index, motion in enumerate(whole.motions) if motion.class_name in renamed]
    chosen = [whole.motions[index] for index in kept]
    motions = tuple(replace(motion, class_name=renamed[motion.class_name]) for motion in chosen)
    return MotionLibrary(
        skeleton=whole.skeleton,
        motions=motions,
        means=whole.means[kept],
        axes=whole.axes[kept],
        deviations=whole.deviations[kept],
    )


@pytest.fixture
def small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Let the demo know one class only; the file its recogniser loads."""
    library = part_of(MotionLibrary.builtin(), {CLASS: CLASS})
    path = tmp_path / "small.npz"
    library.save(path)
    monkeypatch.setattr(MotionLibrary, "builtin", lambda: library)
    monkeypatch.setattr(demo, "BackgroundService", partial(BackgroundService, library=path))
    return path


def test_the_command_names_every_ghost_over_both_transports() -> None:
    """As a command, demo prints exactly one JSON object in which every class was played, answered and right."""
    classes = len(MotionLibrary.builtin().classes)
    with ExitStack() as stack:
        runs = [
            stack.enter_context(started("demo", "--json", "--seconds", 24, "--transport", transport))
            for transport in ("osc", "zmq")
        ]
        for program in runs:
            assert (program.wait(), program.errors) == (0, "")
            assert program.output.count("\n") == 1
            described = json.loads(program.output)
            assert set(described) == {"played", "answered", "right", "p99_ms"}
            assert described["right"] == described["played"] == described["answered"] == classes == 11
            assert 0 < described["p99_ms"] < math.inf


@pytest.mark.usefixtures("small")
def test_a_person_sees_a_table_a_tally_and_a_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The table says it shows ghosts and has a row per class, the tally says how it went, the picture shows both."""
    picture = tmp_path / "demo.svg"
    assert main(["demo", "--seconds", SECONDS, "--picture", str(picture)]) == 0
    printed = capsys.readouterr().out
    assert "made from the library's own signatures" in " ".join(printed.split())
    (row,) = [line.split() for line in printed.splitlines() if line.startswith(CLASS)]
    assert row[:2] == [CLASS, CLASS]
    score, margin, milliseconds = map(float, row[2:])
    assert 0.9 < score <= 1
    assert 0 < margin <= 1
    assert milliseconds > 0
    assert "1 of 1 ghosts named" in printed
    assert "frame sent to answer received over OSC: p50 " in printed
    drawn = picture.read_text(encoding="utf-8")
    assert drawn.startswith("<svg")
    assert drawn.count(CLASS) >= 2
    assert "ghosts&#160;named" in drawn
    assert {path.name for path in tmp_path.iterdir()} == {"demo.svg", "small.npz"}
    assert multiprocessing.active_children() == []


@pytest.mark.usefixtures("small")
def test_on_a_terminal_the_table_fills_while_it_plays(monkeypatch: pytest.MonkeyPatch) -> None:
    """A terminal gets the table again and again: first without answers, at the end with all of them."""
    terminal = Console(file=StringIO(), force_terminal=True, width=100, markup=False)
    monkeypatch.setattr(demo, "console", terminal)
    assert main(["demo", "--seconds", SECONDS, "--transport", "zmq"]) == 0
    assert isinstance(terminal.file, StringIO)
    printed = terminal.file.getvalue()
    drawn = printed.split("Ghosts, made from")
    assert len(drawn) > 5
    assert drawn[1].count(CLASS) == 1
    assert drawn[-1].count(CLASS) == 2
    assert "over ZMQ" in printed


def test_a_recogniser_that_knows_other_names_is_not_right(
    small: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Answers that are not the expected ones are not taken for answers: nothing is right, and the status is 1."""
    other = part_of(MotionLibrary.builtin(), {CLASS: "somethingElse"})
    other.save(small.with_name("other.npz"))
    monkeypatch.setattr(demo, "BackgroundService", partial(BackgroundService, library=small.with_name("other.npz")))
    assert main(["demo", "--seconds", SECONDS, "--json"]) == 1
    assert json.loads(capsys.readouterr().out) == {"played": 1, "answered": 0, "right": 0, "p99_ms": None}


def test_too_few_seconds_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    """When the ghosts could not fill a window each, the least that would do is said in one line, with status 2."""
    assert main(["demo", "--seconds", "5", "--json"]) == 2
    assert capsys.readouterr() == ("", "kinespace: --seconds: expected at least 21 for 11 classes, got 5\n")


@pytest.mark.usefixtures("small")
def test_a_demo_that_is_interrupted_takes_its_recogniser_along(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Ctrl-C while ghosts play ends with 1 and without a word, the recogniser's process and all sockets with it."""

    def interrupted(*_: object) -> NoReturn:
        raise KeyboardInterrupt

    monkeypatch.setattr(demo.Listener, "listen_until", interrupted)
    assert main(["demo", "--seconds", SECONDS, "--json"]) == 1
    assert capsys.readouterr() == ("", "")
    assert multiprocessing.active_children() == []
