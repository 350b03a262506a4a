"""Packets of which no frame comes: the feed they look like, by the same survey as `kinespace listen`."""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence

from kinespace.library.recordings.formats.table_header import coordinate_of
from kinespace.stream.feeds import Preset, builtin_names, builtin_preset
from kinespace.stream.inputs.detection import NATIVE, OURS, Survey
from kinespace.stream.packet import Packet, Sender
from kinespace.tools.programs.listen import advice, command

#: Packets that are looked at.
_MOST = 60
#: Seconds over which packets come before they are looked at, at least.
_LEAST = 1.0
#: Seconds after which packets that still come are looked at again.
_AGAIN = 10.0
#: Addresses that are named, at most.
_MAX_NAMED = 3


class Unread:
    """Says what the packets of one port look like while no frame comes of them.

    Parameters
    ----------
    place
        Host and port of the source.
    preset
        The preset by which the source reads packets; None for our own messages.
    """

    def __init__(self, place: tuple[str, int], preset: Preset | None) -> None:
        self._place, self._own = place, preset.name if preset else NATIVE
        self._survey, self._first, self._looked = Survey(), math.inf, -math.inf
        self._note = ""

    def keep(self, packet: Packet, arrival: float, sender: Sender) -> None:
        """Take in a packet without a frame; every ten seconds look at some of them, in a thread of its own."""
        if arrival - self._looked < _AGAIN:
            return
        self._first = min(self._first, arrival)
        if self._survey.packets < _MOST:
            self._survey.keep(packet, arrival, sender)
        if arrival - self._first >= _LEAST:
            survey, self._survey, self._first, self._looked = self._survey, Survey(), math.inf, arrival
            threading.Thread(target=self._look, args=(survey,), name="kinespace unread", daemon=True).start()

    def note(self, now: float) -> str:
        """Give a line for a person; empty when nothing is known, or nothing came for a while."""
        return self._note if now - self._looked < 2 * _AGAIN else ""

    def _look(self, survey: Survey) -> None:
        guess = survey.guess([builtin_preset(name) for name in builtin_names()])
        addresses = [kind.address for kind in survey.kinds.values()]
        listed = ", ".join(addresses[:_MAX_NAMED]) + (" ..." if len(addresses) > _MAX_NAMED else "")
        if guess is None and not {*addresses}.isdisjoint(OURS):
            self._note = ""  # Our own messages: the decoder says what is wrong with them.
        elif lacking := _lacking(addresses):
            more = " ..." if len(lacking) > _MAX_NAMED else ""
            self._note = (
                f"no frames: {', '.join(lacking[:_MAX_NAMED])}{more}: the sender sends only what changes; "
                "let it send all once, or always"
            )
        elif guess is None:
            nearest = "touchdesigner" if any(each.endswith((":tx", ":ty", ":tz")) for each in addresses) else "native"
            self._note = (
                f"no frames, but {listed or 'packets that are no OSC'}: no feed that is known. kinespace listen "
                f"{self._place[1]} shows it (end this first), kinespace feeds {nearest} > my.toml begins a preset"
            )
        elif guess.preset.name != self._own:
            product, run = guess.preset.product.partition(" (")[0], command(guess, None, self._place)
            self._note = f"no frames, but {listed}: this looks like {product}: end this and run: {run}"
        else:
            self._note = "; ".join(advice(survey, guess, None))


def _lacking(addresses: Sequence[str]) -> list[str]:
    """Name the joints of which one or two coordinates came in messages of their own, and those that never did."""
    came = dict[str, set[str]]()
    for joint, axis in filter(None, map(coordinate_of, addresses)):
        came.setdefault(joint, set()).add(axis)
    return [
        f"{joint} waits for {' and '.join(sorted({*'xyz'} - axes))}" for joint, axes in came.items() if len(axes) < 3
    ]
