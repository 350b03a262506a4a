"""Addresses as the user types them."""

from __future__ import annotations

import re


def host_and_port(text: str) -> tuple[str, int]:
    """Read HOST:PORT, or a port alone for this machine.

    Raises
    ------
    ValueError
        There is no port, or it is not one.
    """
    host, _, port = text.rpartition(":")
    if not re.fullmatch("[0-9]{1,5}", port) or int(port) > 65535:
        raise ValueError(f"address: expected HOST:PORT, the port from 0 to 65535, got {text!r}")
    return host.strip("[]") or "127.0.0.1", int(port)
