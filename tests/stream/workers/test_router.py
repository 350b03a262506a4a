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
        #: The numbers of each performer's frames, and of the last one that each worker got.
        self.sent: dict[str, list[int]] = {name: [] for name in NAMES}
        self.newest: dict[tuple[str, str], int] = {}
        #: Workers that have not been told to answer a performer whom they took over.
        self.warming = set[tuple[str, str]]()
        self.answered = dict.fromkeys(NAMES, 0)
        #: How often a worker took a performer over.
        self.takeovers = 0
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
            self.newest[worker, name] = each.seq
            if (worker, name) not in self.warming:
                self.answered[name] = max(self.answered[name], each.seq)

    def _send(self, worker: str, orders: Orders) -> None:
        self.takeovers += sum(each.take_over is not None for each in orders.frames)
        self._take(worker, orders.frames)

    def join(self, worker: str) -> None:
        """Let a worker come."""
        self.workers.append(worker)
        self._balance(self.workers)

    def lose(self, worker: str) -> None:
        """Let a worker go."""
        self.workers.remove(worker)
        self._remove(worker, self.workers)

    def move_all(self) -> None:
        """Let all performers move, one by one."""
        while any(track.to for track in self._performers.values()):
            before = self.takeovers
            self._move_one()
            assert self.takeovers == before + 1

    def frames(self) -> list[int]:
        """Send a frame of each performer; check that somebody answers it; give how many workers get each."""
        self.now += 1 / 60
        positions = np.random.default_rng(0).normal(size=(self.joints, 3))
        before = dict(self.newest)
        self.push_all([Frame(name, self.now, positions) for name in NAMES], self.now)
        for name, numbers in self.sent.items() if self.workers else ():
            assert numbers[-1] == self.answered[name]
        changed = [name for (worker, name), number in self.newest.items() if before.get((worker, name)) != number]
        return [changed.count(name) for name in NAMES]


def test_performers_move_one_by_one_if_their_former_worker_answers(sticks: MotionLibrary) -> None:
    """A worker's other performers wait for the last seconds of one only; after a death all come at once."""
    router = Noted(sticks)
    router.join("ann")
    for _ in range(100):
        router.frames()
    router.join("ben")
    assert router.takeovers == 0
    router.move_all()
    assert router.takeovers == len(NAMES) / 2
    assert set(router.frames()) == {1}
    router.join("cat")
    router.lose("cat")
    router.move_all()
    assert not any(worker == "cat" for worker, _ in router.newest)
    before = router.takeovers
    router.join("dan")
    router.lose("ben")
    assert router.takeovers == before + len(NAMES) / 2
    assert set(router.frames()) == {1}


@pytest.mark.parametrize("seed", range(6))
def test_every_frame_is_answered_and_no_worker_misses_one(sticks: MotionLibrary, seed: int) -> None:
    """Workers come and go, and performers move, in any order."""
    chance, router = np.random.default_rng(seed), Noted(sticks)
    router.join("worker 0")
    for number in range(1, 80):
        what = str(chance.choice(["join", "lose", "move", "move", "move"]))
        if what == "join" and len(router.workers) < 6:
            router.join(f"worker {number}")
        elif what == "lose" and len(router.workers) > 1:
            router.lose(str(chance.choice(router.workers)))
        elif what == "move":
            router._move_one()  # noqa: SLF001 - as a gateway does from time to time
        for _ in range(chance.integers(8)):
            router.frames()
    router.move_all()
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
