"""Bodies unlike the library's: found after some seconds of movement, and never said of a library of that body."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from kinespace.library import Clip, MotionLibrary, WindowIndex, opened
from kinespace.library.windows.segments import FLAT
from kinespace.stream import Frame, Performers, Recognizer
from kinespace.stream.recognizer.performers import UNLIKE
from kinespace.tools.feeding.feed import resampled

pytestmark = pytest.mark.slow

RATE = 30.0


@pytest.fixture(scope="module")
def squat(small_library: MotionLibrary) -> Clip:
    """Give a squat at 30 frames a second."""
    return resampled(next(m for m in small_library.motions if m.class_name.startswith("squat")), RATE)


def _played(recognizer: Recognizer, positions: NDArray[np.float64], seconds: float, begin: float = 0.0) -> None:
    """Play a motion forth and back for some seconds."""
    there_and_back = np.concatenate([positions, positions[::-1]])
    for index in range(round(seconds * RATE)):
        recognizer.push(Frame("p", begin + index / RATE, there_and_back[index % len(there_and_back)]))


def _short_thighs(clip: Clip) -> NDArray[np.float64]:
    positions, places = clip.positions.copy(), clip.skeleton.joints.index
    for side in "lr":
        hip, knee = places(f"{side}hipjoint"), places(f"{side}femur")
        positions[:, knee] = 0.4 * clip.positions[:, knee] + 0.6 * clip.positions[:, hip]
    return positions


def test_a_body_is_decided_on_after_seconds_of_movement(small_library: MotionLibrary, squat: Clip) -> None:
    """The library's own body is like it, another is not, a still one is not decided on; a reset begins anew."""
    recognizer = Recognizer(small_library)
    _played(recognizer, squat.positions, 2.0)
    assert recognizer.unlike is None
    _played(recognizer, squat.positions, 2.0, 2.0)
    assert recognizer.unlike is False
    recognizer.reset()
    _played(recognizer, np.repeat(_short_thighs(squat)[:1], 2, axis=0), 10.0)
    assert recognizer.unlike is None
    _played(recognizer, _short_thighs(squat), 10.0, 10.0)
    assert recognizer.unlike is True


def test_segments_that_stretch_are_unlike_rigid_ones(small_library: MotionLibrary, squat: Clip) -> None:
    """A body of the library's own lengths is unlike it when its joints tremble by some centimetres."""
    noise = np.random.default_rng(3).standard_normal((2 * squat.frames, *squat.positions.shape[1:]))
    recognizer = Recognizer(small_library)
    _played(recognizer, np.concatenate([squat.positions, squat.positions[::-1]]) + 0.04 * noise, 7.0)
    assert recognizer.unlike is True


def test_a_library_taught_by_the_body_itself_is_like_it(small_index: WindowIndex, squat: Clip) -> None:
    """After one example the note goes: the nearest person of the library is the performer."""
    performers, positions = Performers(small_index), np.concatenate([_short_thighs(squat), _short_thighs(squat)[::-1]])

    def play(begin: float) -> None:
        for index in range(round(8 * RATE)):
            performers.push(Frame("p", begin + index / RATE, positions[index % len(positions)]), 0.0)

    play(0.0)
    assert performers.compared == {"p": UNLIKE}
    taught = replace(squat, positions=_short_thighs(squat), class_name="taught", actor="p")
    performers.exchange(opened(small_index.library).with_motions([taught]))
    play(8.0)
    assert performers.compared == {}


def test_a_flat_body_is_said_to_be_flat(small_library: MotionLibrary, squat: Clip) -> None:
    """2-D landmarks with zeros for depth are said to be flat, once they have moved; a body in space is not."""
    for depth, said in ((0.0, FLAT), (1.0, None)):
        performers = Performers(small_library)
        there_and_back = np.concatenate([squat.positions, squat.positions[::-1]]) * (1.0, 1.0, depth)
        for index in range(round(5 * RATE)):
            frame = Frame("p", index / RATE, there_and_back[index % len(there_and_back)])
            performers.push(frame, index / RATE)
        assert performers.compared.get("p") == said
