"""The answers to whole feeds are the kept ones, and numpy answers as the compiled functions do; see `answers`."""

from pathlib import Path

import answers
import pytest

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("feed", answers.FEEDS)
def test_motions_are_answered_as_ever(feed: str) -> None:
    """Words, events and the means of the numbers are the kept ones."""
    assert not answers.differing(answers.kept()[feed], answers.summed_up(answers.FEEDS[feed]()))


@pytest.mark.parametrize("feed", answers.RECORDED)
def test_recordings_are_answered_as_ever(feed: str, data_folder: Path) -> None:
    """Words, events and the means of the numbers are the kept ones."""
    assert not answers.differing(answers.kept()[feed], answers.summed_up(answers.RECORDED[feed](data_folder)))
