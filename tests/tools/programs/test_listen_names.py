"""What `kinespace listen` says of joints that a sender of our own messages names."""

from __future__ import annotations

import numpy as np
import pytest
import skeletons

from kinespace.stream import Announcement, Frame, osc
from kinespace.stream.feeds import builtin_names, builtin_preset
from kinespace.stream.feeds.detection import Survey
from kinespace.tools.programs.listen import advice, as_object


def _heard(joints: tuple[str, ...], frames: int = 20) -> Survey:
    survey = Survey()
    survey.see(osc.encode_announcement(Announcement("ann", joints)), "127.0.0.1:9", 0.0)
    for number in range(frames):
        frame = Frame("ann", 1.0 + number / 30, np.full((len(joints), 3), 0.5))
        survey.see(osc.encode_frame(frame), "127.0.0.1:9", number / 30)
    return survey


@pytest.mark.parametrize(
    ("joints", "title", "ours"),
    [(skeletons.MIXAMO, "Mixamo", 29), (skeletons.SMPL, "SMPL", 22), (builtin_preset("native").joints[:12], "", 12)],
)
def test_names_of_others_and_fewer_joints_are_well(joints: tuple[str, ...], title: str, ours: int) -> None:
    """A feed whose names are known, or that has some of our joints, is ours, and nothing is lacking."""
    survey = _heard(joints)
    guess = survey.guess([builtin_preset(name) for name in builtin_names()])
    assert guess is not None
    assert (guess.preset.name, guess.frames, len(guess.joints), guess.performers) == ("native", 20, ours, ("ann",))
    assert guess.rate == pytest.approx(30.0)
    assert guess.understood == 1.0
    assert advice(survey, guess, None) == []
    assert as_object(survey, guess, [])["names"] == title


def test_unknown_names_are_told() -> None:
    """Names that nobody knows make no frames, and what to do is said."""
    survey = _heard(("hip", "knee", "toe", "elbow", "nose"))
    guess = survey.looked_at_as(builtin_preset("native"))
    assert guess.frames == 0
    told = " ".join(advice(survey, guess, None))
    assert "0 of the 5 announced joints have names that are known" in told
    assert "--names NAME" in told
