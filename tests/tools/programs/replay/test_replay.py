"""`kinespace replay`: recordings as a fake live feed, and the score of its answers."""

import json
import re
from argparse import Namespace
from collections.abc import Iterable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from programs import LOOPBACK, free_udp_port, ran, small_library, started
from written import write_clip, write_clips

from kinespace.library import MotionLibrary, Reading, read_recordings
from kinespace.stream import Announcement, Frame, Recognizer, osc
from kinespace.tools.feeding.feed import clip_cues, labelled_cues
from kinespace.tools.programs.replay import read_labelled

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("wide")]

#: Fast enough for a short test, slow enough for a busy machine.
SPEED = 8.0
KEYS = {"sent", "failed", "unheard", "answers", "unlabelled", "lacking", "right"}


def course(**wanted: object) -> Namespace:
    """Give options with which recordings are played."""
    usual = {"performer": "me", "speed": 1.0, "pause": 1.0, "loop": False, "begin": 0.0, "end": None}
    return Namespace(**{**usual, **wanted})


@pytest.fixture
def take(tmp_path: Path) -> Path:
    """Write one clip of a second and a half."""
    return write_clip(tmp_path, "bd", "bendLeft", 1)


def replay(*arguments: object) -> tuple[int, str, str]:
    """Run `kinespace replay` in this process, eight times as fast as recorded by default."""
    return ran("replay", "--speed", SPEED, *arguments)


def target(receiver: osc.OscReceiver) -> str:
    """Give a receiver's address as it is typed."""
    return f"{LOOPBACK}:{receiver.address[1]}"


def received(receiver: osc.OscReceiver) -> list[Frame | Announcement]:
    """Take everything that has arrived, decoded."""
    events: list[Frame | Announcement] = []
    while (datagram := receiver.receive()) is not None:
        received = osc.decode(datagram, 0.0)
        assert not received.refused
        events += received.events
    return events


def frames_in(events: Iterable[Frame | Announcement]) -> list[Frame]:
    """Give the frames among some events."""
    return [event for event in events if isinstance(event, Frame)]


def test_a_clip_is_sent_as_live_packets(receiver: osc.OscReceiver, take: Path) -> None:
    """The joints are announced first; then every frame comes in order with its time and its positions as float32."""
    said = "sending 1 recording\n180 frames sent, 0 refused by the system\n"
    assert replay(take, "--osc", target(receiver), "--performer", "me")[:2] == (0, said)
    events = received(receiver)
    (clip,) = read_recordings([take])
    assert events[0] == Announcement("me", clip.skeleton.joints)
    frames = frames_in(events)
    assert [frame.performer for frame in frames] == ["me"] * clip.frames
    np.testing.assert_allclose([frame.time for frame in frames], 1.0 + clip.times, rtol=1e-12)
    np.testing.assert_array_equal([frame.positions for frame in frames], clip.positions.astype(np.float32))


def test_labels_beside_a_take_give_the_right_class_of_each_moment(take: Path) -> None:
    """Each frame of a take has the class of its label, and no class without one; all frames are sent."""
    take.with_suffix(".csv").write_text("start_s;end_s;label\n0,25;0,5;up\n0,5;1,0;down\n")
    (sent,) = read_labelled([take], Reading(), course())
    classes = [cue.class_name for cue in labelled_cues([sent], "me")]
    assert classes == [""] * 30 + ["up"] * 30 + ["down"] * 60 + [""] * 60
    (clip,) = read_recordings([take])
    np.testing.assert_array_equal(sent[0].positions, clip.positions)
    late = course(begin=0.4, end=0.6)
    classes = [cue.class_name for cue in labelled_cues(read_labelled([take], Reading(), late), "me")]
    assert classes == ["up"] * 12 + ["down"] * 12


