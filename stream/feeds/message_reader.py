"""Reading of OSC messages by a preset: one reader for all products."""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple
from urllib.parse import unquote

from kinespace.library.naming.convention import known_as, spelling
from kinespace.stream.feeds.kinematics import Quaternion, Vector
from kinespace.stream.feeds.preset import MAX_ADDRESS, Means, MessageRule, Preset, pattern_of
from kinespace.stream.osc.packet import Message, number_of
from kinespace.stream.packet import remember

#: A performer's name may have 64 characters; the number of a second sender is added to it.
MAX_PERFORMER_LENGTH = 48
#: Addresses and names that are remembered, at most; only a sender that makes them up reaches the limit.
_MAX_REMEMBERED = 4096
_MAX_UNKNOWN = 64


class MessageError(ValueError):
    """A message has one of the preset's addresses, but other arguments."""


class Sighting(NamedTuple):
    """The position of one joint, in the sender's units and axes.

    Attributes
    ----------
    joint
        The preset's name for it.
    position
        None when the sender says that it does not see the joint.
    rotation
        None when the message has none.
    """

    joint: str
    position: Vector | None
    rotation: Quaternion | None = None


class Content(NamedTuple):
    """The content of one message.

    Attributes
    ----------
    means
        The message's meaning for the frame.
    performer
        The performer; None when the message does not say.
    sightings
        Joints in it that the preset knows.
    time
        Seconds on the sender's clock; None when the message does not say.
    present
        False when the sender says that the performer is not there.
    """

    means: Means
    performer: str | None = None
    sightings: Sequence[Sighting] = ()
    time: float | None = None
    present: bool = True


class Mapper:
    """Reads messages by a preset.

    Parameters
    ----------
    preset
        The preset.

    Attributes
    ----------
    known, unknown
        The joints that were sent, by the preset's names, and some of those that it does not name.
    """

    def __init__(self, preset: Preset) -> None:
        self.preset = preset
        self.known, self.unknown = dict[str, None](), set[str]()
        self._names = {spelling(name): name for name in preset.joint_map}
        self._order = preset.order
        self._taught: dict[tuple[str | None, str], str] = {}
        self._ways = lru_cache(_MAX_REMEMBERED)(self._find_ways)
        self._resolved = lru_cache(_MAX_REMEMBERED)(self._resolve)

    def read(self, message: Message) -> Content | None:
        """Read one message; None for one that the preset does not know.

        Raises
        ------
        MessageError
            The preset knows the address, but with other arguments.
        """
        ways = [way for way in self._ways(message.address) if way.literals_fit(message.arguments)]
        best, why = None, ""
        for way in ways:
            try:
                reading = self._read(way, message.arguments)
            except (TypeError, OverflowError) as error:
                why = f": {error}"
                continue
            if reading and reading.means is not Means.FRAME:
                return reading
            # Groups of another length may fit the count, too: whole numbers, as 0 of a turn, pass for names.
            if reading and (best is None or len(reading.sightings) > len(best.sightings)):
                best = reading
        if ways and best is None:
            raise MessageError(f"{message.address}: expected other arguments, got {len(message.arguments)}{why}")
        return best

    def _find_ways(self, address: str) -> "list[_Way]":
        rules = self.preset.messages if len(address) <= MAX_ADDRESS else ()
        found = [(rule, pattern_of(rule.address).fullmatch(address)) for rule in rules]
        # A name in an address may be written as in a URL (`address_part`).
        return [_Way(rule, {key: unquote(name) for key, name in way.groupdict().items()}) for rule, way in found if way]

    def _read(self, way: "_Way", arguments: Sequence[object]) -> Content | None:
        """Read arguments; None, TypeError or OverflowError when they do not fit the roles."""
        if not way.counts_fit(arguments):
            return None
        performer = way.text("performer", arguments)
        time = self._time(way, arguments)
        means = way.means
        if means is Means.GONE or way.nobody(arguments):
            return Content(means, performer, (), time, present=False)
        sightings: list[Sighting] | None = []
        if means is Means.ORDER:
            self._order = tuple(way.joint_names(arguments))
            self._resolved.cache_clear()
        elif means is Means.NAME:
            self._learn(performer, way, arguments)
        elif means in (Means.JOINT, Means.FRAME):
            sightings = self._joints(way, arguments, performer)
        return None if sightings is None else Content(means, performer, sightings, time)

    def _learn(self, performer: str | None, way: "_Way", arguments: Sequence[object]) -> None:
        number, name = way.text("joint", arguments), way.text("name", arguments)
        if number is None or name is None:
            raise TypeError("joint and name: expected both")
        remember(self._taught, (performer, number), name, _MAX_REMEMBERED)
        self._resolved.cache_clear()

    def _time(self, way: "_Way", arguments: Sequence[object]) -> float | None:
        place = way.places.get("time")
        if place is None:
            return None
        time = number_of(arguments[place])
        high = way.places.get("time_high")
        if high is not None:
            time = float((int(number_of(arguments[high])) << 32) + (int(time) & 0xFFFFFFFF))
        # As in our own frames, 0 means "on arrival".
        return time * self.preset.seconds if time and math.isfinite(time) else None

    def _joints(self, way: "_Way", arguments: Sequence[object], performer: str | None) -> list[Sighting] | None:
        """Read all joints of a message; None when there are more joints than names."""
        starts, names = way.starts(arguments), way.joint_names(arguments) or self._order
        if len(starts) > len(names):
            return None
        taught_for = performer if self._taught else None
        named = ((start, self._resolved(name, taught_for)) for start, name in zip(starts, names, strict=False))
        return [self._sighting(way, arguments, start, joint) for start, joint in named if joint]

    def _resolve(self, name: str, performer: str | None) -> str | None:
        known = self._taught.get((performer, name)) or self._taught.get((None, name)) or name
        if known.isascii() and known.isdigit() and spelling(known) not in self._names:
            index = int(known) - self.preset.order_from
            known = self._order[index] if 0 <= index < len(self._order) else known
        found = self._names.get(spelling(known))
        if found is None and self.preset.closings.some and (spelled := known_as(known)):
            # However it is written, it is one joint: senders cannot invent many.
            found = self._names.setdefault(spelled, known)
        if found is not None:
            self.known[found] = None
        elif len(self.unknown) < _MAX_UNKNOWN and not known.isdigit():
            self.unknown.add(known)
        return found

    def _sighting(self, way: "_Way", arguments: Sequence[object], start: int, joint: str) -> Sighting:
        """Read one joint."""
        numbers = [arguments[start + place] for place in way.position]
        if None in numbers:
            return Sighting(joint, None)
        x, y, z = map(number_of, numbers)
        rotation = None
        # World positions need no rotations.
        if way.rotation and self.preset.bones:
            a, b, c, d = (number_of(arguments[start + place]) for place in way.rotation)
            rotation = (a, b, c, d)
        seen = math.isfinite(x + y + z) and (rotation is None or math.isfinite(sum(rotation)))
        if seen and way.confidence is not None:
            seen = self._confidence(arguments[start + way.confidence]) >= self.preset.closings.confidence
        return Sighting(joint, (x, y, z) if seen else None, rotation if seen else None)

    def _confidence(self, argument: object) -> float:
        if isinstance(argument, str):
            # A word that the preset does not list does not make the joint absent.
            return self.preset.closings.words.get(argument.casefold(), math.inf)
        return math.inf if argument is None else number_of(argument)


