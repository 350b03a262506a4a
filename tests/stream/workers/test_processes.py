"""Workers on this machine: they start, answer as one process does, and are replaced."""

from __future__ import annotations

import os
import signal
import sys
import time
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from synthetic import STICK_CLASSES, stick_clip

from kinespace.library.windows.index import opened
from kinespace.stream.frame import Frame
from kinespace.stream.recognition import Recognition
from kinespace.stream.recognizer import Performers, Settings
from kinespace.stream.workers import local, track, worker
from kinespace.stream.workers.terms import Terms

if TYPE_CHECKING:
    from collections.abc import Callable

    from kinespace.library.motion_library import MotionLibrary

pytest.importorskip("zenoh")
RATE, PATIENCE = 60, 60.0
#: Seconds between two answers, and a frame: another worker's hops are others.
HOP = 1 / 30 + 1 / RATE + 0.001
NAMES = ("ann", "bob", "cleo", "dan")


def _without_hurry(*given: Any) -> None:  # noqa: ANN401 - as `local._work`
    """Work as a worker that is never too late, so that it leaves no answer out on a busy machine."""
    worker._Work._note_delay = lambda *_: None  # type: ignore[method-assign]  # noqa: SLF001 - the clock of overload
    local._work(*given)  # noqa: SLF001 - what a process does


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
        gateway.publish = lambda recognition, _: self.heard.append(recognition)

    def play(self, count: int) -> None:
        """Send some moments' frames; read until the last of them are answered."""
        for frames in [self._moments.pop(0) for _ in range(count)]:
            self.gateway.push_all(frames, time.monotonic())
            self.expected += [each for each in self._one.push_all(frames, frames[0].time) if each]
            self.gateway.tend(time.monotonic())
        newest = {each.performer: each.time for each in self.expected}
        self.until(
            lambda: {each.performer for each in self.heard if each.time > newest[each.performer] - HOP} == {*NAMES}
        )

    def until(self, reached: Callable[[], bool]) -> None:
        """Read until something is reached."""
        end = time.monotonic() + PATIENCE
        while not reached():
            assert time.monotonic() < end, (self.gateway.notes, len(self.heard), len(self.expected))
            self.gateway.tend(time.monotonic())
            time.sleep(0.001)

    @property
    def events(self) -> list[list[tuple[str, str, str]]]:
        """The events that came, and those of one process, by performer."""
        return [
            sorted((event.performer, event.kind, event.label) for each in answers for event in each.events)
            for answers in (self.heard, self.expected)
        ]


@pytest.mark.slow
def test_processes_answer_and_are_replaced(sticks: MotionLibrary, monkeypatch: pytest.MonkeyPatch) -> None:
    """No event is lost when one of two workers is killed, or hangs; another process takes its place."""
    monkeypatch.setattr(local, "_MAX_ABSENT", 0.5)
    monkeypatch.setattr(local, "_work", _without_hurry)
    monkeypatch.setattr(track, "DUE", PATIENCE)
    with closing(local.LocalGateway(2, opened(sticks), Terms(settings=Settings(), most=8))) as gateway:
        fed, processes = Fed(sticks, gateway), gateway._processes  # noqa: SLF001 - who is killed
        fed.play(60)
        for number in (signal.SIGKILL, signal.SIGSTOP if sys.platform != "win32" else signal.SIGTERM):
            lost = min(gateway.ready, key=int)
            os.kill(processes[lost].process.pid, number)
            fed.play(60)
            fed.until(lambda lost=lost: lost not in processes and len(gateway.ready) == 2)
        fed.play(60)
        found, expected = fed.events
        assert found == expected
        assert [event.kind for event in gateway.end()] == ["end"] * len(NAMES)
        order = STICK_CLASSES[:0:-1]
        gateway.exchange(opened(sticks.without(classes=STICK_CLASSES[:1])), order)
        fed.until(lambda: (fed.play(1), fed.heard[-1].classes == order)[1])
        numbers = [each.process.pid for each in processes.values()]
    if Path("/proc").is_dir():
        assert not [each for each in numbers if Path(f"/proc/{each}").exists()]


def test_a_worker_that_cannot_begin_is_an_error(sticks: MotionLibrary, monkeypatch: pytest.MonkeyPatch) -> None:
    """No gateway waits for a worker that ends before it is ready."""
    monkeypatch.setattr(local, "_work", sys.exit)
    with pytest.raises(ChildProcessError, match="worker 1 ended before it was ready"):
        local.LocalGateway(1, opened(sticks), Terms(settings=Settings(), most=8))
