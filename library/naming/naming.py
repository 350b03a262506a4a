"""How the joint names of a file or a feed are read: by a convention, found or given, or unchanged."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple, Self

from kinespace.library.naming import hdm05
from kinespace.library.naming.convention import Convention, convention_named, conventions, own_convention, spelling

#: The word by which a person asks to find the convention.
AUTO = "auto"
#: The word by which a person asks to leave names unchanged.
AS_THEY_ARE = "as-they-are"
#: Joints of ours without which a convention is not found in a skeleton.
_MIN_KNOWN = 6
#: A convention is found when it knows this share of the skeleton's names, or when the skeleton has this share of the
#: joints that the convention names. A hand with twenty bones, or half a body, fails one of the two only.
_SHARE = 0.6
#: Skeletons whose names are remembered, at most; and names of a skeleton that are compared with tables: no body has
#: more, and a stranger's four thousand would take a third of a second.
_MAX_REMEMBERED, _MAX_NAMES = 64, 1000
#: Names that are listed because they are not known, and characters of each, at most.
_MAX_LISTED, _MAX_LABEL = 8, 24
#: The joints of each arm and each leg.
_LIMBS = tuple(
    frozenset(side + each for each in limb) for side in "lr" for limb in (("humerus", "radius"), ("femur", "tibia"))
)
#: The table that is copied where none is near.
_USUAL = "mixamo"


class NamedJoints(NamedTuple):
    """Joints by our names.

    Attributes
    ----------
    joints
        All joints in their order: by our name where the convention has one, by their own name elsewhere.
    convention
        The convention that was applied; None where names were not changed.
    """

    joints: tuple[str, ...]
    convention: Convention | None

    @property
    def title(self) -> str:
        """The convention's title; empty where names were not changed, or are ours anyway."""
        return self.convention.title if self.convention and self.convention.name != own_convention().name else ""


def listed(names: Sequence[str], most: int) -> str:
    """Write the first of some names, and dots where there are more."""
    return ", ".join(names[:most]) + (" ..." if len(names) > most else "")


def summary(title: str, joints: Sequence[str]) -> str:
    """Say in a line which convention was applied, and how many of our joints it found."""
    ours = hdm05.SKELETON.joints
    line = f"{title} names: {sum(joint in ours for joint in joints)} of {len(ours)} joints"
    foreign = [joint[:_MAX_LABEL] for joint in joints if joint not in ours]
    if foreign and not all(each <= {*joints} for each in _LIMBS):
        line += f"; an arm or a leg is missing, not understood: {listed(foreign, _MAX_LISTED)}"
    return line


def unknown_names(labels: Sequence[str], joints: Collection[str]) -> str:
    """List the labels that name none of some joints of ours, and say which table is nearest; empty for no labels."""
    named = Naming().met(labels, joints).joints
    lost = [label[:_MAX_LABEL] for label, name in zip(labels, named, strict=True) if name not in joints]
    if not lost:
        return ""
    spelled = [(each, each.spelled(labels[:_MAX_NAMES])) for each in conventions() if each != own_convention()]
    tables = [(each.known(names), each.name) for each, names in spelled if each.fits(names)]
    known, nearest = max(tables, key=lambda each: each[0])
    near = f"the nearest table ({nearest}) knows {known} of {len(labels)}" if known else "no table knows them"
    copied = nearest if known else _USUAL
    write = f"kinespace examples {copied}.toml > my.toml copies a table, to be edited for --names my.toml"
    return f"names not known: {listed(lost, _MAX_LISTED)}; {near}; {write}"


@dataclass(frozen=True, slots=True)
class Naming:
    """How joint names are read.

    Attributes
    ----------
    convention
        The convention to apply; None to find it.
    finds
        Whether to find the convention; if not, and none is given, names are not changed.
    """

    convention: Convention | None = None
    finds: bool = True

    @classmethod
    def asked(cls, text: str) -> Self:
        """Read the option: auto, as-they-are, a convention's name, or a TOML file.

        Raises
        ------
        ConventionError
            There is no such convention, or the file is no convention.
        OSError
            The file cannot be read.
        """
        if text in (AUTO, AS_THEY_ARE):
            return cls(finds=text == AUTO)
        return cls(convention_named(text))

    def read(self, labels: Sequence[str]) -> NamedJoints:
        """Give joints our names, where a convention is given or found."""
        if self.convention:
            return NamedJoints(_renamed(self.convention, labels), self.convention)
        return _found(tuple(labels)) if self.finds else NamedJoints(tuple(labels), None)

    def met(self, labels: Sequence[str], joints: Collection[str]) -> NamedJoints:
        """Give joints our names, unless the joints' own names match more of `joints`.

        Parameters
        ----------
        labels
            A sender's names for its joints.
        joints
            A library's joints, which may have names of their own.
        """
        named, there = self.read(labels), frozenset(joints)
        as_they_are = sum(label in there for label in labels)
        if self.convention is None and as_they_are >= sum(joint in there for joint in named.joints):
            return NamedJoints(tuple(labels), named.convention if named.joints == tuple(labels) else None)
        return named


@lru_cache(maxsize=_MAX_REMEMBERED)
def _found(labels: tuple[str, ...]) -> NamedJoints:
    """Rename joints by the convention that knows most of them; unchanged where no convention fits."""
    best, most = None, (0, 0.0)
    ours = sum(label in hdm05.SKELETON.joints for label in labels)
    if len(labels) > _MAX_NAMES:
        return NamedJoints(labels, None)
    if ours == len(labels) >= _MIN_KNOWN:
        return NamedJoints(labels, own_convention())
    for convention in conventions():
        spelled = convention.spelled(labels)
        known = convention.known(spelled)
        targets = {convention.targets.get(label, "") for label in spelled} - {""}
        # A file that was renamed before has our names and some of the convention's.
        if ours >= _MIN_KNOWN and not convention.needed and convention != own_convention():
            continue
        if len(targets) < _MIN_KNOWN or not convention.fits(spelled):
            continue
        of_names, of_joints = known / len(labels), len(targets) / len(convention.joints)
        # Of two conventions that know as many names, the one of whose joints the skeleton has a larger share.
        if max(of_names, of_joints) >= _SHARE and (known, of_joints) > most:
            best, most = convention, (known, of_joints)
    return NamedJoints(_renamed(best, labels), best) if best else NamedJoints(labels, None)


def _renamed(convention: Convention, labels: Sequence[str]) -> tuple[str, ...]:
    """Rename to each of our joints the first of the convention's names that the skeleton has; leave the others."""
    spelled = convention.spelled(labels)
    places = dict[str, int]()
    for name, target in convention.targets.items():
        if target and target not in places and name in spelled:
            places[target] = spelled.index(name)
    ours = {place: target for target, place in places.items()}
    taken, names = set(places), list[str]()
    for place, label in enumerate(labels):
        name = ours.get(place, label)
        # A joint that keeps its name must not be taken for one of ours: SMPL's head is our upperneck, not our head.
        while place not in ours and (name in taken or spelling(name) in own_convention().targets):
            name = f"{convention.title} {name}"
        names.append(name)
    return tuple(names)
