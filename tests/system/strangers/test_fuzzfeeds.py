"""Fuzzing the feeds: ten thousand broken packets."""

from __future__ import annotations

import numpy as np
import pytest
from fuzzfeeds import broken, golden_packets, run, run_messages

from kinespace.stream.feeds import builtin_names, builtin_preset
from kinespace.stream.inputs.detection import Survey

pytestmark = pytest.mark.slow

#: Of each of the 15 presets, and of ZeroMQ.
PACKETS = 700
PRESETS = [builtin_preset(name) for name in builtin_names()]


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


def test_a_survey_takes_any_packet() -> None:
    """The survey can look at any packet as any preset."""
    survey = Survey()
    golden = [packet for preset in PRESETS for packet in golden_packets(preset.name)]
    for number, packet in zip(range(PACKETS), broken(golden, np.random.default_rng(0)), strict=False):
        survey.keep(packet, number / 30, ("10.0.0.7", 1))
    assert survey.packets == PACKETS
    guess = survey.guess(PRESETS[:6])
    assert guess is None or guess.joints
