"""`kinespace replay`: the feed is sent, and the answers are counted.

Sends recordings as live packets on an absolute schedule. With --listen it counts the answers and prints the share that
was right; a clip's class is in its name (HDM05) or is its folder's name. If a file of labels with a take's name lies
next to the take, the class is the label of the moment. Exit status: 0 sent (and, with --listen, answered), 1 the frames
reached no program, or no answer came to --listen, 2 could not be done.
"""

import argparse
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from itertools import chain, count
from pathlib import Path

import numpy as np

from kinespace.library import Clip, MotionLibrary, Reading, Skeleton, find_recordings
from kinespace.library.recordings import RecordingReader, labelled, segments_beside
from kinespace.library.recordings.formats.labels import Segment
from kinespace.stream import osc, zeromq
from kinespace.stream.inputs.kinerec import ENDING, RawFile, RawPacket
from kinespace.stream.zeromq import Endpoint, Keyring
from kinespace.tools.cli import arguments, console
from kinespace.tools.cli.values import host_and_port, opening
from kinespace.tools.feeding import feed
from kinespace.tools.feeding.service import Listener, ReceivedPacket, answer_in, classes_in

#: Seconds for ZeroMQ peers to connect before the first frame; a peer that connects later loses the first messages.
_MEETING = 0.5
#: A sender for each kind of packets that is sent: "osc", "zmq".
Senders = Mapping[str, feed.FrameSender]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    text = f"recordings, folders, or classes of the built-in library; or one {ENDING} (default: built-in, all)"
    parser.add_argument("clips", nargs="*", type=Path, metavar="CLIP|CLASS", help=text)
    arguments.add_reading(parser)
    parser.add_argument("--osc", metavar="HOST:PORT", help=f"send OSC there (default: {arguments.OSC_IN})")
    parser.add_argument("--zmq", metavar="ENDPOINT", help="publish on ZeroMQ instead; connects, @ before it binds")
    parser.add_argument("--listen", metavar="ADDRESS", help="HOST:PORT or ZeroMQ endpoint where the answers come")
    arguments.add_shared(parser, "--keys", "--open")
    parser.add_argument("--performer", default="replay", help="name of the performer (default %(default)s)")
    text = "factor on the recorded speed (default %(default)s)"
    parser.add_argument("--speed", type=arguments.positive, default=1.0, help=text)
    parser.add_argument("--pause", type=arguments.not_negative, default=1.0, help="seconds between clips (%(default)s)")
    text = "begin each recording at this second"
    parser.add_argument("--from", type=arguments.not_negative, default=0.0, dest="begin", metavar="S", help=text)
    parser.add_argument("--to", type=arguments.positive, dest="end", metavar="S", help="end each at this second")
    parser.add_argument("--loop", action="store_true", help="begin again after the last clip, until Ctrl-C")
    arguments.add_shared(parser, "--json")


def run(options: argparse.Namespace) -> int:
    """Send the recordings; with `--listen`, print the share of right answers.

    Returns
    -------
    The exit status: 1 when the frames reached no program, or when listening and no answers came, else 0.

    Raises
    ------
    ValueError
        A place is no recording, folder or class, a recording cannot be used, or an option does not apply to the places.
    """
    places, reading = options.clips, arguments.reading_of(options)
    if options.end is not None and options.end <= options.begin:
        raise ValueError(f"--to: expected more than --from ({options.begin:g}), got {options.end:g}")
    zmq_to = Endpoint.parse(options.zmq, bind=False, to_anybody=options.open) if options.zmq else None
    is_raw = any(place.suffix.lower() == ENDING for place in places)
    if is_raw:
        if len(places) != 1:
            raise ValueError(f"replay: expected one {ENDING} alone, got {len(places)} recordings")
        if options.listen:
            raise ValueError(f"replay: {ENDING} is sent bit for bit: no --listen")
    with ExitStack() as opened:
        keyring = opened.enter_context(Keyring(options.keys)) if options.keys else None
        osc_to = options.osc or (None if zmq_to else arguments.OSC_IN)
        if is_raw:
            return replay(places[0], _senders(opened, osc_to, zmq_to, keyring), options)
        recordings = recordings_in(places, reading)
        read = read_labelled(recordings, reading, options)
        with console.progress_console.status("Reading"):
            first = next(read)
        played = feed.labelled_cues(chain([first], read), options.performer, speed=options.speed, pause=options.pause)
        listener = _listener(options.listen, keyring, to_anybody=options.open) if options.listen else None
        if listener:
            opened.callback(listener.close)
        *_, sender = _senders(opened, osc_to, zmq_to, keyring).values()
        stream = feed.FrameStream(sender, first[0].skeleton.joints)
        exchange = Exchange(stream, listener, options.performer, zmq_to.address if zmq_to else osc_to or "")
        # Ctrl-C, or a recording that cannot be read, does not end the report.
        opened.callback(exchange.report, as_json=options.json)
        with suppress(KeyboardInterrupt):
            if not options.json:
                again = ", again and again" if options.loop else ""
                console.say(f"sending {console.counted(len(recordings), 'recording')}{again}")
            exchange.play(console.progress(played, "Sending", None))
        in_vain = exchange.reached_nobody
    return 1 if in_vain or (listener and not exchange.answered) else 0


