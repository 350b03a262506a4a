"""The names of HDM05's files, its licence, and its skeleton, which CMU's recordings share."""

import re
import tomllib
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import NamedTuple

from kinespace.library.clip import Clip
from kinespace.library.skeleton import Skeleton

#: The name of a motion's source.
SOURCE = "HDM05"
ATTRIBUTION = (
    "Joint positions computed from the HDM05 motion capture database: M. Mueller, T. Roeder, M. Clausen, B. Eberhardt, "
    'B. Krueger, A. Weber, "Documentation Mocap Database HDM05", Universitaet Bonn, CG-2007-2, 2007.'
)
LICENCE = "CC BY-SA 3.0"

_HELD = tomllib.loads((resources.files("kinespace.library.naming") / "hdm05.toml").read_text("utf-8"))
_JOINTS = [*_HELD["above"]]
SKELETON = Skeleton(tuple(_JOINTS), (-1, *(_JOINTS.index(above) for above in _HELD["above"].values() if above)))
#: How people call HDM05's classes.
_TITLES: dict[str, str] = _HELD["titles"]

#: A cut clip says its class and a take of three digits; an uncut take says scene-part and a take of two digits.
_TAKE = r"(?P<class>.+)_(?P<take>\d{3})|(?P<uncut>\d{2}-\d{2}_\d{2})"
_NAME = re.compile(rf"HDM_(?P<actor>[a-z]{{2}})_(?:{_TAKE})_(?P<rate>\d+)", re.IGNORECASE)


class ClipName(NamedTuple):
    """The parts of a file's name: actor, class, take, frames per second.

    An uncut take shows many motions one after the other: its class is empty.
    """

    actor: str
    class_name: str
    take: str
    frame_rate: float


def read_clip_name(path: Path) -> ClipName | None:
    """Read `HDM_<actor>_<class>_<take>_<rate>` (a cut clip) or `HDM_<actor>_<scene>-<part>_<take>_<rate>` (uncut).

    Returns
    -------
    The parts of the name; None when the file is not named like a file of HDM05.
    """
    named = _NAME.fullmatch(path.stem)
    if named is None or int(named["rate"]) == 0:
        return None
    return ClipName(named["actor"], named["class"] or "", named["take"] or named["uncut"], float(named["rate"]))


def title_of(class_name: str) -> str:
    """Give the name by which people call a class; a class of one's own has its own."""
    return _TITLES.get(class_name, class_name)


def titled(clip: Clip, path: Path) -> Clip:
    """Give a clip the class, the actor and the take of its file's name, where the file is named like HDM05's."""
    named = read_clip_name(path)
    return replace(clip, class_name=named.class_name, actor=named.actor, take=named.take) if named else clip
