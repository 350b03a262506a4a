"""Motions heard once and asked of many libraries: as if each had been asked by itself."""

from __future__ import annotations

from dataclasses import replace
from itertools import groupby, islice

import numpy as np
import pytest

from kinespace.library import MotionLibrary
from kinespace.library.windows.index import WindowIndex
from kinespace.stream.recognizer import Settings
from kinespace.tools.evaluation.scoring.hearing import heard, starts_heard, starts_of

BUILTIN = MotionLibrary.builtin()
#: Two motions of each of four classes by each actor, who teach their own metrics.
FEW = replace(
    BUILTIN,
    motions=tuple(
        motion
        for _, motions in groupby(BUILTIN.motions, key=lambda clip: (clip.class_name, clip.actor))
        for motion in islice(motions, 2)
        if motion.class_name in BUILTIN.classes[::3]
    ),
    learned=None,
)


@pytest.fixture(scope="module")
def everything() -> WindowIndex:
    """Give the windows of the few motions."""
    return WindowIndex.of(FEW)


@pytest.mark.slow
@pytest.mark.parametrize("settings", [Settings(), Settings(sensitivity=0.4, lead=1.0)], ids=["usual", "quick"])
def test_replayed_starts_equal_the_recognisers(everything: WindowIndex, settings: Settings) -> None:
    """A motion heard once, asked in a library of other motions, starts where the recogniser starts it."""
    some = everything.of_some(range(0, len(FEW.motions), 3))
    started = 0
    for clip in FEW.motions[1::20]:
        hops = heard(clip, everything, settings)
        assert hops
        ours = [(event.label, event.time) for event in starts_heard(hops, some, settings)]
        assert ours == [(event.label, event.time) for event in starts_of(clip, some, settings)]
        started += len(ours)
    assert started


def test_doubted_motions_are_left_out(everything: WindowIndex) -> None:
    """A motion in which the whole body jumps is left to a recogniser of its own."""
    clip = FEW.motions[0]
    positions = np.array(clip.positions)
    positions[20:] = positions[20:, ::-1]
    assert heard(replace(clip, positions=positions), everything, Settings()) is None
