"""The commands that the page needs beside teaching: sensitivity, list, record, and examples of some seconds ago."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
from synthetic import stick_clip

from kinespace.library.teaching.examples import Roster
from kinespace.stream.frame import Frame
from kinespace.stream.recognizer import Performers, Recognizer, Settings
from kinespace.stream.teaching import Teacher, commands
from kinespace.stream.teaching.commands import Command, CommandError
from kinespace.stream.teaching.wire import decode_json

if TYPE_CHECKING:
    from kinespace.library import MotionLibrary


@pytest.mark.parametrize(
    ("told", "command"),
    [
        ({"do": "list"}, commands.List()),
        ({"do": "sensitivity", "share": 0.1}, commands.Sensitivity(0.1)),
        (
            {"do": "last", "performer": "ann", "seconds": 2.0, "class": "wave", "ago": 5.5},
            commands.Last("ann", 2.0, "wave", 5.5),
        ),
    ],
)
def test_they_are_read_from_json(told: dict[str, object], command: Command) -> None:
    """Each command is read as the page sends it."""
    assert decode_json(json.dumps(told).encode()) == command


@pytest.mark.parametrize(
    "told",
    [
        {"do": "sensitivity", "share": 1.5},
        {"do": "sensitivity", "share": -0.1},
        {"do": "last", "performer": "ann", "seconds": 2.0, "class": "wave", "ago": -1.0},
        {"do": "last", "performer": "ann", "seconds": 2.0, "class": "wave", "ago": 1e9},
        {"do": "trim"},
    ],
)
def test_numbers_out_of_range_are_refused(told: dict[str, object]) -> None:
    """A share beyond 0 to 1, or a time that cannot be remembered, is refused with the name of the argument."""
    with pytest.raises(CommandError, match=r"share|ago|trim"):
        decode_json(json.dumps(told).encode())


def test_an_example_of_some_seconds_ago_is_the_movement_of_then(sticks: MotionLibrary) -> None:
    """Of two motions the earlier one is taken when its seconds are named, as if asked when it had just ended."""
    bow, wave = stick_clip("bow", seed=70, frames=120), stick_clip("wave", seed=71, frames=120)
    teacher, now, taken = Teacher(sticks.skeleton, Roster()), 0.0, []
    for clip in (bow, wave):
        for positions in clip.positions:
            now += 1 / 60
            teacher.push(Frame("ann", now, positions), now)
        if clip is bow:
            teacher.command(commands.Last("ann", 1.5, "then"), now)
            taken.append(teacher.roster.of("then")[0])
    teacher.command(commands.Last("ann", 1.5, "later", 2.0), now)
    taken.append(teacher.roster.of("later")[0])
    assert taken[1].recording.positions == pytest.approx(taken[0].recording.positions, abs=1e-3)
    assert (taken[1].begin, taken[1].end) == pytest.approx((taken[0].begin, taken[0].end), abs=0.05)


def test_a_sensitivity_holds_from_the_next_hop_on(small_library: MotionLibrary) -> None:
    """A recogniser whose sensitivity is changed answers as one that began with it; so do newcomers among performers."""
    motion = small_library.motions[0]
    frames = [Frame("ann", time, each) for time, each in zip(motion.times.tolist(), motion.positions, strict=True)]

    def outcomes(recognizer: Recognizer) -> list[str]:
        return [answer.outcome for frame in frames if (answer := recognizer.push(frame))]

    for share in (0.0, 1.0):
        changed = Recognizer(small_library, Settings(sensitivity=1.0 - share))
        changed.set_sensitivity(share)
        assert outcomes(changed) == outcomes(Recognizer(small_library, Settings(sensitivity=share)))
    performers = Performers(small_library)
    performers.push(frames[0], 0.0)
    performers.set_sensitivity(0.3)
    assert (performers.sensitivity, performers.settings.sensitivity) == (0.3, 0.3)
