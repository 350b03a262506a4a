"""The joints or markers that are wanted of a file, and their names."""

import re
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from itertools import chain
from itertools import count as counted

from kinespace.library.clip import Clip
from kinespace.library.naming import Naming

#: Joints of a recording, at most: two fingered bodies have some 150.
MAX_JOINTS = 1000
#: Words for a position behind a joint's name: behind a mark, or with a capital.
_PLACE = re.compile(
    r"(?<=[^\W_])([\W_]+|(?<=[a-z0-9])(?=[A-Z]))"
    r"(?i:posi?|positions?|translations?|translate|coord(inate)?s?|loc(ation)?|axis|3d|world|global)\Z"
)
#: Names that programs give to markers that have none.
_UNNAMED = re.compile(r"\*.*|(uname|unnamed|unlabell?ed|unidentified)(?![a-z]).*", re.IGNORECASE)
#: A marker's number in a system's list, before its name: `1 - Head`.
_NUMBER = re.compile(r"\d+[ _\-.)]+(?=[^\W\d])")
#: What stands for a person in a label, and what is left: before the last colon; before so many marks between words;
#: behind the last mark; the last digit (`Spine12` is the second person's `Spine1`); up to a number (`P1Hips`).
_MARK, _WORD = r"[ _\-./|]+", r"[^ _\-./|]*"
_COLON, _LAST, _GLUED, _AHEAD = map(
    re.compile,
    (
        r"(?P<who>.*):(?P<what>[^:]*)",
        rf"(?P<what>.*?){_MARK}(?P<who>{_WORD})",
        r"(?P<what>.*)(?P<who>\d)",
        r"(?P<who>[A-Za-z]+\d+)(?P<what>[A-Z].*)",
    ),
)
_FIRST = tuple(re.compile(rf"(?P<who>{_WORD}(?:{_MARK}{_WORD}){{{n}}}){_MARK}(?P<what>.*)") for n in range(3))
#: Characters of a joint's name, at most.
MAX_NAME = 400


def few(names: Sequence[str]) -> tuple[str, ...]:
    """Give names of joints; ValueError where there are more, or longer ones, than a recording may have."""
    if len(names) > MAX_JOINTS:
        raise ValueError(f"expected at most {MAX_JOINTS} joints, got {len(names)}: choose some")
    if max(map(len, names)) > MAX_NAME:
        raise ValueError(f"expected names of at most {MAX_NAME} characters, got {max(map(len, names))}")
    return tuple(names)


def chosen(labels: Sequence[str], wanted: Sequence[str]) -> list[int]:
    """Choose labels by name.

    Parameters
    ----------
    labels
        As they stand in the file.
    wanted
        Names or patterns with `*` and `?`. A pattern fits a whole label, or the part after the label's last colon
        (`LHip` fits `ann:LHip`). All labels when empty, but those that stand for none (`*12`, `Unlabeled 2012`) where
        others name two.

    Returns
    -------
    Indices of the labels, in the file's order.

    Raises
    ------
    ValueError
        A wanted name fits no label.
    """
    if not wanted:
        those = [index for index, label in enumerate(labels) if not _UNNAMED.fullmatch(_after_colon(label))]
        return those if len(those) > 1 else [*range(len(labels))]
    found = set[int]()
    for pattern in wanted:
        named = enumerate(zip(labels, map(_after_colon, labels), strict=True))
        fitting = {index for index, names in named if any(fnmatchcase(name, pattern) for name in names)}
        if not fitting:
            raise ValueError(f"no joint is called {pattern!r}; there are {', '.join(labels)}")
        found |= fitting
    return sorted(found)


def restricted(clip: Clip, wanted: Sequence[str]) -> Clip:
    """Restrict a clip to the joints that are wanted (as `chosen`); ValueError where it lacks one."""
    if not wanted:
        return clip
    kept = chosen(clip.skeleton.joints, wanted)
    return replace(clip, skeleton=clip.skeleton.restricted_to(kept), positions=clip.positions[:, kept])


def people_in(labels: Sequence[str]) -> dict[str, dict[int, str]]:
    """Give the places of each person's labels, and these without the person: `ann:Hips`, `p_1_Hips`, `Hips.B`, `Hips2`.

    Behind a colon a name must stand twice; beside other marks what is left must name a body for each person. All labels
    are one person's otherwise, who has no name.
    """
    if len({*Counter(labels).values()}) == 1:
        before = defaultdict[str, Iterator[int]](counted)
        labels = [f"{next(before[label])}:{label}".removeprefix("0:") for label in labels]
    for way in (_COLON, *_FIRST, _LAST, _GLUED, _AHEAD):
        people = dict[str, dict[int, str]]()
        for place, label in enumerate(labels):
            person, rest = cut.group("who", "what") if (cut := way.fullmatch(label)) else ("", label)
            people.setdefault(person.strip("()[]"), {})[place] = rest
        rests = [{*each.values()} for each in people.values()]
        twice = way is _COLON and sum(map(len, rests)) > len(set().union(*rests))
        found = {person: each for person, each in people.items() if len(each) > 1}
        # Of names that stand there again, the first have no number.
        again = way not in _FIRST and all(each == rests[0] for each in rests)
        apart = again or (all(people) and way is not _GLUED)
        named = way is not _COLON and apart and all(Naming().read([*each]).convention for each in rests)
        if len(people) > 1 and found and (twice or named):
            if {*map(str.lower, found)} == {"head", "tail"}:
                # Blender's bones begin at their joints.
                return {"": next(each for person, each in found.items() if person.lower() == "head")}
            own = {*found.get("", {}).values()}
            if all(not person or (person.isdecimal() and {*each.values()} < own) for person, each in found.items()):
                # Some joints that stand there again are no second person.
                return {"": dict(sorted(chain(*(each.items() for each in people.values()))))}
            if len(found) > 2 and not again:
                # Beside two people what has no name in front is a thing.
                found.pop("", None)
            return found
    return {"": dict(enumerate(labels))}


def short_names(labels: Sequence[str]) -> tuple[tuple[str, ...], list[str]]:
    """Leave out the part of each label before a colon (`ann:LHip`), and a word for a position behind it (`LHip_pos`).

    Numbers before all names (`1 - Head`) go, too. Of a name that stands there twice the second gets `_2`, as a remark
    says.
    """
    names = [plain(_after_colon(label)) for label in few(labels)]
    bare = [_NUMBER.sub("", name, count=1) for name in names]
    names = bare if all(map(_NUMBER.match, names)) and len({*bare}) == len({*names}) else names
    twice = list(dict.fromkeys(name for name in names if names.count(name) > 1))
    taken, found = {*names}, list[str]()
    for name in names:
        number = 2
        while (each := name if name not in found else f"{name}_{number}") in found or (each != name and each in taken):
            number += 1
        found.append(each)
    return tuple(found), [f"twice: {', '.join(twice)}: the second is called {twice[0]}_2"] if twice else []


def plain(label: str) -> str:
    """Leave out a word for a position behind a joint's name: `LHip_pos`, `LHip Position`."""
    return _PLACE.sub("", label)


def _after_colon(label: str) -> str:
    return label.rpartition(":")[2].strip() or label
