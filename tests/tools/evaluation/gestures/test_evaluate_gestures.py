"""Which segments teach, how they are cut, and what is asked."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import stick_clip

from kinespace.library import MotionLibrary
from kinespace.library.recordings.formats.labels import Segment
from kinespace.stream import Settings
from kinespace.tools.evaluation.evaluate_gestures import example_of, first_of, listened, moved
from kinespace.tools.evaluation.harness import Take
from kinespace.tools.teaching.lessons import open_taught

SEGMENTS = tuple(
    Segment(float(place), place + 1.0, label)
    for place, label in enumerate(["repeated", "bow", "nothing", "bow", "jump"])
)


def test_the_first_segment_of_each_class_teaches() -> None:
    """Over all of a person's takes; a repeated command and nothing teach nothing."""
    first, second = (Take(stick_clip("bow", frames=301, rate=60.0), segments) for segments in (SEGMENTS[:3], SEGMENTS))
    lessons = first_of([first, second])
    assert {name: (of is first, segment) for name, (of, segment) in lessons.items()} == {
        "bow": (True, SEGMENTS[1]),
        "jump": (False, SEGMENTS[4]),
    }


@pytest.mark.parametrize("rate", [30.0, 120.0])
def test_a_segment_is_cut_to_its_movement(rate: float) -> None:
    """A second of movement in five of standing is kept, with an eighth of a second before and a sixth behind it."""
    times = np.arange(round(6 * rate)) / rate
    gone = np.clip(times - 3.0, 0.0, 1.0)
    positions = np.zeros((len(times), 6, 3)) + gone[:, None, None]
    clip = replace(stick_clip("bow", frames=len(times), rate=rate), positions=positions + np.eye(6, 3))
    first, last = moved(clip, Segment(1.0, 6.0, "bow"))
    assert first / rate == pytest.approx(3.0 - 0.13, abs=0.08)
    assert last / rate == pytest.approx(4.0 + 0.17, abs=0.08)
    assert example_of(Take(clip, ()), Segment(1.0, 6.0, "bow")).frames == last - first
    assert moved(clip, Segment(5.0, 6.0, "bow")) == (round(5 * rate), round(6 * rate))


def test_segments_that_teach_do_not_ask() -> None:
    """A squat is asked behind the one that teaches: words in the first and in a repeated command count neither way."""
    squat, arms, other = (
        next(each for each in MotionLibrary.builtin().motions if (each.class_name, each.actor) == (name, "bd"))
        for name in ("squat1Reps", "rotateArmsBothBackward1Reps", "kickLFront1Reps")
    )
    order = [squat, arms, other, arms, squat]
    labels = ["squat", "arms", "kick", "repeated", "squat"]
    ends = np.cumsum([each.duration for each in order]).tolist()
    segments = tuple(map(Segment, [0.0, *ends[:-1]], ends, labels))
    clip = replace(squat, positions=np.concatenate([each.positions for each in order]), rotations=np.zeros((0, 0)))
    take = Take(clip, segments)
    lessons = first_of([take])
    index = open_taught(MotionLibrary.of_clips([example_of(*each) for each in lessons.values()]))
    heard = listened(take, index, lessons, Settings())
    assert (heard.segments, heard.asked, heard.person) == ([segments[4]], 1, "bd")
    assert heard.seconds == pytest.approx(squat.duration)
    assert heard.right("start") == 1
    assert {each.right for each in heard.verdicts["start"] if each.said.at < segments[4].start - 0.001} == {None}
