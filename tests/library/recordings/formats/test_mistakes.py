"""Every mistake in a recording is refused in a line that says what was expected, and where."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from synthetic import ARM, write_pair
from written import MOVES, TURNS, Node, bvh_text, csv_table, trc_text

from kinespace.library.recordings import RecordingError, RecordingReader

AMC = (
    ":FULLY-SPECIFIED\n:DEGREES\n1\nroot 0 0 0 0 0 0\nupper 1 2 3\nlower 4\n2\nroot 0 0 0 0 0 0\nupper 1 2 3\nlower 4\n"
)
LOWER = Node("lower", (2.0, 0.0, 0.0), TURNS, [Node("lower_end", (0.5, 0.0, 0.0))])
BODY = Node("hip", (0.0, 0.0, 0.0), (*MOVES, *TURNS), [Node("upper", (0.0, 1.0, 0.0), TURNS, [LOWER])])
WALK = np.random.default_rng(3).uniform(0.0, 900.0, (3, 3, 3))
LABELS = ("hip", "knee", "heel")
GOOD = {
    "amc": AMC,
    "asf": ARM.asf(),
    "bvh": bvh_text(BODY, np.random.default_rng(3).uniform(-90, 90, (4, 12)).tolist()),
    "trc": trc_text(LABELS, WALK),
    "csv": csv_table(LABELS[:2], WALK[:, :2]),
}
#: By ending: what is replaced, by what, and the message behind the file's name.
BROKEN = tomllib.loads(Path(__file__).with_name("mistakes.toml").read_text(encoding="utf-8"))
BROKEN["amc"] += [
    ("\n2\n", f"\n{'9' * 5000}\n", r":7: expected a frame number "),
    (AMC[AMC.index("1\n") :], "", r":2: no frames in it"),
]
BROKEN["asf"] += [
    (ARM.asf()[ARM.asf().index(":bonedata") :], "", r": not a usable ASF skeleton, no :bonedata in it"),
]
BROKEN["bvh"] += [
    (
        GOOD["bvh"][GOOD["bvh"].index("JOINT upper") : GOOD["bvh"].index("}\nMOTION")],
        "",
        ":7: expected a hierarchy of",
    ),
    (GOOD["bvh"][GOOD["bvh"].index("MOTION") :], "", ":20: expected HIERARCHY and MOTION"),
    ("Frame Time: 0.01\n", "Frame Time: 0.01\n" + "x " * 12 + "\n", ":24: expected numbers, got 'x x"),
    (
        "Frames: 4\nFrame Time: 0.01\n",
        "Frames: 5\nFrame Time: 0.01\n" + "nan " * 12 + "\n",
        ":24: expected finite num",
    ),
]
BROKEN["trc"] += [
    (GOOD["trc"].split("\n")[1], "", ":1: expected a TRC, got no line that names DataRate"),
]
BROKEN["csv"] += [
    (GOOD["csv"][GOOD["csv"].index("\n0.01") :], "", ": expected at least 2 frames, got 1"),
]


@pytest.mark.parametrize(
    ("ending", "old", "new", "message"), [(ending, *row) for ending, rows in BROKEN.items() for row in rows]
)
def test_a_mistake_is_named_with_its_file_and_its_line(
    tmp_path: Path, ending: str, old: str, new: str, message: str
) -> None:
    """The line counts as an editor counts; where no line is at fault the frame is named, or the file alone."""
    spoilt = GOOD[ending].replace(old, new, 1)
    assert spoilt != GOOD[ending]
    if ending in ("amc", "asf"):
        path = write_pair(tmp_path, spoilt if ending == "asf" else GOOD["asf"], spoilt if ending == "amc" else AMC)
    else:
        path = tmp_path / f"take.{ending}"
        path.write_text(spoilt)
    named = tmp_path / "tiny.asf" if ending == "asf" else path
    wanted = message if ending in ("amc", "asf") else re.escape(message)
    with pytest.raises(RecordingError, match=f"^{re.escape(str(named))}{wanted}"):
        RecordingReader().clip(path)
