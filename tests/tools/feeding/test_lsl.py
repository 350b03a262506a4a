"""LSL both ways, on this machine alone: answers to pylsl's inlet, and positions from pylsl's outlet."""

import os
from collections.abc import Iterator
from contextlib import closing
from typing import Any

import numpy as np
import pytest
from programs import PATIENCE, until

from kinespace.stream import Announcement, Done, Event, EventKind, Frame, Outcome, Progress, Recognition, osc
from kinespace.stream.outputs.lsl_sink import FURTHER, LslSink
from kinespace.stream.recognition import Gone
from kinespace.tools.feeding.lsl_feed import LslFeed, StreamJoints

pylsl = pytest.importorskip("pylsl", reason="pylsl finds no library of LSL", exc_type=(ImportError, RuntimeError))
#: No packet leaves this machine, and no stream is another program's, or another run's of these tests.
CONFIG = f"[ports]\nIPv6=disable\n[multicast]\nResolveScope=machine\n[lab]\nSessionID=kinespace-{os.getpid()}\n"
CLASSES = ("bow", "jump")
#: Seconds by which LSL may be mistaken in the offset of two clocks: on a busy machine it takes its own delays for it.
CLOCKS = 0.2
FOLLOWED = Progress("jump", 0.5, 0.5, 1.25, 0.75, sure=1.0, cycles=0)
JOINTS = tuple("abcdef")


@pytest.fixture(autouse=True, scope="module")
def _this_machine(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Configure LSL before its first stream, by a file: ours would take the place of other settings."""
    file = tmp_path_factory.mktemp("lsl") / "lsl_api.cfg"
    file.write_text(CONFIG, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("LSLAPICFG", str(file))
        yield


def _inlet(name: str) -> Any:  # noqa: ANN401 - pylsl has no types
    (info,) = pylsl.resolve_byprop("name", name, timeout=PATIENCE)
    inlet = pylsl.StreamInlet(info)
    inlet.open_stream(timeout=PATIENCE)
    return inlet


def _answer(at: float) -> Recognition:
    scores = np.array([0.25, 0.75], dtype=np.float32)
    return Recognition("ann", at, Outcome.NAMED, CLASSES, scores, movement=0.1, progress=FOLLOWED)


@pytest.mark.slow
def test_scores_and_events_come_by_lsl_with_its_own_clock() -> None:
    """An event's stamp lies as far before the answer as on the sender's clock, but for what LSL mistakes."""
    with closing(LslSink()) as sink:
        sink.send(_answer(100.0))
        scores, events = _inlet("kinespace-ann"), _inlet("kinespace-events")
        assert scores.info().get_channel_labels() == [*CLASSES, *FURTHER]
        sink.send(_answer(101.0))
        now = pylsl.local_clock()
        sink.send(Event("ann", EventKind.START, "jump", 1, 0.75, 100.5))
        sink.send(Done("ann", "jump", 1, 99.0, 1.5, 0.875, 1.25, 0.75, 3))
        sample, _ = scores.pull_sample(timeout=PATIENCE)
        assert sample == pytest.approx([0.25, 0.75, 1.0, _answer(0.0).margin, 0.5, 1.25, 0.75])
        for text, before in (("start jump ann", 0.5), ("done jump ann", 0.5)):
            (got,), stamp = events.pull_sample(timeout=PATIENCE)
            assert got == text
            assert now - before - CLOCKS <= stamp + events.time_correction() <= pylsl.local_clock() - before + CLOCKS
        sink.send(Gone("ann"))


def _outlet(name: str) -> Any:  # noqa: ANN401 - as above
    labels = [f"{joint}_{axis}" for joint in JOINTS for axis in "xyz"]
    info = pylsl.StreamInfo(name, "MoCap", len(labels), 60.0, "float32", name)
    info.set_channel_labels(labels)
    info.set_channel_units(["millimeters"] * len(labels))
    return pylsl.StreamOutlet(info)


def test_positions_of_a_stream_come_as_frames() -> None:
    """A stream in millimetres is sent in metres, with its own times and its name as the performer's."""
    outlet, positions = _outlet("hall"), np.arange(18, dtype=np.float32).reshape(6, 3) * 100
    receiver = osc.OscReceiver("127.0.0.1", 0)
    with closing(receiver), LslFeed("hall", *receiver.address[:2]) as feed:
        assert feed.layout.joints == JOINTS
        assert outlet.wait_for_consumers(PATIENCE)
        begun = pylsl.local_clock()
        stamps = [begun + number / 60 for number in range(30)]
        for stamp in stamps:
            outlet.push_sample(positions.ravel().tolist(), stamp)
        got = list[object]()
        until(lambda: got.extend(osc.decode(receiver.receive() or b"", 0.0).events) or len(got) >= 31)
    announced = [each for each in got if isinstance(each, Announcement)]
    frames = [each for each in got if isinstance(each, Frame)]
    assert announced[0] == Announcement("hall", JOINTS)
    np.testing.assert_allclose([each.time for each in frames], stamps, atol=CLOCKS)
    np.testing.assert_allclose(np.diff([each.time for each in frames]), 1 / 60, atol=0.002)
    np.testing.assert_allclose(frames[-1].positions, positions / 1000, rtol=1e-5)


@pytest.mark.slow
def test_a_stream_that_is_not_there_is_said_with_those_that_are() -> None:
    """The message names the streams of the network."""
    outlet = _outlet("studio")
    with pytest.raises(OSError, match=r"no stream 'hall 7' on the network; there are: .*studio"):
        LslFeed("hall 7", "127.0.0.1", 9)
    del outlet


MOBI = ["PositionX", "PositionY", "PositionZ", "OrientationX"]


@pytest.mark.parametrize(
    ("labels", "types"),
    [
        ([f"{joint}.{axis}" for joint in JOINTS for axis in "XYZ"], [""] * 18),
        ([f"{joint} Position{axis}" for joint in JOINTS for axis in "XYZ"], [""] * 18),
        ([joint for joint in JOINTS for _ in MOBI], MOBI * 6),
        ([f"{joint}_{axis}" for joint in JOINTS for axis in ("x", "y", "z", "quality")], [""] * 24),
    ],
)
def test_joints_are_read_off_labels_or_types(labels: list[str], types: list[str]) -> None:
    """Labels with an axis at their end, MoBI's types, and channels between that are no positions."""
    layout = StreamJoints.of(labels, types, [""] * len(labels))
    assert layout.joints == JOINTS
    step = len(labels) // 6
    np.testing.assert_array_equal(layout.channels, np.arange(6)[:, None] * step + np.arange(3))
    assert layout.metres == 1.0
