"""Files made to break their readers: cut, changed, repeated, with other words, in every format that can be read.

Some hundred in `make test`; `make fuzz` cuts each file and flips its bits at more than 200 places, and reads 20,000;
`make fuzz FILES=100000` as many as asked.
"""

import io
import os
import resource
import shutil
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from fuzzfeeds import changed
from golden import moments
from programs import REMARK, ROOT
from synthetic import stick_clips
from written import written

from kinespace.library import MotionLibrary
from kinespace.library.recordings.formats.labels import Segment
from kinespace.library.windows import remembered
from kinespace.library.windows.taught import usual_weighing
from kinespace.stream import Outcome, Recognition
from kinespace.stream.feeds import builtin_preset
from kinespace.stream.inputs import kinerec
from kinespace.stream.zeromq.keys import make_keys
from kinespace.tools.cli.main import main
from kinespace.tools.evaluation.annotations import write_annotations
from kinespace.tools.evaluation.harness import Take
from kinespace.tools.evaluation.scores import answered_take

pytestmark = pytest.mark.slow

FILES = int(os.environ.get("FILES", "400"))
#: Seconds for a broken file of some kilobytes on a busy machine, and megabytes, with all that a program imports.
LONGEST, MOST = 20.0, 150
#: As OpenSim writes tables.
_TABLE = "Coordinates\nversion=1\nendheader\ntime"
_TABLE += "".join(f"\t{each}_{axis}" for each in ("hips", "head", "lhand") for axis in "xyz")
_TABLE += "".join(f"\n{moment / 100}" + "\t0.5\t0.7\t0.9" * 3 for moment in range(6))
#: Words that mean something to some reader, or should not.
TELLING = (
    *(b"", b"\0", b"nan", b"-1", b"1e999", b"9" * 5000, b"[" * 3000, b"x" * 70_000, b"\n", b"\r", b"\t"),
    *(b"0", b"-", b'"', b"'", b"{", b"}", b",", b";", b":", b"#", b"="),
    *(b"\xff\xfe", b"\xef\xbb\xbf", b"\xff", b"\xed\xa0\x80", "é\u202e".encode()),
)


def _made(ending: str, name: str = "") -> Callable[[Path], Path]:
    """Write a recording of a made-up body."""
    return lambda folder: written(ending, folder, np.random.default_rng(5), frames=6).path.rename(
        folder / (name or f"take.{ending}")
    )


def _text(name: str, text: str) -> Callable[[Path], Path]:
    def write(folder: Path) -> Path:
        (folder / name).write_text(text, encoding="utf-8")
        return folder / name

    return write


def _annotated(name: str) -> Callable[[Path], Path]:
    """Write what was said of a take."""

    def write(folder: Path) -> Path:
        take = Take(stick_clips(takes=1, frames=20)[0], (Segment(0, 0.03, "a"), Segment(0.03, 0.06, "b")))
        answer = Recognition("p", 0.03, Outcome.NAMED, ("a",), np.ones(1), 0.1)
        said = answered_take(take, take.clip.times, [answer], classes=("a",), known=("a",))
        write_annotations(folder / name, [said])
        return folder / name

    return write


def _converted(folder: Path) -> Path:
    assert main(["convert", str(_made("bvh", "other.bvh")(folder)), "-o", str(folder / "take.npz")]) == 0
    return folder / "take.npz"


def _library(folder: Path) -> Path:
    MotionLibrary.of_clips(stick_clips(takes=1, frames=20)).save(folder / "library.npz")
    return folder / "library.npz"


def _raw(folder: Path) -> Path:
    positions, presets = np.random.default_rng(2).normal(size=(4, 31, 3)), {"vmc": builtin_preset("vmc").text}
    with closing(kinerec.RawWriter(folder / "take.kinerec", ["osc 127.0.0.1:9310"], presets)) as writer:
        for moment, packets in moments("native", positions):
            for packet in packets:
                writer.write(kinerec.RawPacket(moment, 0, "10.0.0.7:5000", (packet,)))
    return folder / "take.kinerec"


