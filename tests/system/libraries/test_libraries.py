"""Libraries of one's own: small ones, and one that is taught while a feed runs."""

import json
from collections import defaultdict
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import zmq
from numpy.typing import NDArray
from performed import pushed, shown
from programs import LOOPBACK, PATIENCE, builtin_library, started, wait_until_read
from synthetic import STICK_CLASSES, stick_clip, stick_clips

from kinespace.library import NOTHING, Clip, MotionLibrary, opened
from kinespace.stream import Frame, LiveSignature, Outcome, Recognition, Recognizer, Settings
from kinespace.stream.osc import OscReceiver, OscSender, decode_packet, encode_frame, encode_message
from kinespace.tools.teaching.lessons import open_taught

pytestmark = pytest.mark.slow


# --- own library ------------------------------------------------------------------------------------------------------


BOTH = pytest.mark.parametrize("signature", LiveSignature)


def _answers(library: MotionLibrary, clip: Clip, signature: LiveSignature = LiveSignature.WINDOWS) -> list[Recognition]:
    return pushed(Recognizer(library, Settings(signature=signature)), shown(clip.positions, clip.frame_rate))


def _performed(class_name: str, seed: int = 60) -> Clip:
    return stick_clip(class_name, seed=seed, frames=240)


@BOTH
@pytest.mark.parametrize(
    ("takes", "actors", "classes"),
    [
        (1, ("aa",), STICK_CLASSES),
        (2, ("aa",), STICK_CLASSES[:2]),
        (1, ("aa", "bb"), STICK_CLASSES),
        (1, ("",), STICK_CLASSES),
        (2, ("aa", "bb", "cc"), STICK_CLASSES),
    ],
    ids=["one take each", "two classes", "two people", "nobody's name", "three people"],
)
def test_a_small_library_names_its_motions(
    takes: int, actors: tuple[str, ...], classes: tuple[str, ...], signature: LiveSignature
) -> None:
    """Even with few takes, people and classes, each motion performed anew is guessed right."""
    clips = [clip for clip in stick_clips(takes=takes, actors=actors) if clip.class_name in classes]
    library = MotionLibrary.of_clips(clips)
    for class_name in classes:
        answers = _answers(library, _performed(class_name), signature)
        assert {answer.classes[answer.best] for answer in answers[5:]} == {class_name}


@BOTH
def test_motions_of_the_class_nothing_are_unknown(signature: LiveSignature) -> None:
    """A class renamed to `nothing` competes, has no score of its own, and is answered unknown with a best guess."""
    library = MotionLibrary.of_clips(stick_clips()).renamed({"wave": NOTHING})
    assert library.classes == ("bow", "jump")
    answers = _answers(library, _performed("wave"), signature)
    assert {answer.outcome for answer in answers[5:]} == {Outcome.UNKNOWN}
    assert {answer.classes for answer in answers} == {("bow", "jump")}
    assert {len(answer.scores) for answer in answers} == {2}
    assert {answer.eigenvector_class for answer in answers[5:]} == {None}
    assert {answer.label for answer in _answers(library, _performed("bow"), signature)[5:]} == {"bow"}


def test_a_motion_and_its_reverse_are_told_apart(builtin: MotionLibrary) -> None:
    """Lying down played backwards is a class of its own: by people whom the library does not know both are named."""
    by_person: dict[tuple[str, str], list[Clip]] = defaultdict(list)
    for clip in builtin.motions:
        if clip.class_name in ("lieDownFloor", "sneak2StepsLStart"):
            by_person[clip.class_name, clip.actor].append(clip)
    # Two takes of each do, and are opened faster.
    clips = [clip for takes in by_person.values() for clip in takes[:2]]
    backwards = [
        replace(clip, positions=clip.positions[::-1], class_name="getUpFloor")
        for clip in clips
        if clip.class_name == "lieDownFloor"
    ]
    both = [*clips, *backwards]
    library = MotionLibrary.of_clips(clip for clip in both if clip.actor not in ("dg", "tr"))
    right = []
    for clip in both:
        if clip.actor in ("dg", "tr") and clip.class_name != "sneak2StepsLStart":
            guesses = [answer.classes[answer.best] for answer in _answers(library, clip)]
            right.append(np.mean([guess == clip.class_name for guess in guesses]))
    assert len(right) >= 8
    assert np.mean(right) > 0.8
    assert min(right) > 0.5


# --- teaching ---------------------------------------------------------------------------------------------------------


GESTURES = {"squat": "squat1Reps", "arms": "rotateArmsBothBackward1Reps", "kick": "kickLFront1Reps"}
STILL = 75


