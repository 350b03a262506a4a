"""Prefetching: items in order, so many and no more, errors at their place."""

from __future__ import annotations

import sys
import threading
import time
from typing import TYPE_CHECKING

import pytest
from programs import PATIENCE

from kinespace.tools.feeding.prefetch import ReadAhead

if TYPE_CHECKING:
    from collections.abc import Iterator


def test_all_of_it_comes_in_order() -> None:
    """All items come out in order, and the thread ends."""
    with ReadAhead(iter(range(50))) as ahead:
        assert list(ahead) == list(range(50))
    assert "kinespace reading" not in {thread.name for thread in threading.enumerate()}


@pytest.mark.parametrize("most", [1, 3])
def test_no_more_is_read_than_is_to_be_ready(most: int) -> None:
    """So many wait and one is in the thread's hand; taking one lets one more be read."""
    read = list[int]()

    def source() -> Iterator[int]:
        for number in range(100):
            read.append(number)
            yield number

    with ReadAhead(source(), most=most) as ahead:
        for taken in range(4):
            until = time.monotonic() + PATIENCE
            while len(read) < taken + most + 1 and time.monotonic() < until:
                time.sleep(0.001)
            time.sleep(0.02)
            assert len(read) == taken + most + 1
            assert next(iter(ahead)) == taken


def test_an_error_comes_after_the_items_before_it() -> None:
    """Items before the error are given first; then the error is raised in the consumer."""

    def source() -> Iterator[int]:
        yield 1
        yield 2
        raise ValueError("broken")

    got = list[int]()
    with pytest.raises(ValueError, match="broken"), ReadAhead(source()) as ahead:
        got.extend(ahead)
    assert got == [1, 2]


def test_waiting_is_measured() -> None:
    """Time spent waiting for an item counts; the interpreter's switch interval is restored."""

    def source() -> Iterator[int]:
        time.sleep(0.2)
        yield 1

    before = sys.getswitchinterval()
    with ReadAhead(source()) as ahead:
        assert sys.getswitchinterval() <= before
        assert list(ahead) == [1]
        assert ahead.waited >= 0.15
    assert sys.getswitchinterval() == before
