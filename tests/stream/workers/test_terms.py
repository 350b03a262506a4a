"""Terms: libraries are known by their content."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kinespace.stream.recognizer import Settings
from kinespace.stream.workers import terms as agreed
from kinespace.stream.workers.partition import PARTITIONS
from kinespace.stream.workers.terms import Terms, decode_terms, encode_terms, key
from kinespace.stream.workers.wire import decode_answers
from kinespace.stream.zeromq import FormatError

if TYPE_CHECKING:
    from kinespace.library.motion_library import MotionLibrary

OURS = Terms(
    agreed.own_version(), agreed.PROTOCOL, PARTITIONS, "ab12", "d" * 64, Settings(hop=0.05), (), "auto", 32, 5.0
)


def test_terms_come_back() -> None:
    """Everything in it, the settings too, is what was sent; nobody refuses their own."""
    assert decode_terms(encode_terms(OURS)) == OURS
    assert OURS.refusal(None) == OURS.refusal("d" * 64) == ""


@pytest.mark.parametrize(
    ("changes", "own", "said"),
    [
        ({"version": "99.0"}, None, "the gateway has version 99.0, this worker "),
        ({"protocol": 99}, None, f"the gateway has protocol 99, this worker {agreed.PROTOCOL}"),
        ({"partitions": 32}, None, "the gateway has partitions 32, this worker 64"),
        ({}, "e" * 64, "the gateway has library dddddddddddd, this worker eeeeeeeeeeee"),
    ],
)
def test_a_difference_is_reported_in_one_line(changes: dict[str, Any], own: str | None, said: str) -> None:
    """Another version, protocol, number of partitions or library: one line names it and both values."""
    said_so = msgspec.structs.replace(OURS, **changes).refusal(own)
    assert said_so.startswith(said)
    assert "\n" not in said_so


@given(message=st.binary(max_size=100))
def test_other_bytes_are_no_terms(message: bytes) -> None:
    """Whatever is sent instead of terms, or of an answer, is a format error."""
    for decode in (decode_terms, decode_answers):
        with pytest.raises(FormatError):
            decode(message)


def test_impossible_settings_are_no_terms() -> None:
    """Terms whose settings a recogniser would refuse are a format error."""
    with pytest.raises(FormatError, match="hop"):
        decode_terms(encode_terms(OURS).replace(b'"hop":0.05', b'"hop":-1.0'))


def test_a_library_is_known_by_its_motions(sticks: MotionLibrary) -> None:
    """The same motions give the same digest, other motions another."""
    digest = agreed.digest_of(agreed.file_of(sticks))
    assert agreed.digest_of(agreed.file_of(sticks)) == digest
    fewer = sticks.without(classes=[sticks.classes[0]])
    assert agreed.digest_of(agreed.file_of(fewer)) != digest


def test_any_name_is_part_of_a_key() -> None:
    """What means something in Zenoh's keys is written otherwise in ours."""
    assert key("g", "answer", "a/b*?#$ é", "class") == "kin/g/answer/a%2Fb%2A%3F%23%24%20%C3%A9/class"
