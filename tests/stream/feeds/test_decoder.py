"""The decoder of other products' packets: hosts told apart, and the last packet that could not be read."""

from kinespace.stream.feeds.decoder import MAX_SENDERS, SenderNumbers
from kinespace.stream.feeds.frame_assembler import FORGET_AFTER


def test_hosts_are_numbered() -> None:
    """Hosts get numbers; a host that is silent for long gives its number back; numbers are limited."""
    numbers = SenderNumbers()
    assert [numbers.number(host, 0.0) for host in ("a", "b", "a")] == [1, 2, 1]
    numbers.number("b", FORGET_AFTER)
    assert numbers.number("c", FORGET_AFTER + 1.0) == 1
    given = [numbers.number(f"h{index}", FORGET_AFTER) for index in range(20)]
    assert (max(given), given[-1]) == (MAX_SENDERS, MAX_SENDERS)
    assert numbers.number("b", FORGET_AFTER) == 2
