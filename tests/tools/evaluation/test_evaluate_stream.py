"""`kinespace evaluate stream`: labelled takes in, figures and pictures out, as a person runs it."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
import pytest
from takes import write_take

from kinespace.library import MotionLibrary, Reading, Skeleton, SkeletonMismatchError, read_recordings
from kinespace.library.recordings import ActorIn, performed
from kinespace.library.recordings.formats import utkinect
from kinespace.library.recordings.formats.labels import Segment, cut, read_labels, renamed
from kinespace.stream.frame import Frame
from kinespace.stream.recognizer import Recognizer, Settings
from kinespace.tools.cli.main import main
from kinespace.tools.evaluation.evaluate_stream import replay, shared_joints
from kinespace.tools.evaluation.takes import Sources, read_takes
from kinespace.tools.feeding.joint_sets import joints_of
from kinespace.tools.terminal import pictures

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from kinespace.tools.evaluation.scoring.timeline import Course

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("wide")]

KEYS = [
    "frame_accuracy",
    "segment_accuracy",
    "known_answered",
    "segments_found",
    "median_delay_s",
    "p90_delay_s",
    "median_seen",
    "median_event_delay_s",
    "false_per_minute",
    "unknown_answered",
    "changes_per_minute",
    "true_changes_per_minute",
    "auc_unknown",
    "classes",
    "segment_majority",
    "false_starts_per_minute",
    "takes_found",
    "known",
    "unknown",
    "containing",
    "intervals",
]
BY_EIGENVECTOR = ("--signature", "paper")
KNOWN = [("clap", 2.5), ("hail", 2.5), ("row", 2.5)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write three takes of three motions; the last also has a motion that no other take has."""
    folder = tmp_path_factory.mktemp("takes")
    write_take(folder, 1, KNOWN)
    write_take(folder, 2, KNOWN[::-1])
    write_take(folder, 3, [KNOWN[1], ("salute", 2.5), KNOWN[0]])
    return folder


@pytest.fixture(scope="module")
def library(folder: Path) -> Path:
    """Build a library of the first take's segments."""
    path = folder / "first.library"
    (take,) = read_recordings([folder / "puppet_01.amc"])
    MotionLibrary.of_clips(cut(take, read_labels(folder / "puppet_01.csv"))).save(path)
    return path


def _evaluate(*arguments: object) -> int:
    return main(["evaluate", "stream", *map(str, arguments)])


def _scored(capsys: pytest.CaptureFixture[str], *arguments: object) -> dict[str, Any]:
    """Run the program with --json, and read its output: one object."""
    assert _evaluate(*arguments, "--json") == 0
    score: dict[str, Any] = json.loads(capsys.readouterr().out)
    return score


def _refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """Run it to its failure; the one line it says."""
    assert _evaluate(*arguments) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    return printed.err


# --- figures -----------------------------------------------------------------------------------------------------


