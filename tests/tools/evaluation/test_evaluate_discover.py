from types import SimpleNamespace

import pytest

from kinespace.library import MotionLibrary
from kinespace.library.recordings.formats.labels import Segment
from kinespace.library.teaching.discovery import Piece, Pieces
from kinespace.tools.evaluation.evaluate_discover import named_by_labels, purity
from kinespace.tools.evaluation.takes import Take
from kinespace.tools.programs.recordings.found import Group

CLIP = MotionLibrary.builtin().motions[0]


def _found(*pieces: tuple[int, float, float, int]) -> tuple[Pieces, list[Group]]:
    """Give pieces of takes, and their groups, each: take, start, end, group."""
    numbers = sorted({group for *_, group in pieces})
    own = [Group(each, tuple(place for place, piece in enumerate(pieces) if piece[3] == each), 0.0) for each in numbers]
    every = SimpleNamespace(pieces=[Piece(*piece[:3]) for piece in pieces], clips=[CLIP] * len(pieces))
    return every, own  # type: ignore[return-value]  # as much as is read


def test_the_purity_of_groups() -> None:
    """A segment lies in a group with half of its time in it; nine tenths of a pure group are of one class."""
    takes = [
        Take(CLIP, (Segment(0, 2, "bow"), Segment(2, 4, "bow"), Segment(4, 6, "wave"))),
        Take(CLIP, (Segment(0, 2, "wave"), Segment(2, 4, "kick"))),
    ]
    found = _found((0, 0.0, 2.0, 1), (0, 2.0, 4.9, 1), (0, 4.9, 6.0, 2), (1, 0.0, 1.1, 2), (1, 3.2, 4.0, 3))
    assert tuple(purity(takes, *found).values()) == pytest.approx((4 / 5, 2 / 3, 1 / 5))
    mixed = _found((0, 0.0, 2.0, 1), (0, 2.0, 4.9, 1), (0, 4.9, 6.0, 1), (1, 0.0, 1.1, 2), (1, 3.0, 4.0, 2))
    assert set(purity(takes, *mixed).values()) == {0.0}


def test_groups_are_named_by_most_of_their_time() -> None:
    """A group most of whose time has no label is nothing, and no library is made of such groups alone."""
    takes = [Take(CLIP, (Segment(0, 2, "bow"), Segment(2, 4, "wave")))]
    library = named_by_labels(takes, *_found((0, 0.0, 2.5, 1), (0, 2.5, 4.0, 2), (0, 3.5, 9.0, 3)))
    assert sorted(each.class_name for each in library.motions) == ["bow", "nothing", "wave"]
    assert named_by_labels(takes, *_found((0, 5.0, 9.0, 1))) is None
