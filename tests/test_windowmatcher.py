"""Live recognition by windows, against its slow twin at every hop, and what its settings do."""

from __future__ import annotations

import math
from itertools import combinations, pairwise
from typing import TYPE_CHECKING, NamedTuple

import naive
import naive_live
import numpy as np
import pytest
from naive_live import NaiveBody, NaiveMetric

from library.distances import distance_rows
from library.labels import read_labels
from library.motionlibrary import MotionLibrary
from library.recordings import read_recordings
from stream.recognition import Outcome
from stream.windowmatcher import WindowMatcher

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from library.clip import Clip
    from stream.matcher import Reading

#: Everything holds of the compiled loops and of numpy.
pytestmark = pytest.mark.usefixtures("arithmetic")

STILLNESS, SENSITIVITY = 0.01, 0.1
RATE = 60


class Feed(NamedTuple):
    """A performance at 60 frames per second: positions and distance rows."""

    times: np.ndarray
    positions: np.ndarray
    rows: np.ndarray


class Hop(NamedTuple):
    """When the matcher was asked, and what it said."""

    time: float
    reading: Reading

    @property
    def distances(self) -> np.ndarray:
        """The log distances that the scores were made of."""
        return np.log(1 / self.reading.scores - 1)


@pytest.fixture(scope="module")
def anybody() -> MotionLibrary:
    """Give the built-in library: several people's."""
    return MotionLibrary.builtin()


@pytest.fixture(scope="module")
def one_person(some_clips: tuple[Clip, ...], anybody: MotionLibrary) -> MotionLibrary:
    """Build a library of one person's clips, one of each class."""
    assert anybody.windows is not None
    assert len({clip.actor for clip in some_clips}) == 1
    return MotionLibrary.of_clips(some_clips, comparison=anybody.windows.comparison)


@pytest.fixture(scope="module")
def feed(cmu_folder: Path) -> Feed:
    """Perform a stretch of a take that holds known and unknown motions, stop dead for a while, and go on."""
    (take,) = read_recordings([cmu_folder / "13_29.amc"])
    labels = {segment.label for segment in read_labels(cmu_folder / "13_29.csv") if 8 <= segment.start < 17}
    assert labels == {"ArmCircle", "ToeTouchOneHand"}
    moving = take.positions[8 * 120 : 20 * 120 : 2]
    still = np.repeat(moving[-1:], round(1.6 * RATE), axis=0)
    positions = np.concatenate([moving, still, take.positions[-4 * 120 :: 2]])
    return Feed(10.0 + np.arange(len(positions)) / RATE, positions, distance_rows(positions, take.skeleton))


def _matcher(
    library: MotionLibrary, *, sensitivity: float = SENSITIVITY, stillness: float = STILLNESS
) -> WindowMatcher:
    assert library.windows is not None
    return WindowMatcher(library.windows, stillness=stillness, sensitivity=sensitivity)


def _hops(matcher: WindowMatcher, feed: Feed, every: int = 2) -> list[Hop]:
    """Push a feed, and ask at every so many frames."""
    hops = []
    for index, (time, row) in enumerate(zip(feed.times.tolist(), feed.rows, strict=True)):
        matcher.push([time], row[None])
        if matcher.ready and index % every == 0:
            hops.append(Hop(time, matcher.read()))
    return hops


def _twin_groups(library: MotionLibrary) -> list[list[NaiveMetric]]:
    assert library.windows is not None
    metrics = library.windows.comparison.metrics
    return [
        [
            NaiveMetric(
                str(measure.kind),
                measure.seconds,
                metrics[measure].origin.astype(float),
                metrics[measure].axes.astype(float),
                metrics[measure].outside,
                weight,
            )
            for measure, weight in group
        ]
        for group in library.windows.groups
    ]