class Dancer:
    """Sends frames faster than they would come, each with its own time, so that no clock decides."""

    def __init__(self, sender: OscSender) -> None:
        self._sender, self._time = sender, 10.0

    def stand(self, posture: NDArray[np.float64], frames: int = STILL) -> None:
        """Show one posture for some frames."""
        self._show([posture] * frames)

    def perform(self, gesture: str, take: int) -> None:
        """Show a motion, standing still before and after."""
        positions = _takes(gesture)[take]
        self.stand(positions[0])
        self._show(positions)
        self.stand(positions[-1])

    def _show(self, postures: NDArray[np.float64] | list[NDArray[np.float64]]) -> None:
        for place, posture in enumerate(postures):
            self._time += 1 / 60
            self._sender.send(encode_frame(Frame("ann", self._time, posture)))
            if place % 8 == 7:
                # No socket may overflow, and no frame wait: a recogniser leaves out what has waited.
                wait_until_read(self._sender.target[1])


def _takes(gesture: str) -> list[NDArray[np.float64]]:
    motions = (each for each in builtin_library().motions if each.actor == "bd")
    return [motion.positions for motion in motions if motion.class_name == GESTURES[gesture]]


@pytest.mark.timeout(400)
def test_three_gestures_are_taught_and_recognised(tmp_path: Path) -> None:
    """From nothing, each shown once and asked for in another way; other takes of them start the right events."""
    file = tmp_path / "mine.npz"
    with (
        closing(OscReceiver(LOOPBACK, 0)) as answers,
        started(
            # The dancer's seconds pass faster than ours, by which half a second after a lesson is quiet.
            *("live", "--library", "none", "--teach", file, "--loud-lessons", "--plain", "--osc-in", f"{LOOPBACK}:0"),
            *("--osc-out", f"{LOOPBACK}:{answers.address[1]}"),
            *("--control", "tcp://127.0.0.1:*"),
        ) as live,
        closing(OscSender(LOOPBACK, int(live.expect(r"listening on OSC [\d.]+:(\d+)")[1]))) as sender,
        zmq.Context() as context,
        context.socket(zmq.REQ) as asking,
    ):
        asking.rcvtimeo, asking.linger = round(PATIENCE * 1000), 0
        asking.connect(live.expect(r"ZeroMQ (tcp://\S+) \(control\)")[1])

        def replied(**request: object) -> str:
            asking.send(json.dumps(request).encode())
            return str(json.loads(asking.recv())["states"][0].get("reason"))

        dancer = Dancer(sender)
        dancer.stand(_takes("squat")[0][0])
        sender.send(encode_message("/motion/teach", "bo", "wave"))
        live.expect("no such performer")
        for number, gesture in enumerate(GESTURES, start=1):
            if gesture == "squat":
                sender.send(encode_message("/motion/teach", "ann", "squat", 1, 0.0))
            else:
                replied(do="teach", performer="ann", **{"class": gesture}, countdown=0)
            live.expect(rf"(?s)(teaching ann: waiting\n.*){{{number}}}")
            dancer.perform(gesture, 0)
            live.expect(f"taught {gesture}: good so far: .*; examples: 1")
        for gesture in GESTURES:
            # Again, if a busy machine left too much of it out.
            for _ in range(3):
                dancer.perform(gesture, 1)
                if live.found(f"start: {gesture}", PATIENCE / 4):
                    break
            live.expect(f"start: {gesture}")
        assert replied(do="rename", **{"class": "kick"}, to="high kick") == "kick is high kick"
        assert replied(do="undo") == "3 examples of 3 classes"
        assert "expected one of" in replied(do="jump")
        assert (live.interrupt(), live.errors) == (0, "")
        heard = [each for packet in iter(answers.receive, None) for each in decode_packet(packet)]
    states = [each.arguments[1] for each in heard if each.address == "/motion/teach/state"]
    assert states[:1] == ["refused"]
    assert {"waiting", "recording", "checking", "done"} <= {*states}
    assert tuple(GESTURES) in [tuple(each.arguments) for each in heard if each.address == "/motion/classes"]
    assert set(MotionLibrary.load(file).classes) == set(GESTURES)


def test_a_file_answers_the_same_taught_and_as_a_library(builtin: MotionLibrary) -> None:
    """One example of three classes, opened as by `--library X` and by `--teach X --library none`: the same answers."""
    first = {motion.class_name: motion for motion in reversed(builtin.motions) if motion.actor == "bd"}
    library = MotionLibrary.of_clips([first[name] for name in builtin.classes[:3]])
    names, indices = set[Outcome](), (opened(library), open_taught(library))
    for asked in [each for each in builtin.motions if each.actor == "mm"][::20]:
        frames = [Frame("p", *each) for each in zip(asked.times.tolist(), asked.positions, strict=True)]
        both = [pushed(Recognizer(index), frames) for index in indices]
        for one, other in zip(*both, strict=True):
            assert one.label == other.label
            assert one.evidence.compared == pytest.approx(other.evidence.compared, abs=1e-4)
            names.add(one.outcome)
    assert {Outcome.NAMED, Outcome.UNKNOWN} <= names
