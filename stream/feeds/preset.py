"""Presets: the meaning of a product's messages, read from TOML that a user can copy and edit, checked once.

A preset lists messages: an address in which `{joint}` and `{performer}` stand for names, `{skip}` for any one part and
`{any}` for anything, and the role of each argument. `native.toml` and its neighbours are examples.
"""

import re
from collections.abc import Sequence
from enum import StrEnum
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec

from kinespace.library.naming import Naming, convention_named, hdm05, spelling
from kinespace.library.naming.checked_toml import Text, read_toml, text_of
from kinespace.library.signature.landmark_body import JOINTS
from kinespace.stream.feeds.kinematics import Bone
from kinespace.stream.feeds.unpackers import UNPACKERS

_ENDING = ".toml"
_PRESETS = resources.files("kinespace.stream.feeds") / "presets"
_POSITION = ("x", "y", "z")
_ROTATION = ("qx", "qy", "qz", "qw")
#: The places of the library's joints.
_OURS = {name: place for place, name in enumerate(hdm05.SKELETON.joints)}
_ROLES = ("joint", "performer", *_POSITION, *_ROTATION, "confidence", "time", "time_high", "name", "present", "skip")
#: The role of an argument; a role that begins with = is a text that must be there.
_Role = Annotated[str, msgspec.Meta(pattern=f"^({'|'.join(_ROLES)}|=.*)$")]
#: A number above 0 that is neither infinite nor NaN.
_Length = Annotated[float, msgspec.Meta(ge=1e-9, le=1e9)]
_Port = Annotated[int, msgspec.Meta(ge=1, le=65535)]
#: Characters of an address, as written and as sent; messages and placeholders of an address, at most: a stranger's
#: preset must not take long to match what a stranger sends.
MAX_ADDRESS, _MAX_MESSAGES, _MAX_PLACEHOLDERS = 256, 64, 6
#: Regular expressions for the placeholders of an address.
_PLACEHOLDERS = {"joint": "(?P<joint>[^/]+)", "performer": "(?P<performer>[^/]+)", "skip": "[^/]+", "any": ".+"}


class PresetError(ValueError):
    """A preset cannot be used; the message has the file, the key, the expectation and the value."""


class Means(StrEnum):
    """A message's meaning for the open frame."""

    #: One joint or some joints of the frame.
    JOINT = "joint"
    #: The whole frame.
    FRAME = "frame"
    #: The frame's beginning: earlier joints belong to a complete frame.
    BEGIN = "begin"
    #: The frame's end.
    END = "end"
    #: The frame's time.
    TIME = "time"
    #: The performer has left.
    GONE = "gone"
    #: The name for a joint's number.
    NAME = "name"
    #: The order of the joints in messages with all of them.
    ORDER = "order"
    #: Nothing for a frame: turns, speeds and the like, whose addresses look like a joint's.
    NOTHING = "nothing"


class Closing(StrEnum):
    """The reasons for which a frame is complete."""

    #: A message that says so.
    END = "end"
    #: The end of a bundle, if it brought every joint that came lately.
    BUNDLE = "bundle"
    #: A joint comes that is already in the frame.
    REPEAT = "repeat"
    #: All joints of the preset are there.
    COMPLETE = "complete"
    #: No message has come for a while.
    TIMEOUT = "timeout"


