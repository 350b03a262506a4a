"""A library of one's own, from a labelled folder of BVH, TRC or C3D, through every program that reads recordings."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from recorded import write_takes
from written import bvh_of_acclaim, write_c3d

from library import MotionLibrary, Reading, distance_rows, find_recordings, read_recordings
from library.recordings import ActorIn, labelled
from stream.frame import Frame
from stream.recognizer import LiveSignature, Recognizer, Settings
from tools.cli import main
from tools.console import console

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

ACTORS = ("ann", "bob", "eve")


@pytest.fixture(autouse=True)
def _wide(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(console, "_width", 200)


def bvh_moves(folder: Path, *, actors: Sequence[str] = ACTORS) -> Path:
    """Write `moves/<class>/<actor>_<take>.bvh`, two takes of three classes by each actor."""
    acclaim, moves = folder / "acclaim", folder / "moves"
    acclaim.mkdir()
    for path in write_takes(acclaim, actors=actors):
        _, actor, class_name, take, _ = path.stem.split("_")
        (moves / class_name).mkdir(parents=True, exist_ok=True)
        text, _ = bvh_of_acclaim(acclaim / f"HDM_{actor}.asf", path, scale=100.0)
        (moves / class_name / f"{actor}_{take}.bvh").write_text(text)
    return moves


def c3d_moves(folder: Path) -> Path:
    """Write the same as C3D, millimetres, without parents, the markers in another order in each file."""
    moves = bvh_moves(folder)
    for index, path in enumerate(find_recordings([moves])):
        (clip,) = read_recordings([path])
        order = np.random.default_rng(index).permutation(len(clip.skeleton.joints))
        labels = [f"{path.stem}:{clip.skeleton.joints[joint]}" for joint in order]
        write_c3d(path.with_suffix(".c3d"), labels, clip.positions[:, order] * 1000, rate=120.0)
        path.unlink()
    return moves


@pytest.mark.parametrize("write", [bvh_moves, c3d_moves])
@pytest.mark.parametrize("signature", list(LiveSignature))
def test_a_labelled_folder_becomes_a_library_that_recognises(
    tmp_path: Path, write: object, signature: LiveSignature, capsys: pytest.CaptureFixture[str]
) -> None:
    """With three people's takes in folders the library has its own skeleton and windows, and names a left-out take."""
    moves = write(tmp_path)  # type: ignore[operator]
    asked = find_recordings([moves / "bendLeft"])[0]
    (clip,) = read_recordings([asked])
    asked.unlink()
    assert main(["build", str(moves), "-o", str(tmp_path / "mine.npz"), "--actor-in", "name"]) == 0
    assert "no windows" not in capsys.readouterr().out
    library = MotionLibrary.load(tmp_path / "mine.npz")
    assert library.classes == ("bendLeft", "bendRight", "raiseBoth")
    assert {motion.actor for motion in library.motions} == set(ACTORS)
    assert library.windows is not None
    assert library.skeleton.parents
    recognizer = Recognizer(library, Settings(signature=signature, window=1.0))
    positions = clip.as_of(library.skeleton).positions
    answers = [
        recognizer.push(Frame("ann", 1.0 + moment, frame))
        for moment, frame in zip(clip.times.tolist(), positions, strict=True)
    ]
    said = [answer for answer in answers if answer]
    assert said
    assert said[-1].classes[said[-1].best] == "bendLeft"


def test_too_few_people_leave_whole_motions(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Without actors, or with two, there is nothing to learn how people differ from: it is said, and the rest works."""
    moves = bvh_moves(tmp_path, actors=("ann", "bob"))
    for options in ((), ("--actor-in", "name")):
        assert main(["build", str(moves), "-o", str(tmp_path / "mine.npz"), "--overwrite", *options]) == 0
        assert "whole motions only, no windows" in capsys.readouterr().out
        library = MotionLibrary.load(tmp_path / "mine.npz")
        assert library.windows is None
        assert len(library) == 12


def test_bodies_of_one_folder_must_have_the_same_joints(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A recording with other joints is refused by name; --joints takes those that all have."""
    moves = bvh_moves(tmp_path)
    path = moves / "bendLeft" / "bob_001.bvh"
    path.write_text(path.read_text().replace("head", "crown"))
    output = tmp_path / "mine.npz"
    assert main(["build", str(moves), "-o", str(output)]) == 2
    error = capsys.readouterr().err
    assert "'bob_001'" in error
    assert "crown_end" in error
    assert main(["build", str(moves), "-o", str(output), "--joints", "root,l*,r*"]) == 0
    assert MotionLibrary.load(output).skeleton.joints == ("root", "llower", "llower_end", "rlower", "rlower_end")


def test_who_performs_is_found_where_it_is_said(tmp_path: Path) -> None:
    """The actor is nowhere, in the file's name, or the folder above the class's; HDM05's names go before."""
    moves = bvh_moves(tmp_path, actors=("ann",))
    path = moves / "bendLeft" / "ann_001.bvh"
    (clip,) = read_recordings([path])
    actors = [labelled(clip, path, actor_in).actor for actor_in in ActorIn]
    assert actors == ["", "ann", "moves"]
    assert labelled(clip, path).class_name == "bendLeft"
    named = path.with_name("HDM_bd_jump_001_120.bvh")
    path.rename(named)
    (clip,) = read_recordings([named])
    assert (labelled(clip, named, ActorIn.FOLDER).class_name, labelled(clip, named, ActorIn.FOLDER).actor) == (
        "jump",
        "bd",
    )


def test_every_program_reads_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Retrieval is measured on the folder, a take is told, and a take of another order is evaluated against labels."""
    moves = bvh_moves(tmp_path)
    assert main(["evaluate", "retrieval", str(moves), "--actor-in", "name", "--json"]) == 0
    assert '"motions": 18' in capsys.readouterr().out
    assert main(["info", str(moves)]) == 0
    printed = capsys.readouterr().out
    assert printed.count(".bvh") == 18
    take = moves / "bendLeft" / "ann_001.bvh"
    assert main(["info", str(take), "--unit", "m"]) == 0
    printed = capsys.readouterr().out
    (clip,) = read_recordings([take], Reading(unit="m"))
    assert f"joints: {', '.join(clip.skeleton.joints)}" in printed
    assert f"{np.median(distance_rows(clip.positions, clip.skeleton).max(axis=1)):.2f}" in printed
    main(["build", str(moves), "-o", str(tmp_path / "mine.npz")])
    (tmp_path / "labels.csv").write_text("start_s,end_s,label\n0,1.5,bendLeft\n")
    stream = ["evaluate", "stream", str(take), "--labels", str(tmp_path / "labels.csv")]
    capsys.readouterr()
    assert main([*stream, "--library", str(tmp_path / "mine.npz"), "--json"]) == 0
    assert '"frame_accuracy"' in capsys.readouterr().out


def test_a_unit_nobody_knows_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A unit that is neither a name nor metres is told in one line."""
    assert main(["info", str(tmp_path), "--unit", "ell"]) == 2
    assert capsys.readouterr().err == "kinespace: unit: expected m, cm, mm, in, ft or the metres of one, got 'ell'\n"
