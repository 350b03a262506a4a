"""One naming convention: a program's names for the joints that HDM05 has, read from TOML and checked once.

Capitals and marks between words are ignored: `LeftUpLeg`, `left_up_leg` and `left-upLeg` are one name. So is text in
front of a name: a namespace (`mixamorig:Hips`), a path (`Armature|Hips`, `/tf/hips`), or a prefix that all joints of a
skeleton share (`Skeleton 001_Hip`), and an end that all share (`LEFT_HIP_BD`).
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, lru_cache
from importlib import resources
from pathlib import Path
from string import digits
from typing import Any

import msgspec

from kinespace.library.naming import hdm05
from kinespace.library.naming.checked_toml import Text, read_toml, text_of

_ENDING = ".toml"
#: Names whose spelling is remembered, at most: every convention is tried with each.
_MAX_REMEMBERED = 1024
_BETWEEN_WORDS = re.compile(r"[\s_\-.:]+")
_BEGINS_WORD = re.compile(r"[\s_\-.:]+|(?<=[a-z\d])(?=[A-Z])")
#: The end of a namespace or a path.
_NAMESPACE = re.compile(r"\A.*[:|/]")
#: A side and the rest of a name.
_SIDED = re.compile(
    r"(?:((?i:left|right|l|r))[\s_\-.]+|([lr]|[Ll]eft|[Rr]ight)(?=[A-Z]))(.+)|"
    r"(.+?)(?:[\s_\-.]+((?i:left|right|l|r))|(?<=[a-z\d])(L|R|Left|Right))"
)
#: Names that feeds have for a convention.
_ALSO = {"kinectv2": "kinect2"}
#: Stands for a side in a convention's names, and for its letter in ours.
_SIDE = "*"


class ConventionError(ValueError):
    """A convention cannot be used; the message names the file and the mistake."""


@dataclass(frozen=True, slots=True)
class Convention:
    """A program's names for the joints that HDM05 has.

    Attributes
    ----------
    name, title
        The name by which it is asked for, and the name that people read.
    targets
        Our joint for each of the convention's names, spelled by `spelling`; empty where we have no such joint. Where a
        skeleton has two names for one joint, the first name counts.
    sided
        The names of the two sides' joints, spelled, by `_sided`: a side may stand in front of a name or behind it.
    prefixes
        Prefixes that every name may have, perhaps followed by a number, spelled by `spelling`.
    absent
        Names, spelled by `spelling`; a skeleton that has one of them is not of this convention.
    needed
        Names, spelled by `spelling`; a skeleton that has none of them is not of this convention.
    """

    name: str
    title: str
    targets: Mapping[str, str] = field(repr=False)
    sided: Mapping[str, str] = field(default_factory=dict, repr=False)
    prefixes: tuple[str, ...] = ()
    absent: frozenset[str] = frozenset()
    needed: frozenset[str] = frozenset()

    @property
    def joints(self) -> tuple[str, ...]:
        """Our joints that the convention names, in the order of its names."""
        return tuple(dict.fromkeys(target for target in self.targets.values() if target))

    def spelled(self, labels: Sequence[str]) -> list[str]:
        """Spell labels by `spelling`, without the text in front of each name."""
        plain, sided = _ways(tuple(labels))
        ways = [[self.bare(each) for each in way] for way in plain] if self.prefixes else list(plain)
        ways += [[self.sided.get(*each) for each in way] for way in sided]
        return max(ways, key=self.known)

    def fits(self, spelled: Sequence[str]) -> bool:
        """Say whether a skeleton has none of the names that it must lack, and one of those that it needs."""
        return self.absent.isdisjoint(spelled) and not (self.needed and self.needed.isdisjoint(spelled))

    def known(self, spelled: Sequence[str]) -> int:
        """Count the names that belong to the convention."""
        return sum(name in self.targets for name in spelled)

    def bare(self, spelled: str) -> str:
        """Give a spelled label without a prefix that the convention's names may have."""
        front = next((each for each in self.prefixes if spelled.startswith(each)), "")
        rest = spelled.removeprefix(front)
        return rest.lstrip(digits) or rest if front else spelled


@lru_cache(maxsize=_MAX_REMEMBERED)
def spelling(name: str) -> str:
    """Spell a joint's name without capitals and without marks between words."""
    return _BETWEEN_WORDS.sub("", name).casefold()


@lru_cache(maxsize=_MAX_REMEMBERED)
def _sided(label: str) -> str:
    """Spell a name by its side and what is left of it, wherever the side stands: `shoulder_L`, `leftShoulder`."""
    side = _SIDED.fullmatch(label)
    return f"{(side[1] or side[2] or side[5] or side[6])[0].lower()} {spelling(side[3] or side[4])}" if side else ""


@lru_cache(maxsize=_MAX_REMEMBERED)
def known_as(label: str) -> str:
    """Give the spelling by which some convention knows a label alone; empty where none does."""
    bare = _NAMESPACE.sub("", label) or label
    spelled = spelling(bare)
    ways = (spelled, *(each.bare(spelled) for each in conventions() if each.prefixes), _sided(bare))
    return next((each for each in ways if each in _every_name()), "")


@cache
def _every_name() -> frozenset[str]:
    """Give all names of all conventions, spelled, and by their sides."""
    return frozenset(name for each in conventions() for name in (*each.targets, *each.sided))


