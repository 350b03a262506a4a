"""`kinespace replay`: sends recordings, or motions of the built-in library, as a fake live feed, and scores answers."""

from __future__ import annotations

import json
import time
from collections import Counter
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field, replace
from itertools import chain, pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from kinespace.library import Clip, MotionLibrary, Reading, find_recordings
from kinespace.library.formats.labels import labels_beside, read_labels
from kinespace.library.recordings import RecordingReader, labelled
from kinespace.stream import osc, zeromq
from kinespace.stream.frame import Announcement
from kinespace.stream.recording.kinerec import ENDING
from kinespace.stream.zeromq import Endpoint, Keyring
from kinespace.tools.cli.address import host_and_port
from kinespace.tools.cli.arguments import (
    BUILT_IN,
    OSC_IN,
    add_json,
    add_keys,
    add_reading,
    not_negative,
    positive,
    reading_of,
    share,
)
from kinespace.tools.feeding import packets
from kinespace.tools.feeding.feed import (
    ANNOUNCE_EVERY,
    OscFrameSender,
    Pace,
    Piece,
    ZmqFrameSender,
    piece_cues,
    with_drops,
    with_jitter,
    with_reordering,
)
from kinespace.tools.feeding.prefetch import ReadAhead
from kinespace.tools.loopback.answer_listener import Listener, answer_in
from kinespace.tools.terminal.console import console, printable, progress_console
from kinespace.tools.terminal.named_joints import NameTeller
from kinespace.tools.terminal.tables import add_names

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterable, Iterator, Sequence

    from kinespace.library.formats.labels import Segment
    from kinespace.library.skeleton import Skeleton
    from kinespace.tools.feeding.feed import Cue, FrameSender
    from kinespace.tools.loopback.answer_listener import Heard

#: Seconds without an answer after which no more are expected, and seconds to wait after the last frame, at most.
_LINGER, _MAX_LINGER = 0.3, 3.0
#: Seconds for ZeroMQ peers to connect before the first frame; a peer that connects later loses the first messages.
_MEETING = 0.5
#: Characters of the columns beside classes' names.
_BESIDE_CLASSES = 24
#: Seconds for which a feed may stand still without a note.
_NOTICED = 0.05


@dataclass(frozen=True, slots=True)
class Course:
    """How recordings are played: performer, speed, pause, loop, and the part of each recording (seconds)."""

    performer: str
    speed: float = 1.0
    pause: float = 1.0
    loop: bool = False
    begin: float = 0.0
    end: float | None = None

    def __post_init__(self) -> None:
        if self.end is not None and self.end <= self.begin:
            raise ValueError(f"--to: expected more than --from ({self.begin:g}), got {self.end:g}")


@dataclass(frozen=True, slots=True)
class Faults:
    """Faults of the feed, drawn from a seed.

    Attributes
    ----------
    drop, reorder
        Shares of the frames, 0 to 1, that are dropped or change places with the next frame.
    jitter
        Seconds by which frames may be late.
    """

    drop: float = 0.0
    jitter: float = 0.0
    reorder: float = 0.0
    seed: int = 0

    def applied(self, cues: Iterator[Cue]) -> Iterator[Cue]:
        """Apply the faults to a feed."""
        generator = np.random.default_rng(self.seed)
        if self.drop:
            cues = with_drops(cues, self.drop, generator)
        if self.reorder:
            cues = with_reordering(cues, self.reorder, generator)
        if self.jitter:
            cues = with_jitter(cues, self.jitter, generator)
        return cues


