"""A gateway's own workers: real processes answer as one process does, and are replaced when they die or hang."""

from __future__ import annotations

import os
import signal
import sys
import time
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from synthetic import STICK_CLASSES, stick_clip

from kinespace.library.windows.index import opened
from kinespace.stream.frame import Frame
from kinespace.stream.recognition import Recognition
from kinespace.stream.recognizer import Performers, Settings
from kinespace.stream.workers import local
from kinespace.stream.workers.terms import Terms

if TYPE_CHECKING:
    from collections.abc import Callable

    from kinespace.library.motion_library import MotionLibrary

pytest.importorskip("zenoh")
RATE, PATIENCE = 60, 60.0
NAMES = ("ann", "bob", "cleo", "dan")


class Fed:
    """A gateway with workers of its own, the feed, and the answers of one process."""

    def __init__(self, library: MotionLibrary, gateway: local.LocalGateway) -> None:
        self.gateway, self._one = gateway, Performers(opened(library))
        clips = [stick_clip(name, seed=80, frames=4 * RATE).positions[::2] for name in STICK_CLASSES]
        self._moments = [
            [Frame(name, 1 + k / RATE, each) for name in NAMES]
            for k, each in enumerate(p for clip in clips for p in clip)
        ]
        self.heard, self.expected = list[Recognition](), list[Recognition]()

    def play(self, count: int) -> None:
        """Send some moments' frames."""
        for frames in [self._moments.pop(0) for _ in range(count)]:
            self.gateway.push_all(frames, time.monotonic())
            self.expected += [each for each in self._one.push_all(frames, frames[0].time) if each]
            self.read()

    def read(self) -> None:
        """Look after the workers, and take their answers."""
        self.gateway.source.tend(time.monotonic())
        while (taken := self.gateway.source.take(time.monotonic())) is not None:
            self.heard += [each for each in self.gateway.push_all(taken, time.monotonic()) if each]

    def until(self, reached: Callable[[], bool]) -> None:
        """Read until something is reached."""
        end = time.monotonic() + PATIENCE
        while not reached():
            assert time.monotonic() < end, (self.gateway.notes, len(self.heard), len(self.expected))
            self.read()
            time.sleep(0.001)

    @property
    def events(self) -> list[list[tuple[str, str]]]:
        """The events that came, and those of one process, by performer."""
        return [
            sorted((event.performer, event.kind, event.label) for each in answers for event in each.events)
            for answers in (self.heard, self.expected)
        ]


def process_ids(gateway: local.LocalGateway) -> dict[str, int]:
    """Give the number of each worker's process."""
    return {name: each.process.pid for name, each in gateway._workers.items()}  # noqa: SLF001 - who is killed


def test_processes_answer_and_are_replaced(sticks: MotionLibrary, monkeypatch: pytest.MonkeyPatch) -> None:
    """No event is lost when one of two workers is killed, or hangs; another process takes its place, under its name."""
    monkeypatch.setattr(local, "_MAX_ABSENT", 0.5)
    with closing(local.LocalGateway(2, opened(sticks), Terms(settings=Settings(), most=8))) as gateway:
        fed, before = Fed(sticks, gateway), process_ids(gateway)
        fed.play(60)
        for name, number in (
            ("1", signal.SIGKILL),
            ("2", signal.SIGSTOP if sys.platform != "win32" else signal.SIGTERM),
        ):
            os.kill(before[name], number)
            fed.play(60)
            fed.until(lambda name=name: process_ids(gateway)[name] != before[name] and len(gateway.ready) == 2)
        fed.play(60)
        fed.until(lambda: len(fed.heard) == len(fed.expected))
        found, expected = fed.events
        assert found == expected
        assert "workers lost so far: 2; last: worker 2 does not report" in gateway.notes
        assert [event.kind for event in gateway.end()] == ["end"] * len(NAMES)
        order = STICK_CLASSES[:0:-1]
        gateway.exchange(opened(sticks.without(classes=STICK_CLASSES[:1])), order)
        fed.until(lambda: (fed.play(1), fed.heard[-1].classes == order)[1])
        processes = process_ids(gateway).values()
    if Path("/proc").is_dir():
        assert not [each for each in processes if Path(f"/proc/{each}").exists()]


def test_a_worker_that_cannot_begin_is_an_error(sticks: MotionLibrary, monkeypatch: pytest.MonkeyPatch) -> None:
    """No gateway waits for a worker that ends before it is ready."""
    monkeypatch.setattr(local, "_work", sys.exit)
    with pytest.raises(ChildProcessError, match="worker 1 ended before it was ready"):
        local.LocalGateway(1, opened(sticks), Terms(settings=Settings(), most=8))
