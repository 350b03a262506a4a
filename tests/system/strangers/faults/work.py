"""All that writes files, while the n-th call that writes fails, once or from then on; run with the shim loaded.

Prints for each work the calls that it makes, and everything that is other than promised.
"""

import ctypes
import json
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import closing, redirect_stderr, redirect_stdout, suppress
from dataclasses import replace
from io import StringIO
from pathlib import Path

import mido
import numpy as np

from kinespace.library import MotionLibrary
from kinespace.library.windows import remembered
from kinespace.stream import Event, EventKind, Frame, osc
from kinespace.stream.inputs.kinerec import RawFile, RawPacket, RawWriter
from kinespace.stream.outputs.midi_sink import MidiSink
from kinespace.stream.teaching.examples import Example, Roster
from kinespace.stream.zeromq.keys import make_keys
from kinespace.tools.cli.main import main
from kinespace.tools.teaching import roster_file

#: A work: it prepares a folder, then does its work among faults, then, without them, says what is wrong.
Work = Callable[[Path], Iterator[str]]

_FAULTS = ctypes.CDLL(None).faults
_FAULTS.argtypes = ctypes.c_char_p, ctypes.c_long, ctypes.c_long
_ALWAYS = 1 << 40
_MOTION = MotionLibrary.builtin().motions[0]
#: As little as is written as a motion.
_SHORT = _MOTION.moved_to(_MOTION.positions[:30])
#: Seconds in which something that is tried fifty times a second is tried again; what is not saved then is at the end.
_A_MOMENT = 0.1
_PACKETS, _NOTES = 20, 10


def _two() -> MotionLibrary:
    motions = [replace(_SHORT, class_name=name, take=f"{n:04d}") for n, name in enumerate(("bow", "wave"), start=1)]
    return MotionLibrary.of_clips(motions)


def teaching(folder: Path) -> Iterator[str]:
    """Teach an example and rename a class: both are there, or it was said that they are not."""
    path = folder / "mine.npz"
    _two().save(path)
    yield ""
    with suppress(OSError):
        file = roster_file.RosterFile(path)
        roster = Roster.of_library(_two()).with_example(Example(3, "kick", _SHORT, 0.0, _SHORT.duration))
        for newest in (roster, roster.renamed("kick", "jump")):
            file.save(newest)
            until = time.monotonic() + _A_MOMENT
            while file.has_unsaved and time.monotonic() < until:
                time.sleep(0.002)
        file.close()
        yield ""
        classes, said = MotionLibrary.load(path).classes, [each.reason for each in file.states()]
        if not file.has_unsaved and classes != ("bow", "jump", "wave"):
            yield f"{classes}, and it was not said: {said}"
        if file.has_unsaved and not any("not saved" in each for each in said):
            yield f"not said: {said}"
    yield ""
    if not {"bow", "wave"} <= {*MotionLibrary.load(path).classes}:
        yield "what was taught before is lost"


def building(folder: Path) -> Iterator[str]:
    """Write a library over another one: the old or the new one is there, and nothing else."""
    path, other = folder / "mine.npz", MotionLibrary.of_clips([replace(_SHORT, class_name="new")])
    _two().save(path)
    yield ""
    failed = False
    try:
        other.save(path)
    except OSError:
        failed = True
    yield ""
    if MotionLibrary.load(path).classes != (("bow", "wave") if failed else ("new",)) or len([*folder.iterdir()]) > 1:
        yield f"failed: {failed}, {MotionLibrary.load(path).classes}, {[*folder.iterdir()]}"


def labelling(folder: Path) -> Iterator[str]:
    """Propose labels over those that a person has written: the old or the new ones are there, and nothing else."""
    path, source = folder / "labels.csv", folder / "a.kinerec"
    path.write_text("by hand", encoding="utf-8")
    with closing(RawWriter(source, ["osc 127.0.0.1:1"])) as writer:
        for number, posture in enumerate(_MOTION.positions):
            packet = osc.encode_frame(Frame("ann", 1.0 + number / _MOTION.frame_rate, posture))
            writer.write(RawPacket(number / _MOTION.frame_rate, 0, "", (packet,)))
    yield ""
    with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
        status = main(["cut", str(source), "-o", str(path), "--overwrite"])
    yield ""
    content = path.read_text(encoding="utf-8")
    there = {each.name for each in folder.iterdir()}
    if (content == "by hand") != (status == 2) or there != {path.name, source.name}:
        yield f"{status}, {content!r}, {there}"


