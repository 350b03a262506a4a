"""The answers to whole feeds are the kept ones, and numpy answers as the compiled functions do; see `answers`."""

from pathlib import Path

import answers
import pytest

from kinespace.library import compiled

pytestmark = pytest.mark.slow
#: Seconds of a feed that are answered twice: numpy takes long. What breaks a feed, or is taught to it, comes later.
SECONDS = {"broken": 6.5, "taught": 14.0}
USUAL_SECONDS = 2.2
#: Feeds that numpy answers, too: each signature, progress, lost joints, an exchanged library, a sensor that trembles.
BY_NUMPY = ("motions_120_hz_with_progress", "motions_by_paper", "broken", "taught", "depth_sensor_30_hz")


@pytest.mark.parametrize("feed", answers.FEEDS)
def test_motions_are_answered_as_ever(feed: str) -> None:
    """Words, events and the means of the numbers are the kept ones."""
    assert not answers.differing(answers.kept()[feed], answers.summed_up(answers.FEEDS[feed]()))


@pytest.mark.parametrize("feed", answers.RECORDED)
def test_recordings_are_answered_as_ever(feed: str, data_folder: Path) -> None:
    """Words, events and the means of the numbers are the kept ones."""
    assert not answers.differing(answers.kept()[feed], answers.summed_up(answers.RECORDED[feed](data_folder)))


@pytest.mark.skipif(not compiled.in_use, reason="nothing is compiled here: all is answered by numpy")
@pytest.mark.parametrize("feed", BY_NUMPY)
def test_numpy_answers_as_the_compiled_functions(
    feed: str, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Words, events and the means of the numbers are the same over the first seconds of each feed."""
    monkeypatch.setattr(answers, "seconds", SECONDS.get(feed, USUAL_SECONDS))

    def summed_up() -> dict[str, object]:
        if feed in answers.FEEDS:
            return answers.summed_up(answers.FEEDS[feed]())
        return answers.summed_up(answers.RECORDED[feed](request.getfixturevalue("data_folder")))

    found = summed_up()
    with compiled.left_aside():
        assert not answers.differing(found, summed_up())
    assert found["answers"] > 50  # type: ignore[operator]  # a number
