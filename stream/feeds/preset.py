"""Presets: the meaning of a product's messages, read from TOML that a user can copy and edit, checked once.

A preset lists messages: an address in which `{joint}` and `{performer}` stand for names, `{skip}` for any one part and
`{any}` for anything, and the role of each argument. `native.toml` and its neighbours are examples.
"""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass, field
from enum import StrEnum
from importlib import resources
from typing import TYPE_CHECKING

from kinespace.library.naming import spelling
from kinespace.stream.feeds.checked_table import CheckedTable, PresetError
from kinespace.stream.feeds.kinematics import Bone
from kinespace.stream.feeds.unpackers import UNPACKERS

if TYPE_CHECKING:
    from collections.abc import Mapping
    from importlib.resources.abc import Traversable
    from pathlib import Path

__all__ = ["Preset", "PresetError", "builtin_names", "builtin_preset", "load_preset"]

_ENDING = ".toml"
#: Ten times the longest preset; a longer text might take very long to parse.
_MAX_CHARACTERS = 32_000
_POSITION = ("x", "y", "z")
_ROTATION = ("qx", "qy", "qz", "qw")
#: The roles of an argument; a role that begins with = is a text that must be there.
ROLES = (
    "joint",
    "performer",
    *_POSITION,
    *_ROTATION,
    "confidence",
    "time",
    "time_high",
    "name",
    "present",
    "skip",
)
_PLACEHOLDERS = {"joint": "[^/]+", "performer": "[^/]+", "skip": "[^/]+", "any": ".+"}


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


@dataclass(frozen=True, slots=True)
class MessageRule:
    """The meaning of one kind of message.

    Attributes
    ----------
    address
        As written, with placeholders.
    pattern
        The same as a regular expression, capitals and small letters alike.
    arguments
        Role of each argument; further arguments are ignored, unless `each` gives their roles.
    each
        Roles of a group of arguments that follows once or several times.
    means
        The message's meaning for the frame.
    """

    address: str
    pattern: re.Pattern[str] = field(repr=False)
    arguments: tuple[str, ...] = ()
    each: tuple[str, ...] = ()
    means: Means = Means.JOINT


