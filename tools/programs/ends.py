"""The ends that `kinespace live` opens: sources of frames, sinks of answers, the recording, ways in for commands.

Of packets of which no frame comes it says the feed they look like, by the same survey as `kinespace listen`.
"""

import argparse
import ipaddress
import math
import os
import socket
import threading
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any, TypeVar

from kinespace.library.naming import listed
from kinespace.stream import osc, zeromq
from kinespace.stream.feeds import Preset, builtin_names, builtin_preset
from kinespace.stream.inputs import Admission, FeedSource, OwnDecoder, Receiver, Source
from kinespace.stream.inputs.commands import THIS_MACHINE, CommandReader, RequestSource
from kinespace.stream.inputs.detection import NATIVE, Survey
from kinespace.stream.inputs.kinerec import RawWriter, Recorder, source_name
from kinespace.stream.outputs import LAYOUTS, BodySink, Layout, LayoutSink, ReplySink, Sink, WrittenLayout, ZmqSink
from kinespace.stream.outputs.lsl_sink import LSL, LslSink
from kinespace.stream.outputs.midi_sink import MIDI, MidiSink
from kinespace.stream.packet import Networks, Packet, Sender
from kinespace.stream.service.loop import Recognising
from kinespace.stream.status import Status
from kinespace.stream.zeromq import Keyring
from kinespace.tools.cli.arguments import BUILT_IN
from kinespace.tools.cli.console import say
from kinespace.tools.cli.values import host_and_port, one_of, opening
from kinespace.tools.page.process import PagePlan, PageProcess, Plan
from kinespace.tools.programs.listen import advice, command

#: Packets that are looked at.
_MOST = 60
#: Seconds over which packets come before they are looked at, at least.
_LEAST = 1.0
#: Seconds after which packets that still come are looked at again.
_AGAIN = 10.0
#: Addresses that are named, at most.
_MAX_NAMED = 3


class UnreadPort:
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
        came = listed([kind.address for kind in survey.kinds.values()], _MAX_NAMED) or "packets that are no OSC"
        if guess and guess.preset.name != self._own:
            product, run = guess.preset.product.partition(" (")[0], command(guess, None, self._place)
            said = [f"this looks like {product}: end this and run: {run}"]
        else:
            said = advice(survey, guess, None)
        self._note = f"no frames, but {came}: {'; '.join(said)}" if said else ""


#: Where the page's process finds its recogniser.
_HERE = zeromq.Endpoint("tcp://127.0.0.1:*", bind=True)
#: What a person hears who would teach where nobody may.
_NO_LESSONS = "teaching is off: start kinespace live with --teach FILE"
_ANY_HOST = ("0.0.0.0", "::")  # noqa: S104 - compared, not bound

_End = TypeVar("_End", bound=Any)


