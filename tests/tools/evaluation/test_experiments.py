"""Every experiment as a person runs it: its keys, its table, and the input that it refuses."""

import csv
import json
import tomllib
from collections.abc import Iterator, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from programs import ran, small_library
from written import write_clips, write_take

from kinespace.library import MotionLibrary, Reading
from kinespace.library.recordings import ActorIn
from kinespace.stream import Settings
from kinespace.tools.evaluation.evaluate_stream import replayed
from kinespace.tools.evaluation.harness import Sources, read_takes

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("wide")]

PAGE = (Path(__file__).parents[3] / ".github/docs/json.md").read_text(encoding="utf-8")
ROWS = {line.split("|")[1].strip().strip("`"): line for line in PAGE.splitlines() if line.startswith("| `")}
#: Short runs; `{takes}` is a folder of takes by three persons, `{clips}` one of clips named as HDM05's. The built-in
#: library has few motions. What each prints for a person, beside its figures.
RUNS, REFUSED = tomllib.loads(Path(__file__).with_name("experiments.toml").read_text(encoding="utf-8")).values()


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Write takes of three persons, one with a motion that no other has; and twelve clips."""
    takes, clips, walks = (tmp_path_factory.mktemp(name) for name in ("takes", "clips", "walks"))
    write_take(takes, 1, [("clap", 1.5), ("hail", 1.5), ("row", 1.5)], person="ann")
    write_take(takes, 1, [("row", 1.5), ("clap", 1.5)], person="ben")
    write_take(takes, 1, [("hail", 1.5), ("salute", 1.5)], person="cid")
    write_clips(clips)
    walk = MotionLibrary.builtin().motions[0]
    named = {"positions": walk.positions, "joints": np.array(walk.skeleton.joints)}
    np.savez(walks / "walk.npz", time=walk.times, parents=np.array(walk.skeleton.parents), performer="ann", **named)
    return {"takes": takes, "clips": clips, "walks": walks}


@pytest.fixture(scope="module", autouse=True)
def _few_built_in() -> Iterator[None]:
    """Leave of the built-in library two motions of each of three classes by three persons."""
    library = small_library()
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(MotionLibrary, "builtin", lambda: library)
        yield


def _arguments(line: str, folders: dict[str, Path]) -> list[str]:
    """Split a line at blanks; names after `--fault`, which hold blanks, have commas between."""
    before, option, names = line.partition(" --fault ")
    return ["evaluate", *before.format(**folders).split(), *([option.strip(), *names.split(",")] if option else [])]


def _keys(value: Any) -> set[str]:  # noqa: ANN401 - JSON
    """Collect the keys of an object and of the objects in it; names of persons, classes and figures are not keys."""
    if isinstance(value, list):
        return set[str]().union(*map(_keys, value))
    if not isinstance(value, dict):
        return set()
    named = {"classes", "persons", "intervals", "confusion"}
    below = [each for key, each in value.items() if key not in named]
    by_name = [each for key in {"classes"} & set(value) if isinstance(value[key], dict) for each in value[key].values()]
    return {*value}.union(*map(_keys, [*below, *by_name]))


@pytest.mark.parametrize("run", RUNS)
def test_keys_are_on_the_page_with_a_basis(run: str, folders: dict[str, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    """With --json every key is in its program's row; without it a table says what its figures rest on.

    The table is printed of what was computed for the JSON: the same work is not done twice.
    """
    line, basis, name = RUNS[run]
    arguments, done = _arguments(line, folders), list[object]()
    experiment = import_module(f"kinespace.tools.evaluation.evaluate_{arguments[1]}")
    if basis:
        work = getattr(experiment, name)
        monkeypatch.setattr(experiment, name, lambda *given, **more: done.append(work(*given, **more)) or done[-1])
    printed, row = _printed(arguments), ROWS[f"evaluate {arguments[1]}"]
    assert sorted(key for key in _keys(printed) if f"`{key}`" not in row) == []
    if basis:
        monkeypatch.setattr(experiment, name, lambda *_, **__: done.pop(0))
        status, table, _ = ran(*arguments)
        assert (status, done, basis in " ".join(table.split())) == (0, [], True)


def test_the_papers_figure_is_drawn_and_written(folders: dict[str, Path], tmp_path: Path) -> None:
    """The confusion of each space in the terminal and as a picture; each neighbour a row; all rows as JSON."""
    run = ["evaluate", "retrieval", folders["clips"], "--answers", tmp_path / "a.csv"]
    _, printed, _ = ran(*run, "--picture", tmp_path / "figure.png")
    head, *rows = (tmp_path / "a.csv").read_text().splitlines()
    for space in ("distances", "positions", "rotations"):
        assert f"Confusion by {space} (raw, actor held out)" in printed
    assert "bendLeft                 100   ·   ·" in printed
    assert head.split(",")[3:9] == ["query", "class", "person", "nearest", "nearest_class", "nearest_product"]
    # Three spaces, two signatures; twelve clips, of which bd's six are the library that mm's six ask.
    assert len(rows) == len({tuple(row.split(",")[:4]) for row in rows}) == 6 * (12 + 12 + 6)
    assert (tmp_path / "figure.png").read_bytes()[:4] == b"\x89PNG"
    scores = _printed(run)
    assert len(scores) == 6 * 3
    assert scores[0]["confusion"]["bendLeft"] == {"bendLeft": 1.0}


def test_answers_and_segments_are_tables(folders: dict[str, Path], tmp_path: Path) -> None:
    """A row for each answer, with truth and the score of each class; a row for each segment, with its share right."""
    takes = read_takes(Sources([folders["takes"]]), Reading(actor_in=ActorIn.NAME))
    library, answers, segments = (tmp_path / name for name in ("first.npz", "answers.csv", "segments.csv"))
    MotionLibrary.of_clips(takes[0].motions()).save(library)
    options = f"--library {library} --map salute=hail --actor-in name --answers {answers} --segments {segments}"
    assert ran(*_arguments(f"stream {{takes}} {options}", folders))[0] == 0
    rows, table = ([*csv.DictReader(path.read_text("utf-8").splitlines())] for path in (answers, segments))
    played = replayed(takes[0], MotionLibrary.load(library), ("clap", "hail", "row"), Settings())
    own = [row for row in rows if row["take"] == played.name]
    for row, answer in zip(own, played.answers, strict=True):
        assert (row["guess"], row["label"]) == (answer.as_dict()["guess"], answer.label)
        assert [float(row[f"score {name}"]) for name in answer.classes] == pytest.approx(answer.scores, abs=1e-6)
    assert {row["truth"] for row in rows} >= {"clap", "hail", "row"}
    right = [row["truth"] == row["guess"] for row in own if row["truth"]]
    performed = [(each["performed"], each["person"]) for each in table[:3]]
    assert performed == [("clap", "ann"), ("hail", "ann"), ("row", "ann")]
    ours = [float(each["right"]) for each in table if each["take"] == played.name]
    assert np.mean(ours) == pytest.approx(np.mean(right), abs=0.1)


def _printed(arguments: Sequence[object]) -> Any:  # noqa: ANN401 - JSON
    status, out, _ = ran(*arguments, "--json")
    assert (status, out.count("\n")) == (0, 1)
    return json.loads(out)


@pytest.mark.parametrize("line", REFUSED)
def test_bad_input_is_one_line(line: str, folders: dict[str, Path]) -> None:
    """What cannot be measured is said in one line, with the option that helps; nothing is printed or written."""
    before = sorted(path for folder in folders.values() for path in folder.rglob("*"))
    status, out, err = ran(*_arguments(line, folders))
    assert (status, out) == (2, "")
    assert REFUSED[line] in err.splitlines()[-1]
    assert sorted(path for folder in folders.values() for path in folder.rglob("*")) == before


@pytest.mark.parametrize("options", [["retrieval", "--picture"], ["stream", "--answers"], ["show", "--answers"]])
def test_no_table_is_written_over_a_library(options: list[str]) -> None:
    """An output named like a library is a mistake."""
    said = ran("evaluate", *options, "mine.npz")[2]
    assert "mine.npz: expected a table or a picture, like a.csv or a.png" in said
