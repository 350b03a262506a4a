"""What all evaluations share: takes and the libraries that recognise them, played through the live recogniser."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinespace.library import Clip, MotionLibrary, Skeleton, SkeletonMismatchError
from kinespace.library.motion_library import MIN_JOINTS
from kinespace.library.windows.index import WindowIndex
from kinespace.library.windows.segments import mirrored
from kinespace.stream.frame import Frame
from kinespace.stream.recognition import Recognition
from kinespace.stream.recognizer import Recognizer, Settings
from kinespace.tools.cli import arguments
from kinespace.tools.cli.arguments import joints_of
from kinespace.tools.evaluation.takes import Sources, Take, read_takes, takes_of
from kinespace.tools.terminal.console import note


class Protocol(StrEnum):
    """Which library recognises which take."""

    #: The given library recognises all takes.
    LIBRARY = "library"
    #: A take is recognised by motions cut from the other takes.
    LEAVE_ONE_TAKE_OUT = "leave-one-take-out"
    #: A take is recognised by motions cut from the other persons' takes.
    LEAVE_ONE_PERSON_OUT = "leave-one-person-out"
    #: A library is cut from one person's takes, for every person in turn, and recognises all other takes.
    ONE_PERSON = "one-person"


@dataclass(frozen=True, slots=True, eq=False)
class Fold:
    """Takes that one library recognises.

    Attributes
    ----------
    library
        One object for all takes, so that it is opened once.
    takes
        At least one.
    person
        The person who asks, where the other persons' motions make the library; the person whose motions make the
        library, where it is one person's; else empty.
    """

    library: MotionLibrary = field(repr=False)
    takes: tuple[Take, ...]
    person: str = ""


def folds_of(
    takes: Sequence[Take], protocol: Protocol, library: Callable[[], MotionLibrary], *, either_side: bool = False
) -> list[Fold]:
    """Say which library recognises which takes.

    Takes without labels are recognised by every library of the protocol that has no motions of their person; where one
    take is left out at a time, by the library of all takes.

    Parameters
    ----------
    takes
        At least one.
    protocol
        How libraries are made.
    library
        Gives the library of `Protocol.LIBRARY`; not called for other protocols.
    either_side
        Whether the libraries that are made have each motion mirrored, too.

    Raises
    ------
    ValueError
        The performers are not known, or no motion is left to make a library of.
    """
    if protocol is Protocol.LIBRARY:
        return [Fold(library(), tuple(takes))]
    made = partial(_library, either_side=either_side)
    labelled = [take for take in takes if take.is_known]
    others = [take for take in takes if not take.is_known]
    if protocol is Protocol.LEAVE_ONE_TAKE_OUT:
        _require_two(len(labelled), "takes", protocol)
        folds = [Fold(made([each for each in labelled if each is not take]), (take,)) for take in labelled]
        return [*folds, Fold(made(labelled), tuple(others))] if others else folds
    return _by_person(labelled, others, protocol, made)


def _by_person(
    labelled: Sequence[Take],
    others: Sequence[Take],
    protocol: Protocol,
    made: Callable[[Sequence[Take]], MotionLibrary],
) -> list[Fold]:
    unnamed = [take.clip.name for take in labelled if not take.person]
    if unnamed:
        raise ValueError(f"{unnamed[0]}: expected a name with the actor in it, as HDM05's have; --actor-in says where")
    persons = sorted({take.person for take in labelled})
    _require_two(len(persons), "persons", protocol)
    folds = []
    for person in persons:
        own = [take for take in labelled if take.person == person]
        rest = [take for take in labelled if take.person != person]
        if protocol is Protocol.ONE_PERSON:
            asking = [*rest, *(take for take in others if take.person != person)]
            folds.append(Fold(made(own), tuple(asking), person))
        else:
            folds.append(Fold(made(rest), (*own, *(take for take in others if take.person == person)), person))
    strangers = [take for take in others if take.person not in persons]
    if strangers and protocol is Protocol.LEAVE_ONE_PERSON_OUT:
        folds.append(Fold(made(labelled), tuple(strangers)))
    return folds


def _library(takes: Sequence[Take], *, either_side: bool) -> MotionLibrary:
    motions = [motion for take in takes for motion in take.motions()]
    return MotionLibrary.of_clips([*motions, *map(mirrored, motions)] if either_side else motions)


def _require_two(count: int, what: str, protocol: Protocol) -> None:
    if count < 2:
        raise ValueError(f"--protocol {protocol}: expected at least two labelled {what}, got {count or 'none'}")


#: Seconds before a moment that must lie in a segment for the moment to count as inside it.
INSIDE = 1.0


class Feed(NamedTuple):
    """Frames of a take: times (frames,), seconds, and positions (frames, joints, 3), metres, of a skeleton."""

    times: NDArray[np.float64]
    positions: NDArray[np.floating]
    skeleton: Skeleton

    @classmethod
    def of(cls, clip: Clip, skeleton: Skeleton, delivered: NDArray[np.int64] | None = None) -> Feed:
        """Give a clip's frames, or those that a sensor delivered, in the order of a skeleton's joints."""
        ordered, shown = clip.as_of(skeleton), slice(None) if delivered is None else delivered
        return cls(ordered.times[shown], ordered.positions[shown], skeleton)


class Asked(NamedTuple):
    """A take, the library that recognises it, and the person of the fold (`protocols.Fold`)."""

    take: Take
    library: MotionLibrary
    person: str


def add_sources(parser: argparse.ArgumentParser, usual: str) -> None:
    """Add the options for takes; `usual` says what is played when there are none."""
    text = f"labelled takes, clips named as HDM05's, or folders of them (default: {usual})"
    parser.add_argument("takes", nargs="*", type=Path, metavar="TAKE", help=text)
    parser.add_argument("--clips", action="store_true", help="a recording without labels is one motion, of its folder")
    arguments.add_labels(parser, "for each TAKE, in order (default: next to the take, called like it)")
    arguments.add_reading(parser)
    arguments.add_shared(parser, "--actor-in")
    arguments.add_subjects(parser)
    text = "rename labels"
    parser.add_argument("--map", **arguments.several(arguments.mapping, "LABEL=CLASS"), help=text)
    parser.add_argument("--skeleton", metavar="NAME", help="with the joints of this product alone, like kinectv2")


def add_protocol(parser: argparse.ArgumentParser) -> None:
    """Add the options for tables of takes, and for the library and the recogniser that are asked."""
    arguments.add_takes(parser)
    arguments.add_shared(parser, "--library", "--either-side")
    text = (
        "recognise with the library; with motions cut from the other takes, or from the other persons' takes; or with "
        "motions of one person, for each person in turn"
    )
    text += f" (default: {Protocol.LIBRARY}; {Protocol.LEAVE_ONE_PERSON_OUT} for the library's own motions)"
    parser.add_argument("--protocol", choices=[*map(str, Protocol)], help=text)
    arguments.add_settings(parser)


def sources_of(options: argparse.Namespace) -> Sources:
    """Make the sources of takes from the arguments."""
    return Sources(
        options.takes,
        options.labels,
        clips=options.clips,
        unknown=getattr(options, "unknown", ()),
        tables=getattr(options, "tables", ()),
        names=dict(options.map),
        persons=options.subjects,
        without_persons=options.without_subjects,
        skeleton=options.skeleton,
    )


def takes_at(sources: Sources, options: argparse.Namespace, library: MotionLibrary) -> list[Take]:
    """Read the takes; without any give the motions of a library."""
    if sources:
        return read_takes(sources, arguments.reading_of(options))
    return [take for take in takes_of(library.motions) if sources.wants(take.person)]


def protocol_of(options: argparse.Namespace) -> Protocol:
    """Give the protocol: a library cannot be asked about its own motions."""
    given = sources_of(options)
    return Protocol(options.protocol or (Protocol.LIBRARY if given else Protocol.LEAVE_ONE_PERSON_OUT))


def asked_of(options: argparse.Namespace) -> tuple[list[Asked], tuple[str, ...]]:
    """Say which library recognises which take, over the joints that all have.

    Returns
    -------
    The takes with their libraries, takes of one library together; and all classes of the libraries.

    Raises
    ------
    ValueError
        There are no takes, or the protocol or `--map` does not fit them.
    """
    sources, protocol = sources_of(options), protocol_of(options)
    if not sources and protocol is Protocol.LIBRARY:
        raise ValueError("TAKE, --takes, --unknown: expected takes with --protocol library, got none")
    given = None
    if protocol is Protocol.LIBRARY or not sources:
        given = arguments.library_at(options.library)
        given = given.restricted_to(joints_of(options.skeleton)) if options.skeleton else given
    takes = takes_at(sources, options, given or MotionLibrary.builtin())
    of_library = [given.skeleton] if given else []
    joints = shared_joints([*(take.clip.skeleton for take in takes), *of_library])
    takes = [replace(take, clip=take.clip.restricted_to(joints)) for take in takes]

    def library() -> MotionLibrary:
        return (given or MotionLibrary.builtin()).restricted_to(joints)

    folds = folds_of(takes, protocol, library, either_side=options.either_side)
    classes = tuple(sorted({name for fold in folds for name in fold.library.classes}))
    _require_classes(takes, sources, classes)
    return [Asked(take, fold.library, fold.person) for fold in folds for take in fold.takes], classes


def shared_joints(skeletons: Sequence[Skeleton]) -> tuple[str, ...]:
    """Give the joints that all takes and the library have; say which joints are lost.

    Raises
    ------
    SkeletonMismatchError
        Too few are left.
    """
    bodies = dict.fromkeys(skeleton.joints for skeleton in skeletons)
    every = tuple(dict.fromkeys(name for joints in bodies for name in joints))
    shared = tuple(name for name in every if all(name in joints for joints in bodies))
    if len(shared) < MIN_JOINTS:
        raise SkeletonMismatchError(f"joints: expected at least {MIN_JOINTS} that all have, got {len(shared)}")
    if len(shared) < len(every):
        lost = ", ".join(name for name in every if name not in shared)
        note(f"{len(shared)} joints that all takes and the library have; without {lost}")
    return shared


def _require_classes(takes: Sequence[Take], sources: Sources, classes: Sequence[str]) -> None:
    """Refuse names that are no class: the figures would not show that no motion is known."""
    for class_name in sources.names.values():
        if class_name not in classes:
            raise ValueError(f"--map: expected one of {', '.join(classes)}, got {class_name!r}")
    labels = {label for take in takes for label in take.labels}
    if labels and not labels & set(classes):
        raise ValueError(
            f"expected a label that is a class of the library, got {', '.join(sorted(labels))}; --map LABEL=CLASS "
            f"renames them, to one of {', '.join(classes)}"
        )


def pushed(recognizer: Recognizer, feed: Feed) -> Iterator[tuple[float, Recognition | None]]:
    """Push frames into a recogniser; give the time of each, and its answer if one is due."""
    for time, positions in zip(feed.times.tolist(), feed.positions, strict=True):
        yield time, recognizer.push(Frame("take", time, positions))


def answers_to(feed: Feed, compared: MotionLibrary | WindowIndex, settings: Settings) -> list[Recognition]:
    """Push frames into a recogniser of their own; give its answers."""
    return [answer for _, answer in pushed(Recognizer(compared, settings), feed) if answer is not None]


def print_json(value: object) -> None:
    """Print one JSON value."""
    print(json.dumps(value))


def written(value: float | None, form: str = "{:.1%}") -> str:
    """Write a figure; a dash where there is none."""
    return "-" if value is None else form.format(value)