class Ends(ExitStack):
    """The ends of a recogniser, opened one after the other; leaving the `with` block closes them, the last one first.

    Parameters
    ----------
    options
        Of the program.
    admission
        Admits frames of all sources.

    Attributes
    ----------
    sources, sinks, controls
        Where frames come in, where answers go, and further ways in for commands, as the options name them.
    recording
        Keeps every packet; None for no recording.
    servers, own_sinks, own_controls
        Our own servers of browsers; to them, and from them.
    """

    def __init__(self, options: argparse.Namespace, admission: Admission) -> None:
        super().__init__()
        self.recording: RawWriter | None = None
        self.sources = list[Source]()
        self.sinks, self.own_sinks = list[Sink](), list[Sink]()
        self.controls, self.own_controls = list[RequestSource](), list[RequestSource]()
        self.servers = list[PageProcess]()
        self._options, self._admission = options, admission
        self._browsers = list[zeromq.ZmqReceiver]()
        #: The networks that may connect, and these with this machine; none where all may.
        self._networks: Networks = [ipaddress.ip_network(each, strict=False) for each in options.allow_from]
        self._near: Networks = [*self._networks, *THIS_MACHINE] if self._networks else ()
        self._keyring = self.enter_context(Keyring(options.keys)) if options.keys else None

    def _kept(self, end: _End) -> _End:
        self.callback(end.close)
        return end

    def _endpoint(self, address: str) -> zeromq.Endpoint:
        """Read the address of an endpoint, which is bound unless it says otherwise; ValueError for no address."""
        return zeromq.Endpoint.parse(address, bind=True, to_anybody=self._options.open)

    def open_servers(self, performers: Recognising, *, commands: bool) -> None:
        """Start the page, which may give commands, and the server of WebSocket clients where they are asked for."""
        options, keyring, plans = self._options, self._keyring, list[Plan]()
        if options.page:
            sender = self._kept(zeromq.ZmqSender(_HERE, keyring))
            self.own_sinks += [ZmqSink(sender), BodySink(sender, performers.skeleton_of, performers.carried)]
            if commands:
                self.own_controls.append(self._kept(RequestSource(_HERE, (), keyring)))
            control = self.own_controls[0].address if commands else None
            libraries = tuple(each for each in (options.library or BUILT_IN, options.teach) if each)
            plans.append(PagePlan(options.page, sender.address, options.keys, control, libraries))
        if options.ws:
            from kinespace.tools.page.server import SocketPlan  # noqa: PLC0415 - slow to load

            sender = self._kept(zeromq.ZmqSender(_HERE, keyring))
            self.own_sinks.append(ZmqSink(sender))
            self._browsers.append(self._kept(zeromq.ZmqReceiver(_HERE, keyring=keyring)))
            near, frames = tuple(map(str, self._near)), self._browsers[0].address
            plans.append(SocketPlan(options.ws, sender.address, options.keys, frames, options.ws_origin, near))
        self.servers = [self.enter_context(PageProcess(plan, say)) for plan in plans]

    def open(self, preset: Preset | None = None) -> None:
        """Open the addresses and the recording; frames of browsers are our own, whatever the feed."""
        options, keyring, receivers = self._options, self._keyring, list[Receiver]()
        networks = self._near if options.camera or options.lsl_in else self._networks
        if options.osc_in:
            with opening("--osc-in"):
                receivers.append(self._kept(osc.OscReceiver(*host_and_port(options.osc_in), networks)))
        if options.zmq_in:
            with opening("--zmq-in"):
                endpoint = self._endpoint(options.zmq_in)
                receivers.append(self._kept(zeromq.ZmqReceiver(endpoint, networks=networks, keyring=keyring)))
        native = [("--osc-out", f"native={options.osc_out}")] if options.osc_out else []
        for option, out in [*native, *(("--out", each) for each in options.out)]:
            with opening(option):
                self.sinks.append(self._kept(_layout_sink(out, receivers, self._admission)))
                _require_no_loop(receivers, self.sinks[-1])
        if options.zmq_out:
            with opening("--zmq-out"):
                endpoint = self._endpoint(options.zmq_out)
                known = bool(keyring or networks) or not endpoint.is_open_to_others
                sender = self._kept(zeromq.ZmqSender(endpoint, keyring, self._near))
            self.sinks.append(ZmqSink(sender, named=known))
        read = [*((each, preset) for each in receivers), *((each, None) for each in self._browsers)]
        if options.record:
            # Last, because it may take another file's place.
            options.record.unlink(missing_ok=True)
            presets = {preset.name: preset.text} if preset else {}
            names = [source_name(each.place, fed) for each, fed in read]
            self.recording = self._kept(RawWriter(options.record, names, presets))
        for index, (receiver, fed) in enumerate(read):
            source = self._kept(_source(receiver, fed, options.sender, self._admission))
            source.recorder = Recorder(self.recording, index) if self.recording else None
            source.place = "" if receiver in self._browsers else source.place
            self.sources.append(source)

    def open_controls(self) -> None:
        """Let the frames' own ports take commands, and open the further ways in for them."""
        for source in self.sources:
            source.commands = CommandReader(self._networks, "" if self._options.teach else _NO_LESSONS)
        for control in self._options.control:
            with opening("--control"):
                # The owner of a known key may command from any network.
                near, endpoint = () if self._keyring else self._near, self._endpoint(control)
                opened = RequestSource(endpoint, self._networks, self._keyring, networks=near)
                self.controls.append(self._kept(opened))

    def open_senders(self) -> None:
        """Start the camera and find the LSL stream that are asked for; their frames come to the OSC port.

        Raises
        ------
        ImportError, OSError, ValueError
            As `tools.programs.camera.CameraProcess` and `tools.feeding.lsl_feed.LslFeed`.
        """
        if camera := self._options.camera:
            from kinespace.tools.programs.camera import CameraPlan, CameraProcess  # noqa: PLC0415 - seldom needed

            place, people = "{}:{}".format(*_own_port(self.sources)), self._options.people
            plan = CameraPlan(camera, osc=place, people=people, size=self._options.size)
            process = self.enter_context(CameraProcess(plan, say))
            say(f"camera: {process.opened}")
        if stream := self._options.lsl_in:
            from kinespace.tools.feeding.lsl_feed import LslFeed  # noqa: PLC0415 - only where a stream is asked for

            feed = LslFeed(stream, *_own_port(self.sources))
            say(f"LSL: {stream}, {len(feed.layout.joints)} joints")
            self.enter_context(feed)


def _own_port(sources: Sequence[Source]) -> tuple[str, int]:
    """Give the host and the port at which this machine reaches the OSC port."""
    receiver = next(each.receiver for each in sources if isinstance(each.receiver, osc.OscReceiver))
    host, port = receiver.address[:2]
    return "127.0.0.1" if host in _ANY_HOST else host, port


def _source(receiver: Receiver, preset: Preset | None, sender: str, admission: Admission) -> Source:
    if preset:
        source: Source = FeedSource(receiver, preset, admission, sender=sender)
    else:
        source = Source(receiver, OwnDecoder(), admission)
    if isinstance(receiver, osc.OscReceiver):
        source.unread = UnreadPort(receiver.address, preset)
    return source


def _layout_sink(text: str, receivers: Sequence[Receiver], admission: Admission) -> Sink:
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


def _require_no_loop(receivers: Sequence[Receiver], sink: Sink) -> None:
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
