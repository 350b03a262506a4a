"""Bad feeds: everything that a sender does wrong is counted, and valid frames are recognised all the same."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np
import pytest
import wrong
from performed import assert_same, pushed, shown

from kinespace.stream import osc, zeromq
from kinespace.stream.inputs import Admission, OscDecoder, ZmqDecoder
from kinespace.stream.recognizer import Performers, Recognizer, Settings

if TYPE_CHECKING:
    from kinespace.library.clip import Clip
    from kinespace.library.motion_library import MotionLibrary

pytestmark = pytest.mark.slow

SETTINGS = Settings(hop=0.04)
#: What is counted, with packets that show there and nowhere else.
OSC_PACKETS = {"malformed": wrong.MALFORMED_OSC, "foreign": wrong.FOREIGN_OSC, "other_joints": wrong.OTHER_JOINTS_OSC}
ZMQ_PACKETS = {"malformed": wrong.MALFORMED_ZMQ, "foreign": wrong.FOREIGN_ZMQ, "other_joints": wrong.OTHER_JOINTS_ZMQ}


@pytest.mark.parametrize(("decoder", "bad"), [(OscDecoder(), OSC_PACKETS), (ZmqDecoder(), ZMQ_PACKETS)], ids=type)
def test_everything_at_once(
    small_library: MotionLibrary,
    some_clips: tuple[Clip, ...],
    decoder: OscDecoder,
    bad: dict[str, dict[str, bytes | list[bytes]]],
) -> None:
    """With all that is wrong between the frames, each in its counter and no other, all answers are as without it."""
    clip = next(clip for clip in some_clips if clip.class_name == "squat1Reps")
    frames = shown(clip.positions.astype(np.float32), begin=10.0)
    expected = pushed(Recognizer(small_library, SETTINGS), frames)
    is_osc = not isinstance(decoder, ZmqDecoder)
    wrong_ones = [packet for packets in bad.values() for packet in packets.values()]
    shares = np.array_split(np.random.default_rng(18).permutation(len(wrong_ones)), len(frames))
    admission, performers, answers = Admission(), Performers(small_library, SETTINGS), []
    for seq, (frame, share) in enumerate(zip(frames, shares, strict=True)):
        good = osc.encode_frame(frame) if is_osc else zeromq.encode_frame(frame, seq)
        late = [wrong.late(frame.time - 0.1)[not is_osc]] if seq == len(frames) - 1 else []
        for packet in [good, *(wrong_ones[place] for place in share), *late]:
            events = admission.admit(decoder.decode(packet, frame.time, None), frame.time, None)
            answers += [answer for answer in performers.push_all(events, frame.time) if answer]
    counts, outcomes = decoder.counts, performers.counts
    found = {"malformed": counts.malformed, "foreign": counts.foreign, "other_joints": outcomes.other_joints}
    assert found == Counter({name: len(packets) for name, packets in bad.items()})
    assert (counts.missing, outcomes.no_room, outcomes.recognizers.restarts) == (0, 0, 0)
    assert outcomes.recognizers.out_of_order == 1
    ours = [answer for answer in answers if answer.performer == "p"]
    assert_same(ours, expected)
    assert clip.class_name in {answer.label for answer in ours}