def _windows(folder: Path) -> Path:
    """Keep some numbers as those of opened windows are kept."""
    assert _remembered(folder / "windows" / "any") == 2
    return next((folder / "windows").iterdir())


def _remembered(path: Path) -> int:
    """Give 0 when what is kept is read, 2 when it is computed again."""
    builtin, kept, anew = MotionLibrary.builtin(), ((1, "a", np.arange(3.0)), {"b": 0.5}), list[int]()

    def compute() -> tuple[object, ...]:
        anew.append(1)
        return kept

    with mock.patch.object(remembered, "cache_folder", return_value=path.parents[1]):
        found = remembered.remembered(builtin, usual_weighing(builtin), ("a",), compute)
    assert repr(found) == repr(kept)
    if anew:
        print("computed again", file=sys.stderr)  # noqa: T201 - as a program says that it refuses a file
    return 2 * len(anew)


def _own_keys(name: str) -> Callable[[Path], Path]:
    """Make keys; give the file that is broken."""

    def make(folder: Path) -> Path:
        make_keys(folder / "keys", "ann")
        return folder / "keys" / name

    return make


def _info(path: Path) -> list[str]:
    return ["info", str(path), "--json"]


def _built(path: Path) -> list[str]:
    return ["build", "take.bvh", "--labels", str(path), "-o", "made.npz", "--overwrite"]


def _with_keys(path: Path) -> list[str]:
    """Let `live` read keys, and end because its library is missing."""
    return ["live", "--keys", str(path.parent), "--library", "gone.npz"]


def _laid_out(path: Path) -> list[str]:
    """Let `live` read a layout, and end because it may not publish to everybody."""
    return ["live", "--osc-in", "127.0.0.1:0", "--out", str(path), "--zmq-out", "tcp://0.0.0.0:9321"]


#: By kind: a good file, and the arguments of a program that reads it beside the other good files, or a reader's status.
KINDS: dict[str, tuple[Callable[[Path], Path], Callable[[Path], list[str] | int]]] = {
    **{f".{ending}": (_made(ending), _info) for ending in ("bvh", "c3d", "trc", "csv", "amc")},
    **{f".{ending}": (_made("csv", f"take.{ending}"), _info) for ending in ("tsv", "txt")},
    **{f".{ending}": (_text(f"take.{ending}", _TABLE), _info) for ending in ("sto", "mot")},
    ".npz": (_converted, _info),
    ".kinerec": (_raw, _info),
    "library": (_library, _info),
    "skeleton": (
        lambda folder: _made("amc")(folder).with_suffix(".asf"),
        lambda path: ["info", str(path.with_name("take.amc")), "--asf", str(path), "--json"],
    ),
    "labels": (_text("labels.csv", "start_s,end_s,label,performer\n0,0.03,a,\n0.03,0.06,b,\n"), _built),
    "exported labels": (_text("labels.txt", "0.00\t0.03\ta\n0.03\t0.06\tb\n"), _built),
    "annotations of ELAN": (_annotated("labels.eaf"), _built),
    "events of BORIS": (_annotated("labels.boris"), _built),
    "names": (
        _text("names.toml", 'title = "Mine"\nsides = ["L", "R"]\n[joints]\nhips = "root"\n"*Knee" = "*tibia"\n'),
        lambda path: ["info", "take.bvh", "--names", str(path), "--json"],
    ),
    "preset": (_text("preset.toml", builtin_preset("vmc").text), lambda path: ["feeds", str(path)]),
    "layout": (_text("films.toml", (ROOT / "tests" / "support" / "films.toml").read_text(encoding="utf-8")), _laid_out),
    "public key": (_own_keys("ann.key"), _with_keys),
    "secret key": (_own_keys("ann.key_secret"), _with_keys),
    "opened windows": (_windows, _remembered),
    "table of takes": (
        _text("takes.csv", "file,subject,contains,perhaps\ngone.bvh,ann,squat,\n"),
        lambda path: ["evaluate", "stream", "--takes", str(path)],
    ),
}


