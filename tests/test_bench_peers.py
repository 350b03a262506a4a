"""`kinespace bench peers`: the alternatives compute what they should, and whoever is missing is named."""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec
from typing import TYPE_CHECKING

import numpy as np
import pytest

from library import MotionLibrary, hdm05
from library.distances import distance_rows
from library.signature import Moments, signature_of
from stream.frame import Frame
from stream.recognizer import LiveSignature
from tools.bench import alternatives, peers
from tools.bench.alternatives import AlternativeRecognizer, poses_in_body_frame
from tools.bench.recorded import Feed
from tools.bench.report import Report

if TYPE_CHECKING:
    from library import Clip
    from tools.bench.recorded import Recorded

NAMES = ["SVD of the window", "np.cov + eigh", "ARPACK eigsh", "IncrementalPCA", "DTW", "DTW, 10% band"]
NEEDS = {"IncrementalPCA": "scikit-learn", "DTW": "dtaidistance", "DTW, 10% band": "dtaidistance"}


def of_window(name: str, library: MotionLibrary, clips: tuple[Clip, ...], frames: int) -> alternatives.Alternative:
    """Make an alternative, or skip when what it needs is not there."""
    needs, make = alternatives.makers(library, clips, window=frames / 120, frame_rate=120.0)[name]
    assert needs == NEEDS.get(name, "")
    if not alternatives.is_installed(needs):
        pytest.skip(f"{needs} is not installed")
    return make()


@pytest.mark.parametrize("name", NAMES)
def test_every_peer_finds_a_real_clips_class(name: str, recordings: Recorded) -> None:
    """Shown the whole of a clip, everybody's best score is its class's."""
    library = MotionLibrary.builtin()
    for clip in recordings.examples[::4]:
        alternative = of_window(name, library, recordings.examples, clip.frames)
        for time, positions in zip(clip.times.tolist(), clip.positions, strict=True):
            alternative.push(Frame("me", time, positions))
        scores = alternative.read()
        assert scores.shape == (len(library.classes),)
        assert library.classes[int(np.argmax(scores))] == clip.class_name


@pytest.mark.parametrize("name", NAMES[:3])
def test_the_axis_is_the_windows_leading_eigenvector(name: str, recordings: Recorded) -> None:
    """At every hop of a real take the axis is, up to sign, what the window's covariance has."""
    library = MotionLibrary.builtin()
    alternative = of_window(name, library, (), 120)
    assert isinstance(alternative, alternatives.AxisAlternative)
    feed, compared = Feed(recordings.positions), 0
    for index in range(200):
        alternative.push(feed.next())
        if index >= 120 and index % 16 == 0:
            rows = distance_rows(feed.last(120), library.skeleton)
            exact = signature_of(Moments.of_rows(rows)).axis.vector
            assert abs(exact @ alternative.axis()) == pytest.approx(1.0, abs=1e-6)
            compared += 1
    assert compared == 5


def test_incremental_pca_learns_every_row(recordings: Recorded, monkeypatch: pytest.MonkeyPatch) -> None:
    """However many frames come between two hops, each row is learned once."""
    pytest.importorskip("sklearn")
    library, learned = MotionLibrary.builtin(), []
    alternative = alternatives.IncrementalPca(library, 1.0)
    fit = alternative.model.partial_fit
    monkeypatch.setattr(alternative.model, "partial_fit", lambda rows: (learned.append(rows.copy()), fit(rows)))
    feed = Feed(recordings.positions)
    for count in (150, 4, 4, 70):
        for frame in feed.take(count):
            alternative.push(frame)
        alternative.axis()
    np.testing.assert_array_equal(np.concatenate(learned), distance_rows(feed.last(228), library.skeleton))