@dataclass(slots=True)
class Score:
    """The share of right answers while each class was performed.

    Attributes
    ----------
    answers, right
        By class.
    unlabelled
        Answers at moments without a label.
    """

    answers: Counter[str] = field(default_factory=Counter)
    right: Counter[str] = field(default_factory=Counter)
    unlabelled: int = 0

    def add(self, performed: str, label: str) -> None:
        """Count one answer."""
        if not performed:
            self.unlabelled += 1
            return
        self.answers[performed] += 1
        self.right[performed] += performed == label

    @property
    def heard(self) -> int:
        """The number of answers, at labelled moments and others."""
        return self.answers.total() + self.unlabelled

    def share(self) -> float | None:
        """Give the share of answers that was right; None without any."""
        return self.right.total() / self.answers.total() if self.answers else None

    def table(self) -> Table:
        """Draw the shares by class, and of all answers."""
        table = Table(title="Answers while each class was performed", title_justify="left")
        add_names(table, "performed", self.answers, beside=_BESIDE_CLASSES)
        table.add_column("answers", justify="right")
        table.add_column("right", justify="right")
        for performed, answers in sorted(self.answers.items()):
            table.add_row(performed, f"{answers}", f"{self.right[performed] / answers:.0%}")
        table.add_section()
        table.add_row("all", f"{self.answers.total()}", "" if self.share() is None else f"{self.share():.0%}")
        if self.unlabelled:
            table.add_row("unlabelled", f"{self.unlabelled}", "")
        return table


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.description = (
        "Sends recordings as live packets on an absolute schedule. With --listen it hears the answers and prints the "
        "share that was right; a clip's class is in its name (HDM05) or is its folder's name. Of a take beside which a "
        "file of labels lies, called like it, the class is the label of the moment. Exit status: 0 sent (and, with "
        "--listen, answered), 1 with --listen and without any answer, 2 could not be done."
    )
    parser.add_argument(
        "clips",
        nargs="*",
        type=Path,
        metavar="CLIP|CLASS",
        help="recordings, folders of them, or classes of the built-in library, whose motions are played; or one "
        ".kinerec (default: built-in, all its motions)",
    )
    add_reading(parser)
    parser.add_argument("--osc", metavar="HOST:PORT", help=f"send OSC there (default {OSC_IN})")
    parser.add_argument(
        "--zmq", metavar="ENDPOINT", help="publish on ZeroMQ instead; connects, put @ before it to bind"
    )
    parser.add_argument("--listen", metavar="ADDRESS", help="HOST:PORT or ZeroMQ endpoint where the answers come")
    add_keys(parser)
    parser.add_argument("--performer", default="replay", help="name of the performer (default %(default)s)")
    parser.add_argument("--speed", type=positive, default=1.0, help="times as fast as recorded (default %(default)s)")
    parser.add_argument("--pause", type=not_negative, default=1.0, help="seconds between clips (default %(default)s)")
    parser.add_argument("--from", type=not_negative, default=0.0, dest="begin", metavar="S", help="begin there")
    parser.add_argument("--to", type=positive, dest="end", metavar="S", help="end there, seconds of each recording")
    parser.add_argument("--loop", action="store_true", help="begin again after the last clip, until Ctrl-C")
    parser.add_argument("--drop", type=share, default=0.0, metavar="SHARE", help="lose this share of frames")
    parser.add_argument("--jitter-ms", type=not_negative, default=0.0, metavar="MS", help="delay frames by up to this")
    parser.add_argument("--reorder", type=share, default=0.0, metavar="SHARE", help="swap this share with the next")
    parser.add_argument("--seed", type=int, default=0, help="seed of the faults (default %(default)s)")
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Run the program with these options; return the exit status."""
    return play(
        options.clips,
        reading=reading_of(options),
        osc_to=options.osc or (None if options.zmq else OSC_IN),
        zmq_to=options.zmq,
        listen=options.listen,
        keys=options.keys,
        course=Course(
            options.performer,
            speed=options.speed,
            pause=options.pause,
            loop=options.loop,
            begin=options.begin,
            end=options.end,
        ),
        faults=Faults(drop=options.drop, jitter=options.jitter_ms / 1000, reorder=options.reorder, seed=options.seed),
        as_json=options.json,
    )


def play(
    places: Sequence[Path],
    *,
    reading: Reading,
    osc_to: str | None,
    zmq_to: str | None,
    listen: str | None,
    course: Course,
    faults: Faults,
    as_json: bool,
    keys: Path | None = None,
) -> int:
    """Send the recordings; with `listen`, print the share of right answers.

    Parameters
    ----------
    places
        Recordings, folders of them, and classes of the built-in library; all its motions when there are none.
    reading
        How to read recordings.
    osc_to, zmq_to, listen
        Where frames go, and where answers come in.
    course, faults
        How they are played, and the faults.
    as_json
        Print one JSON object and nothing else.
    keys
        Folder of the keys of the other ends of ZeroMQ; None for none.

    Returns
    -------
    The exit status: 1 when listening and no answers came, else 0.

    Raises
    ------
    ValueError
        A place is no recording, folder or class, a recording cannot be used, or an option does not apply to the places.
    """
    raw = [place for place in places if place.suffix.lower() == ENDING]
    if raw:
        return _run_raw(
            places,
            osc_to=osc_to,
            zmq_to=zmq_to,
            listen=listen,
            keys=keys,
            course=course,
            faults=faults,
            json=as_json,
        )
    recordings = _to_play(places, reading)
    with ExitStack() as opened:
        keyring = opened.enter_context(Keyring(keys)) if keys else None
        pieces = opened.enter_context(ReadAhead(_pieces(recordings, reading, course)))
        with progress_console.status("Reading"):
            first = next(iter(pieces))
        announcement = Announcement(course.performer, first.clip.skeleton.joints)
        played = piece_cues(chain([first], pieces), course.performer, speed=course.speed, pause=course.pause)
        listener = _listener(listen, keyring) if listen else None
        if listener:
            opened.callback(listener.close)
        sender = _sender(osc_to, zmq_to, keyring)
        opened.callback(sender.close)
        replaying = _Replay(sender, listener, announcement)
        # Ctrl-C, or a recording that cannot be read, does not end the report.
        opened.callback(replaying.report, as_json=as_json)
        with suppress(KeyboardInterrupt):
            if zmq_to:
                time.sleep(_MEETING)
            replaying.play(_shown(faults.applied(played), None if course.loop else len(recordings)), pieces)
    return 0 if replaying.answered or not listener else 1


def _to_play(places: Sequence[Path], reading: Reading) -> list[Path | Clip]:
    """List the files to read and the built-in library's motions, place by place, each once."""
    found = [each for place in places for each in _in_place(place)] if places else [*MotionLibrary.builtin().motions]
    if reading != Reading() and not any(isinstance(each, Path) for each in found):
        raise ValueError(
            "replay: expected recordings with --asf, --frame-rate, --unit, --joints, --names, got none to read"
        )
    return list(dict.fromkeys(found))