def _listener(listen: str, keyring: Keyring | None, *, to_anybody: bool) -> Listener:
    """Open the ZeroMQ endpoint, or HOST:PORT, on which answers come."""
    with opening("--listen"):
        if "://" in listen:
            endpoint = Endpoint.parse(listen, bind=False, to_anybody=to_anybody)
            return Listener(zeromq.ZmqReceiver(endpoint, b"class", keyring=keyring))
        return Listener(osc.OscReceiver(*host_and_port(listen)))


def _senders(opened: ExitStack, osc_to: str | None, zmq_to: Endpoint | None, keyring: Keyring | None) -> Senders:
    """Open a sender for each kind of packets that has an address, ZeroMQ last; wait until its peers have connected."""
    senders: dict[str, feed.FrameSender] = {}
    if osc_to:
        senders["osc"] = feed.OscFrameSender(*host_and_port(osc_to), asks=True)
    if zmq_to:
        with opening("--zmq"):
            senders["zmq"] = feed.ZmqFrameSender(zmq_to, keyring, asks=True)
        time.sleep(_MEETING)
    for sender in senders.values():
        opened.callback(sender.close)
    return senders


def recordings_in(places: Sequence[Path], reading: Reading) -> list[Path | Clip]:
    """List the files to read and the built-in library's motions, place by place, each once."""
    found = [each for place in places for each in _in_place(place)] if places else [*MotionLibrary.builtin().motions]
    if reading != Reading() and not any(isinstance(each, Path) for each in found):
        raise ValueError("replay: expected recordings with --asf, --frame-rate, --unit, --joints, --names, got none")
    return list(dict.fromkeys(found))


def _in_place(place: Path) -> Sequence[Path | Clip]:
    """Give the motions of the built-in library, or of its class of that name, if no path has that name."""
    if place == arguments.BUILT_IN and not place.exists():
        return MotionLibrary.builtin().motions
    if name := arguments.class_at(place):
        return [each for each in MotionLibrary.builtin().motions if each.class_name == name]
    return find_recordings([place])


def read_labelled(
    recordings: Sequence[Path | Clip], reading: Reading, options: argparse.Namespace
) -> Iterator[feed.Labelled]:
    """Read the recordings, one after the other, in a loop for ever; all with the first recording's joints."""
    skeleton: Skeleton | None = None
    reader, teller = RecordingReader(reading), console.NameNotes()
    while True:
        for recording in recordings:
            clip, segments = _read(reader, recording)
            skeleton = skeleton or clip.skeleton
            yield _cut(teller(clip).as_of(skeleton), segments, options)
        if not options.loop:
            return


def _read(reader: RecordingReader, recording: Path | Clip) -> tuple[Clip, Sequence[Segment]]:
    """Read a recording, and the labels next to it if there are any; without labels the clip has its class."""
    if isinstance(recording, Clip):
        return replace(recording, name=recording.name or f"{recording.class_name} {recording.actor}".strip()), ()
    clip, segments = reader.clip(recording), segments_beside(recording)
    return (clip, segments) if segments else (labelled(clip, recording), ())


