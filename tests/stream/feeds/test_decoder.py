"""The decoder of other products' packets: hosts told apart, and the last packet that could not be read."""

from __future__ import annotations

from golden import message

from kinespace.stream.feeds import builtin_preset
from kinespace.stream.feeds.decoder import MAX_SENDERS, FeedDecoder, SenderNumbers
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


def test_the_last_malformed_packet_is_named() -> None:
    """A packet that is no OSC, and a message with other arguments, are counted and named with their sender."""
    decoder, sender = FeedDecoder(builtin_preset("osceleton")), ("10.0.0.7", 9)
    assert decoder.decode(b"junk", 1.0, sender) == ()
    (line,) = decoder.refusals.lines()
    assert line == "last malformed: neither a message nor a bundle, from 10.0.0.7:9: 'junk'"
    assert decoder.decode(message("/joint", "s", "head"), 1.0, sender) == []
    (line,) = decoder.refusals.lines()
    assert line.startswith("last malformed: /joint: expected other arguments, got 1, from 10.0.0.7:9: '/joint")
    decoder.assembler.counts.incomplete, decoder.assembler.counts.absurd = 3, 4
    assert (decoder.counts.received, decoder.counts.malformed, decoder.counts.incomplete) == (2, 2, 7)
