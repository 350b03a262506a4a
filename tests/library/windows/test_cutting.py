from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import naive_windows
import numpy as np
import pytest
from naive_windows import body_of, window

from kinespace.library import MotionLibrary, distance_rows
from kinespace.library.windows.cutting import FIRST_WINDOW, CutWindows, window_ends
from kinespace.library.windows.index import measured_clips
from kinespace.library.windows.parts import EIGENVECTORS, PARTS, Kind
from kinespace.stream.recognizer.windows.live_windows import LiveWindows

if TYPE_CHECKING:
    from kinespace.library.clip import Clip
    from kinespace.library.windows.index import WindowIndex


@pytest.fixture(scope="module")
def clip(builtin: MotionLibrary) -> Clip:
    """Give the longest motion, at 30 frames a second: it is longer than every window."""
    longest = max(builtin.motions, key=lambda motion: motion.frames)
    return replace(longest, positions=longest.positions[::2], frame_rate=30.0)


@pytest.fixture(scope="module")
def short(clip: Clip) -> Clip:
    """Give a motion of less than half a second."""
    return clip.moved_to(clip.positions[40:53])


def _cut(index: WindowIndex, *clips: Clip) -> tuple[CutWindows, list[np.ndarray]]:
    ends = [window_ends(clip, 0.4) for clip in clips]
    return CutWindows(clips, ends, index.body, index.basis), ends


def test_the_last_window_ends_with_the_motion(clip: Clip) -> None:
    """The others end every so many seconds before it, the first not before its time."""
    ends = window_ends(clip, 0.4, first=0.5)
    assert ends[-1] == clip.frames
    assert set(np.diff(ends)) == {12}
    assert 15 <= ends[0] < 15 + 12


def test_a_motion_shorter_than_the_first_window_has_one(short: Clip) -> None:
    """The window is the whole motion, if the motion is no shorter than the shortest window."""
    assert window_ends(short, 0.4, first=0.5).tolist() == [13]


@pytest.mark.parametrize(("frames", "windows"), [(4, 0), (5, 1)])
def test_the_shortest_motion_with_a_window(clip: Clip, frames: int, windows: int) -> None:
    """At 30 frames a second it is five frames long."""
    cut = clip.moved_to(clip.positions[:frames])
    assert (cut.duration >= FIRST_WINDOW) == bool(windows)
    assert len(window_ends(cut, 0.4)) == windows


def test_a_window_needs_two_frames(clip: Clip) -> None:
    """At three frames a second one frame lasts long enough, but one frame has no movement."""
    slow = replace(clip, frame_rate=3.0)
    assert not len(window_ends(slow.moved_to(slow.positions[:1]), 0.4))
    assert 2 in window_ends(slow.moved_to(slow.positions[:2]), 0.4, first=1.0)


@pytest.mark.slow
@pytest.mark.parametrize("part", PARTS, ids=lambda part: part.name)
def test_numbers_by_definition(
    part: tuple[Kind, float], clip: Clip, short: Clip, builtin_index: WindowIndex, arithmetic: str
) -> None:
    """Every part of every window of two motions equals its twin, read off the window's own frames."""
    cut, ends = _cut(builtin_index, clip, short)
    body, directions = body_of(clip.skeleton), builtin_index.basis.directions
    numbers = iter(cut.numbers()[part])
    for motion, own in zip((clip, short), ends, strict=True):
        for end in own:
            times, rows = window(motion, end, part.seconds)
            twin = naive_windows.numbers_of([part], times[-1], times, rows, directions, body)[part]
            found = next(numbers)
            ours = found.T @ found if part.kind is Kind.EIGEN else found
            assert np.allclose(ours, twin, atol=1e-7), arithmetic
    assert not list(numbers)


@pytest.mark.slow
def test_eigenpairs(clip: Clip, builtin_index: WindowIndex, arithmetic: str) -> None:
    """The leading eigenvectors over two seconds are the covariance's, but for their signs."""
    cut, [ends] = _cut(builtin_index, clip)
    pairs = cut.eigenpairs[2.0]
    for end, values, vectors in zip(ends, pairs.values, pairs.vectors, strict=True):
        _, rows = window(clip, end, 2.0)
        points = rows @ builtin_index.basis.directions
        twin_values, twin_vectors = naive_windows.leading(naive_windows.covariance(points), EIGENVECTORS)
        assert np.allclose(values, twin_values, rtol=1e-6), arithmetic
        assert np.abs(vectors[0] @ twin_vectors[0]) == pytest.approx(1.0)


def test_a_live_window_has_the_numbers_of_the_librarys(builtin_index: WindowIndex, arithmetic: str) -> None:
    """Given a motion's frames one by one, the live windows have the library's numbers."""
    [clip, *_], [ends, *_], _ = measured_clips(builtin_index.library, every=0.1)
    cut = CutWindows([clip], [ends], builtin_index.body, builtin_index.basis).numbers()
    live, compared = LiveWindows(builtin_index.body, builtin_index.basis), 0
    rows = distance_rows(clip.positions, clip.skeleton)
    for frame, time in enumerate(clip.times.tolist()):
        live.push([time], rows[frame : frame + 1])
        for place in np.flatnonzero(ends == frame + 1):
            numbers = live.read().numbers
            compared += 1
            for part in PARTS:
                ours, theirs = numbers[part], cut[part][place]
                if part.kind is Kind.EIGEN:
                    ours, theirs = ours.T @ ours, theirs.T @ theirs
                assert np.allclose(ours, theirs, atol=1e-6), (arithmetic, part.name)
    assert compared == len(ends) > 5
