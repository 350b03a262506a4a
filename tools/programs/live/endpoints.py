"""The ends that `kinespace live` opens: sources of frames, sinks of answers, the recording, doors for commands."""

from __future__ import annotations

import ipaddress
from contextlib import ExitStack
from dataclasses import replace
from typing import TYPE_CHECKING

from kinespace.stream import osc, zeromq
from kinespace.stream.feeds.source import FeedSource
from kinespace.stream.inputs import OscDecoder, Source, ZmqDecoder
from kinespace.stream.inputs.recording import RawWriter, Recorder, source_name
from kinespace.stream.outputs import LAYOUTS, LayoutSink, NativeLayout, ReplySink, Sink, ZmqSink
from kinespace.stream.zeromq import Endpoint
from kinespace.tools.cli.address import host_and_port, opening
from kinespace.tools.cli.choice import one_of
from kinespace.tools.teaching.door import WEKINATOR_PORT, Allowed, RequestDoor, TaughtDecoder, WekinatorDoor

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from kinespace.stream.feeds import Preset
    from kinespace.stream.inputs import Admission
    from kinespace.stream.inputs.receiver import Networks
    from kinespace.stream.zeromq import Keyring
    from kinespace.tools.programs.live.options import Addresses, Feed, Teaching
    from kinespace.tools.teaching.desk import Desk

#: The addresses of all of a machine's networks, and of the machine itself.
_LOOPBACK = (ipaddress.ip_network("127.0.0.0/8"), ipaddress.ip_network("::1/128"))
_ANY_HOST = ("0.0.0.0", "::")  # noqa: S104 - compared, not bound

_AnyReceiver = osc.OscReceiver | zeromq.ZmqReceiver


def open_ends(
    addresses: Addresses,
    feed: Feed,
    preset: Preset | None,
    record: Path | None,
    *,
    networks: Networks,
    keyring: Keyring | None,
    admission: Admission,
) -> tuple[list[Source], list[Sink], RawWriter | None]:
    """Open the addresses and the recording; after a failure the open addresses are closed again."""
    if preset and not (addresses.osc_in or addresses.zmq_in):
        addresses = replace(addresses, osc_in=f"127.0.0.1:{preset.port}")
    receivers: list[_AnyReceiver] = []
    sinks: list[Sink] = []
    with ExitStack() as opened:
        if addresses.osc_in:
            with opening("--osc-in"):
                receivers.append(osc.OscReceiver(*host_and_port(addresses.osc_in), networks))
            opened.callback(receivers[-1].close)
        if addresses.zmq_in:
            endpoint = Endpoint.parse(addresses.zmq_in, bind=True)
            with opening("--zmq-in"):
                receivers.append(zeromq.ZmqReceiver(endpoint, networks=networks, keyring=keyring))
            opened.callback(receivers[-1].close)
        if addresses.osc_out:
            with opening("--osc-out"):
                sinks.append(LayoutSink(NativeLayout(), osc.OscSender(*host_and_port(addresses.osc_out))))
            opened.callback(sinks[-1].close)
        if addresses.zmq_out:
            endpoint = Endpoint.parse(addresses.zmq_out, bind=True)
            listeners = [*networks, *_LOOPBACK] if networks else ()
            known = bool(keyring or networks) or not endpoint.is_open_to_others
            with opening("--zmq-out"):
                sinks.append(ZmqSink(zeromq.ZmqSender(endpoint, keyring, listeners), named=known))
            opened.callback(sinks[-1].close)
        for out in feed.outs:
            with opening("--out"):
                sinks.append(_layout_sink(out, receivers, admission))
            opened.callback(sinks[-1].close)
        _require_no_loop(receivers, sinks)
        # Last, because it may take another file's place.
        writer = _writer(record, receivers, preset) if record else None
        recorders = [Recorder(writer, index) if writer else None for index in range(len(receivers))]
        sources = [_source(*each, preset, feed.sender, admission) for each in zip(receivers, recorders, strict=True)]
        opened.pop_all()
    return sources, sinks, writer


def _source(
    receiver: _AnyReceiver, recorder: Recorder | None, preset: Preset | None, sender: str, admission: Admission
) -> Source:
    if preset:
        return FeedSource(receiver, preset, sender=sender, recorder=recorder, admission=admission)
    decoder = OscDecoder() if isinstance(receiver, osc.OscReceiver) else ZmqDecoder()
    return Source(receiver, decoder, recorder, admission)


def _layout_sink(text: str, receivers: Sequence[_AnyReceiver], admission: Admission) -> Sink:
    """Open NAME, NAME=HOST:PORT or NAME=sender:PORT."""
    name, _, target = text.partition("=")
    layout = LAYOUTS[one_of("--out", name, LAYOUTS)]()
    if target.partition(":")[0] != "sender":
        host, port = host_and_port(target) if target else ("127.0.0.1", layout.port)
        return LayoutSink(layout, osc.OscSender(host, port))
    heard = [receiver for receiver in receivers if isinstance(receiver, osc.OscReceiver)]
    if not heard:
        raise ValueError("--out: expected an OSC feed to reply to, got none")
    port = host_and_port(target)[1] if ":" in target else layout.port
    return ReplySink(layout, heard[0], port, admission)


def _require_no_loop(receivers: Sequence[_AnyReceiver], sinks: Sequence[Sink]) -> None:
    """Refuse answers to a port on which frames come in: they would be taken for frames."""
    heard = [receiver.address for receiver in receivers if isinstance(receiver, osc.OscReceiver)]
    for sink in sinks:
        for own, listening in heard:
            if _reaches(sink, own, listening):
                raise ValueError(f"--out: expected another place than {own}:{listening}, where frames come in: {sink}")


def _reaches(sink: Sink, own: str, listening: int) -> bool:
    """Say whether a sink sends to one of our own addresses."""
    if isinstance(sink, ReplySink):
        # The sender may be on this machine.
        return sink.port == listening
    sender = sink.sender if isinstance(sink, LayoutSink) else None
    if not isinstance(sender, osc.OscSender):
        return False
    host, port = sender.target[:2]
    return port == listening and (host == own or (own in _ANY_HOST and (host in _ANY_HOST or osc.is_ours(host))))


def _writer(record: Path, receivers: Sequence[_AnyReceiver], preset: Preset | None) -> RawWriter:
    record.unlink(missing_ok=True)
    presets = {preset.name: preset.text} if preset else {}
    return RawWriter(record, [source_name(receiver, preset) for receiver in receivers], presets)


def open_doors(
    teaching: Teaching, desk: Desk, sources: Sequence[Source], networks: Networks, keyring: Keyring | None
) -> list[WekinatorDoor | RequestDoor]:
    """Open the ways in for commands: the frames' own ports, and further ones."""
    allowed = Allowed(networks)
    for source in sources:
        source.decoder = TaughtDecoder(source.decoder, desk, allowed)
    doors: list[WekinatorDoor | RequestDoor] = []
    for control in teaching.controls:
        name, _, place = control.partition("=")
        if name == "wekinator":
            host, port = host_and_port(place) if place else ("127.0.0.1", WEKINATOR_PORT)
            with opening("--control"):
                doors.append(WekinatorDoor(osc.OscReceiver(host, port), desk, allowed))
        elif "://" in control:
            with opening("--control"):
                doors.append(RequestDoor(Endpoint.parse(control, bind=True), desk, allowed, keyring))
        else:
            raise ValueError(f"--control: expected wekinator or an endpoint like tcp://127.0.0.1:9330, got {control!r}")
    return doors
