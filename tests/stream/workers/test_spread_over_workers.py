"""Spreading performers over workers that come and go, without processes: who is sent which frames."""

from __future__ import annotations

from bisect import bisect_left
from typing import TYPE_CHECKING

import numpy as np
import pytest

from kinespace.stream.frame import Frame
from kinespace.stream.recognizer import SentJoints, Settings
from kinespace.stream.workers.ledger import Ledger
from kinespace.stream.workers.spread import Spread
from kinespace.stream.workers.wire import (
    ASK,
    FRAMES,
    TAKE_OVER,
    Answers,
    decode_entries,
    decode_frames,
    decode_number,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.library.motion_library import MotionLibrary
    from kinespace.stream.workers.wire import SentFrame

#: The newest frame of a worker that was told of a performer, and waits for the last seconds.
_TAKEN_OVER = -1
NAMES = tuple(f"performer {number}" for number in range(40))


class Noted(Spread):
    """Notes which frames reach each worker, and how many at once."""

    def __init__(self, library: MotionLibrary) -> None:
        super().__init__(library, library.classes, Settings(), SentJoints(), Ledger(most=64, silence=5.0))
        self.joints = len(library.skeleton.joints)
        self.workers: list[str] = []
        self.leaving: list[str] = []
        self.asked: dict[str, list[int]] = {}
        #: The numbers of each performer's frames, and of the last one that each worker got.
        self.sent: dict[str, list[int]] = {name: [] for name in NAMES}
        self.newest: dict[tuple[str, str], int] = {}
        self.answered = dict.fromkeys(NAMES, 0)
        self.most_at_once = 0
        self.now = 1.0

    def _give(self, worker: str, frames: list[SentFrame]) -> None:
        for each in frames:
            name, number = each.performer, each.seq or 0
            if not self.sent[name] or self.sent[name][-1] < number:
                self.sent[name].append(number)
            self._take(worker, name, number)

    def _take(self, worker: str, name: str, number: int) -> None:
        """Check that a worker gets a performer's frames without a hole, and answer this one."""
        place = bisect_left(self.sent[name], number)
        # The first of the last frames may be any.
        if (before := self.newest.get((worker, name), 0)) != _TAKEN_OVER:
            assert before == (self.sent[name][place - 1] if place else 0)
        self.newest[worker, name] = number
        self.answered[name] = max(self.answered[name], number)

    def _tell(self, worker: str, message: bytes) -> None:
        kind, content = message[: len(FRAMES)], message[len(FRAMES) :]
        if kind == TAKE_OVER:
            for entry in decode_entries(content):
                self.newest[worker, entry.performer] = _TAKEN_OVER
        elif kind == FRAMES:
            frames = decode_frames(content)
            self.most_at_once = max(self.most_at_once, len(frames))
            for each, _ in frames:
                self._take(worker, each.performer, each.seq or 0)
        elif kind == ASK:
            self.asked.setdefault(worker, []).append(decode_number(content))

    def join(self, worker: str) -> None:
        """Let a worker come."""
        self.workers.append(worker)
        self._assign(self.workers)

    def leave(self, worker: str) -> None:
        """Let a worker ask for leave."""
        self.workers.remove(worker)
        self.leaving.append(worker)
        self._assign(self.workers, [worker])

    def lose(self, worker: str) -> None:
        """Let a worker go without a word, perhaps one that has asked for leave."""
        (self.workers if worker in self.workers else self.leaving).remove(worker)
        self._lose(worker, self.workers)
        self.asked.pop(worker, None)

    def deal(self, worker: str) -> None:
        """Let a worker answer the questions so far."""
        if asked := self.asked.pop(worker, []):
            self.take_back(worker, Answers([], last=max(asked)))

    def catch_up(self) -> None:
        """Let all workers deal with everything."""
        while self.asked:
            for worker in [*self.asked]:
                self.deal(worker)

    def frames(self) -> list[int]:
        """Send a frame of each performer; check that somebody answers it; give how many workers get each."""
        self.now += 1 / 60
        positions = np.random.default_rng(0).normal(size=(self.joints, 3))
        before = dict(self.newest)
        self.push_all([Frame(name, self.now, positions) for name in NAMES], self.now)
        assert self.answered == {name: numbers[-1] for name, numbers in self.sent.items()}
        changed = [name for (worker, name), number in self.newest.items() if before.get((worker, name)) != number]
        return [changed.count(name) for name in NAMES]


@pytest.mark.parametrize("order", [("ben", "cat"), ("cat", "ben")])
def test_a_second_worker_comes_before_the_first_has_caught_up(sticks: MotionLibrary, order: Sequence[str]) -> None:
    """The first worker answers until one of them has caught up."""
    spread = Noted(sticks)
    spread.join("ann")
    spread.frames()
    spread.join("ben")
    spread.frames()
    spread.join("cat")
    spread.frames()
    for worker in order:
        spread.deal(worker)
        spread.frames()
    spread.catch_up()
    assert set(spread.frames()) == {1}


def test_performers_move_in_pieces_if_their_former_worker_answers(sticks: MotionLibrary) -> None:
    """A worker's other performers wait for a piece of the last seconds only; after a death all come at once."""
    spread = Noted(sticks)
    spread.join("ann")
    for _ in range(100):
        spread.frames()
    spread.join("ben")
    spread.catch_up()
    assert 0 < spread.most_at_once <= 16
    assert set(spread.frames()) == {1}
    spread.leave("ann")
    spread.catch_up()
    assert spread.most_at_once <= 16
    assert {worker for worker, _ in spread.newest} == {"ann", "ben"}
    spread.join("cat")
    spread.catch_up()
    spread.lose("ben")
    assert spread.most_at_once > 16
    assert set(spread.frames()) == {1}


def test_a_worker_catches_up_with_a_feed_that_is_faster_than_pieces(sticks: MotionLibrary) -> None:
    """Pieces grow where more frames come between two pieces than a piece has."""
    spread = Noted(sticks)
    spread.join("ann")
    for _ in range(150):
        spread.frames()
    spread.join("ben")
    for _ in range(300):
        for _ in range(30):
            spread.frames()
        if not spread.asked:
            break
        spread.deal("ben")
    assert not spread.asked
    assert set(spread.frames()) == {1}


@pytest.mark.parametrize("seed", range(6))
def test_every_frame_is_answered_and_no_worker_misses_one(sticks: MotionLibrary, seed: int) -> None:
    """Workers come, ask for leave, go and catch up in any order."""
    chance, spread = np.random.default_rng(seed), Noted(sticks)
    spread.join("worker 0")
    for number in range(1, 80):
        what = str(chance.choice(["join", "leave", "lose", "end", "deal", "deal", "deal", "deal"]))
        if what == "join" and len(spread.workers) < 6:
            spread.join(f"worker {number}")
        elif what in {"leave", "lose"} and len(spread.workers) > 1:
            getattr(spread, what)(str(chance.choice(spread.workers)))
        elif what == "end" and spread.leaving:
            spread.lose(spread.leaving[0])
        elif what == "deal":
            spread.deal(str(chance.choice(spread.workers)))
        for _ in range(chance.integers(8)):
            spread.frames()
    spread.catch_up()
    assert set(spread.frames()) == {1}
