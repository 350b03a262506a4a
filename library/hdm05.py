"""What the names of HDM05's files mean, and the body its recordings share with CMU's."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, NamedTuple

from library.skeleton import Skeleton

if TYPE_CHECKING:
    from pathlib import Path

ATTRIBUTION = (
    "Computed from the HDM05 motion capture database: M. Mueller, T. Roeder, M. Clausen, B. Eberhardt, "
    'B. Krueger, A. Weber, "Documentation Mocap Database HDM05", Universitaet Bonn, CG-2007-2, 2007.'
)
LICENCE = "CC BY-SA 3.0"

#: Joints in the order of the recordings' `:hierarchy`: the root, its children, their children line by line.
SKELETON = Skeleton(
    joints=(
        *("root", "lhipjoint", "rhipjoint", "lowerback"),
        *("lfemur", "ltibia", "lfoot", "ltoes", "rfemur", "rtibia", "rfoot", "rtoes"),
        *("upperback", "thorax", "lowerneck", "lclavicle", "rclavicle", "upperneck", "head"),
        *("lhumerus", "lradius", "lwrist", "lhand", "lthumb", "lfingers"),
        *("rhumerus", "rradius", "rwrist", "rhand", "rthumb", "rfingers"),
    ),
    parents=(
        *(-1, 0, 0, 0),
        *(1, 4, 5, 6, 2, 8, 9, 10),
        *(3, 12, 13, 13, 13, 14, 17),
        *(15, 19, 20, 21, 21, 22),
        *(16, 25, 26, 27, 27, 28),
    ),
)

_CLIP_NAME = re.compile(r"HDM_(?P<actor>[a-z]{2})_(?P<class>.+)_(?P<take>\d{3})_(?P<rate>\d+)", re.IGNORECASE)


class ClipName(NamedTuple):
    """What a cut clip's file name says: who performs which class, which take, at how many frames per second."""

    actor: str
    class_name: str
    take: str
    frame_rate: float


def read_clip_name(path: Path) -> ClipName | None:
    """Read `HDM_<actor>_<class>_<take>_<rate>`; None when the file is not named like an HDM05 cut clip."""
    named = _CLIP_NAME.fullmatch(path.stem)
    if named is None or int(named["rate"]) == 0:
        return None
    return ClipName(named["actor"], named["class"], named["take"], float(named["rate"]))
