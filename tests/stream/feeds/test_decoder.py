"""The decoder of other products' packets: hosts and programs told apart, and the last packet that could not be read."""

from kinespace.stream.feeds.frame_assembler import FORGET_AFTER
from kinespace.stream.inputs.decoder import MAX_SENDERS, STEADY, SenderNumbers


def test_hosts_are_numbered() -> None:
    """Hosts get numbers; a host that is silent for long gives its number back; numbers are limited."""
    numbers = SenderNumbers()
    assert [numbers.number(host, 0.0) for host in ("a", "b", "a")] == [1, 2, 1]
    numbers.number("b", FORGET_AFTER)
    assert numbers.number("c", FORGET_AFTER + 1.0) == 1
    given = [numbers.number(f"h{index}", FORGET_AFTER) for index in range(20)]
    assert (max(given), given[-1]) == (MAX_SENDERS, MAX_SENDERS)
    assert numbers.number("b", FORGET_AFTER) == 2


def test_two_programs_of_one_host_are_told_apart() -> None:
    """Two that keep to their ports and send the same have two numbers; one that changes ports, or splits, has one."""
    numbers, times = SenderNumbers(), [step / 30 for step in range(60)]
    both = [
        (numbers.number("a", time, 5000, "/p1/head"), numbers.number("a", time, 5001, "/p1/head")) for time in times
    ]
    assert both[0] == (1, 1)
    assert set(both[STEADY:]) == {(1, 2)}
    numbers = SenderNumbers()
    assert {numbers.number("a", time, 5000 + step, "/p1/head") for step, time in enumerate(times)} == {1}
    assert {numbers.number("a", time, 5000 + step % 2, f"/p{step % 2}/head") for step, time in enumerate(times)} == {1}
    numbers = SenderNumbers()
    assert {numbers.number("a", time, 5000 + (step > 30), "/p1/head") for step, time in enumerate(times)} == {1}
