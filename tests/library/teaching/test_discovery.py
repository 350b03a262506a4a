from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from kinespace.library import MotionLibrary
from kinespace.library.motion_library import MIN_JOINTS
from kinespace.library.skeleton import SkeletonMismatchError
from kinespace.library.teaching import discovery
from kinespace.library.teaching.discovery import ALIKE, Pieces, changes, grouped, log_distances, middle

CLASSES = ("squat1Reps", "kickLFront1Reps", "grabHighR")


def _rehearsal() -> tuple[list[tuple[float, float, str]], Pieces]:
    """Cut a take in which one person does three motions four times, standing still between; give when they are."""
    library = MotionLibrary.builtin()
    own = {
        name: [each for each in library.motions if (each.class_name, each.actor) == (name, "bd")] for name in CLASSES
    }
    frames, spans = list[np.ndarray](), list[tuple[float, float, str]]()
    for place, name in enumerate(CLASSES * 4):
        motion = own[name][place // len(CLASSES) % len(own[name])]
        begin = len(frames) / 60 + 1
        frames += [*[motion.positions[0]] * 60, *motion.positions, *[motion.positions[-1]] * 60]
        spans.append((begin, len(frames) / 60 - 1, name))
    pieces = Pieces(library.skeleton.joints)
    take = replace(library.motions[0], positions=np.array(frames), frame_rate=60.0, actor="bd")
    assert pieces.add(take) == len(pieces.pieces)
    return spans, pieces


@pytest.mark.slow
def test_motions_that_repeat_are_grouped() -> None:
    """Each of twelve motions has a piece, and no group has pieces of two classes."""
    spans, pieces = _rehearsal()
    groups, classes = grouped(pieces.vectors(), ALIKE).tolist(), dict[int, set[str]]()
    for begin, end, name in spans:
        shared = [min(each.end, end) - max(each.start, begin) for each in pieces.pieces]
        assert max(shared) > 0.25 * (end - begin)
        classes.setdefault(groups[int(np.argmax(shared))], set()).add(name)
    assert all(len(names) == 1 for names in classes.values())
    assert len(classes) < len(spans)
    for piece, clip in zip(pieces.pieces, pieces.clips, strict=True):
        assert clip.duration == pytest.approx(piece.seconds, abs=0.1)
    assert {piece.take for piece in pieces.of_takes({0}).pieces} == {0}
    assert pieces.of_takes({1}).pieces == []


def _cost(rows: np.ndarray, cuts: tuple[int, ...], penalty: float) -> float:
    """Compute the cost of some cuts as it is written in the textbook."""
    parts = np.split(rows, cuts)
    return sum(float(np.square(part - part.mean(axis=0)).sum()) for part in parts) + penalty * len(parts)


@pytest.mark.parametrize("penalty", [0.5, 3.0, 20.0])
def test_no_other_cuts_cost_less(penalty: float) -> None:
    """All cuts of 26 rows into pieces of eight or more are tried."""
    generator = np.random.default_rng(5)
    rows = np.repeat(generator.normal(0, 1, (3, 4)), (8, 10, 8), axis=0) + generator.normal(0, 0.5, (26, 4))
    allowed = [
        cuts
        for count in range(3)
        for cuts in combinations(range(8, 19), count)
        if all(after - before >= 8 for before, after in zip((0, *cuts), (*cuts, 26), strict=True))
    ]
    best = min(allowed, key=lambda cuts: _cost(rows, cuts, penalty))
    assert tuple(changes(rows, penalty)) == best
    assert changes(rows[:1], penalty) == []


def test_all_pieces_of_a_group_are_alike() -> None:
    """Every two are as near as asked, and each piece has one group."""
    generator = np.random.default_rng(3)
    centres = generator.normal(0, 4, (6, 5))
    vectors = [(np.repeat(centres, 5, axis=0) + generator.normal(0, 0.1, (30, 5))).astype(np.float32) for _ in range(2)]
    groups, logs = grouped(vectors, 0.2), log_distances(vectors, vectors)
    for group in np.unique(groups):
        own = groups == group
        assert logs[np.ix_(own, own)].max() <= 0.2 + 1e-4
    assert (groups > 0).all()
    assert set(middle(vectors, np.flatnonzero(groups == 1)).tolist()) == set(np.flatnonzero(groups == 1).tolist())


def test_pieces_beyond_those_compared_join_groups(monkeypatch: pytest.MonkeyPatch) -> None:
    """Memory is bounded: a further piece joins the group of the piece nearest to it, or stays alone."""
    generator = np.random.default_rng(3)
    near = [np.repeat(generator.normal(0, 4, (3, 5)), 20, axis=0).astype(np.float32) for _ in range(2)]
    near = [each + generator.normal(0, 0.01, each.shape).astype(np.float32) for each in near]
    monkeypatch.setattr(discovery, "MAX_COMPARED", 12)
    groups = grouped(near, 0.2)
    assert [len(set(groups[begin : begin + 20].tolist())) for begin in (0, 20, 40)] == [1, 1, 1]
    assert len(set(groups.tolist())) == 3
    alone = [np.vstack([each, np.full((1, 5), 99.0, np.float32), each]) for each in near]
    assert (np.bincount(grouped(alone, 0.2)) == 1).sum() == 1
    assert grouped([each[:1] for each in near], 0.2).tolist() == [1]


def test_too_few_joints_are_refused() -> None:
    """Pieces are compared by the joints that the built-in library has, five at least."""
    joints = MotionLibrary.builtin().skeleton.joints
    with pytest.raises(SkeletonMismatchError, match="expected at least 5"):
        Pieces((*joints[: MIN_JOINTS - 1], "prop"))
