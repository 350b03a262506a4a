"""CONTRIBUTING's way of one frame is the way that a frame takes: traced from the datagram to the answer."""

import re
import sys
from pathlib import Path
from types import FrameType

import numpy as np
import pytest

from kinespace.library import MotionLibrary, compiled
from kinespace.stream import osc
from kinespace.stream.frame import Frame
from kinespace.stream.inputs import Admission, OscDecoder, Source
from kinespace.stream.outputs import LayoutSink, NativeLayout
from kinespace.stream.recognizer import Performers
from kinespace.stream.service.loop import Service

ROOT = Path(__file__).resolve().parents[3]
#: Frames a second, frames until the windows are full, and frames in all.
RATE, FULL, FRAMES = 120, 250, 300
#: Most files that a frame passes at a hop, and most returns to a file that was left before.
MOST_FILES, MOST_RETURNS = 27, 33


def traced() -> list[str]:
    """Give the product's files in the order in which one frame enters them at a hop: OSC in, one performer, OSC out."""
    library = MotionLibrary.builtin()
    there = library.motions[0].positions.astype(np.float32)
    # To and fro, because a body does not jump back to a beginning.
    positions = np.concatenate([there, there[::-1]])
    receiver = osc.OscReceiver("127.0.0.1", 0)
    sender = osc.OscSender(*receiver.address[:2])
    sink = LayoutSink(NativeLayout(), osc.OscSender("127.0.0.1", 9))
    admission = Admission()
    entered: list[str] = []

    def note(frame: FrameType, event: str, _: object) -> None:
        path = Path(frame.f_code.co_filename)
        if event == "call" and any(path.is_relative_to(ROOT / top) for top in ("library", "stream", "tools")):
            entered.append(str(path.relative_to(ROOT)))

    with Service(
        Performers(library), [Source(receiver, OscDecoder(), None, admission)], [sink], admission=admission
    ) as service:
        way: list[str] = []
        for place in range(FRAMES):
            frame = Frame("ann", place / RATE, positions[place % len(positions)])
            sender.send(osc.encode_frame(frame))
            entered.clear()
            sys.setprofile(note if place > FULL else None)
            service.step(1.0)
            sys.setprofile(None)
            # The hop of many with the fewest files: another has further work in it, like a status.
            answered = {"stream/recognizer/decision.py", "stream/osc/answers.py"} <= {*entered}
            if answered and (not way or (len({*entered}), len(entered)) < (len({*way}), len(way))):
                way = [*entered]
    sender.close()
    return way


def stays(way: list[str]) -> list[str]:
    """Give each stay in a file once."""
    return [path for before, path in zip(["", *way], way, strict=False) if path != before]


@pytest.mark.skipif(not compiled.in_use, reason="the loops are not compiled here")
def test_the_way_of_one_frame_is_drawn() -> None:
    """The files that a frame passes are those of CONTRIBUTING's drawing; they are few, and seldom come again."""
    way = traced()
    there = stays(way)
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    (drawing,) = re.findall(r"## The way of one frame\n.*?```text\n(.*?)```", page, re.DOTALL)
    drawn = {f"{name.replace('.', '/')}.py" for name in re.findall(r"\b((?:stream|library)(?:\.\w+)+)", drawing)}
    assert {path for path in way if not path.endswith("__init__.py")} == drawn
    assert len(set(way)) <= MOST_FILES
    assert len(there) - len(set(there)) <= MOST_RETURNS