def _twin_distances(library: MotionLibrary, feed: Feed, asked: Sequence[float]) -> list[list[float]]:
    """Let the twin measure and compare the windows that end at some times, from positions alone."""
    table = library.windows
    assert table is not None
    pairs = list(combinations(range(len(library.skeleton.joints)), 2))
    body, groups = NaiveBody(pairs, library.skeleton.parents), _twin_groups(library)
    vectors, classes = [each.astype(float) for each in table.vectors], table.classes[table.motions]
    actors = table.actors[table.motions]
    found = []
    for now in asked:
        measures = [
            [
                (
                    metric,
                    body.measured(
                        metric.kind,
                        naive_live.last_rows(feed.times, feed.rows, now, metric.seconds),
                        table.comparison.basis.directions,
                    ),
                )
                for metric in group
            ]
            for group in groups
        ]
        found.append(naive_live.log_distances(measures, vectors, classes, actors))
    return found


# --- against the twin --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["anybody", "one_person"])
def test_distances_are_the_twins_at_every_hop(name: str, feed: Feed, request: pytest.FixtureRequest) -> None:
    """Of a real take, stops and all, each class's averaged log distance at each hop is the twin's from all anew."""
    library: MotionLibrary = request.getfixturevalue(name)
    assert feed.rows[::97] == pytest.approx(
        naive.distance_rows(feed.positions[::97], list(combinations(range(31), 2))), abs=1e-12
    )
    hops = _hops(_matcher(library), feed, every=7)
    times = [hop.time for hop in hops]
    newest = np.array(_twin_distances(library, feed, times))
    exact = np.array(
        [
            [naive_live.averaged(times[: k + 1], each[: k + 1], naive_live.COMPARED_OVER) for each in newest.T]
            for k in range(len(hops))
        ]
    )
    assert len(hops) > 140
    assert np.array([hop.distances for hop in hops]) == pytest.approx(exact, abs=2e-3)
    assert exact.std(axis=0).min() > 0.05
    assert np.abs(exact - newest).max() > 0.05


@pytest.mark.parametrize("name", ["anybody", "one_person"])
@pytest.mark.parametrize("every", [1, 2, 5])
def test_guess_and_outcome_are_the_twins_at_every_hop(
    name: str, every: int, feed: Feed, request: pytest.FixtureRequest
) -> None:
    """The guess by the lead added up, known by the average, still by the movement: at each hop as the twin says."""
    library: MotionLibrary = request.getfixturevalue(name)
    matcher = _matcher(library)
    assert library.windows is not None
    threshold = library.windows.threshold_at(SENSITIVITY)
    hops = _hops(matcher, feed, every)
    twins = naive_live.readings([hop.time for hop in hops], np.array([hop.distances for hop in hops]), threshold)
    longest = 1.0 if name == "anybody" else 0.25
    for hop, twin in zip(hops, twins, strict=True):
        rows = naive_live.last_rows(feed.times, feed.rows, hop.time, longest)
        movement = math.sqrt(np.var(rows, axis=0, ddof=1).mean() / np.square(rows.mean(axis=0)).mean())
        assert hop.reading.movement == pytest.approx(movement, rel=1e-6, abs=1e-8)
        assert hop.reading.best == twin.guess
        expected = Outcome.NAMED if twin.known else Outcome.UNKNOWN
        assert hop.reading.outcome is (Outcome.STILL if movement < STILLNESS * longest else expected)


def test_the_feed_shows_all_there_is_to_see(anybody: MotionLibrary, feed: Feed) -> None:
    """What the twin is held against has named, unknown and still hops, several guesses, and guesses that are held."""
    hops = _hops(_matcher(anybody), feed)
    assert {hop.reading.outcome for hop in hops} == {Outcome.NAMED, Outcome.UNKNOWN, Outcome.STILL}
    assert len({hop.reading.best for hop in hops}) > 2
    assert any(hop.reading.best != hop.reading.scores.argmax() for hop in hops)


