"""The ends that `kinespace live` opens: sources of frames, sinks of answers, the recording, ways in for commands.

Of packets of which no frame comes it says the feed they look like, by the same survey as `kinespace listen`.
"""

import argparse
import ipaddress
import math
import os
import socket
import threading
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, closing, suppress
from pathlib import Path
from typing import NamedTuple

from kinespace.library.recordings.formats.table_header import coordinate_of
from kinespace.stream import osc, zeromq
from kinespace.stream.feeds import Preset, builtin_names, builtin_preset
from kinespace.stream.inputs import Admission, OscDecoder, Source, ZmqDecoder
from kinespace.stream.inputs.commands import CommandReader, RequestSource
from kinespace.stream.inputs.detection import NATIVE, OURS, Survey
from kinespace.stream.inputs.kinerec import RawWriter, Recorder, source_name
from kinespace.stream.inputs.source import FeedSource
from kinespace.stream.outputs import LAYOUTS, Layout, LayoutSink, ReplySink, Sink, ZmqSink
from kinespace.stream.outputs.layouts import WrittenLayout
from kinespace.stream.outputs.lsl_sink import LSL, LslSink
from kinespace.stream.outputs.midi_sink import MIDI, MidiSink
from kinespace.stream.outputs.zeromq_sink import BodySink
from kinespace.stream.packet import Networks, Packet, Sender
from kinespace.stream.service.loop import Recognising
from kinespace.stream.status import Status
from kinespace.stream.zeromq import Keyring
from kinespace.tools.cli.console import say
from kinespace.tools.cli.values import host_and_port, one_of, opening
from kinespace.tools.page.process import PagePlan, Plan
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
            listed = f"{', '.join(lacking[:_MAX_NAMED])}{more}"
            self._note = f"no frames: {listed}: the sender sends only what changes; let it send all once, or always"
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
    waits = {joint: " and ".join(sorted({*"xyz"} - axes)) for joint, axes in came.items()}
    return [f"{joint} waits for {axes}" for joint, axes in waits.items() if axes]


#: The addresses of all of a machine's networks, and of the machine itself.
_LOOPBACK = (ipaddress.ip_network("127.0.0.0/8"), ipaddress.ip_network("::1/128"))
#: Where the page's process finds its recogniser.
_HERE = zeromq.Endpoint("tcp://127.0.0.1:*", bind=True)
#: What a person hears who would teach where nobody may.
_NO_LESSONS = "teaching is off: start kinespace live with --teach FILE"
_ANY_HOST = ("0.0.0.0", "::")  # noqa: S104 - compared, not bound

_AnyReceiver = osc.OscReceiver | zeromq.ZmqReceiver


def open_ends(
    options: argparse.Namespace,
    preset: Preset | None,
    keyring: Keyring | None,
    admission: Admission,
    browsers: Sequence[zeromq.ZmqReceiver] = (),
) -> tuple[list[Source], list[Sink], RawWriter | None]:
    """Open the addresses and the recording; after a failure the open addresses are closed again.

    `browsers` are the receivers of WebSocket clients, whose frames are our own whatever the feed.
    """
    networks = _networks(options)
    if options.camera or options.lsl_in:
        networks = _and_here(networks)
    receivers: list[_AnyReceiver] = []
    sinks: list[Sink] = []
    with ExitStack() as opened:
        for each in browsers:
            opened.callback(each.close)
        if options.osc_in:
            with opening("--osc-in"):
                receiver: _AnyReceiver = osc.OscReceiver(*host_and_port(options.osc_in), networks)
            receivers.append(opened.enter_context(closing(receiver)))
        if options.zmq_in:
            with opening("--zmq-in"):
                endpoint = _endpoint(options, options.zmq_in)
                receiver = zeromq.ZmqReceiver(endpoint, networks=networks, keyring=keyring)
            receivers.append(opened.enter_context(closing(receiver)))
        native = [("--osc-out", f"native={options.osc_out}")] if options.osc_out else []
        for option, out in [*native, *(("--out", each) for each in options.out)]:
            with opening(option):
                sinks.append(opened.enter_context(closing(_layout_sink(out, receivers, admission))))
                _require_no_loop(receivers, sinks[-1])
        if options.zmq_out:
            with opening("--zmq-out"):
                endpoint = _endpoint(options, options.zmq_out)
                known = bool(keyring or networks) or not endpoint.is_open_to_others
                sink = ZmqSink(zeromq.ZmqSender(endpoint, keyring, _and_here(networks)), named=known)
            sinks.append(opened.enter_context(closing(sink)))
        read = [*((each, preset) for each in receivers), *((each, None) for each in browsers)]
        # Last, because it may take another file's place.
        writer = _writer(options.record, read) if options.record else None
        sources = []
        for index, (receiver, fed) in enumerate(read):
            recorder = Recorder(writer, index) if writer else None
            sources.append(_source(receiver, recorder, fed, options.sender, admission))
            sources[-1].is_of_browsers = receiver in browsers
        opened.pop_all()
    return sources, sinks, writer


