"""`kinespace evaluate retrieval`: the paper's experiment as a person runs it."""

from __future__ import annotations

import csv
import json
import re
from collections import defaultdict
from itertools import combinations
from typing import TYPE_CHECKING

import naive_score
import numpy as np
import pytest
from recorded import SWINGS, write_takes

from kinespace.library import MotionLibrary, find_recordings, read_recordings
from kinespace.tools.cli.main import main
from kinespace.tools.evaluation.retrieval.experiment import (
    Labels,
    Protocol,
    Retrieval,
    Space,
    compare,
    motion_axes,
    retrieve,
)

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from kinespace.library import Clip

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("wide")]

KEYS = {"space", "protocol", "motions", "classes", "nearest", "two_nearest"}
#: Measured independently on 287 of the 288 clips, 1-NN by space and protocol.
REFERENCE = {
    ("distances", "leave-one-out"): 0.958,
    ("distances", "actor-held-out"): 0.906,
    ("distances", "split"): 0.879,
    ("positions", "leave-one-out"): 0.951,
    ("positions", "actor-held-out"): 0.896,
    ("positions", "split"): 0.879,
    ("rotations", "leave-one-out"): 0.840,
    ("rotations", "actor-held-out"): 0.697,
    ("rotations", "split"): 0.677,
}


@pytest.fixture
def cut(tmp_path: Path) -> Path:
    """Write twelve takes: three classes by two actors of either side of the split."""
    folder = tmp_path / "cut"
    folder.mkdir()
    write_takes(folder)
    return folder


def evaluate(*arguments: object) -> int:
    """Run `kinespace evaluate retrieval` in this process."""
    return main(["evaluate", "retrieval", *map(str, arguments)])


def table_rows(printed: str, signature: str = "eigenvector") -> dict[tuple[str, str], list[str]]:
    """Read the table that was printed: motions, nearest, its interval, one of two; by space and protocol."""
    rows = [re.split(" {2,}", line.strip()) for line in printed.splitlines() if line.startswith(tuple(Space))]
    return {(row[0], row[2]): row[3:] for row in rows if row[1] == signature and row[3].isdigit()}


def splits_in(printed: str) -> dict[tuple[str, str], tuple[float, str, float]]:
    """Read the splits' lines of the table, by space and signature: the mean, the worst library, the worst share."""
    told = r"^(\w+) +(\w+) +mean of splits +([\d.]+)%.*\n\1 +\2 +worst: ([a-z ]+?) +([\d.]+)%"
    found = re.findall(told, printed, re.MULTILINE)
    return {(space, signature): (float(mean), actors, float(worst)) for space, signature, mean, actors, worst in found}


