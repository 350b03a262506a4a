"""Handshakes, subscriptions and keep-alives: the messages for a sender and when they are due; nothing is sent here."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from kinespace.stream.osc.packet import encode_message

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.stream.feeds.preset import AskedMessage, Asking, Preset

#: Seconds without a frame after which a sender is silent.
SILENCE = 1.0


def is_due(asking: Asking, now: float, asked: float, heard: float) -> bool:
    """Say whether messages to the sender are due.

    Parameters
    ----------
    asking
        The messages for the sender, and how often they are due.
    now, asked, heard
        Seconds on one clock: now, when messages were last sent, and when the last frame came; -inf for never.
    """
    if now - asked < asking.every:
        return False
    return not asking.while_silent or now - heard > SILENCE


def questions(preset: Preset, port: int) -> list[bytes]:
    """Encode the messages for the sender.

    Parameters
    ----------
    preset
        The preset with the messages; without any the list is empty.
    port
        The port on which we listen.
    """
    return _encoded(preset, preset.asking.messages, port) if preset.asking else []


def farewells(preset: Preset, port: int) -> list[bytes]:
    """Encode the farewell to the sender, for when we stop listening on a port."""
    return _encoded(preset, preset.asking.farewell, port) if preset.asking else []


def _encoded(preset: Preset, messages: Sequence[AskedMessage], port: int) -> list[bytes]:
    packets = list[bytes]()
    for address, arguments in ((each.address, each.arguments) for each in messages):
        everything = address + "".join(map(str, arguments))
        named = [name for name, target in preset.joint_map.items() if target] if "{joint}" in everything else [""]
        packets += [_message(address, arguments, joint, port) for joint in named]
    return packets


def _message(address: str, arguments: Sequence[str | float], joint: str, port: int) -> bytes:
    filled = [
        port
        if argument == "{port}"
        else argument.replace("{joint}", joint).replace("{port}", str(port))
        if isinstance(argument, str)
        else argument
        for argument in arguments
    ]
    return encode_message(address.replace("{joint}", joint), *filled)


#: A time before all others, on any clock.
NEVER = -math.inf
