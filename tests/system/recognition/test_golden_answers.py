"""The answers to whole feeds are the kept ones, compiled and by numpy; see `answers` to change them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import answers
import pytest

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("arithmetic")]


@pytest.mark.parametrize("feed", answers.FEEDS)
def test_motions_are_answered_as_ever(feed: str) -> None:
    """Words, events and the means of the numbers are the kept ones."""
    assert not answers.differing(answers.kept()[feed], answers.summed_up(answers.FEEDS[feed]()))


@pytest.mark.parametrize("feed", answers.RECORDED)
def test_recordings_are_answered_as_ever(feed: str, data_folder: Path) -> None:
    """Words, events and the means of the numbers are the kept ones."""
    assert not answers.differing(answers.kept()[feed], answers.summed_up(answers.RECORDED[feed](data_folder)))
