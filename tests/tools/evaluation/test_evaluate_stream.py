"""`kinespace evaluate stream`: the takes and libraries of each protocol replayed by hand, and what options change."""

import csv
from pathlib import Path

import numpy as np
import pytest
from recorded import write_take

from kinespace.library import MotionLibrary, Reading
from kinespace.library.recordings import ActorIn
from kinespace.stream import Settings
from kinespace.tools.cli.main import main
from kinespace.tools.evaluation.evaluate_stream import course
from kinespace.tools.evaluation.harness import Sources, Take, read_takes

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("wide")]

KNOWN = [("clap", 2.5), ("hail", 2.5), ("row", 2.5)]
CLASSES = ("clap", "hail", "row", "salute")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a take of each of three persons; the last also has a motion that no other take has."""
    folder = tmp_path_factory.mktemp("takes")
    write_take(folder, 1, KNOWN, person="ann")
    write_take(folder, 1, KNOWN[::-1], person="ben")
    write_take(folder, 1, [KNOWN[1], ("salute", 2.5), KNOWN[0]], person="cid")
    return folder


@pytest.fixture(scope="module")
def takes(folder: Path) -> list[Take]:
    """Read the takes."""
    return read_takes(Sources([folder]), Reading(actor_in=ActorIn.NAME))


@pytest.fixture(scope="module")
def library(folder: Path, takes: list[Take]) -> Path:
    """Build a library of the first take's segments."""
    path = folder / "first.library"
    MotionLibrary.of_clips(takes[0].motions()).save(path)
    return path


def _evaluate(*arguments: object) -> int:
    return main(["evaluate", "stream", *map(str, arguments)])


def test_answers_and_segments_are_tables(folder: Path, takes: list[Take], library: Path, tmp_path: Path) -> None:
    """A row for each answer, with truth and the score of each class; a row for each segment, with its share right."""
    answers, segments = tmp_path / "answers.csv", tmp_path / "segments.csv"
    files = ("--answers", answers, "--segments", segments)
    assert _evaluate(folder, "--library", library, "--map", "salute=hail", "--actor-in", "name", *files) == 0
    rows = [*csv.DictReader(answers.read_text("utf-8").splitlines())]
    played = course(takes[0], MotionLibrary.load(library), CLASSES[:3], Settings())
    own = [row for row in rows if row["take"] == played.name]
    assert len(own) == len(played.answers)
    for row, answer in zip(own, played.answers, strict=True):
        assert (row["guess"], row["label"]) == (answer.as_dict()["guess"], answer.label)
        assert [float(row[f"score {name}"]) for name in answer.classes] == pytest.approx(answer.scores, abs=1e-6)
    assert {row["truth"] for row in rows} >= {"clap", "hail", "row"}
    right = [row["truth"] == row["guess"] for row in own if row["truth"]]
    table = [*csv.DictReader(segments.read_text("utf-8").splitlines())]
    assert [(each["performed"], each["person"]) for each in table][:3] == [(name, "ann") for name, _ in KNOWN]
    ours = [float(each["right"]) for each in table if each["take"] == played.name]
    assert np.mean(ours) == pytest.approx(np.mean(right), abs=0.1)