def recording(folder: Path) -> Iterator[str]:
    """Keep packets: those that are counted as written can be read, and the others are counted, too."""
    path = folder / "a.kinerec"
    yield ""
    try:
        writer = RawWriter(path, ["osc 127.0.0.1:1"])
    except OSError:
        yield ""
        yield "an empty file stays" if path.exists() else ""
        return
    for number in range(_PACKETS):
        writer.write(RawPacket(float(number), 0, "", (bytes([number]),)))
    writer.close()
    yield ""
    file = RawFile(path)
    read = len([*file.packets()])
    if read != writer.written or read + writer.failed != _PACKETS or file.lost:
        yield f"{read} read, {writer.written} written, {writer.failed} failed, {file.lost} bytes lost"


def keys(folder: Path) -> Iterator[str]:
    """Make pairs of keys: each is whole or not there, and can be made then."""
    yield ""
    with suppress(OSError):
        make_keys(folder, "ann")
    yield ""
    there = [(folder / name).exists() for name in ("ann.key", "ann.key_secret")]
    if any(there) and not all(there):
        yield "half of a pair of keys"
    elif not all(there):
        make_keys(folder, "ann")
    yield "a secret can be read" if any(each.stat().st_mode & 0o077 for each in folder.glob("*_secret")) else ""


def cache(folder: Path) -> Iterator[str]:
    """Keep numbers: they are given all the same, and what is kept is believed rightly."""
    remembered.cache_folder = lambda: folder
    numbers, library = (np.arange(5), 3.0), MotionLibrary.builtin()
    yield ""
    found = [remembered.remembered(library, 0, library.skeleton.joints, lambda: numbers)]
    yield ""
    found.append(remembered.remembered(library, 0, library.skeleton.joints, lambda: numbers))
    if any(each[0].tolist() != numbers[0].tolist() or each[1] != numbers[1] for each in found):
        yield str(found)


def midi(folder: Path) -> Iterator[str]:
    """Play notes: they are in the file, or the sink says that some are not."""
    path = folder / "take.mid"
    yield ""
    try:
        sink = MidiSink(str(path))
    except OSError:
        yield ""
        return
    for _ in range(_NOTES):
        sink.send(Event("ann", EventKind.START, "bow", 0, 0.5, 1.0))
    sink.close()
    yield ""
    content = path.read_bytes()
    notes = len([each for each in mido.MidiFile(path) if not each.is_meta]) if content or not sink.is_behind else 0
    if notes < _NOTES and not sink.is_behind:
        yield f"{notes} notes, behind: {sink.is_behind}"


def _tried(work: Work, first: int, last: int) -> tuple[int, list[str]]:
    """Do a work with faults; give the number of calls, and what is wrong."""
    with tempfile.TemporaryDirectory() as place:
        steps = work(Path(place))
        next(steps)
        _FAULTS(place.encode(), first, last)
        wrong = [next(steps)]
        calls = _FAULTS(b"", 0, 0)
        return calls, [each for each in (*wrong, *steps) if each]


def _main() -> None:
    """Do every work with each of its calls failing."""
    roster_file._AGAIN, roster_file._TOGETHER, roster_file._LOOK, roster_file._QUIET = 0.02, 0.0, 0.005, 0.02  # noqa: SLF001
    found = {}
    for work in (teaching, building, labelling, recording, keys, cache, midi):
        # First without a fault: so many calls there are. Threads may make a few more.
        calls, wrong = _tried(work, 0, 0)
        for number in range(1, calls + 3):
            for last, further in ((number, ""), (_ALWAYS, " and all after it")):
                _, said = _tried(work, number, last)
                wrong += [f"call {number}{further}: {each}" for each in said]
        found[work.__name__] = {"calls": calls, "wrong": wrong}
    sys.stdout.write(json.dumps(found))


if __name__ == "__main__":
    _main()
