"""The charter: what must be agreed on is compared, and libraries are known by their content."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kinespace.stream.cluster import charter as chartered
from kinespace.stream.cluster.charter import Charter, decode_charter, encode_charter, key
from kinespace.stream.recognizer import Settings
from kinespace.stream.workers.partition import PARTITIONS
from kinespace.stream.zeromq import FormatError

if TYPE_CHECKING:
    from kinespace.library.motion_library import MotionLibrary

CHARTER = Charter(
    chartered.own_version(), chartered.PROTOCOL, PARTITIONS, "ab12", "d" * 64, Settings(hop=0.05), (), "auto", 32, 5.0
)


def test_a_charter_comes_back() -> None:
    """Everything in it, the settings too, is what was sent; nobody refuses their own."""
    assert decode_charter(encode_charter(CHARTER)) == CHARTER
    assert CHARTER.refusal(None) == CHARTER.refusal("d" * 64) == ""


@pytest.mark.parametrize(
    ("changes", "own", "said"),
    [
        ({"version": "99.0"}, None, "the gateway has version 99.0, this worker "),
        ({"protocol": 99}, None, f"the gateway has protocol 99, this worker {chartered.PROTOCOL}"),
        ({"partitions": 32}, None, "the gateway has partitions 32, this worker 64"),
        ({}, "e" * 64, "the gateway has library dddddddddddd, this worker eeeeeeeeeeee"),
    ],
)
def test_a_difference_is_reported_in_one_line(changes: dict[str, Any], own: str | None, said: str) -> None:
    """Another version, protocol, number of partitions or library: one line names it and both values."""
    told = msgspec.structs.replace(CHARTER, **changes).refusal(own)
    assert told.startswith(said)
    assert "\n" not in told


@given(message=st.binary(max_size=100))
def test_other_bytes_are_no_charter(message: bytes) -> None:
    """Whatever is sent instead of a charter, or of an answer, is a format error."""
    for decode in (decode_charter, chartered.decode_back):
        with pytest.raises(FormatError):
            decode(message)


def test_impossible_settings_are_no_charter() -> None:
    """A charter whose settings a recogniser would refuse is a format error."""
    with pytest.raises(FormatError, match="hop"):
        decode_charter(encode_charter(CHARTER).replace(b'"hop":0.05', b'"hop":-1.0'))


def test_a_library_is_known_by_its_motions(sticks: MotionLibrary) -> None:
    """The same motions give the same digest, other motions another."""
    digest = chartered.digest_of(chartered.file_of(sticks))
    assert chartered.digest_of(chartered.file_of(sticks)) == digest
    fewer = sticks.without(classes=[sticks.classes[0]])
    assert chartered.digest_of(chartered.file_of(fewer)) != digest


def test_any_name_is_part_of_a_key() -> None:
    """What means something in Zenoh's keys is written otherwise in ours."""
    assert key("g", "answer", "a/b*?#$ é", "class") == "kin/g/answer/a%2Fb%2A%3F%23%24%20%C3%A9/class"
