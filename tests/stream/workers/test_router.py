"""Spreading performers over workers that come and go, without processes: who is sent which frames."""

from __future__ import annotations

from bisect import bisect_left
from typing import TYPE_CHECKING

import numpy as np
import pytest

from kinespace.stream.frame import Announcement, Frame
from kinespace.stream.recognizer import Settings
from kinespace.stream.workers.router import Router
from kinespace.stream.workers.terms import Terms
from kinespace.stream.workers.wire import Answers

if TYPE_CHECKING:
    from kinespace.library.motion_library import MotionLibrary
    from kinespace.stream.workers.wire import Orders, SentFrame

NAMES = tuple(f"performer {number}" for number in range(40))


class Noted(Router):
    """Notes which frames reach each worker, and how many at once."""

    def __init__(self, library: MotionLibrary) -> None:
        super().__init__(library, Terms(settings=Settings(), most=len(NAMES)))
        self.joints = len(library.skeleton.joints)
        self.workers: list[str] = []
        self.leaving: list[str] = []
        self.asked: dict[str, list[int]] = {}
        #: The numbers of each performer's frames, and of the last one that each worker got.
        self.sent: dict[str, list[int]] = {name: [] for name in NAMES}
        self.newest: dict[tuple[str, str], int] = {}
        #: Workers that have not been told to answer a performer whom they took over.
        self.warming = set[tuple[str, str]]()
        self.answered = dict.fromkeys(NAMES, 0)
        #: The performers to whose frames a worker has not sent its answers yet.
        self.owed: dict[str, set[str]] = {}
        self.most_at_once = 0
        self.now = 1.0

    def _send_frames(self, worker: str, frames: list[SentFrame]) -> None:
        self._take(worker, frames)

    def _take(self, worker: str, frames: list[SentFrame]) -> None:
        """Check that a worker gets a performer's frames without a hole, and answer those that it must answer."""
        for each in frames:
            name = each.performer
            if each.seq not in self.sent[name]:
                self.sent[name].append(each.seq)
            place = bisect_left(self.sent[name], each.seq)
            if each.take_over:
                self.warming.add((worker, name))
            if not each.begins:
                assert self.newest[worker, name] == self.sent[name][place - 1]
            if each.go_on:
                self.warming.remove((worker, name))
                assert not any(name in owed for other, owed in self.owed.items() if other != worker)
            self.newest[worker, name] = each.seq
            if (worker, name) not in self.warming:
                self.answered[name] = max(self.answered[name], each.seq)
                self.owed.setdefault(worker, set()).add(name)

    def _send(self, worker: str, orders: Orders) -> None:
        self.most_at_once = max(self.most_at_once, len(orders.frames))
        self._take(worker, orders.frames)
        if orders.question:
            self.asked.setdefault(worker, []).append(orders.question)

    @property
    def alive(self) -> list[str]:
        """The workers that have not gone."""
        return [*self.workers, *self.leaving]

    def join(self, worker: str) -> None:
        """Let a worker come."""
        self.workers.append(worker)
        self._balance(self.workers, self.alive)

    def leave(self, worker: str) -> None:
        """Let a worker ask for leave."""
        self.workers.remove(worker)
        self.leaving.append(worker)
        self._balance(self.workers, self.alive)

    def lose(self, worker: str) -> None:
        """Let a worker go without a word, perhaps one that has asked for leave."""
        (self.workers if worker in self.workers else self.leaving).remove(worker)
        self.asked.pop(worker, None)
        self.owed.pop(worker, None)
        self._remove(worker, self.workers, self.alive)

    def deal(self, worker: str) -> None:
        """Let a worker answer the questions so far."""
        self.owed.pop(worker, None)
        if asked := self.asked.pop(worker, []):
            self.accept(worker, Answers("", question=max(asked)))

    def catch_up(self) -> None:
        """Let all workers deal with everything."""
        while self.asked:
            self.catch_up_once()

    def catch_up_once(self) -> None:
        """Let all workers deal with the questions so far."""
        for worker in [*self.asked]:
            self.deal(worker)

    def frames(self) -> list[int]:
        """Send a frame of each performer; check that somebody answers it; give how many workers get each."""
        self.now += 1 / 60
        positions = np.random.default_rng(0).normal(size=(self.joints, 3))
        before = dict(self.newest)
        self.push_all([Frame(name, self.now, positions) for name in NAMES], self.now)
        for name, numbers in self.sent.items() if self.workers else ():
            move = self._performers[name].move
            assert numbers[-1] == self.answered[name] or (move and move.is_last)
        changed = [name for (worker, name), number in self.newest.items() if before.get((worker, name)) != number]
        return [changed.count(name) for name in NAMES]