def test_a_class_of_the_built_in_library_can_be_named(
    receiver: osc.OscReceiver, take: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A class's name plays that class, beside other classes, cut as a recording is; a path of that name goes before."""
    library = small_library().without(actors=("bd", "dg"))
    monkeypatch.setattr(MotionLibrary, "builtin", lambda: library)
    squats = [motion for motion in library.motions if motion.class_name == "squat1Reps"]
    assert replay("squat1Reps", "--osc", target(receiver))[0] == 0
    assert len(frames_in(received(receiver))) == sum(motion.frames for motion in squats)
    assert replay("squat1Reps", "--osc", target(receiver), "--from", 0.2, "--to", 0.5)[0] == 0
    frames = frames_in(received(receiver))
    np.testing.assert_array_equal(frames[0].positions, squats[0].positions[12].astype(np.float32))
    assert len(frames) == 18 * len(squats)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "squat1Reps").mkdir()
    take.rename(tmp_path / "squat1Reps" / take.name)
    assert replay("squat1Reps", "--osc", target(receiver), "--asf", tmp_path / "HDM_bd.asf")[0] == 0
    assert len(frames_in(received(receiver))) == 180


@pytest.mark.parametrize("transport", ["osc", "zmq"])
def test_frames_that_nobody_hears_are_counted(transport: str, take: Path) -> None:
    """Where no program listens the report says so, counts the packets, and the status is 1."""
    to = {"osc": ("--osc", f"{LOOPBACK}:{free_udp_port()}"), "zmq": ("--zmq", f"@tcp://{LOOPBACK}:*")}[transport]
    status, printed, _ = replay(take, *to)
    _, sent, unheard = printed.splitlines()
    assert (status, sent) == (1, "180 frames sent, 0 refused by the system")
    place = to[1].removeprefix("@")
    assert re.match(
        rf"no program listens at {re.escape(place)}(, or it lets in none .*)?: 18\d packets were lost; start", unheard
    )


@pytest.mark.parametrize("performer", ["my dancer", "[/]"])
def test_osc_answers_to_any_performer_are_counted(performer: str, tmp_path: Path) -> None:
    """With --listen every answer is compared with the class performed, for any name of the performer."""
    take = write_clip(tmp_path, "bd", "bendLeft", 1)
    clips = list(read_recordings(write_clips(tmp_path, takes=1)))
    MotionLibrary.of_clips(clips).save(tmp_path / "mine.npz")
    heard_at = f"{LOOPBACK}:{free_udp_port()}"
    options = ("--library", tmp_path / "mine.npz", "--osc-in", f"{LOOPBACK}:0", "--osc-out", heard_at)
    with started("live", "--plain", *options) as program:
        to = program.expect(r"listening on OSC (\S+);")[1]
        arguments = (take, "--osc", to, "--listen", heard_at, "--performer", performer, "--json")
        status, printed, _ = replay(*arguments, "--speed", "2")
    described = json.loads(printed)
    assert (status, set(described)) == (0, KEYS)
    assert (described["sent"], described["failed"]) == (180, 0)
    recognizer = Recognizer(MotionLibrary.load(tmp_path / "mine.npz"))
    answers = [(cue.class_name, recognizer.push(cue.frame)) for cue in clip_cues(clips[:1], "me")]
    right = [answer.label == performed for performed, answer in answers if answer is not None]
    assert described["answers"] == len(right) > 20
    assert described["right"] == round(sum(right) / len(right), 4)


def test_ctrl_c_ends_a_feed_and_reports(receiver: osc.OscReceiver, take: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An endless feed goes through the clip again and again; Ctrl-C ends it with the report, alone, and status 0."""
    now = [0.0]

    def sleep(seconds: float) -> None:
        now[0] += seconds
        if now[0] > 8.0:
            raise KeyboardInterrupt

    monkeypatch.setattr("kinespace.tools.feeding.feed.time", SimpleNamespace(perf_counter=lambda: now[0], sleep=sleep))
    status, printed, _ = ran("replay", take, "--osc", target(receiver), "--loop", "--json")
    described = json.loads(printed)
    assert (status, set(described)) == (0, KEYS)
    frames = frames_in(received(receiver))
    assert len(frames) == described["sent"] > 400
    times = [frame.time for frame in frames]
    assert times == sorted(times)
    assert times[180] == pytest.approx(1.0 + 1.5 + 1.0)