def _in_place(place: Path) -> Sequence[Path | Clip]:
    """Give the motions of the built-in library, or of its class of that name, if no path has that name."""
    motions = () if place.exists() else MotionLibrary.builtin().motions
    return [each for each in motions if place == BUILT_IN or each.class_name == str(place)] or find_recordings([place])


def _pieces(recordings: Sequence[Path | Clip], reading: Reading, course: Course) -> Iterator[Piece]:
    """Read the recordings, one after the other, in a loop for ever; all with the first recording's joints."""
    skeleton: Skeleton | None = None
    teller = NameTeller()
    with RecordingReader(reading) as reader:
        while True:
            for recording in recordings:
                for piece in _cut(_read(reader, recording), course.begin, course.end):
                    skeleton = skeleton or piece.clip.skeleton
                    yield Piece(piece.start, teller(piece.clip).as_of(skeleton))
            if not course.loop:
                return


def _read(reader: RecordingReader, recording: Path | Clip) -> Iterator[Clip]:
    """Read a recording in consecutive pieces, each of one class, by labels beside the recording if there are any."""
    if isinstance(recording, Clip):
        yield replace(recording, name=recording.name or f"{recording.class_name} {recording.actor}".strip())
        return
    labels = labels_beside(recording)
    segments, start = read_labels(labels) if labels else (), 0
    for clip in reader.pieces(recording):
        if not segments:
            yield labelled(clip, recording)
            continue
        yield from _by_label(clip, start, segments)
        start += clip.frames


def _by_label(clip: Clip, start: int, segments: Sequence[Segment]) -> Iterator[Clip]:
    """Divide a clip, whose first frame is a recording's frame `start`, where labels begin and end."""
    spans = [(round(each.start * clip.frame_rate), round(each.end * clip.frame_rate), each.label) for each in segments]
    ends = (place - start for span in spans for place in span[:2])
    places = sorted({0, clip.frames, *(place for place in ends if 0 < place < clip.frames)})
    for first, last in pairwise(places):
        label = next((label for begin, end, label in spans if begin <= start + first < end), "")
        yield replace(
            clip, positions=clip.positions[first:last], rotations=clip.rotations[first:last], class_name=label
        )


def _shown(cues: Iterable[Cue], recordings: int | None) -> Iterator[Cue]:
    """Pass cues through and show on a terminal which recording is sent, and of how many (None: endless)."""
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=progress_console, transient=True, disable=not progress_console.is_terminal) as bar:
        task, shown = bar.add_task("Sending", total=recordings), -1
        for cue in cues:
            if cue.recording != shown:
                shown = cue.recording
                told = f"{shown + 1} of {recordings}" if recordings else f"{shown + 1}"
                bar.update(task, completed=shown, description=f"Sending {told}: {escape(printable(cue.name))}")
            yield cue


def _run_raw(
    places: Sequence[Path],
    *,
    osc_to: str | None,
    zmq_to: str | None,
    listen: str | None,
    keys: Path | None,
    course: Course,
    faults: Faults,
    json: bool,
) -> int:
    """Send a raw recording; options that would change its packets, or need their contents, are refused."""
    if len(places) != 1:
        raise ValueError(f"replay: expected one {ENDING} alone, got {len(places)} recordings")
    if listen or faults != Faults(seed=faults.seed):
        raise ValueError(f"replay: {ENDING} is sent bit for bit: no --listen, --drop, --jitter-ms or --reorder")
    return packets.replay(
        places[0],
        osc_to=osc_to,
        zmq_to=zmq_to,
        keys=keys,
        speed=course.speed,
        loop=course.loop,
        begin=course.begin,
        end=course.end,
        as_json=json,
    )