def played(library: MotionLibrary, moments: int) -> Noted:
    """Let one worker recognise for a while, then another one join."""
    router = Noted(library)
    router.join("ann")
    for _ in range(moments):
        router.frames()
    router.join("ben")
    return router


def test_performers_move_in_pieces_if_their_former_worker_answers(sticks: MotionLibrary) -> None:
    """A worker's other performers wait for a piece of the last seconds only; after a death all come at once."""
    router = played(sticks, 100)
    router.catch_up()
    assert 0 < router.most_at_once <= 16
    assert set(router.frames()) == {1}
    router.leave("ann")
    router.catch_up()
    assert router.most_at_once <= 16
    assert {worker for worker, _ in router.newest} == {"ann", "ben"}
    router.join("cat")
    moves = {name: track.move for name, track in router._performers.items() if track.move}  # noqa: SLF001 - not begun anew
    router.join("dan")
    assert any(router._performers[name].move is move for name, move in moves.items())  # noqa: SLF001 - as above
    router.leave("dan")
    router.catch_up()
    router.lose("ben")
    assert router.most_at_once > 16
    assert set(router.frames()) == {1}


def test_a_worker_catches_up_with_a_feed_that_is_faster_than_pieces(sticks: MotionLibrary) -> None:
    """Pieces grow where more frames come between two pieces than a piece has."""
    router = played(sticks, 40)
    for _ in range(20):
        for _ in range(20):
            router.frames()
        router.catch_up_once()
    answering = {track.worker for track in router._performers.values()}  # noqa: SLF001 - who answers
    assert answering == {"ann", "ben"}


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_every_frame_is_answered_and_no_worker_misses_one(sticks: MotionLibrary, seed: int) -> None:
    """Workers come, ask for leave, go and catch up in any order."""
    chance, router = np.random.default_rng(seed), Noted(sticks)
    router.join("worker 0")
    for number in range(1, 80):
        what = str(chance.choice(["join", "leave", "lose", "end", "deal", "deal", "deal", "deal"]))
        if what == "join" and len(router.workers) < 6:
            router.join(f"worker {number}")
        elif what in {"leave", "lose"} and len(router.workers) > 1:
            getattr(router, what)(str(chance.choice(router.workers)))
        elif what == "end" and router.leaving:
            router.lose(router.leaving[0])
        elif what == "deal":
            router.deal(str(chance.choice(router.alive)))
        for _ in range(chance.integers(8)):
            router.frames()
    router.catch_up()
    assert set(router.frames()) == {1}
    shares = router._load().values()  # noqa: SLF001 - who has how many
    assert max(shares) - min(shares) <= 1


def test_a_further_performer_has_no_room_and_joints_are_put_in_order(sticks: MotionLibrary) -> None:
    """Its frames are counted; announced joints in another order are put in the library's."""
    router = Noted(sticks)
    router.frames()
    positions = np.arange(3.0 * router.joints).reshape(-1, 3)
    assert router.push_all([Frame("one more", 1.0, positions)], 1.0) == [None]
    assert (router.names, router.counts.no_room, router.unsent) == (NAMES, 1, len(NAMES))
    router.push_all([Announcement(NAMES[0], sticks.skeleton.joints[::-1])], 1.0)
    turned = router.ordered(Frame(NAMES[0], 9.0, positions[::-1]))
    assert turned
    assert np.array_equal(turned.positions, positions)
    assert router.ordered(Frame(NAMES[0], 9.0, positions[1:])) is None
