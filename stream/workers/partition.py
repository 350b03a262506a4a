"""Partitions: a fixed number of groups of performers, each of which belongs to one worker.

The owner of a partition follows from the workers' names alone (rendezvous hashing: Thaler and Ravishankar 1998), so
that each process that knows the workers knows the owners, and few partitions move when a worker comes or goes. No
worker owns more than its share, rounded up.
"""

from __future__ import annotations

from hashlib import blake2b
from typing import TYPE_CHECKING
from zlib import crc32

if TYPE_CHECKING:
    from collections.abc import Collection

#: The number of partitions. All gateways and workers must have the same.
PARTITIONS = 64


def partition_of(performer: str) -> int:
    """Give the partition of a performer, 0 to `PARTITIONS` - 1."""
    return crc32(performer.encode(errors="surrogatepass")) % PARTITIONS


def owners(workers: Collection[str]) -> tuple[str, ...]:
    """Give the owner of each partition: the worker that ranks highest for it and has room; empty without workers."""
    if not workers:
        return ()
    room = dict.fromkeys(sorted(workers), -(-PARTITIONS // len(workers)))
    found = []
    for partition in range(PARTITIONS):
        owner = max((worker for worker, left in room.items() if left), key=lambda worker: _rank(partition, worker))
        room[owner] -= 1
        found.append(owner)
    return tuple(found)


def _rank(partition: int, worker: str) -> bytes:
    return blake2b(f"{partition}/{worker}".encode(), digest_size=8).digest()
