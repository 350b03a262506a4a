"""Recordings from one process into a recogniser in another, over real sockets of this machine."""

import json
from pathlib import Path

import pytest
from programs import LOOPBACK, SMALL_CLASSES, finished, live, small_library
from written import trc_text

from kinespace.library import Clip, read_recordings
from kinespace.stream import Settings
from kinespace.tools.feeding.feed import clip_cues
from kinespace.tools.feeding.service import expected_answers

pytestmark = pytest.mark.slow

SPEED = 4.0


def test_recordings_are_answered_across_processes(some_clips: tuple[Clip, ...], tmp_path: Path) -> None:
    """Frames of real clips come by OSC, and every answer due goes by ZeroMQ, as the recogniser alone gives it."""
    paths = []
    for clip in (each for each in some_clips if each.class_name in SMALL_CLASSES and each.duration > 1.2):
        paths.append(tmp_path / clip.class_name / f"{clip.name}.trc")
        paths[-1].parent.mkdir()
        millimetres = (clip.positions * 1000).round(3)
        paths[-1].write_text(trc_text(clip.skeleton.joints, millimetres, rate=clip.frame_rate))
    cues = list(clip_cues(list(read_recordings(paths)), "replay", speed=SPEED))
    expected = expected_answers(cues, small_library(), Settings())
    right = sum(each.label == cues[each.cue].class_name for each in expected) / len(expected)
    with live("--plain", "--zmq-out", f"tcp://{LOOPBACK}:*") as stage:
        answers = stage.program.expect(r"answering to .*ZeroMQ ([^\s;]+);")[1]
        ends = ("--osc", f"{LOOPBACK}:{stage.port}", "--listen", answers, "--speed", SPEED)
        status, output, errors = finished("replay", *paths, *ends, "--json")
        counts = stage.stopped()
    assert (status, errors) == (0, "")
    described = json.loads(output)
    assert (described["sent"], described["failed"]) == (len(cues), 0)
    # On a busy machine a listener that stops may miss the last answers; the recogniser counts them all.
    assert 0.9 * len(expected) <= described["answers"] <= len(expected)
    assert described["right"] == pytest.approx(right, abs=0.03)
    assert right > 0.6
    assert (counts["answers"], counts["restarts"]) == (len(expected), len(paths) - 1)