@lru_cache(maxsize=8)
def _ways(labels: tuple[str, ...]) -> tuple[tuple[list[str], ...], tuple[list[tuple[str, str]], ...]]:
    """Spell labels once for all conventions: a stranger may send thousands.

    First without a namespace; then also without the beginning that all of them share; then without their common end.
    The second list has the last two, each label by its sides and by its spelling.
    """
    bare = [_NAMESPACE.sub("", label) or label for label in labels]
    front = _without_front(bare)
    both = [label[::-1] for label in _without_front([label[::-1] for label in front], _BETWEEN_WORDS)]
    plain = tuple([spelling(label) for label in each] for each in (bare, front, both))
    sided = (zip(map(_sided, each), spelled, strict=True) for each, spelled in ((front, plain[1]), (both, plain[2])))
    return plain, tuple(map(list, sided))


def _without_front(labels: Sequence[str], mark: re.Pattern[str] = _BEGINS_WORD) -> list[str]:
    """Leave out the beginning that all labels share, up to a mark between words, or a capital."""
    fronts = [labels[0][: found.end()] for found in mark.finditer(labels[0])] if labels else []
    front = max((each for each in fronts if all(label.startswith(each) for label in labels)), key=len, default="")
    return [label.removeprefix(front) or label for label in labels]


@cache
def own_convention() -> Convention:
    """Give HDM05's own names as a convention; CMU's ASF files use the same names."""
    return Convention("hdm05", "HDM05", {spelling(joint): joint for joint in hdm05.SKELETON.joints})


@cache
def conventions() -> tuple[Convention, ...]:
    """Give all conventions that come with kinespace: HDM05's own, then the files in the folder `conventions`."""
    folder = resources.files("kinespace.library.naming") / "conventions"
    files = sorted((file for file in folder.iterdir() if file.name.endswith(_ENDING)), key=lambda file: file.name)
    read = (parse_convention(file.read_text(encoding="utf-8"), file.name) for file in files)
    return (own_convention(), *read)


def convention_named(text: str) -> Convention:
    """Give a convention by its name, or read one from a user's file.

    Raises
    ------
    ConventionError
        There is no convention of that name, or the file is no convention.
    OSError
        The file cannot be read.
    """
    if text.endswith(_ENDING):
        return parse_convention(text_of(Path(text), ConventionError), text)
    name = _ALSO.get(text.casefold(), text.casefold())
    found = next((each for each in conventions() if each.name == name), None)
    if found is None:
        names = ", ".join(sorted((*(each.name for each in conventions()), *_ALSO)))
        raise ConventionError(f"names: expected one of {names}, or a {_ENDING} file, got {text!r}")
    return found


class _ConventionFile(msgspec.Struct, forbid_unknown_fields=True):
    """A convention as written; `sides` is a pair of words for left and right, or a list of such pairs."""

    joints: dict[str, str]
    title: Text = ""
    prefixes: tuple[Text, ...] = ()
    sides: tuple[tuple[Text, Text], ...] = ()
    absent: tuple[Text, ...] = ()
    needed: tuple[Text, ...] = ()

    def __post_init__(self) -> None:
        """Refuse joints that HDM05 lacks, and names that have two targets."""
        targets = dict[str, str]()
        for name, target in self.targets():
            if target and target not in hdm05.SKELETON.joints:
                raise ValueError(f"joints: expected one of HDM05's joints or nothing, got {target!r}")
            if targets.setdefault(spelling(name), target) != target:
                raise ValueError(f"joints: expected each name once, got {name!r} twice")
        if len(set(targets.values()) - {""}) < 2:
            raise ValueError(f"joints: expected at least two of HDM05's joints, got {self.joints!r}")

    def targets(self) -> list[tuple[str, str]]:
        """Give each name and its joint, on both sides."""
        return [each for name, target in self.joints.items() for each in self.both_sides(name, target.strip())]

    def spelled(self, patterns: Sequence[str]) -> frozenset[str]:
        """Spell names, on both sides."""
        return frozenset(spelling(each) for pattern in patterns for each, _ in self.both_sides(pattern))

    def both_sides(self, name: str, target: str = "") -> list[tuple[str, str]]:
        """Replace `*` by each word for a side."""
        if _SIDE not in name:
            return [(name, target)]
        words = [(word, letter) for pair in self.sides for word, letter in zip(pair, "lr", strict=True)]
        return [(name.replace(_SIDE, word), target.replace(_SIDE, letter)) for word, letter in words]


def parse_convention(text: str, file: str) -> Convention:
    """Read a convention from TOML.

    Parameters
    ----------
    text
        The TOML: `title`, `[joints]`, and if needed `sides`, `prefixes`, `absent` and `needed`.
    file
        The file's name in messages; the convention's name is the same without folder and ending.

    Raises
    ------
    ConventionError
        The text is no TOML, or something in it is wrong, missing or unknown.
    """
    read = read_toml(text, file, _ConventionFile, ConventionError, _written_out)
    name = Path(file).name.removesuffix(_ENDING)
    return Convention(
        name=name,
        title=read.title.strip() or name,
        targets={spelling(each): target for each, target in read.targets()},
        sided={
            f"{side} {spelling(name.replace(_SIDE, ''))}": spelling(each)
            for name in read.joints
            if _SIDE in name
            for side, (each, _) in zip("lr", read.both_sides(name), strict=False)
        },
        prefixes=tuple(map(spelling, read.prefixes)),
        absent=read.spelled(read.absent),
        needed=read.spelled(read.needed),
    )


def _written_out(table: dict[str, Any]) -> dict[str, Any]:
    """Write one pair of sides as a list of pairs."""
    sides = table.get("sides")
    pair = isinstance(sides, list) and bool(sides) and not isinstance(sides[0], list)
    return table | {"sides": [sides]} if pair else table
