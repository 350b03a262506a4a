"""Every kind of file that people's programs write is read right, or refused by a line that says what to do."""

from pathlib import Path

import numpy as np
import pytest
from kinds import KINDS, Kind

from kinespace.library import Clip
from kinespace.library.naming import Naming
from kinespace.library.recordings import Reading, RecordingError, RecordingReader
from kinespace.tools.cli.main import main

AS_THEY_ARE = Naming.asked("as-they-are")
#: Of the many kinds that are the plain body, which are one clip once they are read, the first of each ending; of the
#: others all that are read. Those without names are of 72,000 frames, whose counts `convert` does not write.
PLAIN = {kind.ending: name for name, kind in reversed(KINDS.items()) if kind.is_plain}
WRITTEN = [
    name for name, kind in KINDS.items() if kind.reads and kind.names and (not kind.is_plain or name in PLAIN.values())
]


def read(folder: Path, kind: Kind) -> list[Clip]:
    """Write a file and read it."""
    path = folder / f"take.{kind.ending}"
    path.write_bytes(kind.content)
    return list(RecordingReader(Reading(naming=AS_THEY_ARE, **dict(kind.options))).clips(path))  # type: ignore[arg-type]


@pytest.mark.parametrize("name", KINDS)
def test_every_kind_is_read_right(tmp_path: Path, name: str) -> None:
    """Positions, rate, names and persons are those that were written; what is odd is said, and nothing else is."""
    kind = KINDS[name]
    if not kind.reads:
        with pytest.raises(RecordingError, match=kind.tells):
            read(tmp_path, kind)
        return
    clips = read(tmp_path, kind)
    assert tuple(clip.actor for clip in clips) == kind.people
    for number, clip in enumerate(clips):
        assert clip.frame_rate == pytest.approx(kind.rate, rel=1e-5)
        assert kind.tells in " ".join(clip.notes)
        assert bool(clip.notes) == bool(kind.tells)
        if not kind.names:
            assert clip.frames == 72_000
            continue
        assert {*kind.names} - {*clip.skeleton.joints} == {*kind.lacking}
        there = [joint for joint in kind.names if joint not in kind.lacking]
        found = clip.positions[:, [clip.skeleton.joints.index(joint) for joint in there]]
        expected = kind.body[:, [kind.names.index(joint) for joint in there]] + [1.5 * number, 0, 0]
        if name.startswith("BVH"):
            plain = read(tmp_path, KINDS["BVH, positions of nothing" if "osition" in name else "BVH, plain"])[0]
            expected = plain.positions[:, [plain.skeleton.joints.index(joint) for joint in there]]
        held = expected[kind.frames]
        np.testing.assert_allclose(found if len(found) == len(held) else found[kind.frames], held, atol=kind.near)


@pytest.mark.slow
@pytest.mark.parametrize("name", WRITTEN)
def test_reading_twice_changes_nothing(tmp_path: Path, name: str) -> None:
    """What `convert` writes, .npz and CSV in turn, is read as the same clip: joints by our names, times, positions."""
    kind, unit = KINDS[name], {key: str(value) for key, value in KINDS[name].options}
    path = tmp_path / f"take.{kind.ending}"
    path.write_bytes(kind.content)
    clips = RecordingReader(Reading(**dict(kind.options))).clips(path)  # type: ignore[arg-type]
    out = tmp_path / ("again.csv" if WRITTEN.index(name) % 2 else "again.npz")
    for once in clips:
        who = ["--performer", once.actor] if once.actor else []
        rate = ["--frame-rate", unit["frame_rate"]] if unit else []
        assert main(["convert", str(path), "-o", str(out), "--overwrite", *who, *rate]) == 0
        (again,) = RecordingReader().clips(out)
        assert again.skeleton.joints == once.skeleton.joints
        assert again.frame_rate == pytest.approx(once.frame_rate, rel=1e-9)
        np.testing.assert_allclose(again.positions, once.positions, rtol=6e-9)
        assert not again.notes


@pytest.mark.slow
@pytest.mark.parametrize("name", KINDS)
def test_no_kind_that_is_broken_ends_in_a_traceback(tmp_path: Path, name: str) -> None:
    """Cut off, or with some bytes changed, a file is read or refused by name; a table that lost frames says so."""
    kind, generator = KINDS[name], np.random.default_rng(len(name))
    path = tmp_path / f"take.{kind.ending}"
    for number in range(2):
        content = bytearray(kind.content)
        cut = int(generator.integers(len(content)))
        if number % 2:
            for place in generator.integers(len(content), size=3):
                content[place] = generator.integers(256)
        else:
            del content[cut:]
        path.write_bytes(content)
        try:
            clips = RecordingReader(Reading(naming=AS_THEY_ARE, **dict(kind.options))).clips(path)  # type: ignore[arg-type]
        except RecordingError as error:
            assert str(error).startswith(str(path))  # noqa: PT017 - either is right
        else:
            assert all(np.isfinite(clip.positions).all() for clip in clips)
            if not number % 2 and kind.ending in ("trc", "bvh", "c3d"):
                assert cut >= len(content) or any(clip.notes for clip in clips) or len(kind.content) - cut < 600
