"""Turns: packets of senders that take more than their share of the time are served last.

A packet costs at most some milliseconds, but a sender can send many. The time that each sender's packets take is a debt
that time pays off. Packets of a sender whose debt is too high are put aside until nothing else waits, one at a time;
beyond a few megabytes the oldest are dropped. A sender that is alone is never put aside.
"""

from __future__ import annotations

from collections import Counter, deque
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from kinespace.stream.packet import Packet, Sender

#: Share of the time that a sender may take permanently, and seconds that it may take at once.
SHARE, MAX_AT_ONCE = 0.25, 0.02
#: The highest debt, seconds, so that a sender that stops is soon treated like the others.
_MAX_DEBT = 0.1
#: Seconds that a frame takes after decoding, about the time of its recognition.
PER_EVENT = 5e-5
#: Seconds after which a silent sender counts as gone.
_THERE = 1.0
#: Senders whose debts are kept, at most; only a program that sends each packet from another port reaches the limit.
_MAX_SENDERS = 1024
#: Bytes and number of packets that are put aside, at most.
MAX_ASIDE, _MAX_PACKETS = 4 << 20, 1024


class Waiting(NamedTuple):
    """A packet that was put aside: its arrival in seconds on our clock, how long it had waited then, and its sender."""

    packet: Packet
    arrival: float
    waited: float
    sender: Sender


class _Account:
    """A sender's debt in seconds, and the time of that debt."""

    __slots__ = ("at", "debt")

    def __init__(self, now: float) -> None:
        self.debt, self.at = 0.0, now

    def due(self, now: float) -> float:
        """Give the debt as it is now."""
        self.debt, self.at = max(self.debt - SHARE * max(now - self.at, 0.0), 0.0), max(now, self.at)
        return self.debt


class Turns:
    """Keeps the debts of one receiver's senders, and the packets that were put aside.

    Attributes
    ----------
    aside
        The packets that were put aside, the oldest first.
    thrown_away
        Packets that were put aside and then dropped for want of room.
    """

    def __init__(self) -> None:
        self.thrown_away = 0
        self._accounts: dict[Sender, _Account] = {}
        self.aside = deque[Waiting]()
        self._aside_bytes = 0
        #: How many of each sender's packets are put aside.
        self._aside_of: Counter[Sender] = Counter()
        self._before: Sender = None
        #: When a packet last came from another sender than the packet before, seconds on our clock.
        self._changed = float("-inf")

    def comes_last(self, sender: Sender, now: float) -> bool:
        """Note a packet's sender, and say whether the packet is to be put aside; `now` in seconds."""
        if sender != self._before:
            self._before = sender
            # The very first sender is not another than the one before.
            self._changed = now if self._accounts else self._changed
        if now - self._changed >= _THERE:
            return False
        account = self._accounts.get(sender)
        # A sender's packets stay in their order: behind those that are put aside.
        return self._aside_of[sender] > 0 or (account is not None and account.due(now) > MAX_AT_ONCE)

    def charge(self, sender: Sender, seconds: float, events: int, now: float) -> None:
        """Note the seconds that a packet took, and the number of its frames and announcements."""
        account = self._accounts.get(sender)
        if account is None:
            if len(self._accounts) >= _MAX_SENDERS:
                del self._accounts[next(iter(self._accounts))]
            account = self._accounts[sender] = _Account(now)
        account.debt = min(account.due(now) + seconds + PER_EVENT * events, _MAX_DEBT)

    def put_aside(self, waiting: Waiting) -> None:
        """Keep a packet until nothing else waits; the oldest packets make room for it."""
        self.aside.append(waiting)
        self._aside_of[waiting.sender] += 1
        self._aside_bytes += _size(waiting.packet)
        while self._aside_bytes > MAX_ASIDE or len(self.aside) > _MAX_PACKETS:
            self.take()
            self.thrown_away += 1

    def take(self) -> Waiting:
        """Take the oldest packet that was put aside."""
        waiting = self.aside.popleft()
        self._aside_of[waiting.sender] -= 1
        if not self._aside_of[waiting.sender]:
            del self._aside_of[waiting.sender]
        self._aside_bytes -= _size(waiting.packet)
        return waiting

    def last(self, now: float) -> list[Sender]:
        """List the senders whose packets are put aside."""
        if now - self._changed >= _THERE:
            return []
        return [sender for sender, account in self._accounts.items() if account.due(now) > MAX_AT_ONCE / 2]


def _size(packet: Packet) -> int:
    return len(packet) if isinstance(packet, bytes) else sum(map(len, packet))