def broken(whole: bytes, generator: np.random.Generator) -> bytes:
    """Change a file by words that mean something to some reader."""
    return changed(whole, TELLING, generator)


def unpacked_and_broken(whole: bytes, generator: np.random.Generator) -> bytes:
    """Break one array of a zip file, so that no checksum tells it."""
    written = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(whole)) as old, zipfile.ZipFile(written, "w", zipfile.ZIP_DEFLATED) as new:
        names = old.namelist()
        chosen = names[generator.integers(len(names))]
        for name in names:
            held = old.read(name)
            # Mostly the words in front of the numbers.
            front = 130 if generator.random() < 0.7 else len(held)
            new.writestr(name, broken(held[:front], generator) + held[front:] if name == chosen else held)
    return written.getvalue()


def recorded_and_broken(whole: bytes, generator: np.random.Generator) -> bytes:
    """Break one record of a raw recording, with the checksum of what it holds then."""
    records, place = list[bytes](), 0
    while place < len(whole):
        length = int.from_bytes(whole[place : place + 4], "little")
        records.append(whole[place + 8 : place + 8 + length])
        place += 8 + length
    which = int(generator.integers(len(records))) if generator.random() < 0.5 else 0
    records[which] = broken(records[which], generator)
    return b"".join(kinerec._record(record) for record in records)  # noqa: SLF001 - what a writer would write


def cut_and_flipped(whole: bytes, step: int) -> Iterator[bytes]:
    """Cut a file at each byte of its beginning and at 200 places, and flip single bits at 200; every few of these."""
    places = sorted({*range(min(64, len(whole))), *np.linspace(0, len(whole) - 1, 200).astype(int).tolist()})
    for place in places[::step]:
        yield whole[:place]
        yield whole[:place] + bytes([whole[place] ^ 1 << place % 8]) + whole[place + 1 :]


def mutants(name: str, whole: bytes, count: int, seed: int) -> Iterator[bytes]:
    """Give broken files."""
    yield from cut_and_flipped(whole, 1 if FILES > 2000 else 40)
    generator = np.random.default_rng(seed)
    inside = unpacked_and_broken if whole.startswith(b"PK") else recorded_and_broken if name == ".kinerec" else broken
    for number in range(count):
        yield (inside if number % 2 else broken)(whole, generator)


@pytest.mark.parametrize("name", KINDS)
@pytest.mark.timeout(0 if FILES > 2000 else 600)
def test_no_file_ends_in_a_traceback(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A broken file is read, or refused in one line of 300 characters at most; soon, and in little memory."""
    monkeypatch.chdir(tmp_path)
    _made("bvh")(tmp_path)
    make, arguments = KINDS[name]
    path = make(tmp_path)
    kept = path.read_bytes()
    # What the first file loads is no growth.
    if not isinstance(asked := arguments(path), int):
        main(asked)
    capsys.readouterr()
    statuses, before = list[int](), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for number, content in enumerate(mutants(name, kept, FILES // len(KINDS) + 1, seed=len(name))):
        path.write_bytes(content)
        began = time.process_time()
        try:
            asked = arguments(path)
            statuses.append(asked if isinstance(asked, int) else main(asked))
            err = capsys.readouterr().err
            assert statuses[-1] in (0, 2)
            # What is odd about a body that could be read is remarked, a line each.
            refused = [line for line in err.splitlines() if not REMARK.search(line)]
            assert max(map(len, err.splitlines()), default=0) <= 300
            assert len(refused) == (statuses[-1] == 2)
            assert time.process_time() - began < LONGEST
        except BaseException:
            found = tempfile.mkdtemp(prefix="kinespace-fell-")
            shutil.copy(path, found)
            print(f"{name}, file {number}: kept in {found}", file=sys.stderr)  # noqa: T201 - a person looks at it
            raise
    assert 2 in statuses
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < MOST * 1000
