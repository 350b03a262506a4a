"""Partitions: everybody finds the same owners, shares are even, and few partitions move."""

from __future__ import annotations

from collections import Counter

import pytest

from kinespace.stream.workers.partition import PARTITIONS, owners, partition_of


def bit_by_bit(name: str) -> int:
    """Divide by CRC-32's polynomial bit by bit."""
    rest = 0xFFFFFFFF
    for byte in name.encode():
        rest ^= byte
        for _ in range(8):
            rest = (rest >> 1) ^ (0xEDB88320 if rest & 1 else 0)
    return rest ^ 0xFFFFFFFF


@pytest.mark.parametrize("performer", ["ann", "bob", "Žofie", "p1"])
def test_a_partition_is_the_crc_of_the_name(performer: str) -> None:
    """A performer's partition is the CRC-32 of the name in UTF-8 modulo 64: a foreign sender can compute it."""
    assert partition_of(performer) == bit_by_bit(performer) % 64


@pytest.mark.parametrize("count", [1, 2, 3, 5, 16])
def test_shares_are_even(count: int) -> None:
    """No worker owns more than its share, rounded up, in whatever order workers are named."""
    workers = [f"w{number}" for number in range(count)]
    found = owners(workers)
    assert max(Counter(found).values()) <= -(-PARTITIONS // count)
    assert set(found) == set(workers)
    assert owners(workers[::-1]) == found


@pytest.mark.parametrize("count", [2, 3, 5, 16])
def test_few_partitions_move(count: int) -> None:
    """When a worker leaves, at most four times its share moves; without even shares it would be its share alone."""
    workers = [f"w{number}" for number in range(count)]
    before, after = owners(workers), owners(workers[1:])
    assert sum(old != new for old, new in zip(before, after, strict=True)) <= 4 * -(-PARTITIONS // count)


def test_without_workers_no_partition_has_an_owner() -> None:
    """Without workers there are no owners."""
    assert owners([]) == ()