def test_json_has_every_figure_by_its_name(folder: Path, library: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The object has exactly the figures' names, and each class its seconds and shares."""
    score = _scored(capsys, folder, "--library", library)
    assert list(score) == KEYS
    assert list(score["classes"]) == ["clap", "hail", "row"]
    for each in score["classes"].values():
        assert list(each) == ["seconds", "right", "right_inside"]
    figures = set(KEYS) - {"classes", "known", "unknown", "containing", "intervals", "takes_found"}
    assert all(isinstance(score[name], float) for name in figures)
    for name in figures:
        low, high = score["intervals"][name]
        assert low - 1e-9 <= score[name] <= high + 1e-9, name
    assert score["takes_found"] is score["intervals"]["takes_found"] is None
    assert score["known"] == {"seconds": pytest.approx(20.0, abs=0.1), "segments": 8, "persons": None}
    assert score["unknown"]["segments"] == 1
    assert score["classes"]["clap"]["seconds"] == pytest.approx(7.5, abs=0.05)


def test_known_motions_are_found(folder: Path, library: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Takes of the library's own motions, each differently performed, are guessed right once the second is inside."""
    score = _scored(capsys, folder / "puppet_02.amc", "--library", library)
    assert score["segment_accuracy"] > 0.95
    assert score["segments_found"] == 1.0
    assert score["median_delay_s"] < 1.1
    assert score["true_changes_per_minute"] == pytest.approx(2 * 60 / 7.5, rel=0.01)
    assert (score["false_per_minute"], score["unknown_answered"], score["auc_unknown"]) == (None, None, None)


def test_figures_equal_the_take_replayed(folder: Path, library: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Accuracy is the share of the known time in which the take, replayed by hand, was guessed right."""
    score = _scored(capsys, folder / "puppet_03.amc", "--library", library)
    (take,) = read_recordings([folder / "puppet_03.amc"])
    known = MotionLibrary.load(library)
    segments = read_labels(folder / "puppet_03.csv")
    course = replay(take, segments, library=known, classes=known.classes, settings=Settings())
    labels = np.array([segments[int(time / 2.5)].label for time in take.times])
    guesses = np.array(["none", *known.classes])[course.guess + 1]
    performed = np.isin(labels, known.classes)
    assert score["frame_accuracy"] == pytest.approx((guesses == labels)[performed].mean())
    assert score["unknown_answered"] == pytest.approx((course.published >= 0)[~performed].mean())
    assert 0 < performed.mean() < 1


def test_two_runs_are_equal(folder: Path, library: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The same takes have the same figures to the last digit, in every run."""
    for arguments in ([folder / "puppet_03.amc", "--library", library], [folder, "--protocol", "leave-one-take-out"]):
        printed = []
        for _ in range(2):
            assert _evaluate(*arguments, "--json") == 0
            printed.append(capsys.readouterr().out)
        assert printed[0] == printed[1]


def test_without_json_a_person_reads_the_same_figures(
    folder: Path, library: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The table says the shares of --json in per cent, and names every class."""
    score = _scored(capsys, folder, "--library", library)
    assert _evaluate(folder, "--library", library) == 0
    printed = capsys.readouterr().out
    for name in ("frame_accuracy", "segment_accuracy", "unknown_answered"):
        assert f"{score[name]:.1%}" in printed
    assert f"{score['median_delay_s']:.2f} s" in printed
    assert all(name in printed for name in score["classes"])


# --- leave one take out ------------------------------------------------------------------------------------------


def test_each_take_is_recognised_by_the_others(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Leaving one take out is evaluating it with a library of the others' segments; alone known in it is unknown."""
    score = _scored(capsys, folder, "--protocol", "leave-one-take-out")
    paths = [folder / f"puppet_0{number}.amc" for number in (1, 2, 3)]
    takes = [
        (take, read_labels(path.with_suffix(".csv"))) for path, take in zip(paths, read_recordings(paths), strict=True)
    ]
    right, known, answered, unknown = 0, 0, 0, 0
    for index, (take, segments) in enumerate(takes):
        others = [clip for other, each in enumerate(takes) if other != index for clip in cut(*each)]
        library = MotionLibrary.of_clips(others)
        course = replay(take, segments, library=library, classes=library.classes, settings=Settings())
        right += int(((course.guess == course.truth) & (course.truth >= 0)).sum())
        known += int((course.truth >= 0).sum())
        answered += int(((course.published >= 0) & (course.truth < 0)).sum())
        unknown += int((course.truth < 0).sum())
    assert score["frame_accuracy"] == pytest.approx(right / known)
    assert unknown == 300
    assert score["unknown_answered"] == pytest.approx(answered / unknown)
    assert "salute" not in score["classes"]


def test_a_single_take_cannot_be_left_out(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Leaving the only take out leaves no library; the error says so."""
    told = _refused(capsys, folder / "puppet_01.amc", "--protocol", "leave-one-take-out")
    assert "--protocol leave-one-take-out: expected at least two labelled takes, got 1" in told


# --- by person ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def persons(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a take of each of three persons; one performs a motion that no other person performs."""
    folder = tmp_path_factory.mktemp("persons")
    write_take(folder, 1, KNOWN, person="ann")
    write_take(folder, 1, KNOWN[::-1], person="ben")
    write_take(folder, 1, [KNOWN[1], ("salute", 2.5), KNOWN[0]], person="cid")
    return folder


def _replayed(folder: Path, asking: str, library_of: Sequence[str]) -> Course:
    """Replay a person's take, recognised by motions cut from the others' takes."""
    paths = sorted(folder.glob("*.amc"))
    takes = {
        path.stem.partition("_")[0]: (performed(take, path, ActorIn.NAME), read_labels(path.with_suffix(".csv")))
        for path, take in zip(paths, read_recordings(paths), strict=True)
    }
    library = MotionLibrary.of_clips([clip for person in library_of for clip in cut(*takes[person])])
    classes = ("clap", "hail", "row", "salute")
    return replay(*takes[asking], library=library, classes=classes, settings=Settings())


def _right(courses: Sequence[Course]) -> float:
    known = [course.truth >= 0 for course in courses]
    right = [(course.guess == course.truth)[each] for course, each in zip(courses, known, strict=True)]
    return float(np.concatenate(right).mean())


def test_each_person_is_recognised_by_the_others(persons: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Leaving a person out, the figures equal those of a replay with the others' library."""
    score = _scored(capsys, persons, "--protocol", "leave-one-person-out", "--actor-in", "name")
    everybody = ["ann", "ben", "cid"]
    courses = {
        asking: _replayed(persons, asking, [each for each in everybody if each != asking]) for asking in everybody
    }
    assert score["frame_accuracy"] == pytest.approx(_right(list(courses.values())))
    shares = [_right([courses[person]]) for person in everybody]
    assert [score["persons"][person]["frame_accuracy"] for person in everybody] == pytest.approx(shares)
    assert score["mean"]["frame_accuracy"] == pytest.approx(np.mean(shares))
    assert score["worst"]["frame_accuracy"] == pytest.approx(min(shares))
    assert score["known"] == {"seconds": pytest.approx(20.0, abs=0.1), "segments": 8, "persons": 3}
    assert list(score) == [*KEYS, "persons", "mean", "worst"]


def test_each_person_recognises_the_others(persons: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The library of each person is asked by the two others; a segment asked of two libraries counts once."""
    score = _scored(capsys, persons, "--protocol", "one-person", "--actor-in", "name")
    everybody = ["ann", "ben", "cid"]
    courses = {
        person: [_replayed(persons, asking, [person]) for asking in everybody if asking != person]
        for person in everybody
    }
    shares = [_right(courses[person]) for person in everybody]
    assert [score["persons"][person]["frame_accuracy"] for person in everybody] == pytest.approx(shares)
    assert (score["mean"]["frame_accuracy"], score["worst"]["frame_accuracy"]) == (
        pytest.approx(np.mean(shares)),
        pytest.approx(min(shares)),
    )
    assert (score["known"]["segments"], score["known"]["persons"]) == (8, 3)
    worst = max(score["persons"][person]["unknown_answered"] or 0.0 for person in everybody)
    assert score["worst"]["unknown_answered"] == pytest.approx(worst)
    assert score["mean"]["takes_found"] is score["worst"]["takes_found"] is None


def test_a_person_reads_every_persons_figures(persons: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The table has a line for each person, one for the mean and one for the worst, shares in per cent."""
    options = ("--protocol", "leave-one-person-out", "--actor-in", "name")
    score = _scored(capsys, persons, *options)
    assert _evaluate(persons, *options) == 0
    lines = {line.split()[0]: line.split()[1:] for line in capsys.readouterr().out.splitlines() if line.split()}
    shown = ("frame_accuracy", "segment_accuracy", "segment_majority")
    for name in ("ann", "ben", "cid"):
        assert lines[name][:3] == [f"{score['persons'][name][figure]:.1%}" for figure in shown]
    for name in ("mean", "worst"):
        assert lines[name][:3] == [f"{score[name][figure]:.1%}" for figure in shown]


def test_the_library_may_ask_itself(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Without takes the library's own motions are asked, each a stream, of others' motions; never of themselves."""
    builtin = MotionLibrary.builtin()
    wanted = [each for each in builtin.motions if each.class_name in ("grabHighR", "squat1Reps")]
    few = replace(builtin, motions=tuple(each for each in wanted if each.actor in ("bd", "mm"))[::3])
    monkeypatch.setattr(MotionLibrary, "builtin", lambda: few)
    score = _scored(capsys, "--protocol", "one-person")
    assert score["known"]["segments"] == len(few)
    assert score["known"]["seconds"] == pytest.approx(sum(each.duration for each in few.motions))
    assert set(score["persons"]) == {"bd", "mm"}
    assert score["segment_majority"] > 0.8
    assert score["true_changes_per_minute"] == 0.0
    kept = _scored(capsys, "--protocol", "leave-one-take-out", "--subjects", "mm")
    assert kept["known"]["persons"] == 1
    assert "expected takes with --protocol library, got none" in _refused(capsys)


# --- takes without known motions, and takes whose labels have no times -------------------------------------------


def test_of_unknown_takes_all_the_time_counts(
    folder: Path, library: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A take without labels counts as unknown from its first frame to its last."""
    path = write_take(tmp_path, 3, [("salute", 2.5), ("hail", 2.5)], labelled=False)
    score = _scored(capsys, "--unknown", path, "--library", library)
    (take,) = read_recordings([path])
    known = MotionLibrary.load(library)
    course = replay(take, [Segment(0.0, 5.0, "other")], library=known, classes=known.classes, settings=Settings())
    assert score["unknown_answered"] == pytest.approx((course.published >= 0).mean())
    assert score["unknown_answered"] > 0.2
    assert score["unknown"] == {"seconds": pytest.approx(600 / 120), "segments": 1, "persons": None}
    assert (score["frame_accuracy"], score["known"]["segments"], score["classes"]) == (None, 0, {})
    both = _scored(capsys, folder / "puppet_01.amc", "--unknown", path, "--library", library)
    assert (both["known"]["segments"], both["unknown"]["segments"]) == (3, 1)
    assert both["auc_unknown"] is not None


def test_tables_of_takes(folder: Path, library: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A take is found when its class is named at some time, one without any is unknown, a doubtful one left out."""
    table = folder / "takes.list"
    table.write_text(
        "file,subject,contains,perhaps,kind\n"
        "puppet_02.amc,1,row,,x\n"
        'puppet_02.amc,1,"clap,hail",row,x\n'
        "puppet_03.amc,2,fly,,x\n"
        "puppet_03.amc,2,,clap,x\n"
        "puppet_03.amc,3,,,x\n"
    )
    score = _scored(capsys, "--takes", table, "--library", library)
    assert score["takes_found"] == 1.0
    assert score["containing"] == {"seconds": pytest.approx(2 * 7.5, abs=0.1), "segments": 2, "persons": 1}
    assert score["unknown"] == {"seconds": pytest.approx(7.5, abs=0.1), "segments": 1, "persons": 1}
    assert score["unknown_answered"] > 0.4
    chosen = _scored(capsys, "--takes", table, "--library", library, "--without-subjects", "1", "2")
    assert (chosen["takes_found"], chosen["unknown"]["segments"]) == (None, 1)
    renamed_to = _scored(capsys, "--takes", table, "--library", library, "--subjects", "2", "--map", "fly=row")
    assert renamed_to["containing"]["segments"] == 1
    assert "expected a label that is a class" in _refused(
        capsys, "--takes", table, "--library", library, "--subjects", "2"
    )
    assert _evaluate("--takes", table, "--library", library) == 0
    printed = capsys.readouterr().out
    assert "takes that contain a class: 15 s, 2 takes, 1 person" in printed
    assert "unknown motions: 8 s, 1 segment, 1 person" in printed
    assert "\nknown motions" not in printed
    drawn = ("--confusion", folder / "drawn.svg")
    found = (*("--takes", table), *("--library", library), *("--subjects", "1"))
    assert "--confusion: expected takes with labels" in _refused(capsys, *found, *drawn)
    assert not drawn[1].exists()


# --- sensors that skip frames ------------------------------------------------------------------------------------


def test_a_sensors_frames_come_at_their_own_times(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """UTKinect's takes are cut, replayed at their own times, and scored by person."""
    told = list[str]()
    for person in (1, 2, 3):
        generator = np.random.default_rng(person)
        body = np.random.default_rng(0).normal(size=(20, 3))
        kept = np.flatnonzero(generator.random(241) < 0.6)
        lines = []
        for frame in kept:
            moved = body.copy()
            joint, axis = (7, 0) if frame < 120 else (11, 1)
            moved[joint, axis] += 0.3 * np.sin(frame / (5 + person))
            lines.append(" ".join(map(str, (frame + 100, *moved.reshape(-1)))))
        (tmp_path / f"joints_s0{person}_e01.txt").write_text("\n".join(lines))
        told += [f"s0{person}_e01", "push: 100 220", "pull: 220 340", "carry: NaN NaN"]
    (tmp_path / "actionLabel.txt").write_text("\n".join(told))
    score = _scored(capsys, tmp_path, "--protocol", "leave-one-person-out")
    assert list(score["persons"]) == ["s01", "s02", "s03"]
    assert list(score["classes"]) == ["pull", "push"]
    assert score["known"]["segments"] == 6
    assert score["segment_majority"] == 1.0
    takes = read_takes(Sources([tmp_path]), Reading())
    library = MotionLibrary.of_clips([motion for take in takes[1:] for motion in take.motions()])
    frames = utkinect.read_frames(tmp_path / "joints_s01_e01.txt")
    by_hand, lasts, guess = list[bool](), list[int](), None
    recognizer = Recognizer(library, Settings())
    numbers = frames.numbers.tolist()
    for number, after, positions in zip(numbers, [*numbers[1:], 340], frames.positions, strict=True):
        answer = recognizer.push(Frame("p", number / 30, positions))
        if answer is not None:
            guess = answer.classes[answer.best] if answer.guess_index >= 0 else None
        if number < 340:
            by_hand.append(guess == ("push" if number < 220 else "pull"))
            lasts.append(min(after, 220 if number < 220 else 340) - number)
    assert score["persons"]["s01"]["frame_accuracy"] == pytest.approx(np.average(by_hand, weights=lasts))


# --- labels and names --------------------------------------------------------------------------------------------


def test_labels_may_lie_elsewhere(
    folder: Path, library: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Labels given by --labels, in the takes' order, count like labels beside the takes."""
    beside = _scored(capsys, folder / "puppet_01.amc", folder / "puppet_02.amc", "--library", library)
    files = []
    for number in (1, 2):
        take = folder / f"puppet_0{number}.amc"
        files.append(tmp_path / f"{number}.labels.csv")
        files[-1].write_bytes(take.with_suffix(".csv").read_bytes())
    takes = (folder / "puppet_01.amc", folder / "puppet_02.amc")
    assert _scored(capsys, *takes, "--library", library, "--labels", *files) == beside
    assert _scored(capsys, *takes, "--library", library, "--labels", *files[::-1]) != beside


def test_as_many_labels_as_takes(folder: Path, library: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Labels for another number of takes are refused, and the error says both numbers."""
    told = _refused(capsys, folder, "--library", library, "--labels", folder / "puppet_01.csv")
    assert told == "kinespace: --labels: expected one for each of 3 takes, got 1\n"


def test_a_take_without_labels_is_named(library: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A take beside which no labels lie is an error that names the missing file."""
    take = write_take(tmp_path, 9, KNOWN, labelled=False)
    assert "puppet_09.csv" in _refused(capsys, take, "--library", library)


def test_labels_are_renamed_to_classes(folder: Path, library: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A label mapped to a class counts as that class: an unknown motion is then known, and guessed wrong."""
    plain = _scored(capsys, folder / "puppet_03.amc", "--library", library)
    mapped = _scored(capsys, folder / "puppet_03.amc", "--library", library, "--map", "salute=row", "hail=hail")
    assert plain["unknown_answered"] is not None
    assert mapped["unknown_answered"] is None
    assert set(mapped["classes"]) - set(plain["classes"]) == {"row"}
    assert renamed(read_labels(folder / "puppet_03.csv"), {"salute": "row"})[1].label == "row"


@pytest.mark.parametrize("mapping", ["salute", "=row", "salute=", "="])
def test_a_mapping_is_a_label_and_a_class(mapping: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A mapping without a label, a class or the sign between them is refused with the expectation."""
    with pytest.raises(SystemExit) as refused:
        _evaluate(folder, "--map", mapping)
    assert refused.value.code == 2
    assert f"expected LABEL=CLASS, got {mapping!r}" in capsys.readouterr().err


def test_takes_of_another_body_are_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The built-in library cannot recognise a body of six joints; the error is one line."""
    assert "joint" in _refused(capsys, folder)


def test_bodies_meet_over_the_joints_that_all_have(capsys: pytest.CaptureFixture[str]) -> None:
    """Takes of two skeletons and a library are compared over their shared joints, and the lost ones are told."""
    joints = joints_of("kinect1")
    assert shared_joints([Skeleton(joints), Skeleton((*joints[::-1], "tail"))]) == joints
    assert capsys.readouterr().err == "20 joints that all takes and the library have; without tail\n"
    assert shared_joints([Skeleton(joints), Skeleton(joints[::-1])]) == joints
    assert not capsys.readouterr().err
    with pytest.raises(SkeletonMismatchError, match="at least 5 that all takes and the library have, got 4"):
        shared_joints([Skeleton(joints), Skeleton(joints[:4])])


@pytest.mark.parametrize(
    ("mapped", "message"),
    [
        ("clap=fly", "--map: expected one of "),
        ("fly=clap", "got 'fly'"),
    ],
)
def test_a_mapping_that_maps_nothing_is_refused(
    folder: Path, library: Path, mapped: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """A class the library has not, or a label no take has, is named: else every figure would silently be another."""
    assert message in _refused(capsys, folder / "puppet_02.amc", "--library", library, "--map", mapped)


def test_the_error_for_a_take_without_labels_names_the_option(
    folder: Path, library: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """When no labels lie beside a take, the line says where they were looked for and which option names others."""
    (tmp_path / "alone.amc").write_bytes((folder / "puppet_02.amc").read_bytes())
    told = _refused(capsys, tmp_path / "alone.amc", "--library", library)
    assert "alone.csv: no labels for alone.amc; --labels says where they are" in told


def test_settings_reach_the_recogniser(folder: Path, library: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Another paper's window changes the figures; settings that do not apply are refused."""
    take = folder / "puppet_02.amc"
    scores = [
        _scored(capsys, take, "--library", library, *options)
        for options in ((), (*BY_EIGENVECTOR, "--window", "1.5"), (*BY_EIGENVECTOR, "--window", "0.15"))
    ]
    assert len({json.dumps(score, sort_keys=True) for score in scores}) == 3
    assert "--window: expected --signature paper" in _refused(capsys, take, "--library", library, "--window", "1.5")


# --- pictures ----------------------------------------------------------------------------------------------------


def _texts(path: Path) -> Sequence[str]:
    drawn = path.read_text(encoding="utf-8")
    return [part.split("</text>")[0].rsplit(">", 1)[-1] for part in drawn.split("<text")[1:]]


def test_pictures_show_takes_labels_and_answers(
    folder: Path, library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The timeline names each take, every segment in it and each colour; the confusion each label; figures stay."""
    monkeypatch.setitem(mpl.rcParams, "svg.fonttype", "none")
    timeline, shares = tmp_path / "timeline.svg", tmp_path / "confusion.svg"
    plain = _scored(capsys, folder, "--library", library)
    assert _scored(capsys, folder, "--library", library, "--timeline", timeline, "--confusion", shares) == plain
    texts = _texts(timeline)
    assert [texts.count(f"puppet_0{number}") for number in (1, 2, 3)] == [1, 1, 1]
    assert [texts.count(name) for name in ("clap", "hail", "row", "salute")] == [3 + 1, 3 + 1, 2 + 1, 1]
    assert texts.count("performed") == texts.count("published") == texts.count("event") == 3
    texts = _texts(shares)
    assert [texts.count(name) for name in ("clap", "hail", "row", "salute", "none")] == [2, 2, 2, 1, 1]


def test_pictures_depend_on_the_answers(folder: Path, library: Path, tmp_path: Path) -> None:
    """Pictures are of some size, the same for the same answers and others for others."""
    files = {}
    for name, options in {"once": (), "again": (), "other": (*BY_EIGENVECTOR, "--window", "0.15")}.items():
        files[name] = (tmp_path / f"{name}.png", tmp_path / f"{name}_shares.png")
        drawn = ("--timeline", files[name][0], "--confusion", files[name][1])
        assert _evaluate(folder / "puppet_03.amc", "--library", library, *drawn, *options) == 0
    for once, again, other in zip(*files.values(), strict=True):
        assert once.read_bytes().startswith(b"\x89PNG")
        assert once.stat().st_size > 8000
        assert once.read_bytes() == again.read_bytes()
        assert once.read_bytes() != other.read_bytes()


@pytest.mark.parametrize("track", ["published", "event", "score"])
def test_the_timeline_shows_each_track(track: str, folder: Path, library: Path, tmp_path: Path) -> None:
    """Takes with other answers, events or scores have other pictures."""
    (take,) = read_recordings([folder / "puppet_02.amc"])
    known = MotionLibrary.load(library)
    segments = read_labels(folder / "puppet_02.csv")
    course = replay(take, segments, library=known, classes=known.classes, settings=Settings())
    without = replace(course, **{track: np.full_like(getattr(course, track), -1)})
    for name, each in {"with": course, "without": without}.items():
        pictures.draw_timelines(tmp_path / f"{name}.png", [each], known.classes)
    assert (tmp_path / "with.png").read_bytes() != (tmp_path / "without.png").read_bytes()