def _cut(clip: Clip, segments: Sequence[Segment], options: argparse.Namespace) -> feed.Labelled:
    """Give the wanted part of a recording, with the label of each frame's moment, or the recording's class."""
    begin = round(options.begin * clip.frame_rate)
    end = clip.frames if options.end is None else min(round(options.end * clip.frame_rate), clip.frames)
    if begin >= end:
        raise ValueError(f"clip {clip.name!r}: expected --from and --to within its {clip.duration:.2f} s")
    classes = np.full(clip.frames, "" if segments else clip.class_name, dtype=object)
    for each in segments:
        classes[round(each.start * clip.frame_rate) : round(each.end * clip.frame_rate)] = each.label
    part = replace(clip, positions=clip.positions[begin:end], rotations=clip.rotations[begin:end])
    return part, classes[begin:end].tolist()


def replay(path: Path, senders: Senders, options: argparse.Namespace) -> int:
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
    recording, counts = RawFile(path), Counter[str]()
    kinds = [source.partition(" ")[0] for source in recording.header.sources]
    if not {*senders} & {*kinds}:
        raise ValueError(f"{path}: expected --osc or --zmq, because its packets came by {' and '.join(kinds)}")
    # Ctrl-C ends the feed, not the report.
    with suppress(KeyboardInterrupt):
        pace, last = feed.Pace(), 0.0
        for _ in count() if options.loop else range(1):
            start = last
            for due, packet in console.progress(cut(recording.packets(), options.begin, options.end), "Sending", None):
                last, kind = start + due / options.speed, kinds[packet.source]
                pace.wait_for(last)
                if kind in senders:
                    senders[kind].send(b"".join(packet.parts) if kind == "osc" else packet.parts)  # type: ignore[arg-type]  # of one kind
                counts["sent" if kind in senders else "left out"] += 1
            if not counts:
                raise ValueError(_nothing_to_send(recording))
    sent, left_out = counts["sent"], counts["left out"]
    failed, unheard = sum(each.failed for each in senders.values()), sum(each.unheard for each in senders.values())
    if options.json:
        figures = {"sent": sent, "left_out": left_out, "failed": failed, "unheard": unheard}
        console.print_json({**figures, "lost_from": recording.lost_from})
    else:
        counted = f"{failed} refused by the system, {left_out} without an address for their kind"
        lost = [feed.lost_at(str(each), each.unheard) for each in senders.values() if each.unheard]
        for line in (f"{sent} packets sent, {counted}", *lost, *filter(None, [recording.damage()])):
            console.say(line)
    return 1 if unheard and unheard >= sent else 0


def _nothing_to_send(recording: RawFile) -> str:
    """Say why a recording, as cut, has no packets."""
    arrivals = [packet.arrival for packet in recording.packets()]
    why = "no packets in it"
    if arrivals:
        why = f"expected --from and --to within its {arrivals[-1] - arrivals[0]:.2f} s"
    return f"{recording.path}: {'; '.join(filter(None, [why, recording.damage()]))}"


def cut(packets: Iterator[RawPacket], begin: float, end: float | None) -> Iterator[tuple[float, RawPacket]]:
    """Give the packets between two moments, seconds from the first packet, with the time at which each is due."""
    first: float | None = None
    for packet in packets:
        first = packet.arrival if first is None else first
        # A recorder that was held between two looks at a clock dates a packet before the first.
        moment = max(packet.arrival - first, 0.0)
        if end is not None and moment >= end:
            return
        if moment >= begin:
            yield moment - begin, packet


#: Seconds without an answer after which no more are expected.
_LINGER = 0.3
#: Seconds to wait after the last frame, at most.
_MAX_LINGER = 3.0
#: Frames after which it is said that nobody listens.
_SOON = 30
#: Seconds for which a feed may stand still without a note.
_NOTICED = 0.05


