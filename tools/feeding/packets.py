"""Raw recordings sent again, bit for bit, at their own pace or faster."""

from __future__ import annotations

import json
import time
from collections import Counter
from contextlib import ExitStack, suppress
from itertools import count
from typing import TYPE_CHECKING

from kinespace.stream import osc, zeromq
from kinespace.stream.inputs.recording.kinerec import RawFile
from kinespace.stream.zeromq import Keyring
from kinespace.tools.cli.address import host_and_port
from kinespace.tools.feeding.feed import Pace, lost_at
from kinespace.tools.terminal.console import progress, say

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from kinespace.stream.inputs.recording.kinerec import RawPacket
    from kinespace.stream.zeromq import Endpoint

#: Seconds for ZeroMQ peers to connect before the first message.
_MEETING = 0.5

_Sender = osc.OscSender | zeromq.ZmqSender


def replay(path: Path, osc_to: str | None, zmq_to: Endpoint | None, options: argparse.Namespace) -> int:
    """Send a recording's packets at the times of their arrivals.

    Parameters
    ----------
    path
        The recording.
    osc_to, zmq_to
        Where its datagrams and its ZeroMQ messages go; packets of a kind without an address are counted and left out.
    options
        The keys of ZeroMQ (`keys`), the factor on the `speed`, the seconds from the recording's first packet between
        which packets are sent (`begin`, and `end`, which is not part of them), whether to begin again after the last
        until interrupted (`loop`), and whether to print one `json` object and nothing else.

    Raises
    ------
    ValueError
        The recording has no packets, or none between the two moments.
    """
    recording = RawFile(path)
    kinds = [source.partition(" ")[0] for source in recording.header.sources]
    counts: Counter[str] = Counter()
    with ExitStack() as opened:
        senders = _open_senders(opened, kinds, osc_to, zmq_to, options.keys)
        if not senders:
            raise ValueError(f"{path}: expected --osc or --zmq, because its packets came by {' and '.join(kinds)}")
        # Ctrl-C ends the feed, not the report.
        with suppress(KeyboardInterrupt):
            pace, last = Pace(), 0.0
            for _ in count() if options.loop else range(1):
                start = last
                for due, packet in progress(cut(recording.packets(), options.begin, options.end), "Sending", None):
                    last = start + due / options.speed
                    pace.wait_for(last)
                    counts[_send(packet, senders.get(kinds[packet.source]))] += 1
                if not counts:
                    raise ValueError(_nothing_to_send(recording))
        failed = sum(sender.failed for sender in senders.values())
        unheard = {str(sender): sender.unheard for sender in senders.values()}
    every = sum(unheard.values())
    figures = {"sent": counts["sent"], "left_out": counts["left out"], "failed": failed, "unheard": every}
    if options.json:
        print(json.dumps({**figures, "lost_from": recording.lost_from}))
    else:
        say(
            f"{figures['sent']} packets sent, {failed} refused by the system, {figures['left_out']} without an "
            "address for their kind"
        )
        for place, lost in unheard.items():
            if lost:
                say(lost_at(place, lost))
        if recording.damage():
            say(recording.damage())
    return 1 if every and every >= counts["sent"] else 0


def _nothing_to_send(recording: RawFile) -> str:
    """Say why a recording, as cut, has no packets."""
    arrivals = [packet.arrival for packet in recording.packets()]
    damage = f"; {recording.damage()}" if recording.damage() else ""
    if not arrivals:
        return f"{recording.path}: no packets in it{damage}"
    return f"{recording.path}: expected --from and --to within its {arrivals[-1] - arrivals[0]:.2f} s{damage}"


def cut(packets: Iterator[RawPacket], begin: float, end: float | None) -> Iterator[tuple[float, RawPacket]]:
    """Give the packets between two moments, seconds from the first packet, with the time at which each is due."""
    first: float | None = None
    for packet in packets:
        first = packet.arrival if first is None else first
        moment = packet.arrival - first
        if end is not None and moment >= end:
            return
        if moment >= begin:
            yield moment - begin, packet


def _open_senders(
    opened: ExitStack, kinds: Sequence[str], osc_to: str | None, zmq_to: Endpoint | None, keys: Path | None
) -> dict[str, _Sender]:
    """Open the senders of those kinds of packets that have an address."""
    senders: dict[str, _Sender] = {}
    if osc_to and "osc" in kinds:
        senders["osc"] = osc.OscSender(*host_and_port(osc_to), asks=True)
        opened.callback(senders["osc"].close)
    if zmq_to and "zmq" in kinds:
        keyring = opened.enter_context(Keyring(keys)) if keys else None
        senders["zmq"] = zeromq.ZmqSender(zmq_to, keyring, asks=True)
        opened.callback(senders["zmq"].close)
        time.sleep(_MEETING)
    return senders


def _send(packet: RawPacket, sender: _Sender | None) -> str:
    """Send a packet as it came; give `sent`, or `left out` for a kind without an address."""
    if sender is None:
        return "left out"
    if isinstance(sender, osc.OscSender):
        sender.send(b"".join(packet.parts))
    else:
        sender.send(packet.parts)
    return "sent"
