"""The last refusals: a reason, the sender and an excerpt, for a person who has to correct a sender."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from kinespace.stream.inputs.receiver import Packet, Sender

#: Characters of a reason, and bytes of an excerpt, at most.
_MAX_REASON = 160
_MAX_EXCERPT = 24


class Refusals:
    """The last refusal of each kind, like malformed and foreign."""

    def __init__(self) -> None:
        self._last: dict[str, tuple[str, Sender, Packet]] = {}

    def note(self, kind: str, reason: str, sender: Sender, packet: Packet) -> None:
        """Keep a refusal in place of the one before; its text is made only when a person asks."""
        self._last[kind] = reason, sender, packet

    def lines(self) -> list[str]:
        """Describe the last refusal of each kind, a line each."""
        return [f"last {kind}: {_told(*told)}" for kind, told in self._last.items()]


def _told(reason: str, sender: Sender, packet: Packet) -> str:
    first = packet if isinstance(packet, bytes) else b" ".join(packet[:2])
    excerpt = ascii(first[:_MAX_EXCERPT])[1:] + ("..." if len(first) > _MAX_EXCERPT else "")
    came_from = f", from {sender[0]}:{sender[1]}" if sender else ""
    shown = "".join(character if character.isprintable() else "\N{REPLACEMENT CHARACTER}" for character in reason)
    return f"{shown[:_MAX_REASON]}{came_from}: {excerpt}"
