"""`kinespace evaluate noise`: motions with noise through a recogniser whose library does not hold them."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import naive_score
import numpy as np
import pytest
from recorded import SWINGS, write_takes

from kinespace.library import MotionLibrary
from kinespace.stream.frame import Frame
from kinespace.stream.recognizer import Recognizer, Settings
from kinespace.tools.cli.main import main
from kinespace.tools.evaluation import evaluate_noise

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.slow

SHARES = ("answers_right", "answers_guessed", "clips_right", "clips_guessed")


@pytest.fixture(scope="module")
def few() -> MotionLibrary:
    """Give three motions each of three classes of the built-in library."""
    library = MotionLibrary.builtin()
    wanted = ("grabHighR", "squat1Reps", "jogLeftCircle4StepsRstart")
    motions = [[each for each in library.motions if each.class_name == name][::6][:3] for name in wanted]
    return replace(library, motions=tuple(each for some in motions for each in some))


@pytest.fixture
def _few_built_in(few: MotionLibrary, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(MotionLibrary, "builtin", lambda: few)


def _evaluate(*arguments: object) -> int:
    return main(["evaluate", "noise", *map(str, arguments)])


def _scored(capsys: pytest.CaptureFixture[str], *arguments: object) -> dict[str, Any]:
    assert _evaluate(*arguments, "--json") == 0
    score: dict[str, Any] = json.loads(capsys.readouterr().out)
    return score


@pytest.mark.usefixtures("_few_built_in")
def test_figures_equal_a_replay_by_hand(few: MotionLibrary, capsys: pytest.CaptureFixture[str]) -> None:
    """Each motion, at 30 frames a second and with its own noise, is answered by a library without its group."""
    score = _scored(capsys, "--noise", "0", "15", "--groups", "3", "--seed", "4")
    assert score["groups"] == 3
    for described, millimetres in zip(score["noise"], (0.0, 15.0), strict=True):
        named, guessed, last = list[list[bool]](), list[list[bool]](), list[bool]()
        for index, motion in enumerate(few.motions):
            others = [each for place, each in enumerate(few.motions) if place % 3 != index % 3]
            recognizer = Recognizer(replace(few, motions=tuple(others)), Settings())
            noise = np.random.default_rng([4, index]).standard_normal(motion.positions[::2].shape)
            positions = motion.positions[::2] + millimetres / 1000 * noise
            pushed = [recognizer.push(Frame("p", frame / 30, each)) for frame, each in enumerate(positions)]
            answers = [answer for answer in pushed if answer is not None]
            named.append([answer.class_name == motion.class_name for answer in answers])
            guessed.append([each.guess_index >= 0 and each.classes[each.best] == motion.class_name for each in answers])
            last.append(guessed[-1][-1])
        answers_in_all = sum(map(len, named))
        assert described["noise_mm"] == millimetres
        assert described["answers_right"] == pytest.approx(sum(map(sum, named)) / answers_in_all)
        assert described["answers_guessed"] == pytest.approx(sum(map(sum, guessed)) / answers_in_all)
        assert described["clips_right"] == pytest.approx(np.mean([each[-1] for each in named]))
        assert described["clips_guessed"] == pytest.approx(np.mean(last))
        assert (described["clips"], described["persons"]) == (9, len({each.actor for each in few.motions}))
        assert described["seconds"] == pytest.approx(sum(each.duration for each in few.motions))
        drawn = [
            sum(count * sum(each) for count, each in zip(counts, guessed, strict=True))
            / sum(count * len(each) for count, each in zip(counts, guessed, strict=True))
            for counts in naive_score.drawn_again(9, 2012)
        ]
        assert described["intervals"]["answers_guessed"] == pytest.approx(naive_score.middle(drawn))


@pytest.mark.usefixtures("_few_built_in")
def test_a_great_noise_is_worse(capsys: pytest.CaptureFixture[str]) -> None:
    """With half a metre of noise no motion is named, and noises keep their given order."""
    score = _scored(capsys, "--noise", "500", "0", "--groups", "2")
    assert [each["noise_mm"] for each in score["noise"]] == [500, 0]
    drowned, plain = ([each[name] for name in SHARES] for each in score["noise"])
    assert drowned[0] < plain[0]
    assert drowned[1] < plain[1]
    assert plain[1] > 0.6


@pytest.mark.usefixtures("_few_built_in")
def test_two_runs_are_equal_and_other_seeds_are_others(capsys: pytest.CaptureFixture[str]) -> None:
    """Noise is repeatable by its seed."""
    first, again, other = (_scored(capsys, "--noise", "40", "--groups", "2", "--seed", seed) for seed in (1, 1, 2))
    assert first == again
    assert first != other


@pytest.mark.usefixtures("_few_built_in")
def test_a_person_reads_the_same_figures(few: MotionLibrary, capsys: pytest.CaptureFixture[str]) -> None:
    """The table has a line for each noise with its shares in per cent, and the basis of the figures."""
    (described,) = _scored(capsys, "--noise", "7.5", "--groups", "2")["noise"]
    assert _evaluate("--noise", "7.5", "--groups", "2") == 0
    printed = capsys.readouterr().out
    (line,) = [line.split() for line in printed.splitlines() if line.startswith("7.5 mm")]
    assert line[2:] == [f"{described[name]:.1%}" for name in SHARES]
    assert f"9 motions, {len(few.actors)} persons; left out in 2 groups" in printed


def test_clips_of_a_folder_are_asked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Clips are read from a folder as for every program, and each is left out of the library that names it."""
    write_takes(tmp_path, takes=3, frames=240)
    (described,) = _scored(capsys, tmp_path, "--noise", "0", "--groups", "3")["noise"]
    assert (described["clips"], described["persons"], described["seconds"]) == (6 * len(SWINGS), 2, 36.0)
    assert described["clips_guessed"] == 1.0


@pytest.mark.usefixtures("_few_built_in")
@pytest.mark.parametrize("groups", [1, 10])
def test_as_many_groups_as_motions_at_most(groups: int, capsys: pytest.CaptureFixture[str]) -> None:
    """One group would leave an empty library, and there are at most as many groups as motions."""
    assert _evaluate("--groups", groups) == 2
    assert f"--groups: expected 2 to 9, the motions there are, got {groups}" in capsys.readouterr().err


def test_a_motion_without_an_answer_is_wrong() -> None:
    """A motion too short to be answered counts among the motions as wrong, and among answers not at all."""
    silent = evaluate_noise.Heard("ann", 0.1, 0, 0, 0, last_named=False, last_guessed=False)
    right = evaluate_noise.Heard("", 1.0, 4, 2, 4, last_named=True, last_guessed=True)
    score = evaluate_noise.scored(10.0, [silent, right])
    assert [getattr(score, name) for name in SHARES] == [0.5, 1.0, 0.5, 0.5]
    assert (score.seconds, score.clips, score.persons) == (1.1, 2, None)
    assert evaluate_noise.scored(10.0, [silent]).answers_right is None
