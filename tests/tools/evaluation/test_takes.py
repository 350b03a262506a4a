"""Takes and shows that are evaluated, gestures that teach, retrieval, and what is learned of the unknown."""

import argparse
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import naive
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from programs import SMALL_CLASSES, motions_of, ran, small_library
from synthetic import stick_clip
from written import trc_text, write_take

from kinespace.library import NOTHING, Clip, MotionLibrary, Reading, distance_rows
from kinespace.library.recordings import ActorIn
from kinespace.library.recordings.formats.labels import LabelError, Segment
from kinespace.library.windows.rejection import Evidence
from kinespace.stream import Settings
from kinespace.tools.evaluation import evaluate_retrieval as paper
from kinespace.tools.evaluation import evaluate_show
from kinespace.tools.evaluation.evaluate_gestures import example_of, first_of, listened, moved
from kinespace.tools.evaluation.evaluate_retrieval import Labels, RetrievalProtocol, candidates, retrieve
from kinespace.tools.evaluation.evaluate_show import lengths_of
from kinespace.tools.evaluation.harness import Sources, Take, read_takes
from kinespace.tools.evaluation.learn import WeighedWindows, fitted
from kinespace.tools.teaching.lessons import open_taught

BY_NAME = Reading(actor_in=ActorIn.NAME)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Write three takes of two persons."""
    write_take(tmp_path, 1, [("clap", 1.0), ("row", 1.0)], person="ann")
    write_take(tmp_path, 2, [("row", 1.0)], person="ann")
    write_take(tmp_path, 1, [("hail", 1.0)], person="ben")
    return tmp_path


def _names(takes: list[Take]) -> list[str]:
    return [take.clip.name for take in takes]


# --- labelled takes ----------------------------------------------------------------------------------------------


def test_labelled_takes_have_their_segments_and_persons(folder: Path) -> None:
    """Labels beside a take are its segments, and its path names its person if asked for."""
    takes = read_takes(Sources([folder]), BY_NAME)
    assert _names(takes) == ["ann_01", "ann_02", "ben_01"]
    assert takes[0].segments == (Segment(0.0, 1.0, "clap"), Segment(1.0, 2.0, "row"))
    assert [take.person for take in takes] == ["ann", "ann", "ben"]
    assert [take.person for take in read_takes(Sources([folder]), Reading())] == [""] * 3
    assert all(take.is_known and take.contains == () and take.delivered is None for take in takes)


# --- clips -------------------------------------------------------------------------------------------------------


def test_other_clips_are_of_their_folders_class(tmp_path: Path) -> None:
    """With --clips the folder is the class; clips of one name are numbered."""
    for class_name in ("clap", "row"):
        (tmp_path / class_name).mkdir()
        write_take(tmp_path / class_name, 1, [(class_name, 0.5)], person="ann", labelled=False)
    takes = read_takes(Sources([tmp_path], clips=True), BY_NAME)
    found = [(take.clip.name, take.labels, take.person) for take in takes]
    assert found == [("ann_01", {"clap"}, "ann"), ("ann_01 (2)", {"row"}, "ann")]
    with pytest.raises(FileNotFoundError, match=r"ann_01.csv: no labels for ann_01.amc; --clips "):
        read_takes(Sources([tmp_path]), BY_NAME)


# --- tables ------------------------------------------------------------------------------------------------------

HEADER = "file,subject,seconds,contains,perhaps\n"


def _table(folder: Path, text: str) -> Path:
    path = folder / "takes.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_table_lists_the_classes_in_takes(folder: Path) -> None:
    """One with classes contains them, one without any is unknown, one that might contain some is left out."""
    rows = 'ann_01.amc,7,2,"clap, row",hail\nann_02.amc,7,1,,row\nben_01.amc,8,1,,\n'
    takes = read_takes(Sources(tables=[_table(folder, HEADER + rows)], names={"row": "pull"}), Reading())
    assert [(take.clip.name, take.person, take.contains, take.segments) for take in takes] == [
        ("ann_01", "7", ("clap", "pull"), ()),
        ("ben_01", "8", (), (Segment(0.0, 1.0, NOTHING),)),
    ]
    with pytest.raises(LabelError, match=r"takes.csv:2: expected the name of a file, got none"):
        read_takes(Sources(tables=[_table(folder, HEADER + ",7,1,clap,\n")]), Reading())


@pytest.mark.parametrize("rate", [30.0, 120.0])
def test_a_segment_is_cut_to_its_movement(rate: float) -> None:
    """A second of movement in five of standing is kept, with an eighth of a second before and a sixth behind it."""
    times = np.arange(round(6 * rate)) / rate
    positions = np.zeros((len(times), 6, 3)) + np.clip(times - 3.0, 0.0, 1.0)[:, None, None]
    clip = replace(stick_clip("bow", frames=len(times), rate=rate), positions=positions + np.eye(6, 3))
    first, last = moved(clip, Segment(1.0, 6.0, "bow"))
    assert first / rate == pytest.approx(3.0 - 0.13, abs=0.08)
    assert last / rate == pytest.approx(4.0 + 0.17, abs=0.08)
    assert example_of(Take(clip, ()), Segment(1.0, 6.0, "bow")).frames == last - first
    assert moved(clip, Segment(5.0, 6.0, "bow")) == (round(5 * rate), round(6 * rate))


def test_segments_that_teach_do_not_ask() -> None:
    """A squat is asked behind the one that teaches: words in the first and in a repeated command count neither way."""
    names = ("squat1Reps", "rotateArmsBothBackward1Reps", "kickLFront1Reps")
    squat, arms, other = (motions_of(name)[0] for name in names)
    order = [squat, arms, other, arms, squat]
    labels = ["squat", "arms", "kick", "repeated", "squat"]
    ends = np.cumsum([each.duration for each in order]).tolist()
    segments = tuple(map(Segment, [0.0, *ends[:-1]], ends, labels))
    clip = replace(squat, positions=np.concatenate([each.positions for each in order]), rotations=np.zeros((0, 0)))
    take = Take(clip, segments)
    lessons = first_of([take])
    index = open_taught(MotionLibrary.of_clips([example_of(*each) for each in lessons.values()]))
    heard = listened(take, index, lessons, Settings())
    assert (heard.segments, heard.asked, heard.person) == ([segments[4]], 1, "bd")
    assert heard.seconds == pytest.approx(squat.duration)
    assert heard.right("start") == 1
    assert {each.right for each in heard.verdicts["start"] if each.said.at < segments[4].start - 0.001} == {None}


def test_a_show_is_drawn_again_alike(builtin: MotionLibrary) -> None:
    """The same seed gives the same show, another one another; examples are not asked, gestures come every 25 s."""
    options = [argparse.Namespace(seed=seed, gestures=3, examples=1, minutes=2.0) for seed in (0, 0, 1)]
    show, again, other = (evaluate_show.drawn(builtin, [], each, 1) for each in options)
    np.testing.assert_array_equal(show.positions, again.positions)
    assert show.segments == again.segments
    assert [each.name for each in other.examples] != [each.name for each in show.examples]
    assert show.performer == builtin.actors[1] == show.examples[0].actor
    assert len({each.class_name for each in show.examples}) == len(show.examples) == 3
    assert len(show.segments) == 4
    assert {each.label for each in show.segments} <= {each.class_name for each in show.examples}
    ends = [0.0, *(each.end for each in show.segments)]
    pauses = [each.start - end for each, end in zip(show.segments, ends, strict=False)]
    assert min(pauses) >= 25.0
    for segment in show.segments:
        shown = show.positions[round(segment.start * 60) : round(segment.end * 60)]
        lengths = [lengths_of(each, builtin.skeleton.parents) for each in (shown, show.examples[0].positions)]
        np.testing.assert_allclose(*lengths, atol=0.02)


def test_beside_the_library_neither_its_classes_nor_the_performer_teach(
    builtin: MotionLibrary, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The show's examples are the only motions of their classes, and of nobody's name; no other is the performer's."""
    show = evaluate_show.drawn(builtin, [], argparse.Namespace(seed=0, gestures=3, examples=1, minutes=0.1), 0)
    monkeypatch.setattr(evaluate_show.harness, "answers_to", lambda _, index, __: [*index.library.motions])
    compared = evaluate_show.played(show, Settings(), beside=True)
    taught = [each for each in compared if each.class_name in {shown.class_name for shown in show.examples}]
    assert [(each.actor, each.frames) for each in taught] == [("", each.frames) for each in show.examples]
    assert {each.class_name for each in compared} == {*builtin.classes}
    assert {each.actor for each in compared} == {*builtin.actors, ""} - {show.performer}


