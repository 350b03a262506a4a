"""Spreading performers over workers that come and go, without workers: only who is told what."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from kinespace.stream.frame import Frame
from kinespace.stream.recognizer import SentJoints, Settings
from kinespace.stream.recognizer.performers import PerformerCounts
from kinespace.stream.workers.ledger import Ledger
from kinespace.stream.workers.spread import Spread
from kinespace.stream.workers.wire import (
    ASK,
    FRAMES,
    TAKE_OVER,
    UNMUTE,
    Answers,
    Report,
    decode_entries,
    decode_number,
)
from kinespace.stream.zeromq.frames import MAX_SEQ

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.library.motion_library import MotionLibrary
    from kinespace.stream.workers.wire import SentFrame

NAMES = tuple(f"performer {number}" for number in range(40))


class Noted(Spread):
    """Notes which workers may answer for whom, and whose frames reach such a worker."""

    def __init__(self, library: MotionLibrary) -> None:
        super().__init__(library, library.classes, Settings(), SentJoints(), Ledger(most=64, silence=5.0))
        self.joints = len(library.skeleton.joints)
        self.workers: list[str] = []
        self.mute: dict[str, set[str]] = {}
        self.asked: dict[str, list[int]] = {}
        self.heard = dict.fromkeys(NAMES, 0)
        self.now = 1.0

    def _give(self, worker: str, frames: list[SentFrame]) -> None:
        for each in frames:
            self.heard[each.performer] += each.performer not in self.mute.get(worker, ())

    def _tell(self, worker: str, message: bytes) -> None:
        kind, content = message[: len(FRAMES)], message[len(FRAMES) :]
        mute = self.mute.setdefault(worker, set())
        if kind == TAKE_OVER:
            for entry in decode_entries(content):
                (mute.add if entry.answered == MAX_SEQ else mute.discard)(entry.performer)
        elif kind == UNMUTE:
            mute.difference_update(entry.performer for entry in decode_entries(content))
        elif kind == ASK:
            self.asked.setdefault(worker, []).append(decode_number(content))

    def join(self, worker: str) -> None:
        """Let a worker come."""
        self.workers.append(worker)
        self._assign(self.workers)

    def lose(self, worker: str) -> None:
        """Let a worker go without a word."""
        self.workers.remove(worker)
        self._lose(worker, self.workers)
        self.asked.pop(worker, None)

    def caught_up(self, worker: str) -> None:
        """Let a worker answer the questions so far."""
        if asked := self.asked.pop(worker, []):
            report = Report(PerformerCounts(), {}, {}, {}, last=max(asked))
            self.take_back(worker, Answers([], report))

    def frames(self) -> Sequence[int]:
        """Send a frame of each performer; give how many workers that may answer got each."""
        self.now += 1 / 60
        self.heard = dict.fromkeys(NAMES, 0)
        positions = np.random.default_rng(0).normal(size=(self.joints, 3))
        self.push_all([Frame(name, self.now, positions) for name in NAMES], self.now)
        return list(self.heard.values())


@pytest.mark.parametrize("order", [("ben", "cat"), ("cat", "ben")])
def test_a_second_worker_comes_before_the_first_has_caught_up(sticks: MotionLibrary, order: Sequence[str]) -> None:
    """The first worker answers until one of them has caught up."""
    spread = Noted(sticks)
    spread.join("ann")
    spread.frames()
    spread.join("ben")
    assert min(spread.frames()) >= 1
    spread.join("cat")
    assert min(spread.frames()) >= 1
    for worker in order:
        spread.caught_up(worker)
        assert min(spread.frames()) >= 1
    assert set(spread.frames()) == {1}


@pytest.mark.parametrize("seed", range(20))
def test_every_frame_reaches_a_worker_that_may_answer(sticks: MotionLibrary, seed: int) -> None:
    """Workers come, go and catch up in any order."""
    chance, spread = np.random.default_rng(seed), Noted(sticks)
    spread.join("worker 0")
    for number in range(1, 60):
        what = str(chance.choice(["join", "lose", "caught up", "caught up"]))
        if what == "join" and len(spread.workers) < 6:
            spread.join(f"worker {number}")
        elif what == "lose" and len(spread.workers) > 1:
            spread.lose(str(chance.choice(spread.workers)))
        elif what == "caught up":
            spread.caught_up(str(chance.choice(spread.workers)))
        assert min(spread.frames()) >= 1
    for worker in spread.workers:
        spread.caught_up(worker)
    assert set(spread.frames()) == {1}