def test_a_pose_in_the_bodys_frame_forgets_place_and_heading(recordings: Recorded) -> None:
    """Turned about the vertical and shifted, a pose is the same; bent, it is another."""
    clip = recordings.examples[0]
    plain = poses_in_body_frame(clip.positions, hdm05.SKELETON)
    cosine, sine = np.cos(1.1), np.sin(1.1)
    turn = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
    moved = clip.positions @ turn.T + np.array([1.0, 0.5, -2.0])
    np.testing.assert_allclose(poses_in_body_frame(moved, hdm05.SKELETON), plain, atol=1e-9)
    assert np.abs(plain[0] - plain[clip.frames // 2]).max() > 0.05


def test_answers_come_at_every_hop_or_every_so_many() -> None:
    """The first answer comes with the frame after a whole window, as the recogniser's does, and then at every hop."""

    class Counter:
        needs = ""
        pushed = 0

        def push(self, frame: Frame) -> None:
            del frame
            self.pushed += 1

        def read(self) -> np.ndarray[tuple[int, ...], np.dtype[np.floating]]:
            return np.array([0.2, 0.7])

    feed = Feed(np.zeros((1, 2, 3)))
    for every in (1, 3):
        recognizer = AlternativeRecognizer(Counter(), ("a", "b"), window=10, hop=4, every=every)
        answers = [recognizer.push(frame) for frame in feed.take(60)]
        places = [index for index, answer in enumerate(answers) if answer]
        assert places == list(range(10, 60, 4 * every))
        assert {answer.class_name for answer in answers if answer} == {"b"}
    alternative = Counter()
    recognizer = AlternativeRecognizer(alternative, ("a", "b"), window=10, hop=4)
    recognizer.fill(feed)
    assert alternative.pushed == 10
    assert recognizer.push(feed.next()) is not None


def short(recordings: Recorded) -> Recorded:
    """Give the first labelled seconds of one take, and a clip of each class."""
    take, segments = recordings.takes[0], recordings.segments[0]
    known = next(each for each in segments if each.label in MotionLibrary.builtin().classes)
    first = round(known.start * 120)
    cut = take.moved_to(take.positions[first : first + 360])
    labelled = (replace(known, start=0.0, end=3.0),)
    return replace(recordings, clips=recordings.examples, takes=(cut,), segments=(labelled,))


def test_everybody_is_timed_and_scored(recordings: Recorded) -> None:
    """Ours come first with a ratio of one to themselves; all have speed, ratios and accuracy."""
    found = peers.measure(short(recordings), rounds=1, asking=1e6)
    installed = [name for name in NAMES if alternatives.is_installed(NEEDS.get(name, ""))]
    assert [peer.name for peer in found.peers] == [*LiveSignature, *installed]
    for peer in found.peers:
        assert peer.frames_per_second == pytest.approx(1e6 / peer.us_per_frame)
        assert set(peer.ratios) == set(LiveSignature)
        assert all(ratio > 0 for ratio in peer.ratios.values())
        assert peer.accuracy is not None
        assert 0 <= peer.accuracy <= 1
        assert peer.every == 1
    by_name = {peer.name: peer for peer in found.peers}
    for signature in LiveSignature:
        assert found.ratio(signature, signature) == 1.0
    # The same computation, only slower: its accuracy is the paper's signature's.
    ours, svd = by_name[LiveSignature.EIGENVECTOR], by_name["SVD of the window"]
    assert svd.accuracy == pytest.approx(ours.accuracy, abs=0.02)
    assert found.ratio("somebody", LiveSignature.WINDOWS) is None


@pytest.mark.parametrize("package", ["scikit-learn", "dtaidistance"])
def test_a_missing_peer_is_named(package: str, recordings: Recorded, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is not installed is not raced; the report says who is missing and what it needs; its figure is null."""
    module = {"scikit-learn": "sklearn"}.get(package, package)
    monkeypatch.setattr(alternatives, "find_spec", lambda name: None if name == module else find_spec(name))
    found = peers.measure(short(recordings), rounds=1, asking=0.01)
    lacking = [name for name, needs in NEEDS.items() if needs == package]
    assert set(lacking) <= set(found.missing)
    assert not {peer.name for peer in found.peers} & set(lacking)
    report = Report(LiveSignature.EIGENVECTOR, peers=found)
    told = "\n".join(report.all_notes())
    for name in lacking:
        assert f"{name}: not measured, needs {package}: pip install kinespace[bench]" in told
    key = {"scikit-learn": "ratio_incremental_pca", "dtaidistance": "ratio_dtw_band"}[package]
    assert report.figures()[key] is None
    assert report.figures()["ratio_svd"] is not None
