"""One naming convention: a program's names for the joints that HDM05 has, read from TOML and checked once.

Capitals and marks between words are ignored: `LeftUpLeg`, `left_up_leg` and `left-upLeg` are one name. So is text in
front of a name: a namespace (`mixamorig:Hips`), a path (`Armature|Hips`), or a prefix that all joints of a skeleton
share (`Skeleton 001_Hip`).
"""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass, field
from functools import cache
from importlib import resources
from pathlib import Path
from string import digits
from typing import TYPE_CHECKING, cast

from kinespace.library.naming import hdm05

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

_ENDING = ".toml"
_KEYS = ("title", "prefixes", "sides", "absent", "joints")
_BETWEEN_WORDS = re.compile(r"[\s_\-.:]+")
#: The end of a namespace or a path.
_NAMESPACE = re.compile(r".*[:|]")
#: Names that feeds and sets of joints have for a convention.
_ALSO = {"kinect20": "kinect1", "kinectv2": "kinect2"}
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
    prefixes
        Prefixes that every name may have, perhaps followed by a number, spelled by `spelling`.
    absent
        Names, spelled by `spelling`; a skeleton that has one of them is not of this convention.
    """

    name: str
    title: str
    targets: Mapping[str, str] = field(repr=False)
    prefixes: tuple[str, ...] = ()
    absent: frozenset[str] = frozenset()

    @property
    def joints(self) -> tuple[str, ...]:
        """Our joints that the convention names, in the order of its names."""
        return tuple(dict.fromkeys(target for target in self.targets.values() if target))

    def spelled(self, labels: Sequence[str]) -> list[str]:
        """Spell labels by `spelling`, without the text in front of each name."""
        bare = [_NAMESPACE.sub("", label) or label for label in labels]
        return max(([self._bare(label) for label in each] for each in (bare, _without_front(bare))), key=self.known)

    def known(self, spelled: Sequence[str]) -> int:
        """Count the names that belong to the convention."""
        return sum(name in self.targets for name in spelled)

    def _bare(self, label: str) -> str:
        bare = spelling(label)
        front = next((each for each in self.prefixes if bare.startswith(each)), "")
        return bare.removeprefix(front).lstrip(digits) if front else bare


def spelling(name: str) -> str:
    """Spell a joint's name without capitals and without marks between words."""
    return _BETWEEN_WORDS.sub("", name).casefold()


def _without_front(labels: Sequence[str]) -> list[str]:
    """Leave out the beginning that all labels share, up to a mark between words."""
    fronts = [labels[0][: mark.end()] for mark in _BETWEEN_WORDS.finditer(labels[0])] if labels else []
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
        try:
            return parse_convention(Path(text).read_text(encoding="utf-8"), text)
        except UnicodeDecodeError as error:
            raise ConventionError(f"{text}: expected UTF-8 text, got byte {error.start} of another encoding") from error
    name = _ALSO.get(text.casefold(), text.casefold())
    found = next((each for each in conventions() if each.name == name), None)
    if found is None:
        names = ", ".join(sorted((*(each.name for each in conventions()), *_ALSO)))
        raise ConventionError(f"names: expected one of {names}, or a {_ENDING} file, got {text!r}")
    return found


def parse_convention(text: str, file: str) -> Convention:
    """Read a convention from TOML.

    Parameters
    ----------
    text
        The TOML: `title`, `[joints]`, and if needed `sides`, `prefixes` and `absent`.
    file
        The file's name in messages; the convention's name is the same without folder and ending.

    Raises
    ------
    ConventionError
        The text is no TOML, or something in it is wrong, missing or unknown.
    """
    try:
        table: dict[str, object] = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConventionError(f"{file}: expected TOML, got a mistake: {error}") from error
    if unknown := [key for key in table if key not in _KEYS]:
        raise ConventionError(f"{file}: expected {', '.join(_KEYS)}, got {unknown[0]}")
    name = Path(file).name.removesuffix(_ENDING)
    sides = _sides(table.get("sides", []), file)
    title = table.get("title", name)
    if not isinstance(title, str) or not title.strip():
        raise ConventionError(f"{file}: title: expected a text, got {title!r}")
    return Convention(
        name=name,
        title=title.strip(),
        targets=_targets(table.get("joints"), sides, file),
        prefixes=tuple(map(spelling, _texts(table.get("prefixes", []), "prefixes", file))),
        absent=frozenset(
            spelling(each)
            for pattern in _texts(table.get("absent", []), "absent", file)
            for each, _ in _both_sides(pattern, "", sides)
        ),
    )


def _texts(value: object, key: str, file: str) -> list[str]:
    if not isinstance(value, list) or not all(isinstance(each, str) and each for each in value):
        raise ConventionError(f"{file}: {key}: expected a list of texts, got {value!r}")
    return value


def _sides(value: object, file: str) -> list[list[str]]:
    """Read `["Left", "Right"]`, or a list of several such pairs."""
    pairs = [value] if isinstance(value, list) and value and not isinstance(value[0], list) else value
    if not isinstance(pairs, list):
        raise ConventionError(f"{file}: sides: expected a list of left and right, got {value!r}")
    read = [_texts(pair, "sides", file) for pair in pairs]
    if any(len(pair) != len("lr") for pair in read):
        raise ConventionError(f"{file}: sides: expected left and right, got {value!r}")
    return read


def _targets(value: object, sides: list[list[str]], file: str) -> dict[str, str]:
    if not isinstance(value, dict) or not all(isinstance(target, str) for target in value.values()):
        raise ConventionError(f"{file}: joints: expected a table with one of HDM05's joints for each name")
    targets = dict[str, str]()
    for key, given in cast("dict[str, str]", value).items():
        for name, target in _both_sides(key, given.strip(), sides):
            if target and target not in hdm05.SKELETON.joints:
                raise ConventionError(f"{file}: joints: expected one of HDM05's joints or nothing, got {target!r}")
            if targets.setdefault(spelling(name), target) != target:
                raise ConventionError(f"{file}: joints: expected each name once, got {name!r} twice")
    if len({target for target in targets.values() if target}) < 2:
        raise ConventionError(f"{file}: joints: expected at least two of HDM05's joints")
    return targets


def _both_sides(name: str, target: str, sides: list[list[str]]) -> Iterator[tuple[str, str]]:
    """Replace `*` by each word for a side."""
    if _SIDE not in name:
        yield name, target
        return
    for left, right in sides:
        yield name.replace(_SIDE, left), target.replace(_SIDE, "l")
        yield name.replace(_SIDE, right), target.replace(_SIDE, "r")
