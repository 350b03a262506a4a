"""Programs that take OSC, found by the names that they announce by mDNS (`_osc._udp`)."""

from __future__ import annotations

import time
from contextlib import closing, suppress
from importlib.util import find_spec
from queue import Empty, SimpleQueue
from typing import NamedTuple

from kinespace.stream.osc import OscReceiver, is_ours
from kinespace.tools.cli.address import host_and_port
from kinespace.tools.terminal.console import note

OSC_SERVICE = "_osc._udp.local."
#: Seconds within which programs answer.
WITHIN = 1.5


class Found(NamedTuple):
    """A program's name, and where it takes OSC."""

    name: str
    host: str
    port: int

    @property
    def address(self) -> str:
        """HOST:PORT."""
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"

    def __str__(self) -> str:
        return f"{self.name} ({self.address})"


def is_possible() -> bool:
    """Say whether the package for mDNS is installed."""
    return find_spec("zeroconf") is not None


def announced(wanted: str = "", within: float = WITHIN) -> list[Found]:
    """List the programs that announce themselves, sorted; none where mDNS is not possible.

    Parameters
    ----------
    wanted
        The name of a program, in any case: as soon as it is found the search ends.
    within
        Seconds.
    """
    if not is_possible():
        return []
    from zeroconf import InterfaceChoice, ServiceBrowser, Zeroconf  # noqa: PLC0415 - an extra

    found, names, until = dict[str, Found](), SimpleQueue[str](), time.monotonic() + within

    # It asks nothing itself: its thread may still be at work when the network is closed.
    def meet(*, name: str, **_: object) -> None:
        names.put(name)

    # A machine without a network has nobody to find.
    with suppress(OSError, Empty), closing(Zeroconf(InterfaceChoice.All)) as network:
        ServiceBrowser(network, OSC_SERVICE, handlers=[meet])
        while wanted.casefold() not in map(str.casefold, found):
            name = names.get(timeout=max(until - time.monotonic(), 0.0))
            info = network.get_service_info(OSC_SERVICE, name, timeout=round(1000 * within))
            title = name.removesuffix(f".{OSC_SERVICE}")
            if info and info.port and (addresses := info.parsed_addresses()):
                found[title] = Found(title, addresses[0], info.port)
    return sorted(found.values())


def named(name: str, mistake: ValueError) -> Found:
    """Find the program that announces itself by a name.

    Raises
    ------
    ValueError
        None does: the mistake, with the programs that announce themselves.
    """
    seen = announced(name)
    for each in seen:
        if each.name.casefold() == name.casefold():
            return each
    others = f"; announced now: {', '.join(map(str, seen))}" if seen else ""
    raise ValueError(f"{mistake}{others}") from mistake


def recogniser(usual: str) -> str:
    """Give the address of the `kinespace live` that is meant where nobody says which: the usual one, or one found.

    Where a program has the usual port, nobody is looked for. This machine's recognisers come before others.

    Raises
    ------
    ValueError
        There are several.
    """
    try:
        OscReceiver(*host_and_port(usual)).close()
    except OSError:
        return usual
    found = [each for each in announced() if each.name.startswith("kinespace ")]
    found = [each for each in found if is_ours(each.host)] or found
    if len(found) > 1:
        raise ValueError(f"--osc: expected one of {', '.join(map(str, found))}, got none")
    for each in found:
        note(f"sending to {each}")
        return each.address
    return usual
