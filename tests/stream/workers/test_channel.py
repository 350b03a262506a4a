"""The channel: whole messages in order, no waiting, the oldest frames dropped first."""

from __future__ import annotations

import socket
from contextlib import closing
from typing import TYPE_CHECKING

import pytest

from kinespace.stream.workers.channel import MAX_BACKLOG, Channel

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.fixture
def ends() -> Iterator[tuple[Channel, Channel]]:
    """Give both ends of a channel."""
    one, other = map(Channel, socket.socketpair())
    with closing(one), closing(other):
        yield one, other


def read(channel: Channel, sender: Channel, count: int) -> list[bytes]:
    """Read so many messages, while the sender sends what waits."""
    messages: list[bytes] = []
    while len(messages) < count:
        sender.flush()
        messages += channel.receive() or []
    return messages


def test_messages_of_any_size_come_whole_and_in_order(ends: tuple[Channel, Channel]) -> None:
    """Small and large messages, also larger than the system's buffers, come as they were sent."""
    one, other = ends
    messages = [b"", b"a", b"b" * 3_000_000, b"c" * 70_000, b"d"]
    for message in messages:
        one.send(message)
    assert one.is_behind
    assert read(other, one, len(messages)) == messages
    assert not one.is_behind
    assert other.receive() == []


def test_the_oldest_frames_are_dropped_and_nothing_else(ends: tuple[Channel, Channel]) -> None:
    """Beyond the backlog the oldest frames go, counted; what must arrive arrives, and so do the newest frames."""
    one, other = ends
    size = MAX_BACKLOG // 16
    one.send(b"first" + bytes(3_000_000))
    for number in range(40):
        one.send(bytes([number]) * size, frames=10)
    one.send(b"last")
    messages = read(other, one, 42 - one.dropped // 10)
    assert one.dropped > 0
    assert one.dropped % 10 == 0
    assert (messages[0][:5], messages[-1]) == (b"first", b"last")
    assert [each[0] for each in messages[1:-1]] == list(range(one.dropped // 10, 40))


def test_a_closed_end_is_reported_after_its_last_message(ends: tuple[Channel, Channel]) -> None:
    """What was sent before the end is read first; then the end is told, and sending raises nothing."""
    one, other = ends
    one.send(b"last words")
    one.close()
    assert other.receive() == [b"last words"]
    assert other.receive() is None
    for _ in range(3):
        other.send(bytes(100_000))
    assert not other.is_behind
