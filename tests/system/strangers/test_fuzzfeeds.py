"""Fuzzing the feeds: ten thousand broken packets, and any arguments that hypothesis invents."""

from __future__ import annotations

import pytest
from fuzzfeeds import NoSocket, check, run, run_messages
from golden import bundle, message
from hypothesis import given
from hypothesis import strategies as st

from kinespace.stream.feeds import builtin_names, builtin_preset
from kinespace.stream.feeds.detection import Survey
from kinespace.stream.feeds.source import FeedSource

pytestmark = pytest.mark.slow

#: Of each of the 15 presets, and of ZeroMQ.
PACKETS = 700
PRESETS = [builtin_preset(name) for name in builtin_names()]
ADDRESSES = sorted({rule.address for preset in PRESETS for rule in preset.messages})
NAMES = sorted({name for preset in PRESETS for name in preset.joint_map})


@pytest.mark.parametrize("name", builtin_names())
def test_no_packet_raises_and_all_are_counted(name: str) -> None:
    """Golden packets cut, changed, joined and nested, in any order: nothing raises, every one is counted."""
    source = run(builtin_preset(name), PACKETS, seed=builtin_names().index(name))
    counts, made = source.counts, source.decoder.assembler.counts
    assert counts.received == PACKETS
    assert counts.malformed > 0
    assert made.frames + made.incomplete + made.late > 0


def test_no_message_raises_and_all_are_counted() -> None:
    """ZeroMQ messages with broken parts, parts missing, repeated and swapped: nothing raises, every one is counted."""
    counts = run_messages(PACKETS, seed=len(builtin_names())).counts
    assert counts.received == PACKETS
    assert min(counts.malformed, counts.foreign) > 0
    assert counts.malformed + counts.foreign < PACKETS


_ARGUMENTS = st.one_of(
    st.tuples(st.just("i"), st.integers(-(2**31), 2**31 - 1)),
    st.tuples(st.just("f"), st.floats(width=32)),
    st.tuples(st.just("d"), st.floats()),
    st.tuples(
        st.just("s"), st.one_of(st.sampled_from(NAMES), st.text(st.characters(exclude_characters="\0", codec="utf-8")))
    ),
)


@st.composite
def messages(draw: st.DrawFn) -> bytes:
    """Draw a message with an address of some preset's and any arguments."""
    address = draw(st.sampled_from(ADDRESSES))
    for placeholder in ("{joint}", "{performer}", "{skip}", "{any}"):
        while placeholder in address:
            address = address.replace(
                placeholder, draw(st.one_of(st.sampled_from(NAMES), st.integers(0, 99).map(str))), 1
            )
    arguments = draw(st.lists(_ARGUMENTS, max_size=16))
    return message(address, "".join(tag for tag, _ in arguments), *[value for _, value in arguments])


@given(
    st.sampled_from(PRESETS),
    st.lists(st.tuples(st.lists(messages(), min_size=1, max_size=4), st.booleans()), max_size=8),
)
def test_no_argument_raises(preset: object, packets: list[tuple[list[bytes], bool]]) -> None:
    """Messages of any preset with any arguments, loose and in bundles, into any preset."""
    source = FeedSource(NoSocket(), preset)  # type: ignore[arg-type]  # stands in a receiver's place
    for number, (parts, together) in enumerate(packets):
        for packet in [bundle(*parts)] if together else parts:
            check(source, packet, number / 50)


@given(st.lists(st.one_of(st.binary(max_size=60), messages()), max_size=6))
def test_a_survey_takes_any_packet(packets: list[bytes]) -> None:
    """The survey can look at any packet as any preset."""
    survey = Survey()
    for number, packet in enumerate(packets):
        survey.see(packet, "10.0.0.7:1", number / 30)
    assert survey.packets == len(packets)
    guess = survey.guess(PRESETS[:6])
    assert guess is None or guess.joints