# --- the paper's experiment: its counting against loops and sorted lists ----------------------------------------------


@pytest.mark.parametrize("space", list(paper.Space))
def test_axes_equal_the_papers_svd(some_clips: tuple[Clip, ...], space: paper.Space) -> None:
    """In each space a motion's axis is the first of the SVD of its numbers, centred or raw, whatever its sign."""
    generator = np.random.default_rng(3)
    turning = [replace(clip, rotations=generator.normal(size=(clip.frames, 59))) for clip in some_clips[:4]]
    ways = (paper.signatures_of(turning, space, kind) for kind in paper.SignatureKind)
    for clip, axis, raw in zip(turning, *ways, strict=True):
        numbers = {
            paper.Space.DISTANCES: distance_rows(clip.positions, clip.skeleton),
            paper.Space.POSITIONS: clip.positions.reshape(clip.frames, 93),
            paper.Space.ROTATIONS: clip.rotations,
        }
        assert abs(axis @ naive.first_axis_by_svd(numbers[space])) == pytest.approx(1.0, abs=1e-9)
        assert abs(raw @ np.linalg.svd(numbers[space])[2][0]) == pytest.approx(1.0, abs=1e-9)


@given(st.integers(0, 2**32 - 1), st.integers(3, 14), st.sampled_from(list(RetrievalProtocol)))
def test_any_outcome_equals_sorted_lists(seed: int, motions: int, protocol: RetrievalProtocol) -> None:
    """For any scores, with ties, and any labels the outcome equals a count over sorted Python lists."""
    generator = np.random.default_rng(seed)
    scores = generator.integers(0, 5, size=(motions, motions)) / 4.0
    actors = np.array(["bd", "bk", "tr", *generator.choice(["bd", "bk", "tr"], motions - 3)])
    labels = Labels(generator.choice(["bow", "jump", "wave"], motions), actors)
    found = retrieve(scores, labels, candidates(labels, protocol))
    tally = naive.retrieval(scores, labels.classes.tolist(), actors.tolist(), protocol)
    assert len(found.asking) == len(tally)
    assert [each.value() for each in found.shares.values()] == pytest.approx(np.mean(tally, axis=0))


