"""Values as people type them: names, the names that a mistyped one may mean, and addresses."""

import errno
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches

#: Names that are proposed at most.
_MOST = 3


def meant(name: str, known: Iterable[str]) -> str:
    """Propose known names that begin with a mistyped name or look like it: `, perhaps A or B is meant`; else empty."""
    spelled = {each.casefold(): each for each in known}
    typed = name.casefold()
    begun = [each for each in spelled if typed and each.startswith(typed)]
    near = (begun or get_close_matches(typed, spelled))[:_MOST]
    return f", perhaps {' or '.join(spelled[each] for each in near)} is meant" if near else ""


def one_of(option: str, name: str, known: Iterable[str], or_else: str = "") -> str:
    """Give a name that is known.

    Parameters
    ----------
    option
        As typed, like `--out`.
    name, known
        The name, and the names that are known.
    or_else
        Names the other values of the option, like ` or a .toml file`.

    Raises
    ------
    ValueError
        The name is not known; the message proposes near ones.
    """
    known = tuple(known)
    if name not in known:
        raise ValueError(f"{option}: expected one of {', '.join(known)}{or_else}, got {name!r}{meant(name, known)}")
    return name


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


@contextmanager
def opening(option: str) -> Iterator[None]:
    """Add to the error of an address that cannot be opened: its option, the reason, and a remedy.

    Parameters
    ----------
    option
        The option, like `--osc-in`. The errors inside name the address: `HOST:PORT: the system's reason`.

    Raises
    ------
    OSError
        Anything inside raised it.
    ValueError
        As above; for text that is no address the message begins with the option.
    """
    try:
        yield
    except ValueError as error:
        raise ValueError(re.sub("^(address|endpoint): ", f"{option}: ", str(error))) from error
    except OSError as error:
        place = re.split(r": |$", error.strerror or str(error), maxsplit=1)[0]
        if advice := _advice(error.errno, place):
            raise OSError(f"{option} {place}: {advice}") from error
        raise


def _advice(number: int | None, place: str) -> str:
    """Say in words why an address cannot be opened; empty for other errors."""
    host, port = re.sub("^.*://", "", place).rpartition(":")[::2]
    if number == errno.EADDRINUSE:
        return (
            "another program has this port, perhaps another kinespace live or listen (`ss -lntup`, on Windows "
            "`netstat -ano`, lists who has which): end it, or give another port"
        )
    if number in (errno.EADDRNOTAVAIL, errno.ENODEV):
        return f"this machine does not have the address {host}; 0.0.0.0:{port} listens on all that it has"
    if number == errno.EACCES:
        return "the system does not allow this port; every user may open ports from 1024 on"
    return ""


def printable(name: str, kept: str = "") -> str:
    """Give a name from a file or the net without control characters, apart from `kept`."""
    return "".join(each if each.isprintable() or each in kept else "\N{REPLACEMENT CHARACTER}" for each in name)