class _Way:
    """A rule, and the names in an address that fits it."""

    def __init__(self, rule: MessageRule, named: dict[str, str]) -> None:
        self.means, self._named = rule.means, named
        self.places = {role: place for place, role in enumerate(rule.arguments)}
        #: How many arguments stand before the groups, and how many a group has; a message without groups is one joint.
        self._before, self._group = len(rule.arguments), len(rule.each)
        in_group = {role: place for place, role in enumerate(rule.each)} or self.places
        self._joint = in_group.get("joint")
        self.position = [in_group.get(axis, 0) for axis in "xyz"]
        self.rotation = [in_group[axis] for axis in ("qx", "qy", "qz", "qw")] if "qx" in in_group else []
        self.confidence = in_group.get("confidence")
        self._literals = [(place, role[1:]) for place, role in enumerate(rule.arguments) if role.startswith("=")]

    def counts_fit(self, arguments: Sequence[object]) -> bool:
        """Say whether there are as many arguments as the rule needs."""
        rest = len(arguments) - self._before
        if rest < 0 or not self._group:
            return rest >= 0
        # A message of a whole frame without a performer has no further arguments.
        return rest % self._group == 0 and (rest > 0 or self.nobody(arguments))

    def literals_fit(self, arguments: Sequence[object]) -> bool:
        """Say whether the arguments have the texts that the rule demands."""
        # Nearly no rule demands any, and every message asks.
        return not self._literals or all(
            place < len(arguments) and arguments[place] == text for place, text in self._literals
        )

    def nobody(self, arguments: Sequence[object]) -> bool:
        """Say whether the message says that there is no performer."""
        place = self.places.get("present")
        return place is not None and not arguments[place]

    def starts(self, arguments: Sequence[object]) -> Sequence[int]:
        """Give the place where each group of arguments begins."""
        return range(self._before, len(arguments), self._group) if self._group else (0,)

    def text(self, role: str, arguments: Sequence[object]) -> str | None:
        """Give the name or number in a role, from the address when no argument has it."""
        place = self.places.get(role)
        found = self._named.get(role) if place is None else arguments[place]
        return None if place is None and found is None else _text(found)

    def joint_names(self, arguments: Sequence[object]) -> list[str]:
        """Give the joints' names or numbers; nothing where groups have none."""
        if self._joint is not None:
            return [_text(arguments[start + self._joint]) for start in self.starts(arguments)]
        named = self.text("joint", arguments)
        return [] if named is None else [named]


def _text(argument: object) -> str:
    # Patchers send ids as numbers as often as names, and integers as floats.
    if isinstance(argument, float) and argument.is_integer():
        argument = int(argument)
    if isinstance(argument, bool) or not isinstance(argument, (str, int)):
        raise TypeError(f"expected a name or an integer, got {type(argument).__name__}")
    text = str(argument)
    if not 0 < len(text) <= MAX_PERFORMER_LENGTH:
        raise TypeError(f"expected a name of 1 to {MAX_PERFORMER_LENGTH} characters, got {len(text)}")
    return text