@pytest.mark.parametrize("protocol", [RetrievalProtocol.ACTOR_HELD_OUT, RetrievalProtocol.SPLIT])
def test_a_protocol_in_which_nobody_asks_is_refused(protocol: RetrievalProtocol) -> None:
    """With one actor alone no motion has another to be compared with."""
    labels = Labels(np.array(["bow", "bow", "jump"]), np.array(["bd"] * 3))
    with pytest.raises(ValueError, match="--protocol: expected a motion that may be compared with two others"):
        retrieve(np.eye(3), labels, candidates(labels, protocol))


# --- learn: what is taken for a motion that is not known --------------------------------------------------------------


_CLASSES = ("squat1Reps", "kickLFront1Reps")


def _windows(leads: Sequence[float], guess: str = "a") -> list[tuple[Evidence, str]]:
    """Make windows of one guess with these leads, by one group of parts."""
    return [(Evidence((0.0,), (float(lead),)), guess) for lead in leads]


@pytest.mark.slow
def test_the_fit_tells_two_kinds_of_windows_apart() -> None:
    """Windows with a clear lead are known, windows with none are not; a class often guessed wrongly gets a malus."""
    generator = np.random.default_rng(1)
    known, unknown = _windows(1.0 + generator.normal(0, 0.1, 50)), _windows(generator.normal(0, 0.1, 50), "b")
    lessons = [WeighedWindows(known, is_known=True, weight=1.0), WeighedWindows(unknown, is_known=False, weight=1.0)]
    rejection = fitted(lessons, ("a", "b"), 0.3)
    assert all(rejection.logit(*window) > 0 for window in known)
    assert all(rejection.logit(*window) < 0 for window in unknown)
    assert rejection.biases["a"] > rejection.biases["b"]


@pytest.fixture(scope="module")
def takes_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Motions of two persons as takes: squats are known, sneaking is not."""
    folder = tmp_path_factory.mktemp("takes")
    table = "file,subject,contains,perhaps\n"
    for name, contains in (("squat1Reps", "squat1Reps"), ("sneak2StepsLStart", "")):
        for actor in ("mm", "tr"):
            clip = motions_of(name, actor)[0]
            text = trc_text(clip.skeleton.joints, clip.positions, rate=clip.frame_rate, unit="m")
            (folder / f"{name}_{actor}.trc").write_text(text, encoding="utf-8")
            table += f"{name}_{actor}.trc,{actor},{contains},\n"
    (folder / "takes.csv").write_text(table, encoding="utf-8")
    return folder / "takes.csv"


@pytest.mark.slow
def test_a_library_of_one_person_is_taught_by_its_other_motions(takes_file: Path, tmp_path: Path) -> None:
    """Its own motions are named, strangers' sneaking is named as seldom as a rate says; single examples are refused."""
    several = small_library().without(classes=[name for name in SMALL_CLASSES if name not in _CLASSES])
    own = several.without(actors=several.actors[1:])
    arguments = ["learn", tmp_path / "own.npz", "--takes", takes_file, "--json", "-o"]
    own.save(tmp_path / "own.npz")
    printed = json.loads(ran(*arguments, tmp_path / "learned.npz")[1])
    assert all(each["unknown_named"] <= each["rate"] + 1e-9 for each in printed)
    learned = MotionLibrary.load(tmp_path / "learned.npz")
    assert learned.actors == several.actors[:1]
    assert learned.learned
    assert printed[-1]["takes_found"] == 1
    single = own.without(motions=[each for each in own.motions if each.class_name == _CLASSES[0]][1:])
    single.save(tmp_path / "own.npz")
    status, _, said = ran(*arguments, tmp_path / "single.npz")
    assert (status, f"got one of {_CLASSES[0]}" in said) == (2, True)