def _cut(clips: Iterable[Clip], begin: float, end: float | None) -> Iterator[Piece]:
    """Give the part of a recording between two moments, seconds from its start; only this part is read."""
    start = given = 0
    clip: Clip | None = None
    for clip in clips:
        first, last = round(begin * clip.frame_rate), None if end is None else round(end * clip.frame_rate)
        here = slice(max(first - start, 0), None if last is None else max(last - start, 0))
        start += clip.frames
        if len(positions := clip.positions[here]):
            yield Piece(given, replace(clip, positions=positions, rotations=clip.rotations[here]))
            given += len(positions)
        if last is not None and start >= last:
            break
    if clip and not given:
        raise ValueError(f"clip {clip.name!r}: expected --from and --to within its {start / clip.frame_rate:.2f} s")


class _Replay:
    """One feed with its answers."""

    def __init__(self, sender: FrameSender, listener: Listener | None, announcement: Announcement) -> None:
        self._sender = sender
        self._listener = listener
        self._announcement = announcement
        # OSC answers name the performer in their address, which cannot hold every character.
        self._names = {announcement.performer, osc.address_part(announcement.performer)}
        self._score = Score()
        self._sent = self._heard = 0
        self._stood_still = 0.0
        self._performed = ""

    def play(self, cues: Iterable[Cue], pieces: ReadAhead[Piece]) -> None:
        """Send every frame when it is due, the skeleton before the first and every second.

        When a recording is not read in time the feed stands still, and then goes on at its own pace: frames sent all at
        once to catch up would be no feed.
        """
        pace, next_announcement, waited = Pace(), 0.0, pieces.waited
        for cue in cues:
            if pieces.waited > waited:
                late = min(time.perf_counter() - pace.moment(cue.due), pieces.waited - waited)
                waited = pieces.waited
                self._stood_still += pace.put_off(max(late, 0.0))
            if cue.due >= next_announcement:
                self._sender.announce(self._announcement)
                next_announcement = cue.due + ANNOUNCE_EVERY
            packet = self._sender.encode(cue)
            self._wait(pace, cue.due)
            self._sender.send(packet)
            self._sent += 1
            self._performed = cue.class_name
        end = time.perf_counter() + _MAX_LINGER
        while self._listener and time.perf_counter() < end:
            if not self._hear(self._listener.listen_until(time.perf_counter() + _LINGER)):
                break

    def _wait(self, pace: Pace, due: float) -> None:
        if self._listener:
            self._hear(self._listener.listen_until(pace.moment(due)))
        else:
            pace.wait_for(due)

    def _hear(self, heard: Sequence[Heard]) -> bool:
        """Count the answers that came; say whether one about our performer was among them."""
        self._heard += len(heard)
        before = self._score.heard
        for each in heard:
            answer = answer_in(each.packet)
            if answer and answer.performer in self._names:
                self._score.add(self._performed, answer.label)
        return self._score.heard > before

    @property
    def answered(self) -> bool:
        """Whether any answer was heard."""
        return bool(self._score.heard)

    def _silence(self) -> str:
        """Say that no answer came, and what to check."""
        if self._heard:
            return (
                f"no answers about {self._announcement.performer!r} heard, but {self._heard} other packets: do the "
                "frames reach the recogniser, and can it use their joints? It counts and shows both"
            )
        return "no answers heard: is a recogniser running, and does it send its answers here?"

    def report(self, *, as_json: bool) -> None:
        """Print the counts and, when listening, the share of right answers."""
        score = self._score
        if as_json:
            share = score.share()
            figures = {"sent": self._sent, "failed": self._sender.failed, "answers": score.answers.total()}
            figures |= {"unlabelled": score.unlabelled} if score.unlabelled else {}
            print(json.dumps({**figures, "right": None if share is None else round(share, 4)}))
            return
        console.print(f"{self._sent} frames sent, {self._sender.failed} the system would not take")
        if self._stood_still > _NOTICED:
            console.print(f"the feed stood still for {self._stood_still:.1f} s: a recording took longer to be read")
        if self._listener and not score.heard:
            console.print(self._silence(), soft_wrap=True)
        elif self._listener:
            console.print(score.table())


def _listener(address: str, keyring: Keyring | None) -> Listener:
    if "://" in address:
        endpoint = Endpoint.parse(address, bind=False)
        return Listener(zeromq.ZmqReceiver(endpoint, b"class/", keyring=keyring))
    return Listener(osc.OscReceiver(*host_and_port(address)))


def _sender(osc_to: str | None, zmq_to: str | None, keyring: Keyring | None) -> FrameSender:
    if zmq_to:
        return ZmqFrameSender(Endpoint.parse(zmq_to, bind=False), keyring)
    return OscFrameSender(*host_and_port(osc_to or ""))