@dataclass(frozen=True, slots=True)
class Closings:
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
    """

    by: frozenset[Closing]
    timeout: float = 0.1
    hold: float = 0.2
    confidence: float = 0.0
    words: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Asking:
    """Messages that a sender must get before it sends, and while it sends.

    Attributes
    ----------
    port
        The port on which the sender listens.
    every
        Seconds after which the messages are sent again.
    while_silent
        Whether they are sent only while no frames come.
    messages, farewell
        Address and arguments, in which `{port}` is our port and `{joint}` each of the preset's joints in turn; the
        farewell is sent when we stop.
    """

    port: int
    every: float
    while_silent: bool
    messages: tuple[tuple[str, tuple[str | int | float, ...]], ...]
    farewell: tuple[tuple[str, tuple[str | int | float, ...]], ...] = ()


@dataclass(frozen=True, slots=True)
class Preset:
    """The meaning of a product's messages.

    Attributes
    ----------
    name
        The name by which it is asked for.
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
    axes
        For our x (right of the picture), y (up) and z (towards us) the sender's axis and its sign.
    packing
        The packing of its messages (`stream.feeds.unpackers`).
    sender_clock
        Whether a frame's time is the sender's, when it sends one; else the arrival's.
    seconds
        Seconds of one unit of the sender's time.
    closings
        When a frame is complete.
    messages
        Tried in order; the first that fits a message's address and arguments is used.
    joint_map
        The sender's joint names with the motion library's names; an empty one for a joint that the library lacks.
    order, order_from
        Joint names in the order of their numbers, and the first number; also their order in messages without names.
    bones
        For positions relative to a parent: the parents, and offsets for bones without a position.
    asking
        The messages for the sender, or None.
    text
        The TOML it was read from.
    """

    name: str
    product: str
    sender: str
    port: int
    rate: float
    performer: str
    metres: tuple[float, ...]
    axes: tuple[tuple[int, float], ...]
    packing: str
    sender_clock: bool
    seconds: float
    closings: Closings
    messages: tuple[MessageRule, ...] = field(repr=False)
    joint_map: Mapping[str, str] = field(repr=False)
    order: tuple[str, ...] = field(repr=False)
    order_from: int = 0
    bones: tuple[Bone, ...] = field(default=(), repr=False)
    asking: Asking | None = field(default=None, repr=False)
    text: str = field(default="", repr=False, compare=False)

    @property
    def joints(self) -> tuple[str, ...]:
        """The motion library's names of the joints that frames of this feed hold, in the frames' order."""
        return tuple(dict.fromkeys(target for target in self.joint_map.values() if target))


def _presets() -> Traversable:
    return resources.files("kinespace.stream.feeds") / "presets"


def builtin_names() -> tuple[str, ...]:
    """List the presets that come with kinespace, in alphabetical order: the files in the folder `presets`."""
    names = (path.name for path in _presets().iterdir())
    return tuple(sorted(name.removesuffix(_ENDING) for name in names if name.endswith(_ENDING)))


def builtin_text(name: str) -> str:
    """Give the TOML of a preset that comes with kinespace.

    Raises
    ------
    PresetError
        There is none of that name.
    """
    names = builtin_names()
    if name not in names:
        raise PresetError(f"feed: expected a .toml file or one of {', '.join(names)}, got {name!r}")
    return (_presets() / f"{name}{_ENDING}").read_text(encoding="utf-8")


def builtin_preset(name: str) -> Preset:
    """Load a preset that comes with kinespace.

    Raises
    ------
    PresetError
        There is none of that name.
    """
    return parse_preset(builtin_text(name), name, f"{name}{_ENDING}")


def load_preset(path: Path) -> Preset:
    """Read a user's preset.

    Raises
    ------
    PresetError
        The file is no TOML, or something in it is wrong, missing or unknown.
    OSError
        The file cannot be read.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise PresetError(f"{path}: expected UTF-8 text, got byte {error.start} that is none") from error
    return parse_preset(text, path.stem, str(path))


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
    if len(text) > _MAX_CHARACTERS:
        raise PresetError(f"{file}: expected at most {_MAX_CHARACTERS} characters, got {len(text)}")
    try:
        table = CheckedTable(file, "", tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        raise PresetError(f"{file}: expected TOML, got a mistake: {error}") from error
    except RecursionError as error:
        raise PresetError(f"{file}: expected TOML, got tables or lists nested too deep") from error
    order = table.texts("order")
    if len(set(map(spelling, order))) != len(order):
        raise table.fail("order", "distinct names")
    preset = Preset(
        name=name,
        product=table.text("product", name),
        sender=table.text("sender", "nothing: this is your own preset"),
        port=table.integer("port", None, 1, 65535),
        rate=table.number("rate", 30.0, 1.0, 1000.0),
        performer=_performer(table, name),
        metres=_metres(table),
        axes=_axes(table),
        packing=table.choice("packing", list(UNPACKERS), "osc"),
        sender_clock=table.choice("clock", ("arrival", "sender"), "arrival") == "sender",
        seconds=table.number("seconds", 1.0, 1e-9),
        closings=_closings(table.table("frame")),
        messages=_messages(table),
        joint_map=_joint_map(table),
        order=order,
        order_from=table.integer("order_from", 0, 0, 1000),
        bones=_bones(table),
        asking=_asking(table.table("ask")) if "ask" in table else None,
        text=text,
    )
    table.table("ask")
    table.finish()
    _check_names(table, preset)
    return preset


def _performer(table: CheckedTable, name: str) -> str:
    performer = table.text("performer", name[:32])
    if len(performer) > 32:
        raise table.fail("performer", "at most 32 characters")
    return performer


def _metres(table: CheckedTable) -> tuple[float, ...]:
    metres = table.numbers("metres", 3, (1.0, 1.0, 1.0))
    if not all(each > 0 for each in metres):
        raise table.fail("metres", "numbers above 0")
    return metres


def _axes(table: CheckedTable) -> tuple[tuple[int, float], ...]:
    words = table.text("axes", "x y z").split()
    if sorted(word.lstrip("+-") for word in words) != ["x", "y", "z"] or any(len(word) > 2 for word in words):
        raise table.fail("axes", 'x, y and z in some order, each with or without a minus, like "x z -y"')
    return tuple(("xyz".index(word[-1]), -1.0 if word[0] == "-" else 1.0) for word in words)


def _closings(table: CheckedTable) -> Closings:
    by = table.texts("close") or (Closing.REPEAT, Closing.TIMEOUT)
    if unknown := [each for each in by if each not in list(Closing)]:
        raise table.fail("close", f"some of {', '.join(Closing)} and not {unknown[0]}")
    words = {word.casefold(): float(str(value)) for word, value in table.pairs("words", float).items()}
    closings = Closings(
        by=frozenset(map(Closing, by)),
        timeout=table.number("timeout", 0.1, 0.001, 10.0),
        hold=table.number("hold", 0.2, 0.0, 10.0),
        confidence=table.number("confidence", 0.0, 0.0),
        words=words,
    )
    table.finish()
    return closings


def _messages(table: CheckedTable) -> tuple[MessageRule, ...]:
    rules = tuple(map(_message, table.tables("message")))
    if not any(rule.means in (Means.JOINT, Means.FRAME) for rule in rules):
        raise table.fail("message", "at least one that holds x, y and z")
    return rules


def _message(table: CheckedTable) -> MessageRule:
    address = table.text("address")
    if not address.startswith("/"):
        raise table.fail("address", "an address that begins with /")
    try:
        pattern = re.compile(_regular(address), re.IGNORECASE)
    except KeyError as error:
        raise table.fail("address", f"only {{{'}, {'.join(_PLACEHOLDERS)}}} in braces") from error
    except re.error as error:
        raise table.fail("address", f"each of {{joint}} and {{performer}} once ({error})") from error
    arguments, each = table.texts("arguments"), table.texts("each")
    for key, roles in (("arguments", arguments), ("each", each)):
        for role in roles:
            if role not in ROLES and not role.startswith("="):
                raise table.fail(key, f"roles out of {', '.join(ROLES)} or =text, and not {role!r}")
        named = [role for role in roles if role != "skip" and not role.startswith("=")]
        if len(set(named)) != len(named):
            raise table.fail(key, "each role but skip once")
    means = Means(table.choice("means", list(Means), _meant(address, arguments, each)))
    rule = MessageRule(address, pattern, arguments, each, means)
    _check_roles(table, rule)
    table.finish()
    return rule


def _meant(address: str, arguments: tuple[str, ...], each: tuple[str, ...]) -> Means:
    if each:
        return Means.FRAME if set(_POSITION) <= set(each) else Means.ORDER
    if "name" in arguments:
        return Means.NAME
    if "joint" in arguments or "{joint}" in address:
        return Means.JOINT
    return Means.TIME


def _check_roles(table: CheckedTable, rule: MessageRule) -> None:
    here = {*rule.arguments, *rule.each, *re.findall(r"\{(\w+)\}", rule.address)}
    need = {
        Means.JOINT: {"joint", *_POSITION},
        Means.FRAME: set(_POSITION),
        Means.NAME: {"joint", "name"},
        Means.ORDER: {"joint"},
    }.get(rule.means, set())
    if lacking := need - here:
        raise table.fail("arguments", f"{', '.join(sorted(need))} in a {rule.means} message, {min(lacking)} too")
    if here & set(_ROTATION) and not set(_ROTATION) <= here:
        raise table.fail("arguments", "all of qx, qy, qz, qw or none")


def _regular(address: str) -> str:
    """Turn an address with placeholders into a regular expression; KeyError for an unknown placeholder."""
    parts = re.split(r"\{(\w*)\}", address)
    expression = ""
    for index, part in enumerate(parts):
        if index % 2 == 0:
            expression += re.escape(part)
        elif part in ("joint", "performer"):
            expression += f"(?P<{part}>{_PLACEHOLDERS[part]})"
        else:
            expression += f"(?:{_PLACEHOLDERS[part]})"
    return expression


def _joint_map(table: CheckedTable) -> dict[str, str]:
    names = {name: str(target).strip() for name, target in table.pairs("joints", str).items()}
    if len({target for target in names.values() if target}) < 2:
        raise table.fail("joints", "at least two joints, each with the motion library's name for it")
    spelt = [spelling(name) for name in names]
    if len(set(spelt)) != len(spelt):
        raise table.fail("joints", "names that differ in more than capitals, blanks and underscores")
    return names


def _bones(table: CheckedTable) -> tuple[Bone, ...]:
    bones = list[Bone]()
    for name in table.pairs("bones", dict):
        bone = table.table("bones").table(name)
        parent = bone.text("parent", "-")
        known = {each.name for each in bones}
        if parent != "-" and parent not in known:
            raise bone.fail("parent", "a bone that stands before this one")
        bones.append(Bone(name, "" if parent == "-" else parent, _offset(bone)))
        bone.finish()
    return tuple(bones)


def _offset(bone: CheckedTable) -> tuple[float, float, float]:
    x, y, z = bone.numbers("offset", 3, (0.0, 0.0, 0.0))
    return x, y, z


def _asking(table: CheckedTable) -> Asking:
    asking = Asking(
        port=table.integer("port", None, 1, 65535),
        every=table.number("every", 2.0, 0.1, 3600.0),
        while_silent=table.flag("while_silent", default=False),
        messages=tuple(map(_asked, table.tables("message"))),
        farewell=tuple(map(_asked, table.tables("farewell"))),
    )
    if not asking.messages:
        raise table.fail("message", "at least one [[ask.message]]")
    table.finish()
    return asking


def _asked(table: CheckedTable) -> tuple[str, tuple[str | int | float, ...]]:
    address = table.text("address")
    if not address.startswith("/"):
        raise table.fail("address", "an address that begins with /")
    arguments = table.scalars("arguments")
    table.finish()
    return address, arguments


def _check_names(table: CheckedTable, preset: Preset) -> None:
    known = set(map(spelling, preset.joint_map))
    for name in preset.order:
        if spelling(name) not in known:
            raise table.fail("order", f"names that stand in [joints], and not {name!r}")
    bones = {bone.name for bone in preset.bones}
    for name, target in preset.joint_map.items():
        if bones and target and name not in bones:
            raise table.fail("joints", f"names that stand in [bones], and not {name!r}")
    if preset.bones and not any("qx" in rule.arguments + rule.each for rule in preset.messages):
        raise table.fail("message", "one with qx, qy, qz, qw, because there are [bones]")
    whole = any(rule.means is Means.FRAME and "joint" not in rule.each for rule in preset.messages)
    if whole and not preset.order:
        raise table.fail("order", "the joints' order, because a message holds them without their names")