def open_senders(options: argparse.Namespace, sources: Sequence[Source]) -> list[AbstractContextManager[object]]:
    """Start the camera and find the LSL stream that are asked for; their frames come to the OSC port, as any sender's.

    Raises
    ------
    ImportError, OSError, ValueError
        As `tools.programs.camera.CameraProcess` and `tools.feeding.lsl_feed.LslFeed`.
    """
    senders: list[AbstractContextManager[object]] = []
    if camera := options.camera:
        from kinespace.tools.programs.camera import CameraPlan, CameraProcess  # noqa: PLC0415 - where there is a camera

        place = "{}:{}".format(*_own_port(sources))
        process = CameraProcess(CameraPlan(camera, osc=place, people=options.people, size=options.size), say)
        say(f"camera: {process.opened}")
        senders.append(process)
    if stream := options.lsl_in:
        from kinespace.tools.feeding.lsl_feed import LslFeed  # noqa: PLC0415 - only where a stream is asked for

        feed = LslFeed(stream, *_own_port(sources))
        say(f"LSL: {stream}, {len(feed.layout.joints)} joints")
        senders.append(feed)
    return senders


def _own_port(sources: Sequence[Source]) -> tuple[str, int]:
    """Give the host and the port at which this machine reaches the OSC port."""
    receiver = next(each.receiver for each in sources if isinstance(each.receiver, osc.OscReceiver))
    host, port = receiver.address[:2]
    return "127.0.0.1" if host in _ANY_HOST else host, port


def _source(
    receiver: _AnyReceiver, recorder: Recorder | None, preset: Preset | None, sender: str, admission: Admission
) -> Source:
    if preset:
        source: Source = FeedSource(receiver, preset, sender=sender, recorder=recorder, admission=admission)
    else:
        decoder = OscDecoder() if isinstance(receiver, osc.OscReceiver) else ZmqDecoder()
        source = Source(receiver, decoder, recorder, admission)
    if isinstance(receiver, osc.OscReceiver):
        source.unread = Unread(receiver.address, preset)
    return source


def _layout_sink(text: str, receivers: Sequence[_AnyReceiver], admission: Admission) -> Sink:
    """Open NAME or FILE.toml, perhaps with =HOST:PORT or =sender:PORT."""
    name, _, target = text.partition("=")
    if name == LSL and not target:
        return LslSink()
    if name == MIDI:
        return MidiSink(target)
    if name.endswith(".toml"):
        layout: Layout = WrittenLayout(Path(name))
    else:
        layout = LAYOUTS[one_of("--out", name, (*LAYOUTS, LSL, MIDI))]()
    if target.partition(":")[0] != "sender":
        place = host_and_port(target) if target else ("127.0.0.1", layout.port)
        return LayoutSink(layout, osc.OscSender(*place))
    by_osc = [receiver for receiver in receivers if isinstance(receiver, osc.OscReceiver)]
    if not by_osc:
        raise ValueError("--out: expected an OSC feed to reply to, got none")
    port = host_and_port(target)[1] if ":" in target else layout.port
    return ReplySink(layout, by_osc[0], port, admission)


def _require_no_loop(receivers: Sequence[_AnyReceiver], sink: Sink) -> None:
    """Refuse answers to a port on which frames come in: they would be taken for frames."""
    for receiver in receivers:
        if isinstance(receiver, osc.OscReceiver) and _reaches(sink, *receiver.address):
            place = ":".join(map(str, receiver.address))
            raise ValueError(f"address: expected another place than {place}, where frames come in: {sink}")


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


