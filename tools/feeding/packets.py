"""Raw recordings sent again, bit for bit, at their own pace or faster."""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import suppress
from itertools import count
from pathlib import Path

from kinespace.stream.inputs.kinerec import RawFile, RawPacket
from kinespace.tools.feeding.feed import FrameSender, Pace, lost_at
from kinespace.tools.terminal.console import progress, say


def replay(path: Path, senders: Mapping[str, FrameSender], options: argparse.Namespace) -> int:
    """Send a recording's packets at the times of their arrivals.

    Parameters
    ----------
    path
        The recording.
    senders
        Of its datagrams ("osc") and its ZeroMQ messages ("zmq"); packets without a sender are counted and left out.
    options
        The factor on the `speed`, the seconds from the recording's first packet between
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
    if not {*senders} & {*kinds}:
        raise ValueError(f"{path}: expected --osc or --zmq, because its packets came by {' and '.join(kinds)}")
    # Ctrl-C ends the feed, not the report.
    with suppress(KeyboardInterrupt):
        pace, last = Pace(), 0.0
        for _ in count() if options.loop else range(1):
            start = last
            for due, packet in progress(cut(recording.packets(), options.begin, options.end), "Sending", None):
                last, kind = start + due / options.speed, kinds[packet.source]
                pace.wait_for(last)
                if kind in senders:
                    senders[kind].send(b"".join(packet.parts) if kind == "osc" else packet.parts)  # type: ignore[arg-type]  # of one kind
                counts["sent" if kind in senders else "left out"] += 1
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
