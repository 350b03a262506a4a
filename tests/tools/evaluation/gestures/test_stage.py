"""A show's feed: other bodies' movement on a performer's bones, joined without jumps."""

import argparse

import numpy as np

from kinespace.library import MotionLibrary
from kinespace.tools.evaluation import evaluate_show
from kinespace.tools.evaluation.evaluate_show import JOINED, joined, lengths_of

LIBRARY = MotionLibrary.builtin()
PARENTS = LIBRARY.skeleton.parents
RATE = 60.0


def motion_of(actor: str, class_name: str) -> np.ndarray:
    """Give the positions of an actor's first motion of a class."""
    return next(each for each in LIBRARY.motions if (each.actor, each.class_name) == (actor, class_name)).positions


def test_no_step_is_larger_than_a_motions_own_or_a_join_allows() -> None:
    """Between two pieces a joint goes the way between both postures, at most by a sixteenth of it a frame."""
    pieces = [motion_of(actor, name) for actor, name in (("bd", "lieDownFloor"), ("tr", "throwBasketball"))]
    walk, begins = joined(pieces, 0, RATE)
    between = round(JOINED * RATE)
    assert begins == [0, len(pieces[0]) + between]
    assert len(walk) == sum(map(len, pieces)) + between
    steps = np.linalg.norm(np.diff(walk, axis=0), axis=2).max(axis=1)
    own = max(np.linalg.norm(np.diff(each, axis=0), axis=2).max() for each in pieces)
    far = np.linalg.norm(walk[begins[1]] - walk[begins[1] - between - 1], axis=1).max()
    assert steps[begins[1] - between - 1 : begins[1]].max() <= far / 16
    assert steps.max() <= max(own, far / 16) + 1e-6
    np.testing.assert_array_equal(walk[: begins[1] - between], pieces[0])


def options(**changed: object) -> argparse.Namespace:
    """Give the program's usual options, some of them changed."""
    return argparse.Namespace(**{"seed": 0, "gestures": 3, "examples": 1, "minutes": 2.0, **changed})


def test_a_show_is_drawn_again_alike() -> None:
    """The same seed gives the same show, another one another; examples are not asked, gestures come every 25 s."""
    show, again = (evaluate_show.drawn(LIBRARY, [], options(), 1) for _ in range(2))
    np.testing.assert_array_equal(show.positions, again.positions)
    assert show.segments == again.segments
    other = evaluate_show.drawn(LIBRARY, [], options(seed=1), 1)
    assert [each.name for each in other.examples] != [each.name for each in show.examples]
    assert show.performer == LIBRARY.actors[1] == show.examples[0].actor
    assert len({each.class_name for each in show.examples}) == len(show.examples) == 3
    assert len(show.segments) == 4
    assert {each.label for each in show.segments} <= {each.class_name for each in show.examples}
    ends = [0.0, *(each.end for each in show.segments)]
    pauses = [each.start - end for each, end in zip(show.segments, ends, strict=False)]
    assert min(pauses) >= 25.0
    for segment in show.segments:
        first, last = round(segment.start * RATE), round(segment.end * RATE)
        shown = lengths_of(show.positions[first:last], PARENTS)
        np.testing.assert_allclose(shown, lengths_of(show.examples[0].positions, PARENTS), atol=0.02)
