import csv
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from kinespace.library import MotionLibrary
from kinespace.stream.frame import Frame
from kinespace.stream.inputs.kinerec import RawPacket, RawWriter
from kinespace.stream.osc.messages import encode_frame
from kinespace.tools.cli.main import main

pytestmark = pytest.mark.slow

STILL = 1.0
MOTIONS = (0, 40, 130)


@pytest.fixture
def evening(tmp_path: Path) -> Path:
    """Record two performers who stand still between motions; the second comes three seconds later."""
    library, generator = MotionLibrary.builtin(), np.random.default_rng(0)
    frames = []
    for performer, begin in (("ann", 100.0), ("bo", 103.0)):
        time = begin
        for motion in (library.motions[index] for index in MOTIONS):
            still = [motion.positions[0]] * round(STILL * 60), [motion.positions[-1]] * round(STILL * 60)
            for positions in (*still[0], *motion.positions, *still[1]):
                frames.append((time, performer, positions))
                time += 1 / 60
    with closing(RawWriter(tmp_path / "tonight.kinerec", ["osc 127.0.0.1:9310"])) as writer:
        for time, performer, positions in sorted(frames, key=lambda each: each[0]):
            packet = encode_frame(Frame(performer, time, positions))
            writer.write(RawPacket(time - 40 + generator.uniform(0, 0.005), 0, "127.0.0.1:5000", (packet,)))
    return tmp_path / "tonight.kinerec"


def _filled_in(labels: Path) -> None:
    with labels.open(newline="") as file:
        rows = list(csv.DictReader(file))
    names = iter("abcabc")
    by_performer = sorted(rows, key=lambda row: (row["performer"], float(row["start_s"])))
    for row in by_performer:
        row["label"] = next(names)
    with labels.open("w", newline="") as file:
        written = csv.DictWriter(file, rows[0])
        written.writeheader()
        written.writerows(rows)


def test_an_evening_becomes_a_library(evening: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Cut proposes a row for each movement of each performer; with classes filled in, build makes a library of it."""
    labels, library = evening.with_suffix(".csv"), evening.with_name("mine.npz")
    assert main(["cut", str(evening)]) == 0
    assert "6 movements of ann, bo" in capsys.readouterr().out
    _filled_in(labels)
    assert main(["build", str(evening), "--labels", str(labels), "-o", str(library)]) == 0
    built = MotionLibrary.load(library)
    assert [(motion.class_name, motion.actor) for motion in built.motions] == [
        (name, performer) for name in "abc" for performer in ("ann", "bo")
    ]
    whole = MotionLibrary.builtin()
    for name, index in zip("abc", MOTIONS, strict=True):
        mine = next(motion for motion in built.motions if motion.class_name == name)
        assert mine.duration == pytest.approx(whole.motions[index].duration, abs=0.8)


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("1,2,wave,", "expected a performer of ann, bo, got none"),
        ("1,2,wave,cleo", "expected a performer of ann, bo, got 'cleo'"),
        ("1,4,wave,bo", "a body that does not move"),
        ("1,2,,ann", "no segment in it"),
    ],
)
def test_labels_that_do_not_fit(evening: Path, capsys: pytest.CaptureFixture[str], row: str, message: str) -> None:
    """Labels that do not fit their recording are refused in one line."""
    labels = evening.with_name("labels.csv")
    labels.write_text(f"start_s,end_s,label,performer\n{row}\n")
    assert main(["build", str(evening), "--labels", str(labels), "-o", str(evening.with_name("m.npz"))]) == 2
    assert message in capsys.readouterr().err
