"""Recordings from one process into a recogniser in another, over real sockets of this machine, with faults to order."""

from __future__ import annotations

import json
import re
from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest
from programs import (
    LOOPBACK,
    SMALL_CLASSES,
    finished,
    free_udp_port,
    small_library,
    small_library_file,
    started,
    summary_counts,
)
from written import trc_text

from kinespace.library import read_recordings
from kinespace.stream import Settings
from kinespace.tools.feeding.feed import clip_cues
from kinespace.tools.loopback.expected_answers import expected_answers

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from programs import Program

    from kinespace.library import Clip
    from kinespace.tools.feeding.feed import Cue
    from kinespace.tools.loopback.service_process import Transport

pytestmark = pytest.mark.slow

SPEED = 4.0
TRANSPORTS: tuple[Transport, ...] = ("osc", "zmq")


@contextmanager
def recognising(transport: Transport) -> Iterator[tuple[Program, tuple[str, ...]]]:
    """Run `kinespace live --plain`; with it, how `kinespace replay` sends to it and hears it."""
    command = ("live", "--plain", "--library", small_library_file())
    if transport == "osc":
        answers = f"{LOOPBACK}:{free_udp_port()}"
        ends = ("--osc-in", f"{LOOPBACK}:0", "--osc-out", answers)
        with started(*command, *ends) as program:
            frames = program.expect(r"listening on OSC (\S+);")[1]
            yield program, ("--osc", frames, "--listen", answers)
    else:
        ends = ("--zmq-in", f"tcp://{LOOPBACK}:*", "--zmq-out", f"tcp://{LOOPBACK}:*")
        with started(*command, *ends) as program:
            found = program.expect(r"listening on ZeroMQ (\S+); answering to ZeroMQ (\S+);")
            yield program, ("--zmq", found[1], "--listen", found[2])


def ended(program: Program) -> dict[str, int]:
    """Press Ctrl-C; the counts it ends with."""
    assert (program.interrupt(), program.errors) == (0, "")
    return summary_counts(program.output)


def changes(labels: Sequence[str]) -> list[str]:
    """Give each label that differs from the one before."""
    return [label for before, label in zip(["", *labels], labels, strict=False) if label != before]


def announcements(cues: Sequence[Cue]) -> int:
    """Count how often the joints of a feed are announced: at its start and a second after each time, or more."""
    count, next_time = 0, 0.0
    for cue in cues:
        if cue.due >= next_time:
            count, next_time = count + 1, cue.due + 1.0
    return count


@pytest.fixture(scope="module")
def recordings(some_clips: tuple[Clip, ...], tmp_path_factory: pytest.TempPathFactory) -> list[tuple[Path, Clip]]:
    """Write real motions as TRC files, each in a folder of its class's name, and read them again; shortest first."""
    paths = []
    for clip in (each for each in some_clips if each.class_name in SMALL_CLASSES):
        path = tmp_path_factory.mktemp("recordings") / clip.class_name / f"{clip.name}.trc"
        path.parent.mkdir()
        millimetres = (clip.positions * 1000).round(3)
        path.write_text(trc_text(clip.skeleton.joints, millimetres, rate=clip.frame_rate))
        paths.append(path)
    together = zip(paths, read_recordings(paths), strict=True)
    return sorted(together, key=lambda pair: pair[1].frames)


@pytest.mark.parametrize("transport", TRANSPORTS)
def test_recordings_are_answered_across_processes(transport: Transport, recordings: list[tuple[Path, Clip]]) -> None:
    """Every frame of real clips arrives and every answer due is given, the same as the recogniser alone gives."""
    paths, clips = zip(*[pair for pair in recordings if pair[1].duration > 1.2], strict=True)
    cues = list(clip_cues(clips, "replay", speed=SPEED))
    expected = expected_answers(cues, small_library(), Settings())
    right = sum(each.label == cues[each.cue].class_name for each in expected) / len(expected)
    with recognising(transport) as (program, ends):
        status, output, errors = finished("replay", *paths, *ends, "--speed", SPEED, "--json")
        counts = ended(program)
        lines = re.findall(r"^ *[\d.]+ s  replay  (\S+)  score", program.output, re.MULTILINE)
    assert (status, errors) == (0, "")
    described = json.loads(output)
    assert (described["sent"], described["failed"]) == (len(cues), 0)
    # On a busy machine a listener that stops may miss the last answers; the recogniser counts them all.
    assert 0.9 * len(expected) <= described["answers"] <= len(expected)
    assert described["right"] == pytest.approx(right, abs=0.03)
    assert right > 0.6
    told = announcements(cues) if transport == "osc" else 0
    seen = {"received": len(cues) + told, "frames": len(cues), "answers": len(expected), "restarts": len(clips) - 1}
    assert counts == {**dict.fromkeys(counts, 0), **seen}
    assert lines == changes([each.label for each in expected])