def test_what_is_clearly_near_is_known_at_once(anybody: MotionLibrary, feed: Feed) -> None:
    """Some motions of the feed are known before their longer average is near enough, and only if clearly near."""
    assert anybody.windows is not None
    threshold = anybody.windows.threshold_at(SENSITIVITY)
    hops = _hops(_matcher(anybody), feed)
    times, distances = [hop.time for hop in hops], np.array([hop.distances for hop in hops])
    early = []
    for k, (before, hop) in enumerate(pairwise(hops), start=1):
        guess = hop.reading.best
        averaged = naive_live.averaged(times[: k + 1], distances[: k + 1, guess], naive_live.KNOWN_OVER)
        known = (before.reading.outcome, hop.reading.outcome) == (Outcome.UNKNOWN, Outcome.NAMED)
        if known and averaged > threshold:
            early.append(distances[k, guess])
    assert early
    assert max(early) <= threshold - naive_live.CLEAR


# --- guesses -----------------------------------------------------------------------------------------------------


def test_the_guess_changes_less_than_the_nearest_class(anybody: MotionLibrary, feed: Feed) -> None:
    """Holding the guess until another class has led for long enough takes changes away, and adds none."""
    hops = _hops(_matcher(anybody), feed, every=1)
    guesses = sum(a.reading.best != b.reading.best for a, b in pairwise(hops))
    nearest = sum(a.reading.scores.argmax() != b.reading.scores.argmax() for a, b in pairwise(hops))
    assert 2 < guesses < nearest


def test_every_score_is_a_share(anybody: MotionLibrary, feed: Feed) -> None:
    """Scores lie between 0 and 1, one for each class, whatever the outcome."""
    for hop in _hops(_matcher(anybody), feed, every=10):
        assert hop.reading.scores.shape == (len(anybody.classes),)
        assert 0 < hop.reading.scores.min() < hop.reading.scores.max() < 1
        assert hop.reading.axis is None


def test_the_hop_matters_little(anybody: MotionLibrary, feed: Feed) -> None:
    """Asked at 60, 30 and 15 hops a second, guess and outcome are the same nearly always."""
    by_hop = {every: {hop.time: hop.reading for hop in _hops(_matcher(anybody), feed, every)} for every in (1, 2, 4)}
    common = sorted(by_hop[4])
    assert len(common) > 200
    for every in (1, 2):
        same = [by_hop[every][time].best == by_hop[4][time].best for time in common]
        alike = [by_hop[every][time].outcome == by_hop[4][time].outcome for time in common]
        assert np.mean(same) > 0.93
        assert np.mean(alike) > 0.93


@pytest.mark.parametrize("rate", [30, 20])
def test_the_frame_rate_matters_little(anybody: MotionLibrary, feed: Feed, rate: int) -> None:
    """Of every second or third frame only, the guess is the same nearly always."""
    step = RATE // rate
    slow = Feed(*(each[::step] for each in feed))
    full = {hop.time: hop.reading.best for hop in _hops(_matcher(anybody), feed, every=1)}
    same = [full[hop.time] == hop.reading.best for hop in _hops(_matcher(anybody), slow, every=1)]
    assert np.mean(same) > 0.9


# --- sensitivity and stillness -----------------------------------------------------------------------------------


def test_more_sensitivity_answers_more(anybody: MotionLibrary, feed: Feed) -> None:
    """What is named at a lower sensitivity is named at every higher one, more and more, and the guess is the same."""
    by_sensitivity = [_hops(_matcher(anybody, sensitivity=s), feed, every=4) for s in (0.005, 0.02, 0.1, 0.4)]
    named = [np.array([hop.reading.outcome is Outcome.NAMED for hop in hops]) for hops in by_sensitivity]
    for less, more in pairwise(named):
        assert not (less & ~more).any()
    counts = [int(each.sum()) for each in named]
    assert counts[0] < counts[-2] < counts[-1]
    for hops in by_sensitivity[1:]:
        assert [hop.reading.best for hop in hops] == [hop.reading.best for hop in by_sensitivity[0]]


