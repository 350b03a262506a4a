"""Every mistake in a recording is refused in a line that says what was expected, and where."""

import re
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
BROKEN = {
    "amc": [
        ("upper 1 2 3", "uper 1 2 3", r":5: expected a frame number or a bone of .*, got 'uper'"),
        ("upper 1 2 3\n", "", r":6: the frame before has no upper"),
        ("lower 4\n2", "lower 4\nlower 4\n2", r":7: bone 'lower' stands twice in a frame"),
        ("upper 1 2 3", "upper 1 2", r":5: expected 3 numbers after 'upper', got 2"),
        ("root 0 0 0", "root 0 O 0", r":4: expected numbers after 'root', got '0 O 0 0 0 0'"),
        ("\n1\n", "\n", r":3: bone 'root' stands twice in a frame, or before the first"),
        ("\n1\n", "\n1 7\n", r":3: expected a frame number or a bone .*, got '1'"),
        ("\n1\n", "\n²\n", r":3: expected a frame number .*, got '²'"),
        ("\n2\n", f"\n{'9' * 5000}\n", r":7: expected a frame number "),
        (":DEGREES", ":SAMPLES-PER-SECOND fast", r":2: expected numbers as frame rate, got 'fast'"),
        (":DEGREES", ":SAMPLES-PER-SECOND -60", r":2: expected a positive frame rate, got -60"),
        ("lower 4\n2", "lower 1e999\n2", r":6: expected finite numbers after 'lower', got '1e999'$"),
        ("lower 4\n2\n", "lower 4\n1\n", r": expected growing frame numbers, frame 1 comes too late"),
        ("\n2\n", "\n6\n", r": 4 of 6 frames are missing, more than are there"),
        (AMC[AMC.index("1\n") :], "", r":2: no frames in it"),
        ("lower 4\n2\nroot 0 0 0 0 0 0\nupper 1 2 3\nlower 4\n", "", r":5: the file ends in the middle of frame 1"),
    ],
    "asf": [
        ("length 0.0254", "length 0", r":5: expected a positive unit of length, got 0"),
        ("angle deg", "angle grad", r":6: expected angle deg or rad, got 'grad'"),
        ("axis XYZ\n", "axis XYX\n", r":11: expected a rotation order like XYZ, got 'XYX'"),
        ("   axis XYZ\n", "", r": no 'axis' in :root"),
        ("   order TX TY TZ RX RY RZ\n", "", r": no 'order' in :root"),
        ("TX TY TZ", "TX TY TY", r":10: expected some of tx, .* each once, got"),
        ("TX TY TZ", "TX TY L", r":10: expected some of tx, .*, got 'tx ty l rx ry rz'"),
        ("direction 1.0 0.0 0.0", "direction 1.0 nan 0.0", r":18: expected finite numbers after 'direction'"),
        ("     direction 1.0 0.0 0.0\n", "", r":17: bone 'upper' has no direction"),
        ("dof rx ry rz", "dof rx ry rx", r":21: expected some of rx, ry, rz, each once"),
        ("name lower", "name upper", r":26: bone 'upper' is described twice"),
        ("name lower", "name root", r":26: bone 'root' is described twice"),
        ("lower hand\n", "lower hnd\n", r":44: bone 'hnd' stands in the hierarchy but not in"),
        ("lower hand\n", "lower upper\n", r":44: bone 'upper' has two parents"),
        ("root upper\n", "lower upper\n", r":42: bone 'lower' has children before it has a parent"),
        ("    lower hand\n", "", r": not a usable ASF skeleton, bones without a parent: hand"),
        (ARM.asf()[ARM.asf().index(":bonedata") :], "", r": not a usable ASF skeleton, no :bonedata in it"),
    ],
    "bvh": [
        ("HIERARCHY", "HIERARCHIE", ":1: expected a word of a BVH hierarchy, got 'HIERARCHIE'"),
        ("ROOT hip", "ROOT", ":2: expected a name"),
        ("ROOT", "JOINT", ":2: expected a ROOT, and all joints"),
        ("OFFSET 0.0 1.0 0.0", "OFFSET 0.0 1.0", ":8: expected 3 numbers, got 2"),
        ("OFFSET 0.5 0.0 0.0\n", "", ":16: joint 'lower_end' has no OFFSET"),
        ("ROOT hip\n{\n", "OFFSET 1 1 1\nROOT hip\n{\n", ":2: OFFSET stands outside a joint"),
        ("ROOT hip\n{\n", "{\nROOT hip\n{\n", ":2: expected ROOT, JOINT or End Site before {"),
        ("CHANNELS 6", "CHANNELS 5", ":5: expected CHANNELS, a count"),
        ("CHANNELS 3 Zrotation", "CHANNELS 3 Wrotation", ":9: expected CHANNELS, a count"),
        ("}\n}\nMOTION", "}\nCHANNELS 1 Zrotation\n}\nMOTION", ":20: expected the channels of 'hip' once, and before"),
        ("JOINT upper\n{", "JOINT upper\n", ":8: expected { after 'upper', got 'OFFSET'"),
        ("}\n}\n}\nMOTION", "}\n}\nMOTION", ":20: joint 'hip' is not closed with }"),
        ("}\n}\n}\nMOTION", "}\n}\n}\n}\nMOTION", ":21: a } without its {"),
        (
            GOOD["bvh"][GOOD["bvh"].index("JOINT upper") : GOOD["bvh"].index("}\nMOTION")],
            "",
            ":7: expected a hierarchy of",
        ),
        (GOOD["bvh"][GOOD["bvh"].index("MOTION") :], "", ":20: expected HIERARCHY and MOTION"),
        ("Frame Time: 0.01\n", "", ":22: expected a positive Frame Time, got Frames: 4"),
        ("Frame Time: 0.01", "Frame Time: 0", ":23: expected a positive Frame Time, got 0: --frame-rate"),
        ("Frame Time: 0.01\n", "Frame Time: 0.01\n1 2 3\n", ":24: expected 12 numbers, got 3"),
        ("Frame Time: 0.01\n", "Frame Time: 0.01\n" + "x " * 12 + "\n", ":24: expected numbers, got 'x x"),
        (
            "Frames: 4\nFrame Time: 0.01\n",
            "Frames: 5\nFrame Time: 0.01\n" + "nan " * 12 + "\n",
            ":24: expected finite num",
        ),
        ("OFFSET 0.0 1.0 0.0", "OFFSET 1.7e308 -1.7e308 1.7e308", ": expected places of joints, got numbers too large"),
    ],
    "trc": [
        (GOOD["trc"].split("\n")[1], "", ":1: expected a TRC, got no line that names DataRate"),
        ("\n2\t", "\n2\tone\t", ":8: expected 11 numbers, got 11 in '2\\tone"),
        ("\n2\t", "\n2\t1\t", ":8: expected 11 numbers, got 12"),
        ("hip\t\t\tknee\t\t\theel", "hip", ":4: expected names of markers"),
    ],
    "csv": [
        ("knee_z", "knee", ": expected a recording"),
        ("\n0.01,", "\n0.01\n0.01,", ":3: expected 7 fields, got 1"),
        ("\n0.01,", "\n0.01,six", ":3: expected a number, got 'six"),
        (GOOD["csv"][GOOD["csv"].index("\n0.01") :], "", ": expected at least 2 frames, got 1"),
    ],
}


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
