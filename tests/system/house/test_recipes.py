"""What CONTRIBUTING says of adding things, done in a copy of the program."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]

#: A part more: the mean length of each distance, relative to the body's size.
_PART = {
    "library/signature/parts.py": {
        '    TREND = "trend"\n': '    TREND = "trend"\n    LENGTH = "length"\n',
        "PARTS = (EIGEN_LONG, ": "LENGTH = Part(Kind.LENGTH, 1.0)\nPARTS = (LENGTH, EIGEN_LONG, ",
        "#: The function that computes each kind": (
            "def length(moments: Moments, body: Body) -> NDArray[np.float64]:\n"
            "    return moments.mean / body.size(moments.mean)[:, None]\n\n\n"
            "#: The function that computes each kind"
        ),
        "Kind.TREND: trend}": "Kind.TREND: trend, Kind.LENGTH: length}",
    }
}
#: Its numbers, live, are those of the windows that are cut; motions are named by it, too.
_USES_PART = """
import numpy as np
from kinespace import Frame, MotionLibrary, Recognizer, distance_rows, opened
from kinespace.library.signature.parts import LENGTH

motions = [motion for motion in MotionLibrary.builtin().motions if motion.class_name in ("squat1Reps", "clap5Reps")]
index = opened(MotionLibrary.of_clips(motions))
assert LENGTH in index.comparison.weighing.parts and LENGTH in index.comparison.parts
recognizer, motion = Recognizer(index), motions[0]
frames = [Frame("me", *each) for each in zip(motion.times, motion.positions)]
answer = [answer for frame in frames if (answer := recognizer.push(frame))][-1]
last = (motion.times <= answer.time) & (motion.times > answer.time - 1.0 + 1e-6)
mean = distance_rows(motion.positions[last], motion.skeleton).mean(axis=0)
found = recognizer._windows.seen.signature.parts[LENGTH]
np.testing.assert_allclose(found, mean / index.body.size(mean))
print(answer.label)
"""

#: A message more: how many answers a performer got.
_MESSAGE = {
    "stream/recognition.py": {
        "@dataclass(frozen=True, slots=True)\nclass Gone:": (
            "@dataclass(frozen=True, slots=True)\nclass Beat:\n    performer: str\n    number: int\n\n\n"
            "@dataclass(frozen=True, slots=True)\nclass Gone:"
        )
    },
    "stream/osc/messages.py": {
        "def encode_gone(": (
            "def encode_beat(beat) -> bytes:\n"
            '    return encode_message(f"/motion/{address_part(beat.performer)}/beat", beat.number)\n\n\n'
            "def encode_gone("
        )
    },
    "stream/zeromq/messages.py": {
        "import GONE, Answer, ": "import GONE, Answer, Beat, ",
        "    Event: encode_event,\n": (
            "    Event: encode_event,\n"
            '    Beat: lambda beat: [f"beat/{beat.performer}/".encode(), _encode({"number": beat.number})],\n'
        ),
    },
    "stream/outputs/layouts.py": {
        "    taught = state\n": (
            "    taught = state\n\n    def beat(self, beat) -> bytes:\n        return answers.encode_beat(beat)\n"
        )
    },
    "stream/service/loop.py": {
        "import Classes, Event": "import Beat, Classes, Event",
        "        self._publish_events(recognition.events)\n": (
            "        self._publish_events(recognition.events)\n"
            "        tell(self.sinks, Beat(recognition.performer, len(self._hop_times)))\n"
        ),
    },
}
#: It goes out by OSC and by ZeroMQ.
_USES_MESSAGE = """
from kinespace import Frame, MotionLibrary, Performers, Recognizer
from kinespace.stream.osc.packet import decode_packet
from kinespace.stream.outputs.layouts import LayoutSink, NativeLayout
from kinespace.stream.outputs.zeromq_sink import ZmqSink
from kinespace.stream.service.loop import Service

class Sent(list):
    send, failed = list.append, 0

library = MotionLibrary.of_clips([m for m in MotionLibrary.builtin().motions if m.actor == "bd"][:4])
motion, recognizer = library.motions[0], Recognizer(library)
frames = [Frame("ann", *each) for each in zip(motion.times, motion.positions)]
answer = next(answer for frame in frames if (answer := recognizer.push(frame)))
osc, zmq = Sent(), Sent()
service = Service(Performers(library), [], [LayoutSink(NativeLayout(), osc), ZmqSink(zmq)])
service.publish(answer, 0.0)
assert ("/motion/ann/beat", [0]) in [each for packet in osc for each in decode_packet(packet)]
assert [b"beat/ann/"] == [parts[0] for parts in zmq if b"beat" in parts[0]]
"""


def _changed(folder: Path, edits: Mapping[str, Mapping[str, str]]) -> None:
    """Copy the program into a folder, and change some of its texts."""
    for room in ("library", "stream", "tools"):
        shutil.copytree(ROOT / room, folder / "kinespace" / room, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "tools" / "front" / "__init__.py", folder / "kinespace")
    for name, changes in edits.items():
        path = folder / "kinespace" / name
        text = path.read_text(encoding="utf-8")
        for before, after in changes.items():
            assert text.count(before) == 1, before
            text = text.replace(before, after)
        path.write_text(text, encoding="utf-8")


def _run(folder: Path, script: str) -> str:
    environment = dict(os.environ, PYTHONPATH=str(folder), PYTHONDONTWRITEBYTECODE="1")
    command = [sys.executable, "-c", script]
    done = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False, timeout=120
    )
    assert not done.returncode, done.stderr
    return done.stdout


@pytest.mark.slow
def test_a_part_of_the_signature_is_added_in_one_file(tmp_path: Path) -> None:
    """It is read off a live window and off the library's alike, learned, and compared."""
    _changed(tmp_path, _PART)
    assert re.fullmatch("squat1Reps|clap5Reps", _run(tmp_path, _USES_PART).strip())


@pytest.mark.slow
def test_a_message_is_added_in_five_files(tmp_path: Path) -> None:
    """As a value, in each transport, in the layouts, and where the service says it."""
    assert len(_MESSAGE) == 5
    _changed(tmp_path, _MESSAGE)
    _run(tmp_path, _USES_MESSAGE)