@pytest.mark.parametrize(("beyond", "limit"), [(0.0, 0.005), (1.0, 0.4)])
def test_sensitivity_ends_where_the_library_cannot_tell(
    anybody: MotionLibrary, feed: Feed, beyond: float, limit: float
) -> None:
    """Below and above the rates a library keeps thresholds of, the nearest rate's count."""
    outcomes = [
        [hop.reading.outcome for hop in _hops(_matcher(anybody, sensitivity=s), feed, every=6)] for s in (beyond, limit)
    ]
    assert outcomes[0] == outcomes[1]


def test_stillness_comes_first(anybody: MotionLibrary, feed: Feed) -> None:
    """What moves less than told is still however near it is, and with a stillness of 0 nothing is."""
    hops = _hops(_matcher(anybody, stillness=0.5), feed, every=6)
    assert {hop.reading.outcome for hop in hops} == {Outcome.STILL}
    hops = _hops(_matcher(anybody, stillness=0.0), feed, every=6)
    assert Outcome.STILL not in {hop.reading.outcome for hop in hops}


# --- beginnings --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "seconds"), [("anybody", 0.5), ("one_person", 8 / 60)])
def test_the_first_answer_comes_early(name: str, seconds: float, feed: Feed, request: pytest.FixtureRequest) -> None:
    """It is ready after half a second or its shortest window and eight frames, not a frame before."""
    matcher = _matcher(request.getfixturevalue(name))
    ready = []
    for time, row in zip(feed.times.tolist(), feed.rows[:60], strict=False):
        matcher.push([time], row[None])
        ready.append(matcher.ready)
    assert ready.index(True) / RATE == pytest.approx(seconds, abs=0.6 / RATE)
    assert all(ready[ready.index(True) :])


def test_after_clear_it_is_as_new(anybody: MotionLibrary, feed: Feed) -> None:
    """Cleared, it says of a feed what a new one says, number for number, guess and average forgotten."""
    used, fresh = _matcher(anybody), _matcher(anybody)
    late = Feed(feed.times, feed.positions, feed.rows[::-1])
    _hops(used, late)
    used.clear()
    assert not used.ready
    for again, new in zip(_hops(used, feed, every=5), _hops(fresh, feed, every=5), strict=True):
        assert np.array_equal(again.reading.scores, new.reading.scores)
        assert (again.reading.best, again.reading.outcome) == (new.reading.best, new.reading.outcome)


def test_clear_forgets_how_far_everything_was(
    one_person: MotionLibrary, feed: Feed, some_clips: tuple[Clip, ...]
) -> None:
    """After movement that is none of the library's, one of its own clips is named at once when cleared in between."""
    matcher = _matcher(one_person)
    noise = feed.rows * np.random.default_rng(6).uniform(0.5, 1.5, size=feed.rows.shape)
    far = _hops(matcher, Feed(feed.times, feed.positions, noise))
    assert {hop.reading.outcome for hop in far} == {Outcome.UNKNOWN}
    clip = some_clips[4]
    rows = distance_rows(clip.positions, clip.skeleton)
    own = Feed(clip.times, clip.positions, rows)
    matcher.clear()
    cleared, fresh = _hops(matcher, own), _hops(_matcher(one_person), own)
    assert [hop.reading.outcome for hop in cleared] == [hop.reading.outcome for hop in fresh]
    assert cleared[0].reading.outcome is Outcome.NAMED


def test_a_clip_of_the_library_is_named_by_its_own_class(
    one_person: MotionLibrary, some_clips: tuple[Clip, ...]
) -> None:
    """A person's own recordings, performed again, are named rightly nearly always from a fifth of a second on."""
    for clip in some_clips:
        rows = distance_rows(clip.positions, clip.skeleton)
        readings = [hop.reading for hop in _hops(_matcher(one_person), Feed(clip.times, clip.positions, rows), 4)]
        right = [one_person.classes[reading.best] == clip.class_name for reading in readings]
        assert np.mean(right) > 0.9, clip.name
