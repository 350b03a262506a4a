from dataclasses import replace

import naive_windows
import numpy as np
import pytest
from naive_windows import body_of, window

from kinespace.library import Clip, MotionLibrary, WindowIndex
from kinespace.library.signature.parts import PARTS, Kind
from kinespace.library.windows.cutting import FIRST_WINDOW, CutWindows, window_ends


@pytest.fixture(scope="module")
def clip(builtin: MotionLibrary) -> Clip:
    """Give the longest motion, at 30 frames a second: it is longer than every window."""
    longest = max(builtin.motions, key=lambda motion: motion.frames)
    return replace(longest, positions=longest.positions[::2], frame_rate=30.0)


def test_the_last_window_ends_with_the_motion(clip: Clip) -> None:
    """The others end every so many seconds before it, the first not before its time."""
    ends = window_ends(clip, 0.4, first=0.5)
    assert ends[-1] == clip.frames
    assert set(np.diff(ends)) == {12}
    assert 15 <= ends[0] < 15 + 12
    assert window_ends(clip.moved_to(clip.positions[:27]), 0.4, first=0.5).tolist() == [15, 27]


def test_the_shortest_motion_with_a_window(clip: Clip) -> None:
    """It lasts as long as the shortest window and has two frames; its only window is the whole motion."""
    for rate, frames, ends in ((30, 13, [13]), (30, 5, [5]), (30, 4, []), (3, 1, []), (3, 2, [2])):
        cut = replace(clip.moved_to(clip.positions[:frames]), frame_rate=float(rate))
        assert (cut.duration >= FIRST_WINDOW) == (frames != 4)
        assert window_ends(cut, 0.4, first=1.0).tolist() == ends


@pytest.mark.slow
def test_numbers_by_definition(clip: Clip, builtin_index: WindowIndex, arithmetic: str) -> None:
    """Every part of some windows of two motions equals its twin, read off the window's own frames."""
    clips = [clip, clip.moved_to(clip.positions[40:53])]
    ends = [window_ends(each, 0.4)[-9:] for each in clips]
    body, directions = body_of(clip.skeleton), builtin_index.basis.directions
    cut = CutWindows(clips, ends, builtin_index.body, builtin_index.basis)
    numbers, place = cut.numbers, 0
    for motion, own in zip(clips, ends, strict=True):
        for end in own:
            for part in PARTS:
                times, rows = window(motion, end, part.seconds)
                twin = naive_windows.numbers_of([part], times[-1], times, rows, directions, body)[part]
                found = numbers[part][place]
                ours = found.T @ found if part.kind is Kind.EIGEN else found
                assert np.allclose(ours, twin, atol=1e-7), (arithmetic, part)
            vectors = naive_windows.leading(naive_windows.covariance(window(motion, end, 2.0)[1] @ directions))[1]
            assert np.abs(cut.leading[place] @ vectors[0]) == pytest.approx(1.0)
            place += 1
    assert {len(each) for each in numbers.values()} == {place}