@pytest.mark.parametrize("protocol", Protocol)
@pytest.mark.parametrize("space", Space)
def test_the_figures_are_the_librarys(
    space: Space, protocol: Protocol, cut: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The JSON object has its keys, and its figures equal those of the retrieval of the same clips."""
    assert evaluate(cut, "--space", space, "--protocol", protocol, "--json") == 0
    printed = capsys.readouterr().out
    clips = list(read_recordings(sorted(cut.rglob("*.amc"))))
    expected = retrieve(compare(motion_axes(clips, space)), Labels.of_clips(clips), protocol)
    described = json.loads(printed)
    assert set(described) >= KEYS
    assert {key: described[key] for key in KEYS} == {
        "space": space.value,
        "protocol": protocol.value,
        "motions": expected.motions,
        "classes": 3,
        "nearest": round(expected.nearest, 4),
        "two_nearest": round(expected.two_nearest, 4),
    }
    assert printed.count("\n") == 1


def test_json_alone_is_the_papers_own_case(cut: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """By default the JSON object holds the figures of distances, leave one out."""
    assert evaluate(cut, "--json") == 0
    described = json.loads(capsys.readouterr().out)
    assert (described["space"], described["protocol"]) == ("distances", "leave-one-out")
    assert described["motions"] == 12
    assert described["nearest"] == 1.0


def test_a_librarys_motions_are_compared(cut: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With --library the motions of a library are compared, and recordings beside it are refused."""
    file = tmp_path / "mine.npz"
    MotionLibrary.of_clips(read_recordings(find_recordings([cut]))).save(file)
    assert main(["evaluate", "retrieval", "--library", str(file), "--json"]) == 0
    by_library = json.loads(capsys.readouterr().out)
    assert main(["evaluate", "retrieval", str(cut), "--json"]) == 0
    assert by_library["motions"] == json.loads(capsys.readouterr().out)["motions"]
    assert main(["evaluate", "retrieval", str(cut), "--library", str(file)]) == 2
    assert "--library: expected no recordings beside it" in capsys.readouterr().err


def test_the_table_holds_every_case(cut: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Without options the table has a row for every space under every protocol."""
    assert evaluate(cut) == 0
    rows = table_rows(capsys.readouterr().out)
    assert set(rows) == {(space.value, protocol.value) for space in Space for protocol in Protocol}
    assert rows["distances", "leave-one-out"] == ["12", "100.0%", "-", "100.0%"]
    assert rows["distances", "split"][0] == "6"


def test_the_table_holds_the_chosen_spaces_and_protocols(cut: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A space alone gives its three protocols, a protocol alone its three spaces."""
    evaluate(cut, "--space", "positions")
    assert {space for space, _ in table_rows(capsys.readouterr().out)} == {"positions"}
    evaluate(cut, "--protocol", "split")
    rows = table_rows(capsys.readouterr().out)
    assert len(rows) == 3
    assert {protocol for _, protocol in rows} == {"split"}


def test_turning_the_clips_leaves_distances_alone(
    cut: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """With --turned every clip stands elsewhere, by the seed's chance, the distances' figures stay, the title tells."""
    compared: list[NDArray[np.float64]] = []

    def noted(clips: Sequence[Clip], space: Space) -> NDArray[np.float64]:
        compared.append(np.concatenate([clip.positions for clip in clips]))
        return motion_axes(clips, space)

    monkeypatch.setattr("kinespace.tools.evaluation.evaluate_retrieval.motion_axes", noted)
    tables = []
    for options in ((), ("--turned", "--seed", "1"), ("--turned", "--seed", "1"), ("--turned", "--seed", "2")):
        assert evaluate(cut, "--space", "distances", *options) == 0
        printed = capsys.readouterr().out
        assert ("turned and shifted" in " ".join(printed.split())) == bool(options)
        tables.append(table_rows(printed))
    assert tables == [tables[0]] * 4
    plain, once, again, other = compared
    np.testing.assert_array_equal(once, again)
    for moved in (plain, other):
        assert np.abs(once - moved)[:, :, (0, 2)].max(axis=(1, 2)).min() > 0.01
    np.testing.assert_allclose(once[:, :, 1], plain[:, :, 1], atol=1e-9)


def test_the_confusions_are_drawn_and_written(cut: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A picture and a CSV hold three spaces, and distances by the spread; shares of each class performed add up."""
    picture = tmp_path / "confusion.png"
    assert evaluate(cut, "--picture", picture, "--space", "distances", "--json") == 0
    assert json.loads(capsys.readouterr().out)["space"] == "distances"
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert picture.stat().st_size > 10_000
    with picture.with_suffix(".csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 4 * len(SWINGS) ** 2
    shares: dict[tuple[str, ...], float] = defaultdict(float)
    right: dict[str, list[float]] = defaultdict(list)
    for row in rows:
        shares[row["space"], row["signature"], row["performed"]] += float(row["share"])
        if row["performed"] == row["found"]:
            right[row["space"] + row["signature"]].append(float(row["share"]))
    ways = {*((space, "eigenvector") for space in Space), (Space.DISTANCES, "spread")}
    assert set(shares) == {(*way, class_name) for way in ways for class_name in SWINGS}
    assert list(shares.values()) == pytest.approx([1.0] * len(shares), abs=1e-3)
    assert right["distanceseigenvector"] == right["distancesspread"] == [1.0, 1.0, 1.0]


def test_the_csv_is_the_confusion_matrix(cut: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each line of the CSV is the share of a performed class's motions that were taken for a found class."""
    confusion = np.array([[0.5, 0.25, 0.25], [0.0, 1.0, 0.0], [0.125, 0.0, 0.875]])
    right = np.arange(24).reshape(12, 2) % 5 > 0
    outcome = Retrieval(12, 0.8, 0.9, tuple(sorted(SWINGS)), confusion, np.arange(12), right)
    monkeypatch.setattr("kinespace.tools.evaluation.evaluate_retrieval.retrieve", lambda *_: outcome)
    assert evaluate(cut, "--picture", tmp_path / "confusion.png", "--protocol", "split") == 0
    with (tmp_path / "confusion.csv").open(newline="", encoding="utf-8") as file:
        rows = [(row["performed"], row["found"], float(row["share"])) for row in csv.DictReader(file)]
    one_space = [
        (performed, found, confusion[i, j])
        for i, performed in enumerate(outcome.classes)
        for j, found in enumerate(outcome.classes)
    ]
    assert rows == one_space * 4


def test_a_picture_of_no_kind_writes_nothing(cut: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An unknown ending ends with one line, and neither picture nor CSV is left."""
    assert evaluate(cut, "--picture", tmp_path / "confusion.doc") == 2
    error = capsys.readouterr().err
    assert error.startswith("kinespace: ")
    assert error.count("\n") == 1
    assert ", svg, " in error
    assert "got .doc" in error
    assert [path.name for path in tmp_path.iterdir()] == ["cut"]


def test_clips_without_an_actor_are_not_held_out_by_actor(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A clip whose name tells no actor ends a protocol by actors with one line that names the clip."""
    (path,) = write_takes(tmp_path, actors=("bd",), takes=1)[:1]
    (tmp_path / "HDM_bd.asf").rename(tmp_path / "ann.asf")
    path.rename(tmp_path / "ann_7.amc")
    assert evaluate(tmp_path / "ann_7.amc", "--protocol", "actor-held-out") == 2
    error = capsys.readouterr().err
    assert error.startswith("kinespace: ann_7: expected a name that tells the actor, as HDM05's clips have; --actor-in")
    assert error.count("\n") == 1


def test_folders_tell_classes_and_actors(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Clips of other names have their folder's class; without actors one protocol is left, with --actor-in two are."""
    (tmp_path / "cut").mkdir()
    for path in write_takes(tmp_path / "cut"):
        _, actor, _, take, _ = path.stem.split("_")
        path.rename(path.with_name(f"{actor}_{take}.amc"))
    for actor in ("bd", "mm"):
        (tmp_path / "cut" / f"HDM_{actor}.asf").rename(tmp_path / "cut" / f"{actor}.asf")
    for options, protocols in (((), {"leave-one-out"}), (("--actor-in", "name"), set(Protocol))):
        assert evaluate(tmp_path / "cut", *options) == 0
        rows = table_rows(capsys.readouterr().out)
        assert {row[1] for row in rows} == protocols


@pytest.mark.parametrize(("protocol", "actors"), [("actor-held-out", ("bd",)), ("split", ("bd", "bk"))])
def test_a_protocol_without_asking_motions_is_an_error(
    protocol: str, actors: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """With one actor, or with none on the asking side, the error names the protocol."""
    write_takes(tmp_path, actors=actors)
    assert evaluate(tmp_path, "--protocol", protocol, "--json") == 2
    assert protocol in capsys.readouterr().err


# --- all that came out -------------------------------------------------------------------------------------------


def test_json_holds_seconds_and_persons(cut: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Beside the figures stand seconds and persons of the motions that ask, and intervals; of two actors no splits."""
    assert evaluate(cut, "--json", "--protocol", "split") == 0
    described = json.loads(capsys.readouterr().out)
    assert (described["motions"], described["seconds"], described["persons"]) == (6, 9.0, 1)
    assert described["intervals"] == {"nearest": [1.0, 1.0], "two_nearest": [1.0, 1.0]}
    assert described["splits"] is None


def test_intervals_draw_the_asking_motions(
    cut: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """An interval covers the share over motions drawn again, for each figure separately."""
    right = np.array([[index % 2 == 0, index % 4 < 3] for index in range(12)])
    outcome = Retrieval(12, 0.5, 0.75, tuple(sorted(SWINGS)), np.eye(3), np.arange(12), right)
    monkeypatch.setattr("kinespace.tools.evaluation.evaluate_retrieval.retrieve", lambda *_: outcome)
    assert evaluate(cut, "--json") == 0
    intervals = json.loads(capsys.readouterr().out)["intervals"]
    for column, name in enumerate(("nearest", "two_nearest")):
        drawn = naive_score.drawn_again(12, 2012)
        shares = [float(np.multiply(counts, right[:, column]).sum()) / 12 for counts in drawn]
        assert intervals[name] == pytest.approx(naive_score.middle(shares))


def test_five_actors_are_split_in_all_ways(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The mean and the worst of the ten splits equal ten retrievals, and the worst library is named."""
    actors = ("bd", "bk", "dg", "mm", "tr")
    write_takes(tmp_path, actors=actors, takes=1, frames=60)
    clips = [noisy(clip) for clip in read_recordings(sorted(tmp_path.rglob("*.amc")))]
    labels, scores = Labels.of_clips(clips), compare(motion_axes(clips, Space.DISTANCES))
    shares = {library: retrieve(scores, labels, Protocol.SPLIT, library).nearest for library in combinations(actors, 3)}
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("kinespace.tools.evaluation.evaluate_retrieval.read_labelled", lambda *_: clips)
        assert evaluate(tmp_path, "--json", "--protocol", "split") == 0
        described = json.loads(capsys.readouterr().out)["splits"]
        assert evaluate(tmp_path, "--space", "distances") == 0
        told = splits_in(capsys.readouterr().out)
    assert len(set(shares.values())) > 1
    assert described["mean"] == pytest.approx(np.mean(list(shares.values())))
    assert described["worst"] == min(shares.values()) == shares[tuple(described["worst_library"])]
    mean, library, worst = told["distances", "eigenvector"]
    assert library.split() == described["worst_library"]
    assert (mean, worst) == (
        pytest.approx(100 * described["mean"], abs=0.06),
        pytest.approx(100 * described["worst"], abs=0.06),
    )


def noisy(clip: Clip) -> Clip:
    """Shake a clip so that not every neighbour is of its class."""
    generator = np.random.default_rng(sum(map(ord, clip.name)))
    return clip.moved_to(clip.positions + generator.normal(scale=0.5, size=clip.positions.shape))


# --- the paper's figures -----------------------------------------------------------------------------------------


def test_the_built_in_motions_have_the_papers_figures(capsys: pytest.CaptureFixture[str]) -> None:
    """Without a folder the built-in library's motions are asked: figures within a point of the reference."""
    # `test_no_figure_falls` asks by the spread, which takes long.
    assert evaluate("--signature", "eigenvector") == 0
    rows = table_rows(capsys.readouterr().out)
    assert set(rows) == {key for key in REFERENCE if key[0] != "rotations"}
    for key, (_, nearest, _, _) in rows.items():
        assert percent(nearest) == pytest.approx(REFERENCE[key], abs=0.01)


def percent(told: str) -> float:
    """Read a share."""
    return float(told.rstrip("%")) / 100


def test_the_commands_table_is_the_papers(
    hdm05_folder: Path,
    hdm05_clips: tuple[Clip, ...],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """On all 288 clips every figure of the command's table is within a point of the reference; a picture is drawn."""
    monkeypatch.setattr("kinespace.tools.evaluation.evaluate_retrieval.read_labelled", lambda *_: list(hdm05_clips))
    picture = tmp_path / "confusion.svg"
    assert evaluate(hdm05_folder, "--signature", "eigenvector", "--picture", picture) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    rows = table_rows(printed.out)
    assert picture.stat().st_size > 50_000
    with picture.with_suffix(".csv").open(newline="", encoding="utf-8") as file:
        shares = [float(row["share"]) for row in csv.DictReader(file)]
    assert len(shares) % (11 * 11) == 0
    assert sum(shares) == pytest.approx(len(shares) / 11, abs=0.05)
    assert set(rows) == set(REFERENCE)
    nearest = {key: percent(row[1]) for key, row in rows.items()}
    for key, figure in nearest.items():
        assert figure == pytest.approx(REFERENCE[key], abs=0.01)
    assert max(nearest, key=nearest.__getitem__) == ("distances", "leave-one-out")
