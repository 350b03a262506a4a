"""Addresses as a person types them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kinespace.tools.cli.values import host_and_port


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("127.0.0.1:9310", ("127.0.0.1", 9310)),
        ("0.0.0.0:0", ("0.0.0.0", 0)),  # noqa: S104 - only parsed
        ("stage.local:65535", ("stage.local", 65535)),
        ("9310", ("127.0.0.1", 9310)),
        (":9310", ("127.0.0.1", 9310)),
        ("[::1]:9310", ("::1", 9310)),
        ("::1:9310", ("::1", 9310)),
    ],
)
def test_an_address_is_a_host_and_a_port(text: str, expected: tuple[str, int]) -> None:
    """The text after the last colon is the port; without a host it is this machine's port."""
    assert host_and_port(text) == expected


@given(st.text(max_size=20))
def test_any_text_is_an_address_or_refused(text: str) -> None:
    """Any text gives a host and a usable port, or the one error."""
    try:
        host, port = host_and_port(text)
    except ValueError as error:
        assert str(error).startswith("address: ")  # noqa: PT017 - most texts are no address, some are
    else:
        assert host
        assert 0 <= port <= 65535
