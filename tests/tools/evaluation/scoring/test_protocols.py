"""Which library recognises which take: no library contains a motion that the protocol leaves out."""

from dataclasses import replace
from typing import NoReturn

import pytest
from synthetic import STICK_CLASSES, stick_clip

from kinespace.library import NOTHING
from kinespace.library.recordings.formats.labels import Segment
from kinespace.tools.evaluation.harness import Fold, Protocol, Take, folds_of


def _take(person: str, number: int, label: str = "") -> Take:
    """Make a take of half a second of each of two classes, or of one thing throughout."""
    clip = replace(stick_clip("wave", seed=number, frames=120, actor=person), class_name="", name=f"{person}{number}")
    if label:
        return Take(clip, (Segment(0.0, clip.duration, label),))
    first, second = STICK_CLASSES[number % 3], STICK_CLASSES[(number + 1) % 3]
    return Take(clip, (Segment(0.0, 0.5, first), Segment(0.5, 1.0, second)))


@pytest.fixture
def takes() -> list[Take]:
    """Give two takes each of ann and ben, one of cid."""
    return [_take(*each) for each in (("ann", 1), ("ann", 2), ("ben", 3), ("ben", 4), ("cid", 5))]


def _unused() -> NoReturn:
    raise AssertionError


def _names(fold: Fold) -> list[str]:
    return [take.clip.name for take in fold.takes]


def _sources(fold: Fold) -> set[str]:
    """Name the takes that a fold's library was cut from."""
    return {motion.take for motion in fold.library.motions}


def test_each_take_is_recognised_by_the_others(takes: list[Take]) -> None:
    """Leaving one take out its library is cut from all others, the same person's among them."""
    folds = folds_of(takes, Protocol.LEAVE_ONE_TAKE_OUT, _unused)
    everybody = {take.clip.name for take in takes}
    assert [_names(fold) for fold in folds] == [[take.clip.name] for take in takes]
    assert [_sources(fold) for fold in folds] == [everybody - {take.clip.name} for take in takes]
    assert {fold.person for fold in folds} == {""}
    assert len(folds[0].library) == 8


@pytest.mark.parametrize("protocol", [Protocol.LEAVE_ONE_PERSON_OUT, Protocol.ONE_PERSON])
def test_no_library_has_motions_of_a_person_who_asks(takes: list[Take], protocol: Protocol) -> None:
    """Each person is recognised by all others together, or recognises all others: one library for a whole fold."""
    own = {"ann": ["ann1", "ann2"], "ben": ["ben3", "ben4"], "cid": ["cid5"]}
    folds = {fold.person: fold for fold in folds_of(takes, protocol, _unused)}
    assert list(folds) == list(own)
    for person, fold in folds.items():
        others = [name for each in own if each != person for name in own[each]]
        asking, library = (others, own[person]) if protocol is Protocol.ONE_PERSON else (own[person], others)
        assert (_names(fold), _sources(fold)) == (asking, set(library))


def test_unlabelled_takes_are_asked_of_other_persons_libraries(takes: list[Take]) -> None:
    """A take without labels is recognised by every library without motions of its person."""
    unlabelled = [_take("ann", 6, NOTHING), _take("zoe", 7, NOTHING), replace(_take("", 8), segments=())]
    everything = [*takes, *unlabelled]
    asked = {
        protocol: {
            fold.person: {*_names(fold)} & {"ann6", "zoe7", "8"} for fold in folds_of(everything, protocol, _unused)
        }
        for protocol in (Protocol.LEAVE_ONE_TAKE_OUT, Protocol.LEAVE_ONE_PERSON_OUT, Protocol.ONE_PERSON)
    }
    assert asked[Protocol.LEAVE_ONE_TAKE_OUT] == {"": {"ann6", "zoe7", "8"}}
    assert asked[Protocol.LEAVE_ONE_PERSON_OUT] == {"ann": {"ann6"}, "ben": set(), "cid": set(), "": {"zoe7", "8"}}
    strangers = {"zoe7", "8"}
    assert asked[Protocol.ONE_PERSON] == {"ann": strangers, "ben": {"ann6"} | strangers, "cid": {"ann6"} | strangers}
    for protocol in asked:
        assert all("ann6" not in _sources(fold) for fold in folds_of(everything, protocol, _unused))


@pytest.mark.parametrize(
    ("kept", "protocol", "message"),
    [
        (slice(0, 1), Protocol.LEAVE_ONE_TAKE_OUT, "leave-one-take-out: expected at least two labelled takes, got 1"),
        (slice(0, 0), Protocol.LEAVE_ONE_TAKE_OUT, "expected at least two labelled takes, got none"),
        (slice(0, 2), Protocol.ONE_PERSON, "--protocol one-person: expected at least two labelled persons, got 1"),
        (slice(4, 5), Protocol.LEAVE_ONE_PERSON_OUT, "expected at least two labelled persons, got 1"),
    ],
)
def test_a_protocol_without_motions_is_an_error(
    takes: list[Take], kept: slice, protocol: Protocol, message: str
) -> None:
    """One take, or one person, leaves no motion for a library; unlabelled takes do not help."""
    with pytest.raises(ValueError, match=message):
        folds_of([*takes[kept], _take("zoe", 7, NOTHING)], protocol, _unused)