class Exchange:
    """One feed that is sent, the answers that come meanwhile, and the report on both."""

    def __init__(self, stream: feed.FrameStream, listener: Listener | None, performer: str, place: str) -> None:
        self._stream, self._sender, self._place, self._listener = stream, stream.sender, place, listener
        # OSC answers name the performer in their address, which cannot hold every character.
        self._performer, self._names = performer, {performer, osc.address_part(performer)}
        #: The answers while each class was performed, and those of them that were right; none has a class at moments
        #: without a label.
        self._answers, self._right = Counter[str](), Counter[str]()
        self._sent = self._received = 0
        self._stood_still = 0.0
        self._performed = ""
        #: The recogniser's classes, once it has listed them.
        self._classes: list[str] = []

    def play(self, cues: Iterable[feed.Cue]) -> None:
        """Send every frame when it is due.

        Each recording is read in the pause before it. When that takes longer the feed stands still, and then goes on
        at its own pace: frames sent all at once to catch up would be no feed.
        """
        pace, recording = feed.Pace(), 0
        for cue in cues:
            if cue.recording != recording:
                recording = cue.recording
                self._stood_still += pace.put_off(cue.due)
            if self._listener:
                self._take_in(self._listener.listen_until(pace.moment(cue.due)))
            else:
                pace.wait_for(cue.due)
            self._stream.send(cue.frame)
            self._sent += 1
            if self._sent == _SOON and self.reached_nobody:
                console.note(f"no program listens at {self._place} so far; start kinespace live there")
            self._performed = cue.class_name
        end = time.perf_counter() + _MAX_LINGER
        while self._listener and time.perf_counter() < end:
            if not self._take_in(self._listener.listen_until(time.perf_counter() + _LINGER)):
                break

    def _take_in(self, received: Sequence[ReceivedPacket]) -> bool:
        """Count the answers that came; say whether one about our performer was among them."""
        self._received += len(received)
        before = self._answers.total()
        for each in received:
            self._classes = classes_in(each.packet) or self._classes
            answer = answer_in(each.packet)
            if answer and answer.performer in self._names:
                self._answers[self._performed] += 1
                self._right[self._performed] += self._performed == answer.label
        return self._answers.total() > before

    @property
    def answered(self) -> bool:
        """Whether any answer came."""
        return bool(self._answers)

    @property
    def reached_nobody(self) -> bool:
        """Whether it is known that no frame reached a program."""
        return bool(self._sent) and self._sender.unheard >= self._sent

    def _silence(self) -> str:
        """Say that no answer came, and list checks."""
        if self._received:
            other = f"{self._received} other packets: do frames reach the recogniser, and can it use their joints?"
            return f"no answers about {self._performer!r} came, but {other}"
        if self.reached_nobody:
            return "no answers came"
        return "no answers came: is a recogniser running, and does it send its answers here?"

    def report(self, *, as_json: bool) -> None:
        """Print the counts and, when listening, the share of right answers."""
        by_class = {name: count for name, count in sorted(self._answers.items()) if name}
        every, unlabelled, right = sum(by_class.values()), self._answers[""], self._right.total()
        # The classes performed that the library lacks; none before the recogniser has listed its own.
        lacking = sorted(by_class.keys() - {*self._classes}) if self._classes else []
        sender = self._sender
        if as_json:
            figures = {"sent": self._sent, "failed": sender.failed, "unheard": sender.unheard, "answers": every}
            share = round(right / every, 4) if every else None
            console.print_json({**figures, "unlabelled": unlabelled, "lacking": lacking, "right": share})
            return
        console.say(f"{self._sent} frames sent, {sender.failed} refused by the system")
        if self._stood_still > _NOTICED:
            console.say(f"the feed stood still for {self._stood_still:.1f} s: a recording took longer to be read")
        if sender.unheard:
            console.say(feed.lost_at(self._place, sender.unheard))
        if self._listener and not self._answers:
            console.say(self._silence())
        elif self._listener:
            rows = [(name, f"{count}", f"{self._right[name] / count:.0%}") for name, count in by_class.items()]
            rows.append(("all", f"{every}", f"{right / every:.0%}" if every else ""))
            rows += [("unlabelled", f"{unlabelled}", "")] if unlabelled else []
            title = "Answers while each class was performed"
            console.console.print(console.table_of(title, ("performed", "answers", "right"), rows))
        if lacking:
            of_time = f"{sum(by_class[name] for name in lacking) / every:.0%} of the labelled time"
            console.say(f"the library lacks {', '.join(lacking)}: {of_time}, and no answer is right")
