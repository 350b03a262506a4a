"""Names as the user types them, and the names that a mistyped one may mean."""

from __future__ import annotations

from collections.abc import Iterable
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
