"""The protocols: which library recognises which take."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from functools import partial

from kinespace.library import MotionLibrary
from kinespace.library.windows.segments import mirrored
from kinespace.tools.evaluation.takes import Take


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