class MessageRule(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The meaning of one kind of message.

    Attributes
    ----------
    address
        As written, with placeholders.
    arguments
        Role of each argument; further arguments are ignored, unless `each` gives their roles.
    each
        Roles of a group of arguments that follows once or several times.
    given
        The message's meaning for the frame, if the file says it.
    """

    address: Annotated[str, msgspec.Meta(pattern="^/", max_length=MAX_ADDRESS)]
    arguments: tuple[_Role, ...] = ()
    each: tuple[_Role, ...] = ()
    given: Means | None = msgspec.field(name="means", default=None)

    def __post_init__(self) -> None:
        """Refuse an address or roles that make no sense."""
        try:
            pattern_of(self.address)
        except KeyError as error:
            known = "}, {".join(_PLACEHOLDERS)
            raise ValueError(f"address: expected only {{{known}}} in braces, got {error}") from error
        except re.error as error:
            raise ValueError(f"address: expected each of {{joint}} and {{performer}} once, got {error}") from error
        held = [part.count("{") for part in self.address.split("/")]
        if max(held) > 1 or sum(held) > _MAX_PLACEHOLDERS or self.address.count("{any}") > 1:
            expected = f"at most {_MAX_PLACEHOLDERS} names in braces, one between two slashes, and {{any}} once"
            raise ValueError(f"address: expected {expected}, got {self.address!r}")
        for key, roles in (("arguments", self.arguments), ("each", self.each)):
            named = [role for role in roles if role != "skip" and not role.startswith("=")]
            if len(set(named)) != len(named):
                raise ValueError(f"{key}: expected each role but skip once, got {roles!r}")
        here = {*self.arguments, *self.each, *re.findall(r"\{(\w+)\}", self.address)}
        needed = _NEEDED.get(self.means, set())
        if lacking := needed - here:
            expected = f"{', '.join(sorted(needed))} in a {self.means} message, {min(lacking)} too"
            raise ValueError(f"arguments: expected {expected}, got {self.arguments!r}")
        if here & set(_ROTATION) and not set(_ROTATION) <= here:
            raise ValueError(f"arguments: expected all of qx, qy, qz, qw or none, got {self.arguments!r}")

    @property
    def means(self) -> Means:
        """The message's meaning for the frame; by default as its address and its roles say."""
        if self.given:
            return self.given
        if self.each:
            return Means.FRAME if set(_POSITION) <= set(self.each) else Means.ORDER
        if "name" in self.arguments:
            return Means.NAME
        return Means.JOINT if "joint" in self.arguments or "{joint}" in self.address else Means.TIME


#: The roles that a message needs for its meaning.
_NEEDED = {
    Means.JOINT: {"joint", *_POSITION},
    Means.FRAME: {*_POSITION},
    Means.NAME: {"joint", "name"},
    Means.ORDER: {"joint"},
}


class Closings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The rules for a complete frame, and for absent joints.

    Attributes
    ----------
    by
        The reasons for which a frame is complete.
    timeout
        Seconds without a new joint after which a frame is closed; half of the time between two frames when that is
        less.
    hold
        Seconds for which an absent joint stays where it was; after that it is lost, and a frame with many lost refused.
    confidence
        A joint sent with less than this is absent.
    words
        The confidence of words that come in place of a number, in small letters.
    some
        Whether frames hold the joints that came in the last seconds alone, not all of the preset's.
    """

    by: frozenset[Closing] = msgspec.field(name="close", default=frozenset({Closing.REPEAT, Closing.TIMEOUT}))
    timeout: Annotated[float, msgspec.Meta(ge=0.001, le=10)] = 0.1
    hold: Annotated[float, msgspec.Meta(ge=0, le=10)] = 0.2
    confidence: Annotated[float, msgspec.Meta(ge=0, le=1e9)] = 0.0
    words: dict[str, float] = {}
    some: bool = False

    def __post_init__(self) -> None:
        """Spell the words in small letters."""
        msgspec.structs.force_setattr(self, "words", {word.casefold(): each for word, each in self.words.items()})


class AskedMessage(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A message for a sender: in its arguments `{port}` is our port and `{joint}` each of the preset's joints."""

    address: Annotated[str, msgspec.Meta(pattern="^/")]
    arguments: tuple[str | int | float, ...] = ()


class Asking(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Messages that a sender must get before it sends, and while it sends.

    Attributes
    ----------
    port
        The port on which the sender listens.
    messages
        The messages.
    farewell
        The messages that are sent when we stop.
    every
        Seconds after which the messages are sent again.
    while_silent
        Whether they are sent only while no frames come.
    """

    port: _Port
    messages: Annotated[tuple[AskedMessage, ...], msgspec.Meta(min_length=1)] = msgspec.field(name="message")
    farewell: tuple[AskedMessage, ...] = ()
    every: Annotated[float, msgspec.Meta(ge=0.1, le=3600)] = 2.0
    while_silent: bool = False


class PresetFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The meaning of a product's messages, as its file gives it.

    Attributes
    ----------
    product, sender
        The product, and the settings of its sender.
    port
        The port to which it usually sends.
    rate
        Frames per second that it usually sends.
    performer
        The performer's name when the messages have none.
    metres
        Metres of one unit along each of the sender's axes.
    turned
        For our x (right of the picture), y (up) and z (towards us) the sender's axis, each perhaps with a minus.
    packing
        The packing of its messages (`stream.feeds.unpackers`).
    clock
        Whose clock gives a frame its time; the arrival's too when the sender sends none.
    seconds
        Seconds of one unit of the sender's time.
    closings
        When a frame is complete.
    messages
        Tried in order; the first that fits a message's address and arguments is used.
    joint_map
        The sender's joint names with the motion library's names; an empty one for a joint that the library lacks.
    tables
        Naming conventions for few joints, of which no convention is found. A sender of `some` joints may use any
        convention that is found in its names.
    order, order_from
        Joint names in the order of their numbers, and the first number; also their order in messages without names.
    bones
        By name, for positions relative to a parent: the parents, and offsets for bones without a position.
    guessed
        Whether a network guessed the positions from one picture: `library.signature.landmark_body` makes a body then.
    asking
        The messages for the sender, or None.
    """

    port: _Port
    messages: Annotated[tuple[MessageRule, ...], msgspec.Meta(max_length=_MAX_MESSAGES)] = msgspec.field(name="message")
    joint_map: dict[str, str] = msgspec.field(name="joints")
    tables: tuple[str, ...] = ()
    product: Text = ""
    sender: Text = "nothing: this is your own preset"
    rate: Annotated[float, msgspec.Meta(ge=1, le=1000)] = 30.0
    performer: Annotated[str, msgspec.Meta(pattern=r"\S", max_length=32)] = ""
    metres: tuple[_Length, _Length, _Length] = (1.0, 1.0, 1.0)
    turned: str = msgspec.field(name="axes", default="x y z")
    packing: str = "osc"
    clock: Literal["arrival", "sender"] = "arrival"
    seconds: _Length = 1.0
    closings: Closings = msgspec.field(name="frame", default=Closings())
    order: tuple[Text, ...] = ()
    order_from: Annotated[int, msgspec.Meta(ge=0, le=1000)] = 0
    bones: dict[str, Bone] = {}
    guessed: bool = False
    asking: Asking | None = msgspec.field(name="ask", default=None)

    def __post_init__(self) -> None:
        """Refuse values that make no sense together."""
        if self.packing not in UNPACKERS:
            raise ValueError(f"packing: expected one of {', '.join(UNPACKERS)}, got {self.packing!r}")
        words = self.turned.split()
        if sorted(word.lstrip("+-") for word in words) != ["x", "y", "z"] or any(len(word) > 2 for word in words):
            expected = 'x, y and z in some order, each with or without a minus, like "x z -y"'
            raise ValueError(f"axes: expected {expected}, got {self.turned!r}")
        self._check_joints()
        self._check_order()
        if not any(rule.means in (Means.JOINT, Means.FRAME) for rule in self.messages):
            raise ValueError("message: expected at least one that holds x, y and z, got none")
        if self.bones and not any("qx" in rule.arguments + rule.each for rule in self.messages):
            raise ValueError("message: expected one with qx, qy, qz, qw, because there are [bones], got none")

    def _check_joints(self) -> None:
        joints = {name: target.strip() for name, target in self.joint_map.items()}
        msgspec.structs.force_setattr(self, "joint_map", joints)
        for table in self.tables:
            convention_named(table)
        if self.tables and not self.closings.some:
            raise ValueError(f"tables: expected some = true in [frame] with them, got {self.tables!r}")
        if len(self.sent) < 2:
            raise ValueError(f"joints: expected at least two joints, each with the library's name, got {joints!r}")
        if len(set(map(spelling, joints))) != len(joints):
            raise ValueError(f"joints: expected names that differ in more than capitals and blanks, got {[*joints]!r}")
        before = {""}
        for name, bone in self.bones.items():
            if bone.parent not in before:
                raise ValueError(f"bones, {name}, parent: expected a bone before this one, got {bone.parent!r}")
            before.add(name)
        for name, target in joints.items():
            if self.bones and target and name not in before:
                raise ValueError(f"joints: expected names that stand in [bones], got {name!r}")

    def _check_order(self) -> None:
        known, spelt = set(map(spelling, self.joint_map)), [spelling(name) for name in self.order]
        if len(set(spelt)) != len(spelt):
            raise ValueError(f"order: expected distinct names, got {self.order!r}")
        for name in self.order:
            if spelling(name) not in known:
                raise ValueError(f"order: expected names that stand in [joints], got {name!r}")
        whole = any(rule.means is Means.FRAME and "joint" not in rule.each for rule in self.messages)
        if whole and not self.order:
            raise ValueError("order: expected the joints' order, because a message holds them without names, got none")

    @property
    def axes(self) -> tuple[tuple[int, float], ...]:
        """For each of our axes the index of the sender's axis, and its sign."""
        return tuple(("xyz".index(word[-1]), -1.0 if word[0] == "-" else 1.0) for word in self.turned.split())

    @property
    def joints(self) -> tuple[str, ...]:
        """The motion library's names of the joints that frames of this feed hold, in the frames' order."""
        return JOINTS if self.guessed else self.sent

    @property
    def sent(self) -> tuple[str, ...]:
        """The motion library's names of the joints that the sender sends, or may send."""
        any_of = hdm05.SKELETON.joints if self.closings.some else ()
        return tuple(dict.fromkeys((*any_of, *filter(None, self.joint_map.values()))))

    def named(self, names: Sequence[str]) -> dict[str, str]:
        """Give the library's names for the joints that a sender sends, in the library's order where it sends any.

        Empty where the library has no such joint; names that are not known are left out.
        """
        if not self.closings.some:
            return {name: self.joint_map[name] for name in names}
        own = {spelling(name): target for name, target in self.joint_map.items()}
        found = {name: own[spelling(name)] for name in names if spelling(name) in own}
        others = [name for name in names if name not in found]
        convention = Naming().read(others).convention
        if convention is None:
            # Of few joints no convention is found: the first table that knows most of them.
            tables = map(convention_named, self.tables)
            convention = max(tables, key=lambda each: each.known(each.spelled(others)), default=None)
        if convention:
            read = zip(others, convention.spelled(others), Naming(convention).read(others).joints, strict=True)
            known = {name: joint for name, spelled, joint in read if spelled in convention.targets}
            found |= {name: joint if joint in _OURS else "" for name, joint in known.items()}
        return dict(sorted(found.items(), key=lambda each: _OURS.get(each[1], -1)))


class Preset(PresetFile, frozen=True, kw_only=True):
    """A preset: its file, the name by which it is asked for, and the TOML it was read from."""

    name: str
    text: str


def builtin_names() -> tuple[str, ...]:
    """List the presets that come with kinespace, in alphabetical order: the files in the folder `presets`."""
    names = (path.name for path in _PRESETS.iterdir())
    return tuple(sorted(name.removesuffix(_ENDING) for name in names if name.endswith(_ENDING)))


def builtin_preset(name: str) -> Preset:
    """Load a preset that comes with kinespace.

    Raises
    ------
    PresetError
        There is none of that name.
    """
    names, file = builtin_names(), f"{name}{_ENDING}"
    if name not in names:
        raise PresetError(f"feed: expected a .toml file or one of {', '.join(names)}, got {name!r}")
    return parse_preset((_PRESETS / file).read_text(encoding="utf-8"), name, file)


def load_preset(path: Path) -> Preset:
    """Read a user's preset.

    Raises
    ------
    PresetError
        The file is no TOML, or something in it is wrong, missing or unknown.
    OSError
        The file cannot be read.
    """
    return parse_preset(text_of(path, PresetError), path.stem, str(path))


def parse_preset(text: str, name: str, file: str) -> Preset:
    """Read a preset from TOML.

    Parameters
    ----------
    text
        The TOML.
    name
        The preset's name.
    file
        The file's name in messages.

    Raises
    ------
    PresetError
        The text is no TOML, or something in it is wrong, missing or unknown.
    """
    read = read_toml(text, file, PresetFile, PresetError, _with_three_axes)
    found = msgspec.structs.asdict(read)
    found |= {"product": read.product or name, "performer": read.performer or name[:32]}
    return Preset(**found, name=name, text=text)


def _with_three_axes(table: dict[str, Any]) -> dict[str, Any]:
    """Write one number of metres for three axes out."""
    metres = table.get("metres")
    return table | {"metres": [metres] * 3} if isinstance(metres, (int, float)) else table


@lru_cache
def pattern_of(address: str) -> re.Pattern[str]:
    """Turn an address with placeholders into a regular expression; KeyError for an unknown placeholder.

    Capitals and small letters are alike.
    """
    expression = re.sub(r"\\{(\w*)\\}", lambda found: _PLACEHOLDERS[found[1]], re.escape(address))
    return re.compile(expression, re.IGNORECASE)