def _writer(record: Path, read: Sequence[tuple[_AnyReceiver, Preset | None]]) -> RawWriter:
    record.unlink(missing_ok=True)
    presets = {preset.name: preset.text for _, preset in read if preset}
    return RawWriter(record, [source_name(*each) for each in read], presets)


def _and_here(networks: Networks) -> Networks:
    """Add this machine to the networks that may connect, unless all may."""
    return [*networks, *_LOOPBACK] if networks else ()


def _networks(options: argparse.Namespace) -> Networks:
    """Read the networks that may connect; ValueError for no network."""
    return [ipaddress.ip_network(each, strict=False) for each in options.allow_from]


def _endpoint(options: argparse.Namespace, address: str) -> zeromq.Endpoint:
    """Read the address of an endpoint, which is bound unless it says otherwise; ValueError for no address."""
    return zeromq.Endpoint.parse(address, bind=True, to_anybody=options.open)


class Served(NamedTuple):
    """A server of browsers, for a process of its own: how answers reach it, and how frames and commands leave it."""

    plan: Plan
    sinks: list[Sink]
    frames: list[zeromq.ZmqReceiver]
    requests: list[RequestSource]


def open_servers(
    options: argparse.Namespace, keyring: Keyring | None, performers: Recognising, *, commands: bool
) -> Iterator[Served]:
    """Prepare the page, which may give commands, and the server of WebSocket clients where they are asked for."""
    if options.page:
        sender = zeromq.ZmqSender(_HERE, keyring)
        requests = [RequestSource(_HERE, (), keyring)] if commands else []
        control = requests[0].address if requests else None
        page = PagePlan(options.page, sender.address, options.keys, control)
        bodies = BodySink(sender, performers.skeleton_of, performers.carried)
        yield Served(page, [ZmqSink(sender), bodies], [], requests)
    if options.ws:
        from kinespace.tools.page.server import SocketPlan  # noqa: PLC0415 - slow to load

        sender, frames = zeromq.ZmqSender(_HERE, keyring), zeromq.ZmqReceiver(_HERE, keyring=keyring)
        networks = tuple(map(str, _and_here(_networks(options))))
        clients = SocketPlan(options.ws, sender.address, options.keys, frames.address, options.ws_origin, networks)
        yield Served(clients, [ZmqSink(sender)], [frames], [])


def open_controls(
    options: argparse.Namespace, sources: Sequence[Source], keyring: Keyring | None
) -> list[RequestSource]:
    """Let the frames' own ports take commands, and open the further ways in for them."""
    networks = _networks(options)
    for source in sources:
        source.commands = CommandReader(networks, "" if options.teach else _NO_LESSONS)
    controls: list[RequestSource] = []
    for control in options.control:
        with opening("--control"):
            # The owner of a known key may command from any network.
            near = () if keyring else _and_here(networks)
            controls.append(RequestSource(_endpoint(options, control), networks, keyring, networks=near))
    return controls


class Systemd(Sink):
    """Sends what sd_notify(3) sends: READY at the first status, at each one WATCHDOG and a line on the health.

    A recogniser that hangs sends no status, so that systemd starts it again (`WatchdogSec=`).

    Parameters
    ----------
    address
        Of systemd's socket; `@` begins a name that is no file.
    """

    def __init__(self, address: str) -> None:
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.settimeout(0)
        self._ready = "READY=1\n"

    def publish_status(self, status: Status) -> None:
        """Say that the service runs, and how."""
        self._send(f"{self._ready}WATCHDOG=1\nSTATUS={status.health}")
        self._ready = ""

    def close(self) -> None:
        """Say that the service ends."""
        self._send("STOPPING=1")
        self._socket.close()

    def _send(self, text: str) -> None:
        # Nobody may wait for systemd, and a recogniser goes on without it.
        with suppress(OSError):
            self._socket.sendto(text.encode(), self._address)


def supervisors() -> list[Sink]:
    """Give a sink for systemd where it has started this program and wants to know."""
    address = os.environ.get("NOTIFY_SOCKET", "")
    return [Systemd(address)] if address and hasattr(socket, "AF_UNIX") else []
