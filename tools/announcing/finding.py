"""Programs that take OSC, found by the names that they announce by mDNS (`_osc._udp`)."""

from __future__ import annotations

import ipaddress
import re
import time
from collections import deque
from contextlib import closing, suppress
from importlib.util import find_spec
from queue import Empty, SimpleQueue
from typing import NamedTuple

from kinespace.stream.osc import OscReceiver, is_ours
from kinespace.tools.cli.address import host_and_port
from kinespace.tools.terminal.console import note

OSC_SERVICE = "_osc._udp.local."
#: Seconds within which programs answer: the whole search takes no longer, however many there are.
WITHIN = 1.5
#: Seconds for which one program is waited for before the next is asked; its late answer counts in its next turn.
_TURN = 0.2
#: Bytes of a name, at most: DNS-SD allows no longer one.
_MAX_NAME = 63


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


def is_name(text: str) -> bool:
    """Say whether a program may announce itself by a text: HOST:PORT with a wrong port is none, nor is a number."""
    if not (text.isprintable() and 0 < len(text.encode(errors="replace")) <= _MAX_NAME):
        return False
    if "://" in text or text.isdecimal() or re.search(r":[^:\s]*$", text):
        return False
    with suppress(ValueError):
        ipaddress.ip_address(text)
        return False
    return True


def announced(wanted: str = "") -> list[Found]:
    """List the programs that announce themselves within `WITHIN`, sorted; none where mDNS is not possible.

    Parameters
    ----------
    wanted
        The name of a program, in any case: as soon as it is found the search ends.
    """
    if not is_possible():
        return []
    from zeroconf import Error, InterfaceChoice, ServiceBrowser, ServiceInfo, Zeroconf  # noqa: PLC0415 - an extra

    found, names, until = dict[str, Found](), SimpleQueue[str](), time.monotonic() + WITHIN
    asked = deque[str]()

    # It asks nothing itself: its thread may still be at work when the network is closed.
    def meet(*, name: str, **_: object) -> None:
        # Anybody may announce anything: what cannot be a name is never shown, nor asked for.
        if is_name(_title(name)):
            names.put(name)

    # A machine without a network has nobody to find.
    with suppress(OSError, Error), closing(Zeroconf(InterfaceChoice.All)) as network:
        ServiceBrowser(network, OSC_SERVICE, handlers=[meet])
        while wanted.casefold() not in map(str.casefold, found) and (left := until - time.monotonic()) > 0:
            with suppress(Empty):
                asked.append(names.get(timeout=0.0 if asked else left))
            asked.extend(names.get_nowait() for _ in range(names.qsize()))
            if not asked:
                continue
            # The one that is wanted has every turn from when it is heard of.
            name = next((each for each in asked if _title(each).casefold() == wanted.casefold()), asked[0])
            asked.remove(name)
            told = False
            with suppress(Error):
                info = ServiceInfo(OSC_SERVICE, name)
                # What came with the announcement need not be asked for.
                told = info.load_from_cache(network) or info.request(network, 1000 * min(left, _TURN))
            if not told:
                asked.append(name)
            elif info.port and (addresses := info.parsed_addresses()):
                found[_title(name)] = Found(_title(name), addresses[0], info.port)
    return sorted(found.values())


def _title(name: str) -> str:
    """Give a service's name without the kind of service."""
    return name.removesuffix(f".{OSC_SERVICE}")


def named(name: str, mistake: ValueError) -> Found:
    """Find the program that announces itself by a name; what cannot be a name is not looked for.

    Raises
    ------
    ValueError
        None does: the mistake, with the programs that announce themselves.
    """
    seen = announced(name) if is_name(name) else []
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
